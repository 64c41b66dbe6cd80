"""Bins by pull on varying ground: pulls that do not know the ground, slips that answer to it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings, slip_of
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.library import SoilLibrary
from terragrip.soil.pull_bins import bin_by_pull

A = 0.9
GRID = np.linspace(0.0, 0.6, 6001)
HEIGHT = CURVES["exponential"].value(GRID, {"a": 1.0})
BY_PULL = BinSettings(by="pull")


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


def fit(slip, mu, metres, run, settings=BY_PULL, bootstrap=0, **options):
    bins = bin_by_pull(slip, mu, mu, metres, run, settings)
    return AdhesionCurve(bins=settings, bootstrap=bootstrap, **options).fit_bins(bins)


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
def test_weak_spots_draw_bins_of_slip_down_and_not_bins_of_pull(seed):
    slip, mu, metres, run = drive(seed, 0.15, slip_noise=0.02)
    by_slip = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
    by_pull = fit(slip, mu, metres, run)
    assert by_slip.parameters_["a"] < 0.97 * A
    assert by_pull.parameters_["a"] == pytest.approx(A, rel=0.03)


def test_even_ground_gives_the_same_twice():
    slip, mu, metres, run = drive(1003, 0.0)
    for curve in (AdhesionCurve(bootstrap=0).fit(slip, mu, run), fit(slip, mu, metres, run)):
        assert curve.parameters_["a"] == pytest.approx(A, rel=1e-3)
        assert curve.r2_ > 0.999


def test_a_shape_that_is_not_the_prototypes_is_found():
    """The slips are averaged on the prototype's scale; a steeper curve still shows."""
    rng = np.random.default_rng(5)
    slip = rng.uniform(0.03, 0.5, 20_000)
    mu = CURVES["effective"].value(slip, {"A": 0.45, "k": 18.0, "d": 0.0})
    bins = bin_by_pull(slip, mu, mu, np.full(slip.size, 0.01), np.arange(slip.size) % 10, BY_PULL)
    result = AdhesionCurve("effective", bootstrap=0).fit_bins(bins).parameters_
    assert result["k"] == pytest.approx(18.0, rel=0.02)
    assert result["A"] == pytest.approx(0.45, rel=0.01)


def test_metres_count_not_samples():
    """A stop-and-go log samples weak ground ten times as often: the mean stays that of the way."""
    pull = np.tile(np.repeat(np.linspace(0.1, 0.27, 50), 20), 2)
    a = np.repeat([0.6, 1.0], 1000)
    slip = slip_of(pull / a)
    often = np.where(a == 0.6, 10, 1)
    curve = fit(*(x.repeat(often) for x in (slip, pull, 0.1 / often, np.arange(2000) % 20)))
    assert curve.parameters_["a"] == pytest.approx(
        2 / (1 / 0.6 + 1), rel=1e-2
    )  # under given pulls: the harmonic mean


@pytest.mark.parametrize(("metres", "runs"), [(1.0, 1), (4.0, 2), (20.0, 6)])
def test_each_bin_holds_its_metres_from_its_runs(metres, runs):
    slip, mu, way, run = drive(1004, 0.1)
    settings = BinSettings(by="pull", metres=metres, runs=runs)
    bins = bin_by_pull(slip, mu, mu, way, run, settings)
    assert bins.used.all()
    assert (bins.weight >= metres).all()
    assert (np.count_nonzero(bins.cluster_count, axis=0) >= runs).all()
    assert bins.count.sum() + bins.left_out == slip.size
    assert (np.diff(bins.mean) > 0).all()
    assert {row["metres"] for row in bins.to_list()} == set(bins.weight)


def test_bins_are_what_a_loop_finds():
    slip, mu, way, run = drive(1005, 0.1, runs=4, spots=600)
    bins = bin_by_pull(slip, mu, mu, way, run, BinSettings(by="pull", metres=1e-9, runs=1))
    edges = bins.reference * np.interp(bins.settings.edges, GRID, HEIGHT)
    filled = [np.flatnonzero((mu >= low) & (mu < high)) for low, high in pairwise(edges)]
    filled = [rows for rows in filled if rows.size]
    assert len(filled) == len(bins.mean)
    for j, rows in enumerate(filled):
        assert bins.count[j] == rows.size
        assert bins.mean[j] == pytest.approx(mu[rows].mean())
        height = CURVES["exponential"].value(slip[rows], {"a": 1.0})
        assert np.interp(bins.slip[j], GRID, HEIGHT) == pytest.approx(height.mean(), abs=1e-6)
        about = mu[rows] - mu[rows].mean() / height.mean() * height
        assert bins.std[j] == pytest.approx(np.sqrt((about**2).mean()))


