"""Two loggers' clocks that run apart within one file."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings


def log(rate: float, late: float = 0.0, seconds: float = 300.0, seed: int = 0) -> Recording:
    """A drive at 20 Hz of changing speed; the ground speed's stamps are ``late`` [s] and gain ``rate`` seconds a second."""
    draws = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.05)
    knots = np.arange(0, seconds + 8, 4.0)
    level = 1.5 + 0.5 * draws.standard_normal(len(knots))

    def speed(when: np.ndarray) -> np.ndarray:
        return np.interp(when, knots, level)

    ground = 0.95 * speed((time - late) / (1 + rate)) + 0.02 * draws.standard_normal(len(time))
    rims = {
        f"wheel_speed_{w}": (speed(time) + 0.02 * draws.standard_normal(len(time))) / 0.4 for w in ("l", "r")
    }
    return Recording(time, {"ground_speed": ground, **rims})


@pytest.mark.parametrize("rate", [0.002, -0.002, 0.005])
def test_a_clock_that_runs_away_is_named_with_its_rate(rate: float) -> None:
    (note,) = unit_warnings(log(rate), None)
    assert f"drift apart by {abs(rate):.2%}" in note
    factor = float(note.split("divide the time of the ground speed by ")[1].split()[0])
    assert factor == pytest.approx(1 + rate, abs=3e-4)


@pytest.mark.parametrize(("rate", "late"), [(0.0, 0.0), (0.0, 0.5), (0.0005, 0.0)])
def test_a_steady_lag_and_a_small_drift_are_not(rate: float, late: float) -> None:
    for seed in range(3):
        assert unit_warnings(log(rate, late, seed=seed), None) == []


def test_a_lag_that_jumps_once_is_no_drift() -> None:
    early, late = log(0.0), log(0.0, 0.6)
    half = early.time < 180
    mixed = {n: np.where(half, v, late.channels[n]) for n, v in early.channels.items()}
    assert unit_warnings(Recording(early.time, mixed), None) == []
