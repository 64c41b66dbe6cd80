"""Wheels that share one column: sentences for the user, never errors.

One motor's torque, or the speed of a drive train, is sometimes entered for each wheel. What is noise in one column is then the same noise
in the other, which two sensors never show.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import measured_part
from terragrip.recording.lag import is_copy
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import quantile

if TYPE_CHECKING:
    from terragrip.arrays import Floats
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FEW = 100  # rows
_NOISY = 1e-3  # of a channel's size: less need not be noise


def copy_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Sentences on torques of several wheels that are one signal, and on speeds of both sides of an axle that are."""
    notes = [
        f"{', '.join(group)} are one signal: how wheels share it was not measured, so only their mean adhesion is, and single wheels' "
        "intervals are too narrow. If it is the sum of their torques, divide it ('scale:' in the profile)."
        for group in _groups(recording, [f"drive_torque_{wheel}" for wheel in vehicle.wheels])
    ]
    for axle in vehicle.axles.values():
        names = [f"wheel_speed_{wheel}" for wheel in (axle.wheels[0], axle.wheels[-1])]
        if len(axle.wheels) < 2 or not _groups(recording, names) or _is_of_the_ground(recording, names[0]):
            continue
        notes.append(
            f"{' and '.join(names)} are one signal: in turns the slips of both sides are wrong. Give it once, as wheel_based_speed [m/s], "
            "or the wheels' own speeds."
        )
    return notes


def _groups(recording: Recording, names: list[str]) -> list[list[str]]:
    """Columns that are in proportion to each other, noise included."""
    left = [name for name in names if name in recording.channels]
    groups = []
    while left:
        first, *others = left
        same = [name for name in others if _is_same(recording.channels[name], recording.channels[first])]
        if same and _is_noisy(recording, first):
            groups.append([first, *same])
        left = [name for name in others if name not in same]
    return groups


def _is_same(one: Floats, other: Floats) -> bool:
    for rows in (slice(_FEW), slice(None)):  # of most channels the first show it already
        known = np.isfinite(one[rows]) & np.isfinite(other[rows])
        if known.any() and not is_copy(one[rows][known], other[rows][known]):
            return False
    return bool(known.sum() > _FEW)


def _is_noisy(recording: Recording, name: str) -> bool:
    time, values = measured_part(recording.time, recording.channels[name])
    size = quantile(np.abs(values), 0.95) if len(values) else 0.0
    return (white_noise(time, values) or 0.0) > _NOISY * size > 0.0


def _is_of_the_ground(recording: Recording, name: str) -> bool:
    """Whether a wheel's speed was made of the ground speed, as that of a free wheel may be (docs/vehicle.md)."""
    ground = recording.channels.get("ground_speed")
    return ground is not None and _is_same(recording.channels[name], ground)