def test_interval_holds_the_mean_ground():
    held = 0
    for seed in range(1000, 1040):
        slip, mu, metres, run = drive(seed, 0.12)
        low, high = fit(slip, mu, metres, run, bootstrap=200).interval_["a"]
        held += low <= A <= high
    assert held >= 34


def test_an_error_that_all_runs_share_widens_the_interval():
    data = drive(1005, 0.1)
    plain, wide = (fit(*data, bootstrap=2000, common_sd=sd).interval_["a"] for sd in (0.0, 0.05))
    expected = np.hypot(plain[1] - plain[0], 2 * 1.96 * 0.05 * A)
    assert wide[1] - wide[0] == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("sd", [0.01, 0.03])
def test_noise_of_slip_is_taken_out(sd):
    """It enters by the curve's bend alone, always upwards."""
    slip, mu, metres, run = drive(1006, 0.0, slip_noise=sd)
    plain = fit(slip, mu, metres, run).parameters_["a"]
    bins = bin_by_pull(slip, mu, mu, metres, run, BY_PULL, np.full(slip.size, sd))
    freed = AdhesionCurve(bins=BY_PULL, bootstrap=0).fit_bins(bins).parameters_["a"]
    assert plain > A
    assert abs(freed - A) < max(0.3 * (plain - A), 1e-3)
    without = bin_by_pull(slip, mu, mu, metres, run, BY_PULL, np.full(slip.size, np.nan))
    np.testing.assert_array_equal(without.slip, bin_by_pull(slip, mu, mu, metres, run, BY_PULL).slip)


def test_nothing_to_sort_is_no_bin():
    none = np.zeros(0)
    assert bin_by_pull(none, none, none, none).used.size == 0
    slip, mu, metres, run = drive(1007, 0.1)
    assert bin_by_pull(slip, -mu, -mu, metres, run).used.size == 0
    assert bin_by_pull(slip, mu, np.full(mu.size, np.nan), metres, run).left_out == slip.size
    with pytest.raises(ValueError, match="pairs"):
        bin_by_pull(slip, mu, mu[1:], metres, run)
    with pytest.raises(InputError, match="hold 4 m of way or more, too few to fit a"):
        fit(slip, -mu, metres, run)


def test_pairs_without_way_are_left_out_and_counted():
    """A machine that spins on the spot tells nothing of the way, however often it is sampled."""
    slip, mu, metres, run = drive(1009, 0.1, runs=4, spots=600)
    spot = np.full(100, 0.2)
    plain = bin_by_pull(slip, mu, mu, metres, run)
    spun = bin_by_pull(
        *(
            np.r_[x, y]
            for x, y in ((slip, 0.5 + spot), (mu, spot), (mu, spot), (metres, 0 * spot), (run, 0 * spot))
        )
    )
    assert spun.left_out == plain.left_out + 100
    np.testing.assert_array_equal(spun.count, plain.count)
    np.testing.assert_array_equal(spun.mean, plain.mean)


def test_too_little_way_for_any_bin_leaves_all_out():
    slip, mu, metres, run = drive(1010, 0.1, runs=4, spots=600)
    bins = bin_by_pull(slip, mu, mu, 1e-3 * metres, run)
    assert bins.used.size == 0
    assert bins.left_out == slip.size


@pytest.mark.parametrize("bad", [{"by": "colour"}, {"metres": 0.0}, {"runs": 0}])
def test_settings_that_sort_nothing(bad):
    with pytest.raises(ValueError, match=r"sorted by|no bins"):
        BinSettings(**bad)


def test_a_library_keeps_what_sorted_the_bins(tmp_path):
    from terragrip.soil.library import Soil

    path = tmp_path / "soils.json"
    curve = fit(*drive(1008, 0.1))
    SoilLibrary({"field": Soil.from_curve("field", curve)}).write(path)
    again = SoilLibrary.load(path)["field"]
    assert again.fit["settings"]["by"] == "pull"
    assert again.bins[0]["metres"] >= again.fit["settings"]["metres"]
