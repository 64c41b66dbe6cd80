"""Forces measured on a smooth wheel in sand (../shared/data/cmu_single_wheel_sand): a curve of net traction needs its intercept."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.soil.bins import bin_pairs
from terragrip.soil.choice import compare_forms
from terragrip.soil.fit import AdhesionCurve

EXAMPLE = Path(__file__).parents[2] / "examples/cmu_single_wheel_sand/sand_curve.py"
DATA = "data/cmu_single_wheel_sand/single_wheel_averages.csv"


@pytest.fixture
def example():
    return runpy.run_path(str(EXAMPLE))


@pytest.fixture
def bins(shared, example):
    return example["levels"](shared(DATA))


def test_pull_is_positive_at_slip_and_the_wheel_is_dragged_without(shared, example):
    slip, kappa = example["straight_runs"](shared(DATA))
    assert (kappa[slip > 0.1] > 0).all()
    assert (kappa[slip < -0.1] < -0.2).all()
    assert -0.07 < kappa[np.abs(slip) < 0.02].mean() < -0.04


def test_five_slip_levels_of_three_runs(bins):
    rows = bins.to_list()
    assert [round(row["slip"], 2) for row in rows] == [0.0, 0.23, 0.5, 0.75, 0.9]
    assert {row["count"] for row in rows} == {3}


def test_the_intercept_form_follows(bins):
    curve = AdhesionCurve(intercept=True).fit_bins(bins)
    assert curve.r2_ >= 0.90
    low, high = curve.interval_["intercept"]
    assert low < curve.parameters_["intercept"] < high < 0  # minus the motion resistance ratio


def test_the_prototype_without_it_is_flagged(bins):
    verdict = compare_forms(bins, asked="exponential")
    assert AdhesionCurve(bootstrap=0).fit_bins(bins).r2_ < 0.6
    assert not verdict.follows
    assert verdict.proposal == "exponential with intercept"
    assert "cannot follow" in verdict.sentence


def test_the_intercept_form_is_not_flagged(bins):
    assert compare_forms(bins, asked="exponential with intercept").follows


def test_five_levels_do_not_judge_forms_of_four_parameters(bins):
    verdict = compare_forms(bins)
    assert {score.parameters for score in verdict.ranking} == {1, 2, 3}
    assert "5 slip bins cannot distinguish forms of more than 3 parameters" in verdict.sentence
    with pytest.raises(InputError, match="too few to compare"):
        compare_forms(bins, asked="pacejka")


def test_three_levels_are_too_few():
    slip = np.repeat([0.1, 0.2, 0.3], 20)
    with pytest.raises(InputError, match="3 slip bins are too few"):
        compare_forms(bin_pairs(slip, slip))


def test_the_example_runs(shared, example, capsys):
    example["main"](shared(DATA))
    text = capsys.readouterr().out
    assert "with an intercept: R2 0.9" in text
    assert "cannot follow" in text
