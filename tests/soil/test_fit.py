"""Fits against closed forms, scipy and repeated sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES, PROTOTYPE
from terragrip.soil.bins import BinSettings
from terragrip.soil.fit import AdhesionCurve


def test_default_fit_is_the_closed_form():
    slip, mu, run = pairs(1, a=0.85)
    curve = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
    used = curve.bins_.used
    g = CURVES["exponential"].value(curve.bins_.slip[used], {**PROTOTYPE, "a": 1.0})
    mean = curve.bins_.mean[used]
    assert curve.parameters_["a"] == pytest.approx(np.sum(mean * g) / np.sum(g**2), rel=1e-8)
    off = mean - curve.parameters_["a"] * g
    assert curve.r2_ == pytest.approx(1 - np.sum(off**2) / np.sum((mean - mean.mean()) ** 2))
    assert curve.nrmse_ == pytest.approx(np.sqrt(np.mean(off**2)) / (mean.max() - mean.min()))


@pytest.mark.parametrize(
    "name", ["effective", "burckhardt", "pacejka", "schreiber_kutzbach", "brixius", "wismer_luth"]
)
def test_fits_reach_scipys_minimum(name):
    slip, mu, run = pairs(2, "effective", A=0.6, k=12.0, d=0.3)
    curve = AdhesionCurve(name, bootstrap=0).fit(slip, mu, run)
    model, used = CURVES[name], curve.bins_.used

    def off(x):
        return (
            model.value(curve.bins_.slip[used], dict(zip(model.names, x, strict=True)))
            - curve.bins_.mean[used]
        )

    lower, upper = [p.lower for p in model.parameters], [p.upper for p in model.parameters]
    peer = min(
        (
            least_squares(
                off, np.clip([p.start * f for p in model.parameters], lower, upper), bounds=(lower, upper)
            )
            for f in (0.5, 1, 2)
        ),
        key=lambda r: r.cost,
    )
    ours = np.sum(off([curve.parameters_[n] for n in model.names]) ** 2)
    assert ours <= 2 * peer.cost * (1 + 1e-4) + 1e-12


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("name", "truth", "asked"),
    [("exponential", {"a": 0.85}, "a"), ("effective", {"A": 0.5, "k": 11.0, "d": 0.1}, "A")],
)
def test_intervals_hold_in_85_of_100_repetitions(name, truth, asked):
    held = 0
    for seed in range(5000, 5100):
        slip, mu, run = pairs(seed, name, runs=12, samples=250, **truth)
        low, high = AdhesionCurve(name, bootstrap=300).fit(slip, mu, run).interval_[asked]
        held += low <= truth[asked] <= high
    assert held >= 85


def test_interval_comes_from_runs_not_samples():
    slip, mu, run = pairs(3, a=0.85, run_spread=0.15, scatter=0.01)
    by_run = AdhesionCurve().fit(slip, mu, run).interval_["a"]
    by_sample = AdhesionCurve().fit(slip, mu, np.arange(slip.size) % 400).interval_["a"]
    assert by_run[1] - by_run[0] > 4 * (by_sample[1] - by_sample[0])


def test_one_run_gives_no_interval_and_says_so():
    slip, mu, _ = pairs(4, a=0.85)
    curve = AdhesionCurve().fit(slip, mu)
    assert curve.interval_ == {}
    assert curve.notes_[0].startswith("All samples come from 1 run or stretch of a run: no interval")
    two = AdhesionCurve().fit(slip, mu, np.arange(slip.size) % 2)
    assert two.notes_[0].startswith("All samples come from 2 runs or stretches of a run: no interval")
    with pytest.raises(ValueError, match="without a bootstrap"):
        curve.band([0.1])


def test_all_four_parameters_warn_and_give_the_effective_ones():
    slip, mu, run = pairs(5, a=0.85)
    curve = AdhesionCurve(fixed="free").fit(slip, mu, run)
    badge = curve.identifiability_
    assert not badge.identifiable
    assert badge.condition > 1e5
    assert set(curve.interval_) == {"A", "k", "d"}
    low, high = curve.interval_["A"]
    assert low <= 0.85 * 0.48 <= high
    assert badge.twin is not None
    grid = np.linspace(0.05, 0.6, 100)
    twin = CURVES["exponential"].value(grid, badge.twin)
    assert np.abs(twin - curve.predict(grid)).max() < 2e-4
    assert "same curve" in curve.notes_[0]


def test_a_fit_keeps_to_its_bounds_and_what_stops_there_is_not_identified():
    slip, mu, run = pairs(5, a=0.85)
    free = AdhesionCurve().fit(slip, mu, run)
    assert free.identifiability_.identifiable
    assert free.at_bound_ == []
    wide = AdhesionCurve(bounds={"a": (0.1, 2.0)}).fit(slip, mu, run)
    assert wide.parameters_["a"] == pytest.approx(free.parameters_["a"], rel=1e-9)
    assert wide.interval_["a"] == pytest.approx(free.interval_["a"], rel=1e-9)
    held = AdhesionCurve(bounds={"a": (1.0, 2.0)}).fit(slip, mu, run)
    assert held.parameters_["a"] == pytest.approx(1.0)
    assert held.at_bound_ == ["a"]
    assert not held.identifiability_.identifiable
    assert "a stopped at an end of its range" in held.notes_[0]
    assert held.interval_["a"][0] >= 1.0
    for wrong in ({"a": (2.0, 1.0)}, {"a": (-1e9, 1.0)}, {"k": (0.0, 1.0)}):
        with pytest.raises(InputError, match="bounds of"):
            AdhesionCurve(bounds=wrong).fit(slip, mu, run)


def test_a_curve_with_every_parameter_given_is_evaluated():
    slip, mu, run = pairs(5, a=0.85)
    given = {**PROTOTYPE, "a": 0.85}
    curve = AdhesionCurve(fixed=given).fit(slip, mu, run)
    used = curve.bins_.used
    off = curve.bins_.mean[used] - CURVES["exponential"].value(curve.bins_.slip[used], given)
    spread = curve.bins_.mean[used] - curve.bins_.mean[used].mean()
    assert curve.r2_ == pytest.approx(1 - off @ off / (spread @ spread))
    assert curve.parameters_ == given
    assert curve.interval_ == {}
    assert not curve.identifiability_.identifiable
    assert "Every parameter is given" in curve.notes_[0]


def test_net_traction_needs_its_intercept():
    slip, mu, run = pairs(6, a=0.85)
    with_rho = AdhesionCurve(intercept=True).fit(slip, mu - 0.12, run)
    assert with_rho.parameters_["intercept"] == pytest.approx(-0.12, abs=0.01)
    assert with_rho.r2_ > AdhesionCurve().fit(slip, mu - 0.12, run).r2_


def test_weights_follow_the_count():
    slip, mu, run = pairs(7, a=0.85)
    keep = (slip < 0.3) | (np.arange(slip.size) % 40 == 0)
    plain = AdhesionCurve(bootstrap=0).fit(slip[keep], mu[keep], run[keep])
    weighted = AdhesionCurve(bootstrap=0, weights="count").fit(slip[keep], mu[keep], run[keep])
    assert plain.parameters_["a"] != weighted.parameters_["a"]
    assert weighted.parameters_["a"] == pytest.approx(0.85, abs=0.06)


def test_band_holds_the_curve():
    slip, mu, run = pairs(8, a=0.85)
    curve = AdhesionCurve().fit(slip, mu, run)
    low, high = curve.band(np.linspace(0.05, 0.6, 30))
    assert np.all(low <= curve.predict(np.linspace(0.05, 0.6, 30)))
    assert np.all(high >= curve.predict(np.linspace(0.05, 0.6, 30)))


@pytest.mark.parametrize(
    "slip",
    [np.full(500, 0.2), np.linspace(-0.5, -0.1, 500), np.full(500, np.nan), np.zeros(0)],
    ids=["one bin", "negative slip only", "NaN", "nothing"],
)
def test_nothing_comes_from_nothing(slip):
    with pytest.raises(InputError, match="too few to fit a"):
        AdhesionCurve().fit(slip, np.full(slip.size, 0.3))


def test_calls_that_cannot_be():
    for bad in ({"model": "cubic"}, {"weights": "much"}, {"fixed": "some"}, {"fixed": {"zz": 1.0}}):
        with pytest.raises(InputError):
            AdhesionCurve(**bad).fit(np.linspace(0, 0.6, 2000), np.linspace(0, 0.6, 2000))


def test_a_curve_that_is_not_fitted_says_so():
    curve = AdhesionCurve()
    for call in (lambda: curve.predict(0.1), lambda: curve.band(0.1), curve.peak, curve.to_dict, curve.plot):
        with pytest.raises(InputError, match="the curve is not fitted; call fit first"):
            call()


def test_an_intercept_is_drawn_with_its_own_curve():
    """Rise and intercept err against each other: any rise with any intercept made the band of measured sand five times as wide."""
    slip, mu, run = pairs(8, "effective", A=0.3, k=8.0, d=0.0)
    curve = AdhesionCurve(intercept=True, bins=BinSettings(0.01, 0.2, 0.6)).fit(slip, mu - 0.05, run)
    low, high = curve.band([0.25, 0.5])
    assert np.ptp(curve.interval_["intercept"]) > np.max(high - low)


def test_a_band_has_the_shape_of_its_slips():
    curve = AdhesionCurve(bootstrap=50).fit(*pairs(8, a=0.85))
    low, high = curve.band([[0.1, 0.2], [0.3, 0.4]])
    assert low.shape == high.shape == (2, 2)
    assert curve.band(0.2) == (low[0, 1], high[0, 1])


def test_a_run_without_a_name_is_one():
    slip, mu, run = pairs(8, a=0.85)
    named = [None if one == 0 else f"run {one}" for one in run]
    assert AdhesionCurve(bootstrap=50).fit(slip, mu, named).bins_.clusters == np.unique(run).size


def test_grass_has_its_own_range():
    slip, mu, run = pairs(9, a=0.4)
    curve = AdhesionCurve(bins=BinSettings(upper=0.40)).fit(slip, mu, run)
    assert np.nanmax(curve.bins_.slip) < 0.40
    assert curve.to_dict()["settings"]["upper"] == 0.40


def test_a_band_holds_the_middle_share_of_the_bootstrap_curves():
    curve = AdhesionCurve().fit(*pairs(8, a=0.85))
    slip = np.linspace(0.05, 0.6, 5)
    curves = [CURVES["exponential"].value(slip, {**curve.parameters_, "a": a}) for a in curve.samples_[:, 0]]
    assert curve.free_ == ("a",)
    for level in (0.5, 0.95):
        low, high = np.quantile(curves, [0.5 - level / 2, 0.5 + level / 2], axis=0)
        assert np.all(curve.band(slip, level)[0] <= low)
        assert np.all(curve.band(slip, level)[1] >= high)


RISES = {  # of the literature, about as high at 10 % of slip
    "hyperbola": lambda s: 1.2 * 12 * s / (1 + 12 * s),
    "contact patch (Janosi)": lambda s: 0.7 * (1 + np.expm1(-40 * s) / np.maximum(40 * s, 1e-9)),
    "wet asphalt (Burckhardt)": lambda s: -0.857 * np.expm1(-33.8 * s) - 0.347 * s,
    "wheel numeric 15 (Wismer and Luth)": lambda s: -0.75 * np.expm1(-4.5 * s),
}


@pytest.mark.parametrize("rise", RISES.values(), ids=RISES)
def test_beyond_its_data_a_band_holds_what_soils_of_other_forms_do(rise):
    rng = np.random.default_rng(8160001)
    slip, run = rng.uniform(0.005, 0.1, 4000), np.repeat(np.arange(10), 400)
    mu = rise(slip) * (1 + 0.02 * rng.standard_normal(10))[run] + 0.05 * rng.standard_normal(4000)
    curve = AdhesionCurve(bins=BinSettings(0.005, 0.005, 0.1, 20)).fit(slip, mu, run)
    at = np.array([0.1, 0.2, 0.3])
    low, high = curve.band(at)
    assert np.all((low <= rise(at)) & (rise(at) <= high))
    own = np.ptp(curve.interval_["a"]) * CURVES["exponential"].value(at, {"a": 1.0})
    assert np.any(np.abs(rise(at) - curve.predict(at)) > own)  # the form's own interval holds it not


def test_data_up_to_high_slips_leave_little_to_other_forms():
    slip, mu, run = pairs(8, a=0.85)
    low, high = AdhesionCurve().fit(slip, mu, run).band(np.array([0.1, 0.3, 0.55]))
    assert np.all(high - low < 0.15 * high)
