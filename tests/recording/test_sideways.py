"""Acceleration to the left and roll of a wrong sign, on a drive of lanes and headlands across a slope (made up)."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.arrays import Floats
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.plausibility import wrong_signs


def drive(*, sideways: float = 1.0, lean: float = 1.0, turning: bool = True) -> Recording:
    """Ten minutes at 20 Hz, 1.5 m/s, a lane of 40 s, a turn of 8 s, across a slope that waves; signs of acceleration_y and roll."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 600.0, 0.05)
    speed = 1.5 + 0.2 * np.sin(time / 7)
    rate = np.where(time % 48 > 40, np.pi / 8 * np.where(time // 48 % 2, -1, 1), 0.0) if turning else 0 * time
    heading = np.cumsum(rate) * 0.05
    roll = 0.06 * np.cos(heading) + 0.04 * np.sin(time / 11)
    felt = speed * rate + 9.81 * np.sin(roll) + 0.1

    def noisy(values: Floats, sd: float) -> Floats:
        return np.asarray(values + sd * rng.standard_normal(len(time)))

    return Recording(
        time,
        {
            "ground_speed": noisy(speed, 0.03),
            "angular_velocity_z": noisy(rate, 0.01),
            "acceleration_y": sideways * noisy(felt, 0.4),
            "roll": lean * noisy(roll, 0.01),
        },
    )


def named(log: Recording) -> list[tuple[str, ...]]:
    return [note.channels for note in wrong_signs(log, None)]


def test_right_signs_are_left_alone() -> None:
    assert unit_warnings(drive(), None) == []


@pytest.mark.parametrize("lean", [1.0, -1.0])
def test_an_acceleration_to_the_right_is_named(lean: float) -> None:
    """As SAE's and NED's axes have it: loads moved to the inner wheels of a turn, without a word."""
    (note,) = unit_warnings(drive(sideways=-1.0, lean=lean), None)
    assert note.startswith("acceleration_y falls in turns to the left")


def test_a_roll_with_the_right_side_up_is_named() -> None:
    assert named(drive(lean=-1.0)) == [("roll",)]


def test_without_turns_either_may_be_wrong() -> None:
    assert named(drive(lean=-1.0, turning=False)) == [("roll", "acceleration_y")]
    assert named(drive(turning=False)) == []
