"""A ground speed, a rate of turn or torques that are not 0 where the vehicle stands: sentences for the user, never errors."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.physics.loads import GRAVITY
from terragrip.recording.once import once
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import rim_names
from terragrip.recording.stretches import DRIVING, LONG, gaps
from terragrip.recording.turns import filled_channel

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_STILL = 0.01  # of a rim's speed that a twentieth of the drive exceeds
_ROLLING_OUT = 1.0  # s after the wheels stop, and before they start
_FEWEST = 4  # values of a stop
_SHIFT = 0.03  # of the usual speed, which slip is off by
_SURE = 4.0  # standard deviations at rest: noise without a sign has a mean of 1.9 of its own (Rayleigh)
_ALIKE = 0.5  # of the shift, by which stops differ
_TURNED = 0.005  # of the usual speed, which the hubs of both sides seem to be off by
_HELD = 0.1  # of a torque, likewise: motors hold a vehicle, or each other, on one slope and another
_STOPS = 3  # two agree by chance (2 notes on the few of 96 right drives that had two)
_THRUST = 0.01  # of the weight
_ONE_WHEEL = 0.02  # of its share of it
_SLOPE = 0.3  # of a thrust, that a measured slope explains


def rest_warnings(recording: Recording) -> list[str]:
    """A sentence where the ground speed reads much the same value, not 0, whenever all wheels stand for long."""
    ground = recording.channels.get("ground_speed")
    if ground is None or not np.isfinite(ground).any():
        return []
    rows, still = _stops(recording)
    read = _read(ground, rows)
    if not read:
        return []
    shift = _alike(read)
    usual = _usual(ground, still)
    scatter = median(np.array([float(np.std(values)) for values in read]))
    if not usual > 0 or not abs(shift) > max(_SHIFT * usual, _SURE * scatter):
        return []
    return [
        f"ground_speed reads {shift:.2g} m/s in {len(read)} stop{'s' if len(read) > 1 else ''} of all wheels: its zero is off, and slip "
        f"at usual speed by {abs(shift) / usual:.2g}, unless the vehicle slid. Write 'offset:' for it in the profile."
    ]


def noise_at_rest(recording: Recording) -> float:
    """SD [m/s] of the ground speed where all wheels stand for long, in the usual stop; 0 where none shows it. It holds errors with memory,
    as a receiver filters them, which fast changes do not show (`noise.white_noise`); a zero that is off everywhere does not count, nor a
    stop in which the vehicle drives by it: the wheels' speeds are lost there, or it slides."""
    ground = recording.channels.get("ground_speed")
    if ground is None:
        return 0.0
    rows, still = _stops(recording)
    most = DRIVING * _usual(ground, still)
    read = [values for values in _read(ground, rows) if abs(np.mean(values)) <= most]
    if not read:
        return 0.0
    shift = _alike(read)
    return median(np.array([float(np.sqrt(np.mean((values - shift) ** 2))) for values in read]))


