"""The verdict on a form: the prototype follows its own data, not a curve that peaks and falls."""

from __future__ import annotations

import numpy as np
import pytest

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.soil.bins import bin_pairs
from terragrip.soil.choice import compare_forms


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
