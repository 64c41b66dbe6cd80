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
def test_the_slope_holds_over_all_of_the_parameters_range(name):
    model, rng = CURVES[name], np.random.default_rng(7)
    slip, h = np.linspace(0.01, 0.99, 99), 1e-6
    for _ in range(20):
        parameters = {p.name: rng.uniform(0.8 * p.lower + 0.2 * p.upper, p.upper) for p in model.parameters}
        numeric = (model.value(slip + h, parameters) - model.value(slip - h, parameters)) / (2 * h)
        np.testing.assert_allclose(model.slope(slip, parameters), numeric, rtol=1e-5, atol=1e-6)


def test_values_are_the_formulas_of_their_authors():
    """Written out as the books print them, at parameters of no model's start."""
    s = 0.17
    printed = {
        "exponential": ({"a": 0.7, "p": 0.4, "alpha_1": 0.3, "alpha_2": -9.0}, 0.7 * (1 - 0.4 * np.exp(0.3 * s) - 0.6 * np.exp(-9 * s))),
        "effective": ({"A": 0.6, "k": 9.0, "d": 0.2}, 0.6 * (1 - np.exp(-9 * s)) - 0.2 * s),
        "burckhardt": ({"c1": 1.1, "c2": 25.0, "c3": 0.5}, 1.1 * (1 - np.exp(-25 * s)) - 0.5 * s),
        "schreiber_kutzbach": ({"a": 0.5, "b": 0.6, "c": 8.0, "d": 0.15}, 0.5 - 0.6 * np.exp(-8 * s) - 0.15 * s),
        "pacejka": (
            {"B": 9.0, "C": 1.5, "D": 0.8, "E": -0.7},
            0.8 * np.sin(1.5 * np.arctan(9 * s + 0.7 * (9 * s - np.arctan(9 * s)))),
        ),
        "brixius": ({"mobility": 20.0}, 0.88 * (1 - np.exp(-0.1 * 20)) * (1 - np.exp(-7.5 * s))),
        "wismer_luth": ({"wheel_numeric": 35.0}, 0.75 * (1 - np.exp(-0.3 * 35 * s))),
    }  # fmt: skip
    assert set(printed) == set(CURVES)
    for name, (parameters, value) in printed.items():
        assert CURVES[name].value(s, parameters) == pytest.approx(value, rel=1e-12), name


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


def test_a_peak_at_the_end_of_the_slips_is_that_end_and_one_beside_it_is_refined():
    falling = {"A": 0.1, "k": 1.0, "d": 3.0}
    assert CURVES["effective"].peak(falling) == (0.0, 0.0)
    rising = {"A": 0.5, "k": 4.0, "d": 0.0}
    assert CURVES["effective"].peak(rising, upper=0.4) == (0.4, pytest.approx(0.5 * (1 - np.exp(-1.6))))
    # A k e^(-k s) = d at .7 of the first step of the grid
    top = 0.7 * 0.0005
    slip, mu = CURVES["effective"].peak({"A": 0.5, "k": 4.0, "d": 2.0 * np.exp(-4 * top)})
    assert slip == pytest.approx(top, rel=1e-2)
    assert mu > 0


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
    assert brixius_resistance(number) == pytest.approx(1 / 37.5)  # at no slip
    assert wismer_luth_resistance(40.0) == pytest.approx(0.07)
    with pytest.raises(ValueError, match="positive"):
        brixius_mobility_number(-1.0, 0.5, 1.5, 20e3, 0.2, 1.0)
    for place in range(6):
        sizes = [1e6, 0.5, 1.5, 20e3, 0.2, 1.0]
        sizes[place] = 0.0
        if place == 4:  # a tyre that does not bend is one
            assert brixius_mobility_number(*sizes) == pytest.approx(18.75)
            continue
        with pytest.raises(ValueError, match="positive"):
            brixius_mobility_number(*sizes)


def test_efficiency_peaks_before_adhesion():
    parameters = {**PROTOTYPE, "a": 0.85}
    slip, eta = efficiency_peak(CURVES["exponential"], parameters, 0.1, 0.02)
    grid = np.linspace(1e-4, 1, 20001)
    mu = CURVES["exponential"].value(grid, parameters)
    brute = np.where(mu > 0.1, (mu - 0.1) / (mu + 0.02) * (1 - grid), 0)
    assert eta == pytest.approx(brute.max(), abs=1e-6)
    assert slip == pytest.approx(grid[brute.argmax()], abs=1e-3)
    assert slip < CURVES["exponential"].peak(parameters)[0]
    nothing = efficiency_peak(CURVES["exponential"], parameters, 0.9, 0.02)
    assert np.isnan(nothing[0])
    assert nothing[1] == 0.0


def test_unknown_parameter_is_named():
    with pytest.raises(ValueError, match="has no parameter q"):
        CURVES["pacejka"].value(0.1, {"q": 1.0})
