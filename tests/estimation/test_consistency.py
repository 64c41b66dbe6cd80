"""Agreement, coverage, NIS and whiteness against closed forms and known laws."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.estimation.consistency import (
    agreement,
    coverage,
    mean_absolute_error,
    nis_consistency,
    whiteness,
)


def test_agreement_by_hand() -> None:
    observed = [1.0, 2.0, 3.0, 4.0]
    predicted = [1.0, 2.0, 3.0, 5.0]
    got = agreement(observed, predicted)
    # SSE 1, SST 5, range 3, RMSE sqrt(1/4)
    assert got.r2 == pytest.approx(0.8)
    assert got.rmse == pytest.approx(0.5)
    assert got.nrmse == pytest.approx(0.5 / 3)
    assert got.bias == pytest.approx(0.25)


def test_r_squared_is_not_symmetric_and_can_be_negative() -> None:
    observed, predicted = [0.0, 1.0], [10.0, 11.0]
    assert agreement(observed, predicted).r2 == pytest.approx(1 - 200 / 0.5)
    # the normalisation is by the observations: swapping the arguments changes NRMSE
    small, large = [0.0, 1.0, 2.0], [0.0, 1.0, 8.0]
    assert agreement(small, large).nrmse != agreement(large, small).nrmse


def test_rows_with_nan_and_outside_the_mask_are_left_out() -> None:
    observed = np.array([1.0, np.nan, 3.0, 4.0, 100.0])
    predicted = np.array([1.0, 2.0, np.nan, 4.0, 0.0])
    got = agreement(observed, predicted, mask=[True, True, True, True, False])
    assert (got.count, got.r2) == (2, 1.0)
    assert mean_absolute_error(observed, predicted) == pytest.approx(100 / 3)


@pytest.mark.parametrize(
    ("observed", "predicted"),
    [([], []), ([1.0], [1.0]), ([np.nan, np.nan], [1.0, 2.0]), ([2.0, 2.0], [1.0, 3.0]), ([1.0, 2.0], [1.0])],
)
def test_what_cannot_be_scored_is_refused(observed: list[float], predicted: list[float]) -> None:
    with pytest.raises(InputError):
        agreement(observed, predicted)


def test_an_error_needs_a_row() -> None:
    assert mean_absolute_error([1.0, np.nan], [3.0, 1.0]) == 2.0
    with pytest.raises(InputError, match="only 0 rows"):
        mean_absolute_error([np.nan], [1.0])


@pytest.mark.parametrize("probability", [0.5, 0.9, 0.95])
def test_coverage_of_honest_and_of_too_narrow_intervals(probability: float) -> None:
    rng = np.random.default_rng(1)
    truth = rng.normal(size=40_000)
    estimate = truth + 0.3 * rng.normal(size=truth.size)
    honest = coverage(truth, estimate, np.full(truth.size, 0.3), probability)
    assert honest == pytest.approx(probability, abs=0.006)  # 2.4 binomial SDs at .5
    assert coverage(truth, estimate, np.full(truth.size, 0.15), probability) < probability - 0.1


def test_coverage_refuses_a_probability_of_one() -> None:
    with pytest.raises(InputError, match="inside"):
        coverage([1.0], [1.0], [1.0], 1.0)


def test_nis_consistency_tells_a_right_from_a_too_sure_filter() -> None:
    rng = np.random.default_rng(3)
    channels = rng.integers(0, 6, size=30_000)
    nis = np.where(channels > 0, rng.chisquare(np.maximum(channels, 1)), 0.0)
    right = nis_consistency(nis, channels)
    assert right.count == int((channels > 0).sum())
    assert right.ratio == pytest.approx(1.0, abs=0.02)
    assert right.within == pytest.approx(0.95, abs=0.004)
    too_sure = nis_consistency(2.0 * nis, channels)
    assert too_sure.ratio == pytest.approx(2.0, abs=0.04)
    assert too_sure.within < 0.85
    with pytest.raises(InputError):
        nis_consistency([0.0, 0.0], [0, 0])


def test_the_whiteness_statistic_by_hand() -> None:
    """Of 1, 2, 4, 1: mean 2, so -1, 0, 2, -1: lag 1 (0 + 0 - 2)/6, lag 2 (-2 + 0)/6; n (n + 2) (r1²/(n - 1) + r2²/(n - 2))."""
    got = whiteness([1.0, 2.0, 4.0, 1.0], lags=2)
    assert got.autocorrelation == pytest.approx([-1 / 3, -1 / 3])
    assert got.statistic == pytest.approx(4 * 6 * (1 / 9 / 3 + 1 / 9 / 2))
    assert got.p_value == pytest.approx(np.exp(-got.statistic / 2))  # chi² of two degrees


def test_whiteness_of_white_and_of_coloured_noise() -> None:
    rng = np.random.default_rng(4)
    white = rng.normal(size=5000)
    assert whiteness(white).p_value > 0.01
    assert whiteness(white).bound == pytest.approx(0.0277, abs=1e-4)  # 1.96/sqrt(5000)
    coloured = np.convolve(white, [1.0, 0.5], mode="valid")
    got = whiteness(coloured, lags=5)
    # MA(1) with 0.5: autocorrelation 0.4 at lag 1, none beyond
    assert got.autocorrelation[0] == pytest.approx(0.4, abs=0.03)
    assert np.all(np.abs(got.autocorrelation[1:]) < 0.05)
    assert got.p_value < 1e-6
    with pytest.raises(InputError):
        whiteness(np.ones(100))
