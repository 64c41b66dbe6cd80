"""Slip bins against a plain loop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.soil.bins import BinSettings, bin_pairs

PAIRS = st.lists(
    st.tuples(
        st.floats(-1, 1) | st.just(float("nan")), st.floats(-2, 2) | st.just(float("nan")), st.integers(0, 3)
    ),
    max_size=200,
)


@given(PAIRS)
def test_bins_are_what_a_loop_counts(pairs):
    settings = BinSettings(width=0.05, lower=0.05, upper=0.60, minimum=2)
    slip, mu, run = (np.array([p[i] for p in pairs], dtype=float) for i in range(3))
    bins = bin_pairs(slip, mu, run.astype(int), settings)
    edges = settings.edges
    for j in range(len(edges) - 1):
        inside = [
            i
            for i in range(len(pairs))
            if np.isfinite(slip[i]) and np.isfinite(mu[i]) and np.floor((slip[i] - 0.05) / 0.05 + 1e-9) == j
        ]
        assert bins.count[j] == len(inside)
        if len(inside) >= 2:
            assert bins.mean[j] == pytest.approx(np.mean(mu[inside]), abs=1e-9)
            assert bins.std[j] == pytest.approx(np.std(mu[inside], ddof=1), abs=1e-6)
            assert bins.slip[j] == pytest.approx(np.mean(slip[inside]), abs=1e-9)
        else:
            assert np.isnan(bins.mean[j])
    assert bins.left_out == len(pairs) - bins.count.sum()


def test_the_papers_range_has_55_bins():
    assert len(BinSettings().edges) == 56
    assert BinSettings().edges[-1] == pytest.approx(0.60)


@pytest.mark.parametrize(
    "bad",
    [
        {"width": 0.0},
        {"lower": 0.6, "upper": 0.6},
        {"minimum": 0},
        {"metres": 0.0},
        {"metres": -1.0},
        {"runs": 0},
    ],
)
def test_settings_that_are_no_bins(bad):
    with pytest.raises(ValueError, match="no bins"):
        BinSettings(**bad)


def test_lengths_must_agree():
    with pytest.raises(ValueError, match="2 slips but 1"):
        bin_pairs([0.1, 0.2], [0.1])
