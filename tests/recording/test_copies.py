"""One signal in the columns of several wheels, and a buffer that was written twice, are named; what is alike by nature is not."""

from __future__ import annotations

import numpy as np
import pytest

from steady_drive import TIME, pulling
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.copies import replay_warnings, speed_copy_warnings, torque_copy_warnings
from terragrip.vehicle import Vehicle

Columns = dict[str, np.ndarray]
TORQUES = [f"drive_torque_{wheel}" for wheel in ("fl", "fr", "rl", "rr")]


def notes_on(columns: Columns, vehicle: Vehicle) -> list[str]:
    log = Recording.from_frame(columns)
    return torque_copy_warnings(log, vehicle) + speed_copy_warnings(log, vehicle)


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


def test_a_motors_speed_rounded_to_whole_turns_is_one_signal_where_the_machine_turns(
    columns: Columns, vehicle: Vehicle
) -> None:
    """One motor for all wheels: 1 rpm of 2000 is too little to be noise."""
    coarse = (
        np.round(np.where(columns["time"] > 8, 2000 + 10 * np.sin(columns["time"] / 7), 0)) / 500
    )  # it stands at first
    motor = columns | dict.fromkeys(("wheel_speed_fl", "wheel_speed_fr"), coarse)
    turning = np.where(columns["time"] > 20, 0.4, 0.0)
    tracked = Vehicle.from_dict({**vehicle.to_dict(), "track": 0.5})
    assert notes_on(motor | {"angular_velocity_z": 0 * turning}, tracked) == []
    (note,) = notes_on(motor | {"angular_velocity_z": turning}, tracked)
    assert "wheel_speed_fl and wheel_speed_fr are one signal" in note
    assert "unless a lock couples the wheels" in note


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


SECOND = (TIME >= 40) & (TIME < 44)
FIRST = np.flatnonzero(SECOND) - 120  # 12 s before


def written_twice(drive: Recording) -> Recording:
    """The rows from 28 to 32 s also from 40 to 44 s, in place of what was measured there."""
    return drive.with_channels(**{n: np.where(SECOND, np.roll(v, 120), v) for n, v in drive.channels.items()})


def test_a_buffer_that_was_written_twice_is_named() -> None:
    """Estimates there were those of other ground, without a word."""
    assert replay_warnings(pulling()) == []
    (note,) = unit_warnings(written_twice(pulling()), None)
    assert note.startswith("The rows from 40 to 43.9 s repeat those from 28 to 31.9 s to the last digit")
    two = written_twice(pulling()).select(np.flatnonzero((TIME < 40) | (TIME >= 43.5) | (TIME < 41)))
    assert replay_warnings(two) == [], "ten rows"


def test_rows_of_channels_of_several_rates_are_compared_with_their_holes() -> None:
    holes = {
        "ground_speed": np.where(np.arange(len(TIME)) % 5 == 0, pulling().channels["ground_speed"], np.nan)
    }
    sparse = pulling(**holes)
    assert replay_warnings(sparse) == []
    (note,) = replay_warnings(written_twice(sparse))
    assert "from 40 to 43.9 s repeat those from 28 to 31.9 s" in note


def test_values_that_are_held_over_several_rows_are_repeated_all_the_same() -> None:
    held = {n: v[np.arange(len(TIME)) // 2 * 2] for n, v in pulling().channels.items()}
    assert replay_warnings(pulling(**held)) == []
    assert replay_warnings(written_twice(pulling(**held)))


@pytest.mark.parametrize("steps", [3, 10, 50])
def test_a_coarse_log_repeats_no_buffer(steps: int) -> None:
    """Few values a channel: any row has its like."""
    drive = pulling()
    coarse = {n: np.round(v / np.ptp(v) * steps) for n, v in drive.channels.items() if np.ptp(v)}
    assert replay_warnings(drive.with_channels(**coarse)) == []


def test_a_vehicle_that_stands_repeats_no_buffer() -> None:
    still = {n: np.where(TIME > 30, 0.0, v) for n, v in pulling().channels.items()}
    assert replay_warnings(pulling(**still)) == []
