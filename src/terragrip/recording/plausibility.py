"""Units that are likely wrong: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

# Ratio of wheel speed times radius to ground speed, and what makes it so; slip raises it by 1/(1 - slip).
_RATIOS = (
    (3.6, "wheel_speed may come from km/h, or ground_speed may be 3.6 times too small"),
    (9.5493, "wheel_speed may be in rpm: 1 rpm is 0.1047 rad/s"),
    (57.296, "wheel_speed may be in deg/s: 1 deg/s is 0.01745 rad/s"),
    (1 / 3.6, "ground_speed may be in km/h: 1 km/h is 0.2778 m/s"),
    (0.10472, "wheel_speed may be in rpm divided twice, or ground_speed 9.55 times too fast"),
    (0.15915, "wheel_speed may be in revolutions per second: 1 rev/s is 6.283 rad/s"),
    (0.017453, "wheel_speed may have been taken from degrees to radians twice"),
    (1e-2, "ground_speed may be in cm/s"),
    (1e-3, "ground_speed may be in mm/s"),
    (1e3, "wheel_speed or ground_speed may be off by a factor of 1000"),
)
_ENOUGH = 4000  # rows: a median that is to be told from another by a third needs no more
_PLAUSIBLE = (0.6, 2.2)  # a median ratio within is left to slip


def unit_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Sentences on channels that are likely not in SI: speeds against each other, angles, acceleration, time.

    The speeds are judged where both are well above standstill, by the median of their ratio.
    """
    return [
        *_speed_warnings(recording, vehicle),
        *_angle_warnings(recording),
        *_acceleration_warnings(recording),
        *_time_warnings(recording),
    ]


def _speed_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    found: dict[str, list[tuple[str, float]]] = {}
    for wheel, radius in zip(vehicle.wheels, vehicle.wheel_radius, strict=True):
        ratio = _speed_ratio(recording, wheel, float(radius))
        if ratio is None or _PLAUSIBLE[0] <= ratio <= _PLAUSIBLE[1]:
            continue
        reasons = [(radius, "wheel_speed may be the rim's speed in m/s: divide it by the radius"), *_RATIOS]
        reasons.append((3.6 * float(radius), "wheel_speed may be the rim's speed in km/h"))
        # Where two reasons fit, the nearer one speaks.
        distance, why = min((abs(np.log(ratio / (1.08 * r))), text) for r, text in reasons)
        if distance > np.log(1.35):
            why = "check units, gear ratio and radius"
        found.setdefault(why, []).append((wheel, ratio))
    return [
        f"The wheel speed of {', '.join(wheel for wheel, _ in those)} times the radius is "
        f"{np.median([ratio for _, ratio in those]):.3g} times the ground speed: {why}."
        for why, those in found.items()
    ]


def _speed_ratio(recording: Recording, wheel: str, radius: float) -> float | None:
    """Median of |wheel speed| radius / |ground speed| while both move; None without enough motion."""
    speed, turning = recording.channels.get("ground_speed"), recording.channels.get(f"wheel_speed_{wheel}")
    if speed is None or turning is None:
        return None
    pairs = _pairs(recording.time, speed, turning)
    if pairs is None:
        return None
    ground, rim = np.abs(pairs[0]), radius * np.abs(pairs[1])
    moving = (ground > 0.3 * _high(ground)) & (rim > 0.3 * _high(rim)) & (ground > 0) & (rim > 0)
    return float(np.median(rim[moving] / ground[moving])) if moving.sum() >= 10 else None


def _high(values: Floats) -> float:
    """What 5 % of the values (n,), n > 0, reach."""
    rank = int(0.95 * (len(values) - 1))
    return float(np.partition(values, rank)[rank])


def _pairs(time: Floats, speed: Floats, turning: Floats) -> tuple[Floats, Floats] | None:
    """About `_ENOUGH` pairs of ground speed and wheel speed at one time; None where either has fewer than two values."""
    few = slice(None, None, max(1, len(time) // _ENOUGH))
    if np.isfinite(speed[few]).all() and np.isfinite(turning[few]).all() and len(time) > 1:
        return speed[few], turning[few]
    known, rows = np.flatnonzero(np.isfinite(speed)), np.flatnonzero(np.isfinite(turning))
    if len(known) < 2 or len(rows) < 2:
        return None
    rows = rows[:: max(1, len(rows) // _ENOUGH)]
    return np.interp(time[rows], time[known], speed[known]), turning[rows]


def _angle_warnings(recording: Recording) -> list[str]:
    said = []
    for name in ("pitch", "roll"):
        size = _typical_size(recording, name)
        if size is not None and size > 1.6:
            said.append(f"{name} reaches {size:.3g} rad: it may be in degrees.")
    for name in ("latitude", "longitude"):
        values = recording.channels.get(name)
        if values is not None and np.nanmax(np.abs(values), initial=0.0) > 180:
            said.append(f"{name} exceeds 180: it must be in degrees.")
    return said


def _acceleration_warnings(recording: Recording) -> list[str]:
    values = recording.channels.get("acceleration_z")
    if values is None or not np.isfinite(values).any():
        return []
    rest = float(np.nanmedian(values))
    if 0.9 < abs(rest) < 1.1:
        return ["acceleration_z rests at 1: the accelerations may be in g."]
    if rest < -8:
        return ["acceleration_z rests at -g: the axes point the other way (z up, specific force)."]
    return []


def _time_warnings(recording: Recording) -> list[str]:
    if len(recording) < 10:
        return []
    step = np.diff(recording.time)
    spacing = float(np.median(step[:: max(1, len(step) // _ENOUGH)]))
    if spacing >= 5.0:
        return [f"The samples are {spacing:.3g} s apart: time may not be in seconds."]
    return []


def _typical_size(recording: Recording, name: str) -> float | None:
    values = recording.channels.get(name)
    known = None if values is None else np.abs(values[np.isfinite(values)])
    return None if known is None or not len(known) else float(np.quantile(known, 0.95))
