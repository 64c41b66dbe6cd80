"""Angles, gravity, mass and time that are likely not in SI, each by itself: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.ranks import median, quantile

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_EMPTY = 0.5  # of the vehicle file's mass: few machines are so much lighter without their load
_ENOUGH = 4000  # rows that show how far rows are apart
_HOUR, _ON_TIME = 3600.0, 3.0  # s, and times the usual distance of rows: no pause lasts for just an hour
_SPARSE, _DENSE = 5.0, 1e-4  # s between samples: no log of a drive has more, or less


def angle_warnings(recording: Recording) -> list[str]:
    """Angles of the body that are in degrees, positions that are not."""
    notes = []
    for name in ("pitch", "roll"):
        size = _typical_size(recording, name)
        if size is not None and size > 1.6:
            notes.append(f"{name} reaches {size:.3g} rad: it may be in degrees.")
    for name in ("latitude", "longitude"):
        values = recording.channels.get(name)
        if values is not None and np.nanmax(np.abs(values), initial=0.0) > 180:
            notes.append(f"{name} exceeds 180: it must be in degrees.")
    return notes


def gravity_warnings(recording: Recording) -> list[str]:
    """A vertical acceleration that rests at another value than gravity."""
    values = recording.channels.get("acceleration_z")
    if values is None or not np.isfinite(values).any():
        return []
    rest = float(np.nanmedian(values))
    if 0.9 < abs(rest) < 1.1:
        return ["acceleration_z rests at 1: the accelerations may be in g."]
    if rest < -8:
        return ["acceleration_z rests at -g: the axes point the other way (z up, specific force)."]
    return []


def mass_warnings(recording: Recording, vehicle: Vehicle | None) -> list[str]:
    """A mass that never comes near the vehicle file's: that of the load alone, as a tank's level gives it."""
    size = _typical_size(recording, "mass")
    if vehicle is None or size is None or size > _EMPTY * vehicle.mass:
        return []
    return [
        f"mass reads up to {size:.4g} kg, under half of the vehicle file's {vehicle.mass:.4g} kg: if it is of the load alone, add the "
        "empty machine by 'offset:' in the profile; else correct the vehicle file."
    ]


def spacing_warnings(recording: Recording) -> list[str]:
    """Rows that are further apart, or closer, than those of a drive, a time written as hhmmss, and a clock set to summer time."""
    if len(recording) < 10:
        return []
    step = np.diff(recording.time)
    spacing = median(step[:: max(1, len(step) // _ENOUGH)])
    if _is_written_as_hhmmss(recording.time, spacing):
        return [
            "time is a time of day written as hhmmss: 59 is followed by 100. Write it as 10:00:00.5, or as seconds; "
            "every time, distance and gap is wrong now."
        ]
    hour = np.flatnonzero((step > _HOUR) & (step <= _HOUR + _ON_TIME * spacing))
    if len(hour) == 1 and spacing < _SPARSE and _goes_on(recording, int(hour[0])):
        return [
            f"time leaps by an hour from {recording.time[hour[0]]:.10g} s to the next row: was the clock set to summer time? Write times "
            "in UTC, or subtract 3600 s from there on; now nothing is known for an hour."
        ]
    mean = float(recording.time[-1] - recording.time[0]) / len(
        step
    )  # instants of two clocks may be close by chance
    if spacing < _SPARSE and mean > _DENSE:
        return []
    return [f"The samples are {max(spacing, mean):.3g} s apart: time may not be in seconds."]


def _goes_on(recording: Recording, row: int) -> bool:
    """Whether no channel changes more from a row to the next than from any other one."""
    changes = [np.abs(np.diff(values)) for values in recording.channels.values()]
    return not any(own[row] > np.nanmax(np.delete(own, row), initial=0.0) for own in changes)


def _is_written_as_hhmmss(time: Floats, spacing: float) -> bool:
    """Whether the last two digits before the point never reach 60, but go on from 59 to the next hundred."""
    if not (time[0] >= 0 and time[-1] < 240000):
        return False
    digits, hundreds = time % 100, time // 100
    change = np.flatnonzero(np.diff(hundreds))
    near = max(3 * spacing, 1.0)
    goes_on = (digits[change] >= 60 - near) & (digits[change + 1] < near)
    return len(change) > 0 and bool((digits < 60).all() and (hundreds % 100 < 60).all() and goes_on.all())


def _typical_size(recording: Recording, name: str) -> float | None:
    values = recording.channels.get(name)
    known = None if values is None else np.abs(values[np.isfinite(values)])
    return None if known is None or not len(known) else quantile(known, 0.95)
