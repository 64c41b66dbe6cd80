"""The calibration of a vehicle from its own logs: zeros, then radii, then relative gains, each using the results before it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.estimation.calibration import zeros
from terragrip.estimation.calibration.gains import ChannelErrors, RelativeGains, relative_gains
from terragrip.estimation.calibration.plausible import (
    completed_by_positions,
    gains_by_axle,
    plausible,
    turned_unseen,
)
from terragrip.estimation.calibration.radii import WINDOW as RADIUS_WINDOW
from terragrip.estimation.calibration.radii import Rolling, rolling_radii
from terragrip.estimation.calibration.result import Calibration, Quantity, Unknown
from terragrip.estimation.calibration.speeds import calibrate_radii
from terragrip.estimation.calibration.torque_scale import identify_torque_scale
from terragrip.estimation.calibration.windows import track_blocks, windows
from terragrip.estimation.rims import speeds_alone
from terragrip.estimation.zero_slip import Span
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording, sensor_noise, unit_warnings, without_held
from terragrip.recording.alignment import recording_of
from terragrip.recording.brake import unbraked
from terragrip.recording.cycles import in_cycles
from terragrip.vehicle import Vehicle, require_vehicle

_OTHER_LOAD = 0.02  # of the mass, by which the load may differ
_SENSOR_BIAS = 0.03  # m/s^2 where the vehicle gives none, of an accelerometer that is level to .2 deg


def _refuse_other_load(log: Recording, vehicle: Vehicle) -> None:
    """Raise InputError if a log's machine does not carry the vehicle file's load: torque gains follow from its weight."""
    for name, usual in (("mass", vehicle.mass), ("hitch_load", 0.0)):
        values = log.channels.get(name, np.empty(0))
        known = values[np.isfinite(values)]
        weight = vehicle.mass * (1.0 if name == "mass" else GRAVITY)
        if len(known) and np.quantile(np.abs(known - usual), 0.9) > _OTHER_LOAD * weight:
            unit = "kg" if name == "mass" else "N"
            raise InputError(
                f"calibrate needs the load of the vehicle file, {usual:.4g} {unit} to within {_OTHER_LOAD * weight:.3g} (2 % of the "
                f"weight, to which torque gains are relative); here it is {np.min(known):.4g} to {np.max(known):.4g}",
                file=log.source,
                place=f"column {name}",
                hint="drive with the tank contents of the vehicle file and no tool on the hitch, or give a vehicle file for this load",
            )


def calibrate(
    recordings: Recording | Any | Sequence[Recording | Any],
    vehicle: Vehicle,
    *,
    light: Sequence[Span | None] | None = None,
) -> Calibration:
    """Determine a vehicle's sensor errors and wheel radii from its logs.

    Zeros of torque, drawbar and accelerometer come from standstill; rolling radii from straight passes at zero pull;
    relative torque gains of the wheels from the adhesion curve that they share. Each has a 95 % interval and names its
    data; values that the logs do not determine are listed with the reason. Logs without any torque give radii alone, by the
    zero of slip that `estimate` finds too. An existing ``calibration`` block of the vehicle is used for values that the
    logs do not determine.

    Parameters
    ----------
    recordings: one log, or a list of logs of one vehicle in one state, each a Recording or a table that :meth:`Recording.from_frame`
        accepts. A ``soil`` label sharpens the gains.
    vehicle: from its file.
    light: of each log without torque the span [s] driven without load, if known (None: unknown).

    Raises
    ------
    InputError: there is no log, or one does not fit the vehicle.
    """
    several = isinstance(recordings, list | tuple | Iterator)
    logs = [recording_of(one) for one in (recordings if several else [recordings])]
    require_vehicle(vehicle)
    if not logs:
        raise InputError("there is no recording to calibrate from", hint="give at least one log")
    logs = [in_cycles(log) for log in logs]
    sources = [log.source or f"recording {k + 1}" for k, log in enumerate(logs)]
    doubts = _doubts(logs, sources, vehicle)
    if all(speeds_alone(log.channels, vehicle) for log in logs):
        return replace(calibrate_radii(logs, vehicle, sources, light), notes=doubts)
    for log in logs:
        log.check_against(vehicle)
        _refuse_other_load(log, vehicle)
    logs = [unbraked(without_held(log)) for log in logs]
    quantities, unknown, (yaw_zero, yaw_std) = _zeros(logs, vehicle, sources)
    zeroed = Calibration(tuple(quantities), ()).apply(vehicle)
    completed = [completed_by_positions(_corrected(log, zeroed, yaw_zero)) for log in logs]
    corrected = [log for log, _ in completed]
    doubts += tuple(dict.fromkeys(text for _, notes in completed for text in notes))

    measured = {wheel for log in logs for wheel in log.wheels}
    passes = windows(corrected, zeroed, RADIUS_WINDOW)
    rolling = rolling_radii(passes, zeroed, track_blocks(passes), sources)
    rolled = zeroed
    if isinstance(rolling, Rolling):
        together = [q for q in _radii(rolling, None, vehicle) if q.wheel in measured]
        together = plausible(_possible(together, vehicle, unknown), vehicle, unknown)
        rolled = Calibration(tuple(together), ()).apply(zeroed)
    else:
        unknown.append(rolling)

    gains = relative_gains(
        corrected,
        rolled,
        _offset_errors(quantities, vehicle),
        replace(_channel_errors(quantities, vehicle, logs), yaw=yaw_std),
        sources,
        _common_radius(rolling, vehicle),
    )
    shared: list[Quantity] = []
    if isinstance(gains, RelativeGains):
        unknown += gains.unknown
        shared = _accepted(gains.quantities, vehicle, unknown)
    else:
        unknown += gains
    if isinstance(rolling, Rolling):
        apart = gains if isinstance(gains, RelativeGains) else None
        radii = _radii(rolling, apart, vehicle, determined=bool(shared))
        quantities += _accepted([q for q in radii if q.wheel in measured], vehicle, unknown)
    quantities += shared
    try:
        quantities.append(identify_torque_scale(_with_gains(corrected, shared), rolled))
    except InputError as error:
        unknown.append(Unknown("drive_torque_scale", "; ".join(filter(None, (error.problem, error.hint)))))
    unknown += turned_unseen(corrected, vehicle, [q.name for q in quantities])
    doubts += tuple(gains_by_axle(shared, vehicle))
    return Calibration(tuple(quantities), tuple(unknown), _left(quantities, vehicle), doubts)


def _doubts(logs: Sequence[Recording], sources: Sequence[str], vehicle: Vehicle) -> tuple[str, ...]:
    """What the motion contradicts, with the logs that do where not all of them do."""
    found: dict[str, list[str]] = {}
    for log, source in zip(logs, sources, strict=True):
        for note in unit_warnings(log, vehicle):
            found.setdefault(note, []).append(Path(source).name)
    return tuple(
        note if len(names) == len(logs) else f"{', '.join(names)}: {note}" for note, names in found.items()
    )


def _zeros(
    logs: Sequence[Recording], vehicle: Vehicle, sources: Sequence[str]
) -> tuple[list[Quantity], list[Unknown], tuple[float, float]]:
    """Everything that standstill determines; the last is the gyroscope's zero and its error, which have no place in the vehicle file."""
    noise, standing = _sensor_noise(logs, vehicle), windows(logs, vehicle, zeros.WINDOW)
    quantities: list[Quantity] = []
    unknown: list[Unknown] = []
    level, without = zeros.inclination_zeros(standing, vehicle, sources, noise["acceleration"])
    if len(_possible(level, vehicle, unknown)) < len(level):
        level = []  # they are the parts of one difference
    for zeroed, missing in (
        zeros.torque_zeros(standing, vehicle, sources, noise["drive_torque"]),
        zeros.drawbar_zero(standing, vehicle, sources, noise["drawbar_force"]),
        (level, without),
    ):
        unknown += missing
        quantities += _accepted(zeroed, vehicle, unknown)
    return quantities, unknown, zeros.yaw_rate_zero(standing, vehicle)


