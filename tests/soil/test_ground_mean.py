"""The mean curve of varying ground: pulls that do not know the ground, slips that answer to it."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.adhesion import CURVES
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.ground_mean import mean_over_ground

A = 0.9
GRID = np.linspace(0.0, 0.6, 6001)
HEIGHT = CURVES["exponential"].value(GRID, {"a": 1.0})


def drive(seed, variation, slip_noise=0.0, runs=12, spots=1500):
    """Pulls drawn over the ground's reach; each spot's own a (log-normal, mean A) says the slip. Spots lie 1 cm apart."""
    rng = np.random.default_rng(seed)
    run = np.repeat(np.arange(runs), spots)
    sigma = np.sqrt(np.log1p(variation**2))
    a = A * np.exp(sigma * rng.standard_normal(run.size // 30).repeat(30) - sigma**2 / 2)
    mu = rng.uniform(0.05, 0.95 * 0.476 * A, run.size // 100).repeat(100)
    held = mu < 0.475 * a  # elsewhere the wheels would spin: not driven
    slip = np.interp(mu / a, HEIGHT, GRID) + slip_noise * rng.standard_normal(run.size)
    return slip[held], mu[held], np.full(int(held.sum()), 0.01), run[held]


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
def test_weak_spots_draw_the_bins_down_and_metres_do_not(seed):
    slip, mu, metres, run = drive(seed, 0.15, slip_noise=0.02)
    curve = AdhesionCurve(bootstrap=200).fit(slip, mu, run)
    found = mean_over_ground(curve, slip, mu, metres, run, 0.02, bootstrap=200)
    assert curve.parameters_["a"] < 0.97 * A
    assert found.mean == pytest.approx(A, rel=0.02)
    assert found.matters
    assert found.interval[0] < found.mean < found.interval[1]
    assert f"{found.mean:.3g}" in found.sentence


def test_even_ground_gives_the_same_twice():
    slip, mu, metres, run = drive(1003, 0.0)
    curve = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
    found = mean_over_ground(curve, slip, mu, metres, run)
    assert found.mean == pytest.approx(A, rel=1e-3)
    assert curve.parameters_["a"] == pytest.approx(A, rel=1e-3)
    assert not found.matters


def test_metres_count_not_samples():
    """A stop-and-go log samples one stretch ten times as often: the mean stays that of the ground."""
    s = np.tile(np.linspace(0.06, 0.3, 50), 2)
    a = np.repeat([0.6, 1.0], 50)
    mu = CURVES["exponential"].value(s, {"a": 1.0}) * a
    curve = AdhesionCurve(bootstrap=0).fit(np.repeat(s, 20), np.repeat(mu, 20))
    often = np.where(a == 0.6, 10, 1)
    found = mean_over_ground(curve, s.repeat(often), mu.repeat(often), (0.1 / often).repeat(often))
    assert found.mean == pytest.approx(0.8, rel=0.03)
    assert found.interval is None


@pytest.mark.parametrize(
    "curve", [AdhesionCurve("effective", bootstrap=0), AdhesionCurve(intercept=True, bootstrap=0)]
)
def test_only_a_scale_has_a_mean(curve):
    slip, mu, metres, _ = drive(1004, 0.1)
    assert mean_over_ground(curve.fit(slip, mu), slip, mu, metres) is None


def test_interval_holds_the_mean_ground():
    held = 0
    for seed in range(1000, 1040):
        slip, mu, metres, run = drive(seed, 0.12, slip_noise=0.02)
        curve = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
        found = mean_over_ground(curve, slip, mu, metres, run, 0.02, bootstrap=200)
        held += found.interval[0] <= A <= found.interval[1]
    assert held >= 34


def test_an_error_that_all_runs_share_widens_the_interval():
    slip, mu, metres, run = drive(1005, 0.1)
    curve = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
    plain = mean_over_ground(curve, slip, mu, metres, run)
    wide = mean_over_ground(curve, slip, mu, metres, run, common_sd=0.05)
    assert wide.mean == plain.mean
    for side in (0, 1):
        own = abs(plain.interval[side] - plain.mean)
        assert abs(wide.interval[side] - wide.mean) == pytest.approx(
            np.hypot(own, 1.96 * 0.05 * plain.mean), rel=1e-4
        )
