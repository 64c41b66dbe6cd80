"""Median and quantile are NumPy's, to the last digit."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording.ranks import median, quantile


@pytest.mark.parametrize("size", [1, 2, 3, 10, 11, 1000, 4001])
@pytest.mark.parametrize("kind", ["normal", "whole numbers", "equal"])
def test_ranks_are_those_of_numpy(size: int, kind: str) -> None:
    draws = np.random.default_rng(size)
    values = {
        "normal": draws.normal(3.0, 2.0, size),
        "whole numbers": draws.integers(0, 5, size),
        "equal": np.full(size, 0.1),
    }[kind]
    before = values.copy()
    assert median(values) == np.median(values)
    for share in (0.0, 0.05, 0.25, 0.5, 0.9, 0.95, 1.0):
        assert quantile(values, share) == np.quantile(values, share)
    np.testing.assert_array_equal(values, before)
