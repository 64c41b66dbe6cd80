"""The badge of a fit, against singular values in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.adhesion import CURVES
from terragrip.soil.identifiability import LIMIT, _sensitivity, _twin, judge

SLIP = np.linspace(0.05, 0.55, 40)
EFFECTIVE = {"A": 0.6, "k": 10.0, "d": 0.2}


def test_the_condition_is_that_of_the_scaled_sensitivities() -> None:
    """By hand: dmu/dln A, dln k, dln d of A(1 - e^(-k s)) - d s."""
    a, k, d = EFFECTIVE.values()
    columns = [a * (1 - np.exp(-k * SLIP)), a * k * SLIP * np.exp(-k * SLIP), -d * SLIP]
    expected = np.linalg.cond(np.column_stack(columns))
    badge = judge(CURVES["effective"], EFFECTIVE, ["A", "k", "d"], SLIP, 0.99)
    assert badge.condition == pytest.approx(expected, rel=1e-4)
    assert badge.identifiable
    assert badge.separable
    assert badge.twin is None
    alone = judge(CURVES["effective"], EFFECTIVE, ["k"], SLIP, 0.99)
    assert alone.condition == pytest.approx(1.0)


def test_a_parameter_at_zero_is_moved_by_a_hundredth() -> None:
    badge = judge(CURVES["effective"], {**EFFECTIVE, "d": 0.0}, ["A", "d"], SLIP, 0.99)
    columns = [0.6 * (1 - np.exp(-10 * SLIP)), -0.01 * SLIP]
    assert badge.condition == pytest.approx(np.linalg.cond(np.column_stack(columns)), rel=1e-4)


def test_an_intercept_counts_by_the_curves_range() -> None:
    badge = judge(CURVES["effective"], EFFECTIVE, ["A", "intercept"], SLIP, 0.99)
    curve = CURVES["effective"].value(SLIP, EFFECTIVE)
    columns = [0.6 * (1 - np.exp(-10 * SLIP)), np.full(40, np.ptp(curve))]
    assert badge.condition == pytest.approx(np.linalg.cond(np.column_stack(columns)), rel=1e-4)
    assert "A, intercept" in badge.sentence


def test_a_curve_that_explains_little_is_a_hint() -> None:
    badge = judge(CURVES["effective"], EFFECTIVE, ["A", "k"], SLIP, 0.3)
    assert not badge.identifiable
    assert badge.separable
    assert "R2 0.30" in badge.sentence


def test_parameters_that_draw_one_curve_have_a_twin() -> None:
    """The paper's four: another set within 1e-4 everywhere, and the three that the data do fix."""
    parameters = {"a": 1.42, "p": 0.52, "alpha_1": 0.01, "alpha_2": -11.36}
    model = CURVES["exponential"]
    badge = judge(model, parameters, list(parameters), SLIP, 0.99)
    assert badge.condition > LIMIT
    assert not badge.identifiable
    assert badge.twin is not None
    assert badge.twin_difference is not None
    off = np.abs(model.value(SLIP, badge.twin) - model.value(SLIP, parameters)).max()
    assert off == pytest.approx(badge.twin_difference)
    assert 0 < off <= 1e-4
    assert max(abs(badge.twin[n] / parameters[n] - 1) for n in parameters) > 0.01
    bounds = {p.name: (p.lower, p.upper) for p in model.parameters}
    assert all(low <= badge.twin[n] <= high for n, (low, high) in bounds.items())
    assert badge.effective == pytest.approx({"A": 1.42 * 0.48, "k": 11.36, "d": 1.42 * 0.52 * 0.01})


def test_a_twin_is_looked_for_on_both_sides() -> None:
    """Where one parameter is at its bound there is a way to one side alone, wherever the direction points."""
    model, parameters = CURVES["exponential"], {"a": 10.0, "p": 0.52, "alpha_1": 0.01, "alpha_2": -11.36}
    columns = [_sensitivity(model, parameters, name, SLIP) for name in parameters]
    flattest = np.linalg.svd(np.column_stack(columns))[2][-1]
    twins = [_twin(model, parameters, list(parameters), way, SLIP)[0] for way in (flattest, -flattest)]
    assert twins[0] == pytest.approx(twins[1])
    assert twins[0]["a"] < 10.0
    judged = judge(model, parameters, list(parameters), SLIP, 0.99)
    assert judged.twin == pytest.approx(twins[0])


def test_a_parameter_without_any_effect_is_no_division_by_zero() -> None:
    """Without a rise (A = 0 is not allowed, p = 0 is) the slow rate does nothing."""
    parameters = {"a": 1.0, "p": 0.0, "alpha_1": 0.01, "alpha_2": -11.0}
    badge = judge(CURVES["exponential"], parameters, ["a", "alpha_1"], SLIP, 0.99)
    assert np.isfinite(badge.condition)
    assert badge.condition >= 1e15
