"""Means over a course, and its points, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording.courses import points_of, smooth


def test_a_mean_is_over_so_many_seconds_and_their_middle() -> None:
    """1 s at 10 Hz: five values on each side and the one itself; beyond the ends the last value stands."""
    impulse = np.where(np.arange(41) == 20, 11.0, 0.0)
    np.testing.assert_allclose(smooth(impulse, 1.0, 0.1), np.abs(np.arange(41) - 20) <= 5, atol=1e-12)
    ramp = smooth(np.arange(41.0), 1.0, 0.1)
    np.testing.assert_allclose(ramp[5:-5], np.arange(5.0, 36.0))
    assert ramp[-1] == pytest.approx((35 + 36 + 37 + 38 + 39 + 40 * 6) / 11)


def test_points_are_as_fine_as_the_rows_and_a_log_too_coarse_has_none() -> None:
    points, step = points_of(np.arange(0.0, 100.0, 0.3))
    assert step == pytest.approx(0.3)
    np.testing.assert_allclose(np.diff(points), 0.3)
    assert points_of(np.arange(0.0, 1000.0, 20.0)) is None
