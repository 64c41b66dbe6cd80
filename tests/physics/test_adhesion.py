"""Curve models against printed numbers, finite differences and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.adhesion import (
    CURVES,
    PROTOTYPE,
    brixius_mobility_number,
    brixius_resistance,
    effective_parameters,
    efficiency_peak,
    wismer_luth_resistance,
)

SLIP = np.linspace(-1, 1, 201)


@pytest.mark.parametrize("name", list(CURVES))
def test_slope_is_the_derivative_of_the_value(name):
    model = CURVES[name]
    parameters = {p.name: p.start for p in model.parameters}
    slip, h = SLIP[np.abs(SLIP) > 1e-3], 1e-6
    numeric = (model.value(slip + h, parameters) - model.value(slip - h, parameters)) / (2 * h)
    np.testing.assert_allclose(model.slope(slip, parameters), numeric, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", list(CURVES))
def test_curves_are_odd_about_their_intercept(name):
    model = CURVES[name]
    parameters = {p.name: p.start for p in model.parameters}
    middle = model.value(0.0, parameters)
    np.testing.assert_allclose(
        model.value(-SLIP, parameters) - middle, middle - model.value(SLIP, parameters), atol=1e-12
    )


def test_prototype_peaks_at_0_476_a():
    slip, mu = CURVES["exponential"].peak({**PROTOTYPE, "a": 1.42})
    assert mu == pytest.approx(0.476 * 1.42, abs=5e-4 * 1.42)
    # dmu/ds = 0: p alpha_1 e^{alpha_1 s} = -(1-p) alpha_2 e^{alpha_2 s}
    exact = np.log((1 - 0.52) * 11.36 / (0.52 * 0.01)) / (0.01 + 11.36)
    assert slip == pytest.approx(exact, abs=1e-5)


def test_negative_slip_is_not_the_printed_form():
    parameters = {**PROTOTYPE, "a": 1.42}
    printed = 1.42 * (1 - 0.52 * np.exp(0.01 * -0.5) - 0.48 * np.exp(-11.36 * -0.5))
    assert printed < -190  # physics.md 5: as printed mu(-0.5) = -199
    assert CURVES["exponential"].value(-0.5, parameters) == pytest.approx(
        -CURVES["exponential"].value(0.5, parameters)
    )


def test_two_parameter_sets_draw_one_curve():
    slip = np.linspace(0, 0.6, 200)
    one = CURVES["exponential"].value(slip, {"a": 1.42, "p": 0.52, "alpha_1": 0.01, "alpha_2": -11.36})
    other = CURVES["exponential"].value(slip, {"a": 3.00, "p": 0.773, "alpha_1": 0.0032, "alpha_2": -11.36})
    assert np.abs(one - other).max() < 1.5e-3  # the printed digits; physics.md says 9e-6 with all digits


def test_effective_form_follows_the_paper_form():
    parameters = {**PROTOTYPE, "a": 0.85}
    slip = np.linspace(0, 0.6, 61)
    simple = CURVES["effective"].value(slip, effective_parameters(parameters))
    np.testing.assert_allclose(simple, CURVES["exponential"].value(slip, parameters), atol=2e-5)


def test_brixius_against_hand_figures():
    number = brixius_mobility_number(1e6, 0.5, 1.5, 20e3, 0.2, 1.0)
    assert number == pytest.approx(1e6 * 0.5 * 1.5 / 20e3 * 2.0 / 2.0)
    assert CURVES["brixius"].value(0.1, {"mobility": number}) == pytest.approx(
        0.88 * (1 - np.exp(-3.75)) * (1 - np.exp(-0.75))
    )
    assert brixius_resistance(number, 0.1) == pytest.approx(1 / 37.5 + 0.05 / np.sqrt(37.5))
    assert wismer_luth_resistance(40.0) == pytest.approx(0.07)
    with pytest.raises(ValueError, match="positive"):
        brixius_mobility_number(-1.0, 0.5, 1.5, 20e3, 0.2, 1.0)


def test_efficiency_peaks_before_adhesion():
    parameters = {**PROTOTYPE, "a": 0.85}
    slip, eta = efficiency_peak(CURVES["exponential"], parameters, 0.1, 0.02)
    grid = np.linspace(1e-4, 1, 20001)
    mu = CURVES["exponential"].value(grid, parameters)
    brute = np.where(mu > 0.1, (mu - 0.1) / (mu + 0.02) * (1 - grid), 0)
    assert eta == pytest.approx(brute.max(), abs=1e-6)
    assert slip == pytest.approx(grid[brute.argmax()], abs=1e-3)
    assert slip < CURVES["exponential"].peak(parameters)[0]
    assert efficiency_peak(CURVES["exponential"], parameters, 0.9, 0.02)[1] == 0.0


def test_unknown_parameter_is_named():
    with pytest.raises(ValueError, match="has no parameter q"):
        CURVES["pacejka"].value(0.1, {"q": 1.0})
