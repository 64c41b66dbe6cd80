"""The verdict on a form: the prototype follows its own data, not a curve that peaks and falls."""

from __future__ import annotations

import numpy as np
import pytest

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings, bin_pairs
from terragrip.soil.choice import compare_forms
from terragrip.soil.pull_bins import bin_by_pull


@pytest.mark.parametrize("seed", range(5))
def test_prototype_follows_prototype_soils(seed):
    slip, mu, run = pairs(seed, a=0.85)
    verdict = compare_forms(bin_pairs(slip, mu, run))
    assert verdict.follows
    assert verdict.proposal is None


@pytest.mark.parametrize("seed", range(5))
def test_a_curve_that_peaks_and_falls_is_seen(seed):
    slip, mu, run = pairs(seed, "effective", A=0.7, k=15.0, d=0.6)
    verdict = compare_forms(bin_pairs(slip, mu, run))
    assert not verdict.follows
    assert verdict.proposal in ("effective", "effective with intercept", "pacejka")
    assert "cannot follow" in verdict.sentence
    errors = [score.error for score in verdict.ranking]
    assert errors == sorted(errors)


def test_one_run_falls_back_to_bins_and_says_so():
    slip, mu, _ = pairs(1, "effective", A=0.7, k=15.0, d=0.6)
    assert "one run only" in compare_forms(bin_pairs(slip, mu)).sentence


def test_too_few_bins():
    with pytest.raises(InputError, match="too few to compare"):
        compare_forms(bin_pairs(np.repeat([0.1, 0.2], 50), np.repeat([0.1, 0.2], 50)))
    with pytest.raises(InputError, match="no curve form"):
        compare_forms(bin_pairs(*pairs(1, a=0.8)), asked="cubic")


@pytest.mark.parametrize(("candidates", "expected"), [(["effective"], 2), (["effective", "exponential"], 2)])
def test_the_form_in_question_takes_part_once_whatever_the_candidates(candidates, expected):
    verdict = compare_forms(bin_pairs(*pairs(1, a=0.85)), candidates=candidates)
    forms = [score.form for score in verdict.ranking]
    assert len(forms) == expected
    assert set(forms) == {"effective", "exponential"}


@pytest.mark.parametrize(("samples", "compared"), [(5, True), (4, False)])
def test_a_bin_counts_where_the_runs_that_are_left_fill_it(samples, compared):
    """Three runs and least ten samples a bin: two runs of five fill a bin, two of four do not, though all three do."""
    slip = np.tile(np.repeat(0.055 + 0.05 * np.arange(8), samples), 3)
    mu = 0.5 * (1 - np.exp(-9 * slip))
    bins = bin_pairs(slip, mu, np.repeat([0, 1, 2], 8 * samples), BinSettings(minimum=10))
    assert bins.used.sum() == 8
    if compared:
        assert "leaving runs out" in compare_forms(bins).sentence
    else:
        with pytest.raises(InputError, match="too unlike"):
            compare_forms(bins)


def test_each_form_fits_the_parameters_of_its_own():
    """The paper's scale; A, k, d; B, C, D, E less what is held; and one more where there is an intercept."""
    verdict = compare_forms(bin_pairs(*pairs(1, a=0.85)))
    fitted = {score.form: score.parameters for score in verdict.ranking}
    assert (fitted["exponential"], fitted["exponential with intercept"]) == (1, 2)
    assert (fitted["effective"], fitted["effective with intercept"]) == (3, 4)


def test_bins_by_pull_count_with_half_of_their_way():
    """Three runs fill each bin with just the metres that are asked for: two of them are still enough to fit."""
    slip = np.tile(np.repeat(0.055 + 0.05 * np.arange(8), 5), 3)
    mu = CURVES["exponential"].value(slip, {"a": 0.9})
    settings = BinSettings(by="pull", metres=3.0, runs=3)
    bins = bin_by_pull(slip, mu, mu, np.full(slip.size, 0.2 + 1e-9), np.repeat([0, 1, 2], 40), settings)
    assert bins.used.size == 8
    verdict = compare_forms(bins)
    assert verdict.follows
    assert "leaving runs out" in verdict.sentence


def test_the_error_is_that_of_the_runs_left_out():
    """Each run on a level of its own: the form's free scale takes the level of the others, so the error is known."""
    slip = np.tile(np.repeat(0.105 + 0.05 * np.arange(8), 20), 2)
    level = np.repeat([0.8, 1.0], 8 * 20)
    height = CURVES["exponential"].value(slip, {"a": 1.0})
    bins = bin_pairs(slip, level * height, np.repeat([0, 1], 8 * 20))
    verdict = compare_forms(bins, candidates=["exponential"])
    expected = 0.2 * np.sqrt(
        np.mean(CURVES["exponential"].value(0.105 + 0.05 * np.arange(8), {"a": 1.0}) ** 2)
    )
    assert verdict.ranking[0].error == pytest.approx(expected, rel=1e-6)
    assert verdict.ranking[0].standard_error == pytest.approx(0.0, abs=1e-9)
    assert verdict.ranking[0].parameters == 1
