"""A ground speed that is not 0 where the wheels stand."""

from __future__ import annotations

import numpy as np
import pytest

from steady_drive import TIME, log
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.rest import rest_warnings

STOPS = (np.abs(TIME - 60) < 8) | (np.abs(TIME - 140) < 6)


def stopping(shift: float = 0.0, noise: np.ndarray | float = 0.0) -> Recording:
    """The drive with two stops more; the ground speed reads ``shift`` [m/s] too much."""
    drive = {n: v for n, v in log().channels.items() if n != "acceleration_x"}  # it would see other stops
    held = {n: np.where(STOPS, 0.0, v) for n, v in drive.items() if "speed" in n}
    draws = 0.005 * np.random.default_rng(3).standard_normal(len(TIME))
    return Recording(TIME, drive | held | {"ground_speed": held["ground_speed"] + shift + draws + noise})


@pytest.mark.parametrize("shift", [0.15, -0.15, 0.1])
def test_a_zero_that_is_off_is_named_with_its_size(shift: float) -> None:
    """Slip was .08 off at 1.9 m/s, and the zero-slip radius of a tractor 15 %, without a word."""
    (note,) = unit_warnings(stopping(shift), None)
    assert note.startswith(f"ground_speed reads {shift:.2g} m/s in 3 stops of all wheels")
    off = float(note.split("at usual speed by ")[1].split(",")[0])
    assert off == pytest.approx(abs(shift) / 2, rel=0.15)


def test_a_right_zero_noise_without_a_sign_and_creeping_are_left_alone() -> None:
    assert rest_warnings(stopping()) == []
    assert rest_warnings(stopping(0.03)) == []
    receiver = np.abs(np.random.default_rng(4).normal(0, 0.1, (2, len(TIME)))).max(axis=0)
    assert rest_warnings(stopping(0.0, np.where(STOPS, receiver, 0.0))) == []
    creep = np.where(np.abs(TIME - 60) < 8, 0.2, 0.0)  # in one stop of three: it slid
    assert rest_warnings(stopping(0.0, creep)) == []