def _accepted(quantities: Sequence[Quantity], vehicle: Vehicle, unknown: list[Unknown]) -> list[Quantity]:
    """The quantities that are possible, plausible and news, those of one key together; ``unknown`` says why the others are not."""
    possible, kept = _possible(quantities, vehicle, unknown), []
    for key in dict.fromkeys(quantity.key for quantity in possible):
        own = [quantity for quantity in possible if quantity.key == key]
        kept += _useful(plausible(own, vehicle, unknown), vehicle, unknown)
    return kept


def _possible(quantities: Sequence[Quantity], vehicle: Vehicle, unknown: list[Unknown]) -> list[Quantity]:
    """The quantities that a vehicle can have; the others are added to ``unknown``."""
    kept = []
    for quantity in quantities:
        try:
            Calibration((quantity,), ()).apply(vehicle)
        except InputError:
            why = f"{quantity.value:.4g} {quantity.unit} is impossible: check the log's units and axes"
            unknown.append(Unknown(quantity.name, why))
        else:
            kept.append(quantity)
    return kept


def _corrected(log: Recording, vehicle: Vehicle, yaw_zero: float) -> Recording:
    """The log with the vehicle's zeros subtracted; gains stay."""
    block = vehicle.calibration
    offsets = {f"drive_torque_{w}": block.drive_torque_offset.get(w, 0.0) for w in vehicle.wheels}
    offsets |= {
        "drawbar_force": block.drawbar_offset,
        "acceleration_x": block.acceleration_bias_x,
        "pitch": block.pitch_offset,
        "angular_velocity_z": yaw_zero,
    }
    changed = {
        name: log[name] - offset for name, offset in offsets.items() if offset and name in log.channels
    }
    return log.with_channels(**changed)


