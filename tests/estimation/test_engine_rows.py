"""The last known value of each row, against a loop over the rows before it."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation.engine_torque import earlier, held


def loop(time: np.ndarray, values: np.ndarray, row: int, least: float, most: float) -> float:
    """The last value known at least ``least`` seconds before a row, NaN where it is older than ``most``."""
    for k in range(row, -1, -1):
        if np.isfinite(values[k]) and time[row] - time[k] >= least - 1e-9:
            return float(values[k]) if time[row] - time[k] <= most else np.nan
    return np.nan


@pytest.mark.parametrize("seed", range(6))
def test_values_stand_two_seconds_and_are_compared_over_three(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # quarters of a second, so that values of exactly the limit's age are among them
    time = np.cumsum(rng.integers(1, 6, 120)) / 4.0
    values = np.where(rng.random(120) < 0.6, np.nan, rng.normal(size=120))
    rows = range(len(time))
    np.testing.assert_array_equal(held(time, values), [loop(time, values, k, 0.0, 2.0) for k in rows])
    for lag in (0.5, 1.0):
        np.testing.assert_array_equal(
            earlier(time, values, lag), [loop(time, values, k, lag, 3.0) for k in rows]
        )


def test_nothing_known_is_nothing() -> None:
    time, nothing = np.arange(4.0), np.full(4, np.nan)
    assert np.isnan(held(time, nothing)).all()
    assert np.isnan(earlier(time, nothing, 0.5)).all()
