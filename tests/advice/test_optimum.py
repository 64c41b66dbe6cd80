"""The best slips of curves whose optimum is known by calculus."""

import numpy as np
import pytest

from advice_drives import VEHICLE
from terragrip.advice.optimum import GRID, best_of, over_slip
from terragrip.advice.soil_curves import of_library
from terragrip.physics.adhesion import CURVES, efficiency_peak
from terragrip.soil.bins import BinSettings
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.library import Soil


def straight(slope: float, resistance: float, tire: float, driven: float = 1.0):
    """mu = slope s with constant resistance: everything has a closed form."""
    return over_slip(slope * GRID[None], np.full((1, GRID.size), resistance), GRID, tire, driven)


def test_best_efficiency_of_a_straight_curve_is_the_root_by_calculus():
    # eta = (k s - r)(1 - s)/(k s + t): d/ds = 0 where k^2 s^2 + 2 k t s - (k r + k t + r t) = 0... solved here by its own quadratic
    k, r, t = 4.0, 0.06, 0.02
    # numerator N = (k s - r)(1 - s), N' (k s + t) = N k  ->  -k^2 s^2 - 2 k t s + (k t + r t + r k) = 0
    s = (-2 * k * t + np.sqrt(4 * k**2 * t**2 + 4 * k**2 * (k * t + r * t + r * k))) / (2 * k**2)
    curves = straight(k, r, t)
    best = best_of(curves, curves.efficiency)
    assert best.slip == pytest.approx(s, abs=2e-5)
    assert best.efficiency == pytest.approx((k * s - r) * (1 - s) / (k * s + t), abs=1e-4)


def test_most_pull_power_of_a_straight_curve_is_half_way_to_full_slip():
    # (k s - r)(1 - s) is largest at s = (1 + r/k)/2
    k, r = 1.0, 0.1
    curves = straight(k, r, 0.0)
    assert best_of(curves, curves.productivity).slip == pytest.approx((1 + r / k) / 2, abs=1e-5)


def test_with_all_wheels_driven_it_is_the_papers_efficiency():
    parameters = {"a": 0.91}
    mu = CURVES["exponential"].value(GRID, parameters)
    curves = over_slip(mu[None], np.full((1, GRID.size), 0.07), GRID, 0.02)
    slip, eta = efficiency_peak(CURVES["exponential"], parameters, 0.07, 0.02)
    best = best_of(curves, curves.efficiency)
    assert best.slip == pytest.approx(slip, abs=1e-4)
    assert best.efficiency == pytest.approx(eta, abs=1e-4)


def test_an_axle_that_only_rolls_costs_efficiency_and_asks_for_more_slip():
    mu = CURVES["exponential"].value(GRID, {"a": 0.91})[None]
    rho = np.full((1, GRID.size), 0.07)
    whole, part = over_slip(mu, rho, GRID, 0.02), over_slip(mu, rho, GRID, 0.02, driven=0.6)
    all_driven, rear = best_of(whole, whole.efficiency), best_of(part, part.efficiency)
    assert rear.efficiency < all_driven.efficiency
    assert rear.slip > all_driven.slip
    # power balance at that slip: pull x travel over wheel power, by forces on a machine of weight 1
    s = GRID[np.searchsorted(GRID, rear.slip)]
    grip = float(np.interp(s, GRID, mu[0]))
    pull = 0.6 * grip - 0.4 * 0.02 - 0.07
    power_in = 0.6 * (grip + 0.02) / (1 - s)
    assert np.interp(s, GRID, part.efficiency[0]) == pytest.approx(pull / power_in, rel=1e-9)


def test_nothing_is_pulled_where_resistance_exceeds_the_grip():
    curves = straight(0.1, 0.2, 0.02)
    assert best_of(curves, curves.efficiency).efficiency == 0.0


def test_curves_that_pull_nothing_make_the_interval_wide_instead_of_naming_a_slip():
    slopes = np.array([4.0] * 20 + [0.1] * 2)
    curves = over_slip(slopes[:, None] * GRID, np.full((22, GRID.size), 0.07), GRID, 0.02)
    low, high = best_of(curves, curves.efficiency).interval
    assert low == pytest.approx(best_of(curves, curves.efficiency).slip, abs=1e-6)
    assert high == pytest.approx(GRID[-1])


def test_the_loss_of_a_slip_is_what_nearly_all_curves_lose_there_at_most():
    curves = straight(4.0, 0.06, 0.02)
    best = best_of(curves, curves.efficiency)
    assert curves.loss(best.slip) == pytest.approx(0.0, abs=1e-5)
    k, r, t, s = 4.0, 0.06, 0.02, 0.3
    eta = (k * s - r) * (1 - s) / (k * s + t)
    assert curves.loss(s) == pytest.approx(best.efficiency - eta, abs=1e-4)


@pytest.mark.parametrize("rate", [20.0, 34.0])
def test_a_librarys_curve_that_ends_before_the_best_slip_tells_it_by_what_soils_do(rate):
    """Other rises than the fit's, known closely to 5 % of slip: by the fit's own form the interval of the best slip held neither."""

    def rise(slip):
        return 0.6 * -np.expm1(-rate * slip)

    rng = np.random.default_rng(8160003)
    slip, run = rng.uniform(0.005, 0.05, 4000), np.repeat(np.arange(10), 400)
    mu = rise(slip) + 0.02 * rng.standard_normal(4000)
    fit = AdhesionCurve(bins=BinSettings(0.005, 0.005, 0.05, 20)).fit(slip, mu, run)
    curves = of_library(Soil.from_curve("a", fit, "", (0.06, 0.01)), None, VEHICLE)
    truth = over_slip(
        rise(GRID)[None], 0.06 + 0.06 * (GRID[None] - 0.05), GRID, VEHICLE.tire_rolling_resistance
    )
    low, high = best_of(curves.over, curves.over.efficiency).interval
    assert low <= best_of(truth, truth.efficiency).slip <= high
