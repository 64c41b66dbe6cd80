"""Rim speeds of wheels, or of a drive train as one wheel, and the radii that they rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.estimation import zero_slip
from terragrip.estimation.engine import wheel_radii
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

DRIVE = "drive"
"""Name of the wheel that stands for all driven ones, where only the drive train's speed was logged."""

_RADIUS = 0.02  # relative SD of a radius that nothing calibrated


@dataclass(frozen=True)
class RimSpeed:
    """A wheel's rim speed (n,) [m/s] by the radius that counts, its SD, the radius [m] and its relative SD."""

    wheel: str
    values: Floats
    noise: float
    radius: float
    spread: float


def wheel_of(channel: str) -> str:
    """The wheel whose speed a channel is: that of its name, or DRIVE."""
    return DRIVE if channel == "wheel_based_speed" else channel.removeprefix("wheel_speed_")


def zero_of(recording: Recording, vehicle: Vehicle, name: str) -> zero_slip.Ratio | None:
    """The zero-slip ratio of a channel in this log."""
    radius = _radius_of(vehicle, name, recording.source)
    return zero_slip.lightest(*zero_slip.ratios(recording, name, radius))


def radius_before_any_log(vehicle: Vehicle, name: str) -> tuple[float, float, float]:
    """What takes a channel to m/s, the radius [m] that it stands for, and its relative SD, by the vehicle file alone."""
    stated = vehicle.uncertainty.wheel_radius
    if name != "wheel_based_speed":
        radius = _radius_of(vehicle, name, None)
        return radius, radius, _RADIUS if stated is None else stated
    supposed = _radius_of_file(vehicle)
    scale, spread, _ = _scale_of_drive(vehicle, None, supposed, stated)
    return scale, scale * supposed, spread


def _radius_of(vehicle: Vehicle, name: str, source: str | None) -> float:
    """What takes a channel to m/s by the vehicle file."""
    if name == "wheel_based_speed":
        return 1.0
    wheel = wheel_of(name)
    if wheel not in vehicle.wheels:
        mend = f"its wheels are {', '.join(vehicle.wheels)}"
        raise InputError(f"the vehicle has no wheel {wheel}", file=source, place=f"column {name}", mend=mend)
    return float(wheel_radii(vehicle)[1][vehicle.wheels.index(wheel)])


def rim_speeds(
    log: Recording, vehicle: Vehicle, noise: Mapping[str, float], zero: Mapping[str, zero_slip.Ratio | None]
) -> tuple[list[RimSpeed], list[str]]:
    """The rim speeds that slip is told from, and sentences on their radii."""
    notes: list[str] = []
    rims: list[RimSpeed] = []
    stated = vehicle.uncertainty.wheel_radius
    for wheel in log.wheels:
        name = f"wheel_speed_{wheel}"
        radius = _radius_of(vehicle, name, log.source)
        values = radius * log.channels[name] + _hub(log, vehicle, wheel)
        rims.append(
            RimSpeed(wheel, values, radius * noise[name], radius, _RADIUS if stated is None else stated)
        )
        notes += _told(f"wheel {wheel}", zero[name], radius, "the vehicle file says")
    if rims:
        if "wheel_based_speed" in log.channels:
            notes.append("wheel_based_speed is not used: the wheels have speeds of their own.")
        return rims, notes
    supposed = _radius_of_file(vehicle)
    scale, spread, said = _scale_of_drive(vehicle, zero["wheel_based_speed"], supposed, stated)
    values = scale * log.channels["wheel_based_speed"]
    sd = scale * noise["wheel_based_speed"]
    return [RimSpeed(DRIVE, values, sd, scale * supposed, spread)], said


def _radius_of_file(vehicle: Vehicle) -> float:
    """The driven wheels' mean radius [m] as the vehicle file says it, before calibration."""
    radii = [data.radius for data, driven in zip(vehicle.wheel_data, vehicle.driven, strict=True) if driven]
    return float(np.mean(radii))


def _scale_of_drive(
    vehicle: Vehicle, zero: zero_slip.Ratio | None, supposed: float, stated: float | None
) -> tuple[float, float, list[str]]:
    """Factor of the drive train's speed, its relative SD, and the sentence on it."""
    calibrated = vehicle.calibration.wheel_radius
    driven = [w for w, d in zip(vehicle.wheels, vehicle.driven, strict=True) if d]
    if all(wheel in calibrated for wheel in driven):
        of_file = [vehicle.wheel_data[vehicle.wheels.index(wheel)].radius for wheel in driven]
        scale = float(np.mean([calibrated[w] / r for w, r in zip(driven, of_file, strict=True)]))
        spread = _RADIUS if stated is None else stated
        return scale, spread, _told("the drive", zero, supposed, "before calibration")
    if zero is None:
        return (
            1.0,
            _RADIUS,
            [
                "The log is too short to tell the zero-slip radius: slip is against the speed as the machine gives it, "
                f"to about {100 * _RADIUS:.0f} %."
            ],
        )
    return (
        zero.value,
        zero.std,
        [
            *_told("the drive", zero, supposed, "the vehicle file says"),
            "Slip counts from there: the lightest tenth of steady stretches is called zero. Calibrate on a pass without load "
            "to make it absolute.",
        ],
    )


def _told(what: str, zero: zero_slip.Ratio | None, radius: float, beside: str) -> list[str]:
    if zero is None:
        return []
    return [
        f"Zero-slip radius of {what} in this log: {zero.value * radius:.4f} ± {zero.std * radius:.4f} m, from the lightest "
        f"tenth of {zero.windows} steady windows ({beside} {radius:.4f} m)."
    ]


def _hub(log: Recording, vehicle: Vehicle, wheel: str) -> Floats | float:
    """What a turn takes off the speed of a wheel's hub [m/s] (n,): yaw rate times the wheel's distance to the left."""
    if not vehicle.track or "angular_velocity_z" not in log.channels:
        return 0.0
    own = np.flatnonzero(vehicle.wheel_axle == vehicle.wheel_axle[vehicle.wheels.index(wheel)])
    place = int(np.searchsorted(own, vehicle.wheels.index(wheel)))
    side = float(np.linspace(vehicle.track / 2, -vehicle.track / 2, len(own))[place]) if len(own) > 1 else 0.0
    yaw = log.channels["angular_velocity_z"]
    known = np.isfinite(yaw)
    return side * np.interp(log.time, log.time[known], yaw[known]) if known.any() else 0.0