def _with_gains(logs: Sequence[Recording], gains: Sequence[Quantity]) -> list[Recording]:
    """The logs with torques divided by the relative gains."""
    factors = {f"drive_torque_{q.wheel}": q.value for q in gains}
    return [
        log.with_channels(**{n: log[n] / k for n, k in factors.items() if n in log.channels}) for log in logs
    ]


def _sensor_noise(logs: Sequence[Recording], vehicle: Vehicle) -> dict[str, float]:
    """Standard deviation of a sample [SI], by the vehicle file, else from the logs, else 0 (no such channel)."""
    columns = {
        "drive_torque": "drive_torque_",
        "drawbar_force": "drawbar_force",
        "acceleration": "acceleration_x",
    }
    measured: list[dict[str, float]] | None = None
    noise = {}
    for sensor, column in columns.items():
        stated = getattr(vehicle.sensors, sensor)
        if stated is None:
            measured = [sensor_noise(log, {}) for log in logs] if measured is None else measured
            quantities = [value for log in measured for name, value in log.items() if name.startswith(column)]
            stated = float(np.median(quantities)) if quantities else 0.0
        noise[sensor] = stated
    return noise


def _offset_errors(quantities: Sequence[Quantity], vehicle: Vehicle) -> npt.NDArray[np.float64]:
    """Standard error (w,) of each wheel's torque zero if it was found, else the vehicle's prior, else 0."""
    prior = vehicle.uncertainty.drive_torque_offset or 0.0
    spread = {q.wheel: q.std for q in quantities if q.key == "drive_torque_offset"}
    return np.array([spread.get(wheel, prior) for wheel in vehicle.wheels])


def _channel_errors(
    quantities: Sequence[Quantity], vehicle: Vehicle, logs: Sequence[Recording]
) -> ChannelErrors:
    """Errors that the channels keep: they move load between the wheels, and thereby change the gains."""
    stated, errors = vehicle.uncertainty, {quantity.name: quantity.std for quantity in quantities}
    ground = GRAVITY * stated.assumed("slope") / np.sqrt(len(logs))
    sensor = _SENSOR_BIAS if stated.acceleration_bias is None else stated.acceleration_bias
    measured = all("acceleration_x" in log.channels for log in logs)
    pitched = all("pitch" in log.channels for log in logs)
    kinematic = GRAVITY * stated.assumed("pitch_offset") if pitched else ground
    push = errors.get("acceleration_bias_x", sensor) if measured else kinematic
    lateral = sensor if all("acceleration_y" in log.channels for log in logs) else ground
    return ChannelErrors(
        push=float(push),
        lateral=float(lateral),
        drawbar=float(errors.get("drawbar_offset", stated.drawbar_offset or 0.0)),
        axle_load=stated.assumed("vertical_load"),
    )


