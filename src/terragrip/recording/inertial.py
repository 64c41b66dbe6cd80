"""Gyroscope and accelerometer against the wheels, in time: sentences for the user, never errors.

A vehicle turns by the difference of its rims from side to side and gains speed as they do, after a lag of its own: it accelerates by pull,
and pull needs slip. With the pull coefficient rising by K per slip it is v / (g K) (lag.py). A sensor that is later, or early, is not of
the same instant as the wheels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.courses import CALM, lag_of, points_of, quick, smooth
from terragrip.recording.lag import STIFFNESS, measured
from terragrip.recording.ranks import median, quantile
from terragrip.recording.turns import side_differences
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle


_LAG = 0.1  # s, and a sample: tyres and filters
_WITHIN = 2.0  # s, and five samples: the largest lag searched
_MOST_TIME = 300.0  # s of the log, from its start
_ALIKE = 0.7  # correlation at the lag
_LEFT = 0.5  # of the variance that the other course leaves unexplained without the lag
_MOVING = 0.3  # of the rims' speed that a twentieth of the drive exceeds


def inertial_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Sentences on a rate of turn and an acceleration that are not of the wheels' instant."""
    courses = _courses(recording, vehicle)
    if courses is None:
        return []
    step, speed, pairs = courses
    lags = {
        name: _lag(own, wheels, step, speed) if other is None or not _together(own, other, step) else 0.0
        for name, (own, wheels, other) in pairs.items()
    }
    late = {name: seconds for name, seconds in lags.items() if seconds}
    if len(late) > 1 and np.ptp(list(late.values())) < 2.5 * step:  # of one sensor
        return [_sentence(float(np.mean(list(late.values()))), list(late))]
    # of one half, which turns before or after the other's wheels as the joint bends
    joint = (vehicle.wheelbase or 0.0) / speed if vehicle.articulated else 0.0
    if abs(late.get("angular_velocity_z", np.inf)) <= joint:
        del late["angular_velocity_z"]
    return [_sentence(seconds, [name]) for name, seconds in late.items()]


def _courses(
    recording: Recording, vehicle: Vehicle
) -> tuple[float, float, dict[str, tuple[Floats, Floats, Floats | None]]] | None:
    """The points' distance [s], the usual speed of the rims [m/s], and of each channel its quick course, that of the wheels, and of the
    acceleration that of the ground speed."""
    channels = recording.channels
    found = points_of(recording.time, _MOST_TIME)
    if found is None or not {"angular_velocity_z", "acceleration_x"} & channels.keys():
        return None
    points, step = found
    rows = slice(0, int(np.searchsorted(recording.time, points[-1])) + 1)

    def at(name: str) -> Floats | None:
        known = measured(recording.time[rows], channels[name][rows]) if name in channels else None
        return None if known is None else np.interp(points, *known)

    read = {w: at(f"wheel_speed_{w}") for w in vehicle.wheels}
    rims = {w: vehicle.radii[w] * turning for w, turning in read.items() if turning is not None}
    if not rims:
        return None
    rim = np.mean(list(rims.values()), axis=0)
    fast = np.abs(rim) > _MOVING * quantile(np.abs(rim), 0.95)
    if not fast.any():
        return None
    sides = side_differences(vehicle, rims)
    shown = {"acceleration_x": np.gradient(smooth(rim, CALM, step), step)}
    if sides:
        shown["angular_velocity_z"] = np.mean(sides, axis=0)
    own, ground = {name: at(name) for name in sorted(shown)}, at("ground_speed")
    rate = None if ground is None else quick(np.gradient(smooth(ground, CALM, step), step), step)
    pairs = {
        name: (quick(values, step), quick(shown[name], step), rate if name == "acceleration_x" else None)
        for name, values in own.items()
        if values is not None
    }
    return step, median(np.abs(rim[fast])), pairs


def _together(own: Floats, other: Floats, step: float) -> bool:
    """Whether two courses are of one instant."""
    seconds, alike, _ = lag_of(own, other, step, max(_WITHIN, 5 * step))
    return alike > _ALIKE and abs(seconds) <= max(_LAG, step) + 1e-9


def _lag(own: Floats, wheels: Floats, step: float, speed: float) -> float:
    """The lag [s] of a course behind that of the wheels, 0 where it is not certain, or explained."""
    within = max(_WITHIN, 5 * step)
    seconds, alike, without = lag_of(own, wheels, step, within)
    most = max(_LAG, step) + 1e-9
    explained = speed / (STANDARD_GRAVITY * STIFFNESS)
    if -most <= seconds <= most + explained or abs(seconds) >= within - step:
        return 0.0
    is_sure = alike > _ALIKE and 1 - alike**2 < _LEFT * (1 - max(without, 0.0) ** 2)
    return seconds if is_sure else 0.0


def _sentence(seconds: float, names: list[str]) -> str:
    one, size, who = len(names) == 1, f"{abs(seconds):.2f} s", " and ".join(names)
    place, late, whose = "ahead of", "these are", "each of them"
    if seconds > 0:
        place, late, whose = "behind", "it is" if one else late, "it" if one else whose
    return (
        f"{who} {'is' if one else 'are'} {size} {place} the wheel speeds: if {late} late, write 'delay: {size}' for {whose} "
        "in the profile."
    )
