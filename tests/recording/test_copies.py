"""One signal in the columns of several wheels is named; like wheels are not (made here)."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.copies import copy_warnings
from terragrip.vehicle import Vehicle

Columns = dict[str, np.ndarray]
TORQUES = [f"drive_torque_{wheel}" for wheel in ("fl", "fr", "rl", "rr")]


def notes_on(columns: Columns, vehicle: Vehicle) -> list[str]:
    return copy_warnings(Recording.from_frame(columns), vehicle)


def test_wheels_of_their_own_say_nothing(columns: Columns, vehicle: Vehicle) -> None:
    assert notes_on(columns, vehicle) == []


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("count", [2, 4])
def test_a_torque_of_several_wheels_is_named(
    columns: Columns, vehicle: Vehicle, count: int, scale: float
) -> None:
    same = {
        name: columns["drive_torque_fl"] * (scale if k else 1.0) for k, name in enumerate(TORQUES[:count])
    }
    (note,) = notes_on(columns | same, vehicle)
    assert note.startswith(
        f"{', '.join(TORQUES[:count])} are one signal: how wheels share it was not measured"
    )
    assert note in unit_warnings(Recording.from_frame(columns | same), vehicle)


def test_a_gap_in_one_of_them_makes_no_other_signal(columns: Columns, vehicle: Vehicle) -> None:
    gap = columns["drive_torque_fl"].copy()
    gap[100:300] = np.nan
    assert notes_on(columns | {"drive_torque_fr": gap}, vehicle)


def test_torques_without_noise_may_be_alike(columns: Columns, vehicle: Vehicle) -> None:
    """A made log, or motors that are both off."""
    smooth = 10 + np.sin(columns["time"] / 9)
    assert notes_on(columns | dict.fromkeys(TORQUES, smooth), vehicle) == []
    assert notes_on(columns | dict.fromkeys(TORQUES, 0.0 * smooth), vehicle) == []


def test_a_speed_of_both_sides_is_named_and_one_side_of_a_tracked_vehicle_is_not(
    columns: Columns, vehicle: Vehicle
) -> None:
    speed = columns["wheel_speed_fl"]
    (note,) = notes_on(columns | {"wheel_speed_fr": speed}, vehicle)
    assert note.startswith(
        "wheel_speed_fl and wheel_speed_fr are one signal: in turns the slips of both sides are wrong"
    )
    assert notes_on(columns | {"wheel_speed_rl": speed}, vehicle) == []
    free = dict.fromkeys(("wheel_speed_fl", "wheel_speed_fr"), columns["ground_speed"] / 0.2)
    assert notes_on(columns | free, vehicle) == []
