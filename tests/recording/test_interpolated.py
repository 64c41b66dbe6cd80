"""Speeds that lie on straight lines between fewer samples: interpolated, not measured."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.interpolated import period_of_lines

TIME = 0.05 * np.arange(2400)
DRAWS = np.random.default_rng(13)
SPEED = 1.5 + np.sin(TIME / 5) + 0.03 * DRAWS.standard_normal(len(TIME))


@pytest.mark.parametrize("digits", [4, 15])
@pytest.mark.parametrize("late", [0.0, 0.013])
def test_a_speed_on_straight_lines_is_named(digits: int, late: float) -> None:
    """1 Hz drawn at 20 Hz: slip was held in 84 % of the rows, without a word."""
    drawn = np.round(np.interp(TIME - late, TIME[::20], SPEED[::20]), digits)
    channels = {"ground_speed": drawn, "wheel_speed_l": 5 * SPEED, "wheel_speed_r": 5 * SPEED}
    notes = [n for n in unit_warnings(Recording(TIME, channels), None) if "straight lines" in n]
    assert len(notes) == 1
    assert notes[0].startswith("ground_speed (1 s): values lie on straight lines")


@pytest.mark.parametrize(
    "values",
    [
        SPEED,
        np.round(SPEED, 2),
        np.round(1.5 + np.sin(TIME / 5), 2),  # coarse
        1.5 + np.sin(TIME / 5),  # without noise, as of a filter
        np.round(1.5 + 0.2 * np.sin(TIME / 50), 8),  # slowly: its bends come and go with the rounding
        SPEED[::20].repeat(20),  # held
        np.convolve(SPEED, np.ones(20) / 20, mode="same"),
        np.interp(TIME, [0, 40, 80, 120], [0, 2, 2, 0]),  # a command
        np.interp(TIME, np.sort(DRAWS.uniform(0, 120, 120)), SPEED[:120]),  # unevenly: as of a command, too
    ],
)
def test_other_channels_are_not(values: np.ndarray) -> None:
    assert period_of_lines(TIME, values) is None