def turn_rest_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where the gyroscope reads much the same rate of turn, not 0, whenever all wheels stand for long."""
    yaw, ground = (recording.channels.get(name) for name in ("angular_velocity_z", "ground_speed"))
    if yaw is None or ground is None or vehicle.track is None:
        return []
    rows, still = _stops(recording)
    read = _read(yaw, rows)
    if not read:
        return []
    shift, usual = _alike(read), _usual(ground, still)
    error = median(np.array([float(np.std(values)) / np.sqrt(len(values)) for values in read]))
    off = abs(shift) * float(np.max(np.abs(vehicle.wheel_side)))
    if not usual > 0 or not off > _TURNED * usual or not abs(shift) > _SURE * error:
        return []
    return [
        f"angular_velocity_z reads {shift:.2g} rad/s in {len(read)} stop{'s' if len(read) > 1 else ''} of all wheels: its zero is off, and "
        f"the slips of both sides at usual speed by {off / usual:.2g}. Write 'offset:' for it in the profile."
    ]


def torque_rest_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on drive torques that read one and the same value, not 0, in three long stops of all wheels or more.

    A motor that holds the vehicle reads as much as the slope asks for, which differs from stop to stop.
    """
    measured = {w: recording.channels.get(f"drive_torque_{w}") for w in vehicle.wheels}
    read = {w: values for w, values in measured.items() if values is not None}
    pitch = recording.channels.get("pitch", np.zeros(len(recording)))
    stops = [
        stop
        for stop in _stops(recording)[0]
        if read and all(len(_known(values[stop])) >= _FEWEST for values in read.values())
    ]
    if len(stops) < _STOPS:
        return []
    places = [vehicle.wheels.index(w) for w in read]
    weight, radius = GRAVITY * vehicle.mass, vehicle.wheel_radius[places]
    torques = np.array([[np.mean(_known(values[stop])) for values in read.values()] for stop in stops])
    thrusts = (torques - vehicle.drive_torque_offset[places]) / radius / weight  # (stops, wheels)
    climbs = np.array([np.sin(np.mean(tilt)) if len(tilt := _known(pitch[stop])) else 0.0 for stop in stops])
    total, stated = thrusts.sum(axis=1), (vehicle.uncertainty.drive_torque_offset or 0.0) / radius / weight
    share = (vehicle.axle_mass / vehicle.mass / np.bincount(vehicle.wheel_axle))[vehicle.wheel_axle[places]]
    least = np.maximum(_ONE_WHEEL * share, _SURE * stated)
    off = np.array([_is_off(own, limit) for own, limit in zip(thrusts.T, least, strict=True)])
    off |= _is_off(total, max(_THRUST, _SURE * float(np.sqrt(np.sum(stated**2)))))
    if off.all() and np.any(climbs / median(total) > _SLOPE):
        return []
    if not off.any():
        return []
    shown = ", ".join(f"{w} {median(torques[:, k]):.3g}" for k, w in enumerate(read) if off[k])
    return [
        f"The drive torques read the same in {len(stops)} stops of all wheels ({shown} N m), "
        f"{median(np.abs(thrusts[:, off].sum(axis=1))):.2g} of the weight over the radius: their zeros are off, and adhesion by as much, "
        "unless brakes hold against the drive. Of a hydraulic motor the difference of its two pressures counts; else write 'offset:' for "
        "each in the profile."
    ]


def _is_off(thrusts: Floats, least: float) -> bool:
    """Whether thrusts over the weight (stops,) are much the same, and not 0."""
    usual = median(thrusts)
    return abs(usual) > least and float(np.max(np.abs(thrusts - usual))) <= _HELD * abs(usual)


def _read(values: Floats, stops: list[slice]) -> list[Floats]:
    """What a channel (n,) reads in each stop that has enough of it."""
    return [known for stop in stops if len(known := _known(values[stop])) >= _FEWEST]


def _alike(read: list[Floats]) -> float:
    """The usual mean of what is read in stops, 0 where they differ by half of it."""
    means = np.array([np.mean(values) for values in read])
    shift = median(means)
    return shift if quantile(np.abs(means - shift), 0.75) <= _ALIKE * abs(shift) else 0.0


def _usual(ground: Floats, still: Bools) -> float:
    """The speed (n,) that a twentieth of the driving exceeds."""
    driven = np.abs(ground[~still & np.isfinite(ground)])
    return quantile(driven, 0.95) if len(driven) else 0.0


def _known(values: Floats) -> Floats:
    return values[np.isfinite(values)]


@once
def _stops(recording: Recording) -> tuple[list[slice], Bools]:
    """The rows of each long stop of all wheels, without those in which they stop and start, and whether they stand (n,)."""
    time, still = recording.time, np.ones(len(recording), dtype=bool)
    rims = rim_names(recording.channels)
    if not rims or np.any(np.diff(time) <= 0):
        return [], still
    for name in rims:
        turning = np.abs(filled_channel(recording, name))
        usual = quantile(turning, 0.95) if np.isfinite(turning).all() else 0.0
        if not usual > 0:  # dead, or it hardly ever turns: it shows no stop
            return [], still
        still &= turning <= _STILL * usual
    cut = np.flatnonzero(np.r_[True, (still[1:] != still[:-1]) | gaps(time), True])
    stops = []
    for first, after in pairwise(cut.tolist()):
        start, end = time[first] + _ROLLING_OUT, time[after - 1] - _ROLLING_OUT
        if still[first] and end - start >= LONG - 2 * _ROLLING_OUT:
            stops.append(slice(*np.searchsorted(time, [start, end])))
    return stops, still
