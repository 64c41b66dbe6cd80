"""One mistake gets one note, on what is wrong: none on what follows from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from development_machine import machine
from terragrip.arrays import Floats
from terragrip.recording import Recording, unit_warnings
from terragrip.vehicle import Vehicle

Log = tuple[Recording, Vehicle]
Mistake = Callable[[Recording, Vehicle], Log]


def channels(beginning: str, by: Callable[[Floats], Any]) -> Mistake:
    """The mistake that changes those channels."""

    def changed(log: Recording, vehicle: Vehicle) -> Log:
        values = {n: by(v) if n.startswith(beginning) else v for n, v in log.channels.items()}
        return replace(log, channels=values, delay=None), vehicle

    return changed


def from_the_middle(change: Callable[[Floats], Any], rows: int = 10**9) -> Callable[[Floats], Floats]:
    """A change of so many rows in the middle of the log."""

    def by(values: Floats) -> Floats:
        row = np.arange(len(values)) - len(values) // 2
        return np.where((row >= 0) & (row < rows) & np.isfinite(values), change(values), values)

    return by


def one_speed(log: Recording, vehicle: Vehicle) -> Log:
    left, *_, right = next(iter(vehicle.axles.values())).wheels
    return log.with_channels(**{f"wheel_speed_{left}": log[f"wheel_speed_{right}"]}), vehicle


def late(seconds: float) -> Mistake:
    def shifted(log: Recording, vehicle: Vehicle) -> Log:
        own = log["acceleration_x"]
        known = np.isfinite(own)
        moved = np.interp(log.time - seconds, log.time[known], own[known])
        return log.with_channels(acceleration_x=np.where(known, moved, np.nan)), vehicle

    return shifted


def half_a_radius(log: Recording, vehicle: Vehicle) -> Log:
    data = vehicle.to_dict()
    for part in (data, *data["axles"].values()):
        if part.get("wheel"):
            part["wheel"]["radius"] /= 2
    return log, Vehicle.from_dict(data)


@pytest.mark.parametrize(
    ("number", "mistake", "words"),
    [
        (1, channels("wheel_speed", np.degrees), "may be in deg/s"),
        (2, channels("ground_speed", lambda v: 1000 * v), "may be in mm/s"),
        (4, channels("ground_speed", lambda v: 1.944 * v), "may be in knots"),
        (2, channels("wheel_speed_1l", lambda v: 2 * v), "Straight ahead the rim of 1l"),
        (
            1,
            channels("wheel_speed_1l", lambda v: np.round(5 * v / np.nanmax(v)) * np.nanmax(v) / 5),
            "comes in steps",
        ),
        (
            1,
            channels("ground_speed", lambda v: np.where(np.isfinite(v), np.nanmedian(v), v)),
            "never changes",
        ),
        (9, channels("drive_torque_1l", from_the_middle(lambda v: 0 * v, 160)), "while all other torques"),
        (1, channels("drive_torque", lambda v: np.maximum(v, 0) + 0 * v), "and never less"),
        (0, channels("pitch", np.degrees), "may be in degrees"),
        (1, one_speed, "are one signal"),
        (2, late(0.5), "behind the wheel speeds"),
        (1, half_a_radius, "times the ground speed"),
    ],
)
def test_one_mistake_gets_one_note(number: int, mistake: Mistake, words: str) -> None:
    right = machine(number)
    assert unit_warnings(right.recording, right.vehicle) == []
    (note,) = unit_warnings(*mistake(right.recording, right.vehicle))
    assert words in note
