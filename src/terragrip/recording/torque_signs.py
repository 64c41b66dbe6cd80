"""Torques without a sign while the vehicle brakes or drives backward: sentences for the user, never errors.

Converters that log the size of a current, and meters of power, have no sign. The wheels' thrust is the pull, the force that moves the mass,
and a resistance (physics.md 1). Where the first two show that the wheels must brake, a thrust of that size with the other sign closes the
balance, and the logged one does not. Where noise, or a change of direction, takes a torque through 0, one without a sign turns back
there, as often in a narrow band beside 0 as in the next one, where a torque that is never negative by nature hardly comes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.ranks import median
from terragrip.recording.turns import filled
from terragrip.recording.window_means import window_means
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.arrays import Floats, Ints
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_WINDOW = 1.0  # s, at least, and two samples of the ground speed
_MOVING = 0.15  # of the speed that a twentieth of the windows exceed
_LEAST = 20  # windows in motion
_STEADY = 0.1  # m/s²: a vehicle that slows down less than that does not brake
_BRAKING = 0.3  # m/s² of braking thrust over the mass: more than offset of torques and grade make
_FEWEST = 4  # such windows
_NEAR = 0.1  # of the smaller neighbour: a dip to 0, as often as to the band beside it
_DIPS = 12  # (right logs moved up until none is negative: 10)
_AS_HARD = 0.5  # of the braking thrust, with the other sign: a motor that is off while another brake works has none of it


def sign_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where no torque is ever below 0 and they turn back at 0, or the motion shows that the wheels braked, or drove backward, as
    hard as they pulled."""
    radii, channels = vehicle.driven_radii, recording.channels
    names = [f"drive_torque_{wheel}" for wheel in radii]
    ground = channels.get("ground_speed")
    if not names or ground is None or not all(name in channels for name in names):
        return []
    if min(float(np.nanmin(channels[name], initial=0.0)) for name in names) < 0.0:
        return []
    dips = np.sum([_dips(channels[name]) for name in names], axis=0)
    if dips[0] >= _DIPS and dips[0] > max(dips[1] / 2, dips[2]):
        return [
            f"{', '.join(names)} are never below 0, but {dips[0]} times they fall to 0 from one sample to the next and rise again as far: "
            "the torques have no sign. Log them with it (against the forward direction negative)."
        ]
    known = recording.time[np.isfinite(ground)]
    if len(known) < _LEAST or np.any(np.diff(recording.time) < 0):
        return []
    length = max(_WINDOW, 2 * median(np.diff(known)))
    place = ((recording.time - recording.time[0]) / length).astype(np.intp)

    def mean(values: Floats) -> Floats:
        plain = window_means(filled(recording.time, values), place, int(place[-1]) + 1)
        return np.r_[np.nan, (plain[:-2] + 2 * plain[1:-1] + plain[2:]) / 4, np.nan]

    speed = window_means(ground, place, int(place[-1]) + 1)
    needed = np.r_[np.nan, (speed[2:] - speed[:-2]) / (2 * length), np.nan]
    slows = needed < -_STEADY
    if "drawbar_force" in channels:
        needed = needed + mean(channels["drawbar_force"]) / vehicle.mass
    if "pitch" in channels:
        needed = needed + STANDARD_GRAVITY * mean(np.sin(channels["pitch"]))
    thrust = np.sum([mean(channels[n]) / r for n, r in zip(names, radii.values(), strict=True)], axis=0)
    thrust = thrust / vehicle.mass
    rows = np.isfinite(thrust) & np.isfinite(needed)
    rows &= np.abs(np.nan_to_num(speed)) > _MOVING * float(np.nanquantile(np.abs(speed), 0.95))
    ahead = rows & (speed > 0) & ~slows
    if rows.sum() < _LEAST or not ahead.any():
        return []
    resistance = max(median((thrust - needed)[ahead]), 0.0)
    expected = needed + np.sign(np.nan_to_num(speed)) * resistance
    braking = rows & (expected < -_BRAKING)
    if braking.sum() < _FEWEST:
        return []
    share = -float(np.sum((thrust * expected)[braking]) / np.sum(expected[braking] ** 2))
    if share < _AS_HARD:
        return []
    when = float(braking.sum() * length)
    return [
        f"{', '.join(names)} are never below 0, but for {when:.3g} s the wheels brake or drive backward by the motion, as hard as these "
        "say that they pull: the torques have no sign. Log them with it (against the forward direction negative)."
    ]


def _dips(values: Floats) -> Ints:
    """How often a torque (n,) that is never negative dips between two samples to within `_NEAR` of 0, to as far beyond, and to 0 itself, as
    one does that is cut there."""
    known = values[np.isfinite(values)]
    known = known[np.flatnonzero(np.diff(known, prepend=np.nan))]  # each value once, however long it is held
    inner, least = known[1:-1], _NEAR * np.minimum(known[:-2], known[2:])
    return np.array(
        [
            np.sum((inner > 0) & (inner < least)),
            np.sum((inner >= least) & (inner < 2 * least)),
            np.sum(inner == 0),
        ]
    )