def _common_radius(rolling: Rolling | Unknown, vehicle: Vehicle) -> float:
    """Relative error that the radii of all driven wheels may share."""
    if isinstance(rolling, Rolling):
        return float(np.mean(rolling.std[vehicle.driven]))
    return vehicle.uncertainty.assumed("wheel_radius")


def _useful(quantities: list[Quantity], vehicle: Vehicle, unknown: list[Unknown]) -> list[Quantity]:
    """The quantities of one kind, or none if the vehicle file already states them more precisely."""
    if not quantities:
        return []
    key, stated = quantities[0].key, vehicle.uncertainty
    relative = key in ("drive_torque_gain", "wheel_radius")
    prior = {
        "drive_torque_gain": stated.assumed("drive_torque_gain"),
        "drive_torque_offset": stated.drive_torque_offset,
        "drawbar_offset": stated.drawbar_offset,
        "wheel_radius": stated.assumed("wheel_radius"),
    }.get(key)
    errors = [q.spread / (abs(q.value) if relative else 1.0) for q in quantities]
    if prior is None or max(errors) < prior:
        return quantities
    worst, known = (
        f"{float(f'{100 * x:.2g}'):g} %" if relative else f"{x:.2g} {quantities[0].unit}"
        for x in (max(errors), prior)
    )
    unknown.append(
        Unknown(key, f"determined only to {worst}, but the vehicle file states {known}: record more")
    )
    return []


def _radii(
    rolling: Rolling, gains: RelativeGains | None, vehicle: Vehicle, *, determined: bool = True
) -> list[Quantity]:
    """The radii of all wheels: the common part from the passes, the differences of the wheels from ``gains``.

    Where gains and radii could not be separated (not ``determined``), the differences that were found are no more than a measure
    of how far the wheels may differ.
    """
    wheels = len(vehicle.wheels)
    differences = (np.ones(wheels), np.zeros(wheels)) if gains is None else (gains.radius, gains.radius_std)
    if gains is not None and not determined:
        differences = (np.ones(wheels), np.hypot(gains.radius - 1, gains.radius_std))
    sentence = (
        "ground speed over wheel speed on straight passes at zero pull, corrected for the slip of "
        f"{100 * rolling.slip:.2f} % there"
    )
    if gains is not None and determined:
        sentence += "; each wheel's difference from the others follows from its torque over slip"
    return [
        Quantity(
            "wheel_radius",
            float(radius * apart),
            float(radius * np.hypot(std, own_std)),
            "m",
            rolling.rests_on,
            sentence,
            wheel=wheel,
            factor=rolling.factor,
        )
        for wheel, radius, std, apart, own_std in zip(
            vehicle.wheels, rolling.radius, rolling.std, *differences, strict=True
        )
    ]


def _left(quantities: Sequence[Quantity], vehicle: Vehicle) -> dict[str, Any]:
    """The vehicle's considered constants after calibration: the remaining uncertainty of each calibrated one."""
    prior, left = vehicle.uncertainty, {}

    def spread(key: str) -> float | None:
        errors = [q.spread for q in quantities if q.key == key]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    for key, name in (
        ("drive_torque_offset", "drive_torque_offset"),
        ("drawbar_offset", "drawbar_offset"),
        ("acceleration_bias_x", "acceleration_bias"),
        ("pitch_offset", "pitch_offset"),
    ):
        error = spread(key)
        if error is not None:
            left[name] = error
    radius = [q.spread / q.value for q in quantities if q.key == "wheel_radius"]
    if radius:
        left["wheel_radius"] = float(np.sqrt(np.mean(np.square(radius))))
    gain = spread("drive_torque_gain")
    if gain is not None and prior.drive_torque_gain is not None:
        # Independent errors of n wheels: their mean, prior/√n, is common to all and stays; the rest is known now.
        wheels = sum(q.key == "drive_torque_gain" for q in quantities)
        known_common = prior.drive_torque_gain_common or 0.0
        left["drive_torque_gain_common"] = float(
            np.hypot(known_common, prior.drive_torque_gain / np.sqrt(wheels))
        )
        left["drive_torque_gain"] = gain
    return left
