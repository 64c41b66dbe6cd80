"""A buffer that a logger wrote twice is named; coarse, held and standing channels repeat values by nature."""

from __future__ import annotations

import numpy as np
import pytest

from steady_drive import TIME, pulling
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.replays import replay_warnings

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
