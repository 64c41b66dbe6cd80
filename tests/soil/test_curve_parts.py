"""Fits of curves, bins by pull and the choice of a form, step by step, against NumPy, SciPy and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES, PROTOTYPE
from terragrip.soil.bins import BinSettings, bin_pairs, slip_of
from terragrip.soil.choice import FORMS, FormScore, _bin_folds, _run_folds, _score, _split, compare_forms
from terragrip.soil.fit import AdhesionCurve, _student
from terragrip.soil.identifiability import at_bound
from terragrip.soil.known import known_soils
from terragrip.soil.least_squares import _jacobian, solve, starts
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.pull_bins import _joined, _start, _unbiased

EFFECTIVE = CURVES["effective"]
SLIP = np.linspace(0.05, 0.55, 20)
ONES = np.ones((1, 20))


def test_a_parameter_that_nothing_moves_stays_where_it_began() -> None:
    """Of A (1 - e^(-k s)) with A held at 0, k moves nothing: no singular step, no other k."""
    x, cost = solve(EFFECTIVE, ["k"], {"A": 0.0, "d": 0.0}, SLIP[None], 0 * ONES, ONES, np.array([[12.0]]))
    assert x.tolist() == [[12.0]]
    assert cost.tolist() == [0.0]


def test_bins_without_weight_count_nothing_whatever_they_hold() -> None:
    truth = {"A": 0.6, "k": 9.0, "d": 0.2}
    mean = EFFECTIVE.value(SLIP, truth)
    weight = np.where(np.arange(20) % 3 == 0, 0.0, 2.0)
    spoilt, where = np.where(weight > 0, mean, np.nan), np.where(weight > 0, SLIP, np.nan)
    x, cost = solve(
        EFFECTIVE, list(truth), {}, where[None], spoilt[None], weight[None], np.array([[0.5, 12.0, 0.1]])
    )
    np.testing.assert_allclose(x[0], list(truth.values()), rtol=1e-5)
    assert cost[0] < 1e-12
    off = mean + 0.1
    x, cost = solve(
        EFFECTIVE,
        ["intercept"],
        {**truth, "intercept": 9.0},
        SLIP[None],
        off[None],
        weight[None],
        np.zeros((1, 1)),
    )
    assert x[0, 0] == pytest.approx(0.1)
    x, cost = solve(
        EFFECTIVE,
        ["A"],
        {"k": 9.0, "d": 0.2, "intercept": 0.1},
        SLIP[None],
        off[None],
        weight[None],
        np.array([[0.5]]),
    )
    assert x[0, 0] == pytest.approx(0.6)
    x, cost = solve(
        EFFECTIVE, ["intercept"], truth, SLIP[None], mean[None] + 5.0, weight[None], np.zeros((1, 1))
    )
    assert x[0, 0] == 2.0  # the bound of an intercept
    assert cost[0] == pytest.approx(2.0 * 9.0 * np.count_nonzero(weight))


def test_differences_are_forward_and_backward_at_an_upper_bound() -> None:
    calls: list[np.ndarray] = []

    def square(x: np.ndarray) -> np.ndarray:
        calls.append(x.copy())
        return x**2

    x = np.array([[1.0, 2.0], [3.0, 1e-9]])
    jacobian = _jacobian(square, x, x**2, np.array([3.0, 5.0]))
    np.testing.assert_allclose(jacobian[:, :, 0], [[2.0, 0.0], [6.0, 0.0]], atol=1e-5)
    np.testing.assert_allclose(jacobian[:, :, 1], [[0.0, 4.0], [0.0, 0.0]], atol=1e-5)
    assert calls[0][1, 0] < 3.0  # at the bound
    assert calls[0][0, 0] == pytest.approx(1.0 + 1e-6, abs=1e-12)
    assert calls[1][1, 1] == pytest.approx(1e-8, rel=0.2)  # a hundredth of 1 at least


def test_starts_scale_heights_to_the_data_and_try_other_rates() -> None:
    mean = np.array([0.1, np.nan, -0.5])
    begin = starts(EFFECTIVE, ["A", "k", "d", "intercept"], mean)
    assert begin.shape == (8, 4)
    start = {p.name: p.start for p in EFFECTIVE.parameters}
    np.testing.assert_allclose(begin[:, 0], 0.55)
    np.testing.assert_allclose(begin[::2, 1], start["k"] * np.array([1.0, 0.5, 0.2, 3.0]))
    np.testing.assert_allclose(begin[:, 2], start["d"])
    np.testing.assert_allclose(begin[:, 3], [0.0, -0.05] * 4)
    np.testing.assert_allclose(starts(CURVES["exponential"], ["a"], mean)[:, 0], 0.5 / 0.476)
    np.testing.assert_allclose(starts(EFFECTIVE, ["A"], np.zeros(3))[:, 0], 0.11)


@pytest.mark.parametrize(
    ("value", "bound"), [(0.0, True), (0.00099, True), (0.0011, False), (0.9989, False), (0.99901, True)]
)
def test_a_thousandth_of_its_range_from_an_end_a_parameter_is_at_it(value: float, bound: bool) -> None:
    first = EFFECTIVE.parameters[0]
    at = first.lower + value * (first.upper - first.lower)
    held = {p.name: p.start for p in EFFECTIVE.parameters} | {first.name: at}
    assert at_bound(EFFECTIVE, held, [first.name]) == ([first.name] if bound else [])
    assert at_bound(EFFECTIVE, held, []) == []


def test_weights_by_count_are_those_of_the_standard_error() -> None:
    slip, mu, run = pairs(7, a=0.85)
    curve = AdhesionCurve(bootstrap=0, weights="count").fit(slip, mu, run)
    bins = curve.bins_
    weight = bins.count / bins.std**2
    height = CURVES["exponential"].value(bins.slip, {**PROTOTYPE, "a": 1.0})
    used = bins.used
    expected = np.sum((weight * bins.mean * height)[used]) / np.sum((weight * height**2)[used])
    assert curve.parameters_["a"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("runs", [3, 12])
def test_the_bootstrap_is_of_runs_and_widened_for_few(runs: int) -> None:
    """Of n runs alike in way the mean's error is s/√n; the draws have it less (n-1)/n, and t for 1.96."""
    level = np.linspace(0.8, 0.9, runs)
    slip = np.tile(np.repeat(np.arange(0.055, 0.60, 0.01), 10), runs)
    run = np.repeat(np.arange(runs), slip.size // runs)
    mu = CURVES["exponential"].value(slip, {"a": 1.0}) * level[run]
    curve = AdhesionCurve(bootstrap=1000).fit(slip, mu, run)
    assert curve.samples_ is not None
    expected = np.std(level, ddof=1) / np.sqrt(runs) * student.ppf(0.975, runs - 1) / 1.959964
    assert np.std(curve.samples_[:, 0]) == pytest.approx(expected, rel=0.1)
    assert curve.interval_["a"] == pytest.approx(np.percentile(curve.samples_[:, 0], [2.5, 97.5]))
    assert _student(runs - 1) == pytest.approx(student.ppf(0.975, runs - 1))


def test_a_fit_that_was_read_has_the_band_of_its_one_parameter_or_the_written_one() -> None:
    fitted = AdhesionCurve().fit(*pairs(8, a=0.85))
    wide = AdhesionCurve("effective", bootstrap=50).fit(*pairs(8, "effective", A=0.5, k=9.0, d=0.1))
    library = SoilLibrary({"one": Soil.from_curve("one", fitted), "many": Soil.from_curve("many", wide)})
    read = known_soils(library, ["one", "many", "none"])
    one, many = read.soils["one"].curve, read.soils["many"].curve
    assert read.not_fitted == {"none": "the library does not contain it"}
    at = np.array([0.1, 0.25])
    for curve, its in ((many, wide), (one, fitted)):
        np.testing.assert_allclose(curve.band(at), its.band(at), atol=1e-5)
    earlier = {key: value for key, value in library["one"].fit.items() if key != "band"}
    bare = known_soils(SoilLibrary({"one": replace(library["one"], fit=earlier)}), ["one"]).soils["one"].curve
    for edge, a in zip(bare.band(SLIP), fitted.interval_["a"], strict=True):
        np.testing.assert_allclose(edge, CURVES["exponential"].value(SLIP, {"a": a}))
    for a, b in ((one, fitted), (many, wide)):
        assert (a.free_, a.parameters_, a.interval_) == (b.free_, b.parameters_, b.interval_)
        assert (a.r2_, a.nrmse_) == (b.r2_, b.nrmse_)
        for name in ("slip", "mean", "std", "count"):
            np.testing.assert_array_equal(getattr(a.bins_, name), getattr(b.bins_, name)[b.bins_.used])
        slip, mean, enough = a.bins_.drawn(np.ones((1, 1)))
        np.testing.assert_allclose((slip[0], mean[0]), (a.bins_.slip, a.bins_.mean))
        assert enough.all()
        assert a.identifiability_.condition == b.identifiability_.condition


def test_noise_of_slip_is_taken_out_of_a_height_on_average() -> None:
    draws = np.random.default_rng(1).standard_normal(200_000)
    for sd in (0.02, 0.05):
        seen = 0.3 + sd * draws
        height = CURVES["exponential"].value(0.3, {"a": 1.0})
        assert _unbiased(seen, np.full(draws.size, sd)).mean() == pytest.approx(float(height), abs=5e-4)
    capped, most = _unbiased(np.array([0.3, 0.3]), np.array([0.1, 5.0]))
    assert capped == most
    at = np.array([-0.2, 0.0, 0.3])
    np.testing.assert_allclose(
        _unbiased(at, np.array([0.1, 0.1, np.nan])), CURVES["exponential"].value(at, {"a": 1.0}), atol=1e-12
    )


def test_cells_are_joined_upwards_until_they_hold_enough_of_enough_runs() -> None:
    way = np.array([[3.0, 0.0, 2.0, 5.0, 0.0, 1.0], [0.0, 1.0, 3.0, 0.0, 4.0, 0.0]])
    assert _joined(way, 4.0, 2) == [[0, 1], [2], [3, 4, 5]]
    assert _joined(way, 4.0, 1) == [[0, 1], [2], [3], [4, 5]]
    assert _joined(way, 4.1, 1) == [[0, 1, 2], [3], [4, 5]]
    assert _joined(way, 99.0, 1) == []
    assert _joined(np.zeros((1, 3)), 1.0, 1) == []


def test_a_first_scale_is_that_of_all_pairs_above_the_lowest_slip() -> None:
    mu, height, dx = np.array([9.0, 0.2, 0.3]), np.array([0.1, 0.2, 0.4]), np.array([1.0, 2.0, 1.0])
    assert _start(mu, height, dx, 0.1) == pytest.approx(0.7 / 0.8)
    assert _start(mu, height, dx, 0.5) == 1.0


def test_slip_of_a_height_is_the_inverse_of_the_prototype() -> None:
    slip = np.array([-0.6, -0.2, 0.0, 0.05, 0.4, 0.59])
    height = CURVES["exponential"].value(slip, {"a": 1.0})
    np.testing.assert_allclose(slip_of(height), slip, atol=2e-4)
    assert slip_of(9.0) == 0.6


def two_runs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    slip = np.tile(np.repeat(0.055 + 0.05 * np.arange(10), 20), 4)
    return (
        slip,
        CURVES["effective"].value(slip, {"A": 0.5, "k": 12.0, "d": 0.0}),
        np.repeat([0, 1, 2, 3], 200),
    )


def test_folds_leave_every_run_out_once() -> None:
    slip, mu, run = two_runs()
    bins = bin_pairs(slip, mu + 0.1 * run, run)
    folds = _run_folds(bins, 3)
    assert len(folds) == 3
    left = [f[4][f[5] > 0].mean() - mu.mean() for f in folds]
    assert left == pytest.approx([0.15, 0.1, 0.2])  # runs 0 and 3, 1, 2
    kept = [f[1][f[2] > 0].mean() - mu.mean() for f in folds]
    assert kept == pytest.approx([0.15, 0.5 / 3, 0.4 / 3])
    assert len(_run_folds(bins, 9)) == 4
    assert _run_folds(bin_pairs(slip, mu), 3) == []


def test_bins_take_turns_where_there_is_one_run() -> None:
    slip, mu, _ = two_runs()
    bins = bin_pairs(slip, mu)
    folds = _bin_folds(bins, 5)
    tests = np.array([f[5] for f in folds])
    trains = np.array([f[2] for f in folds])
    np.testing.assert_array_equal(tests.sum(axis=0), bins.used)
    np.testing.assert_array_equal(trains + tests, np.tile(bins.used, (5, 1)))
    assert np.flatnonzero(tests[1]).tolist() == np.flatnonzero(bins.used)[1::5].tolist()


@pytest.mark.parametrize(("by", "train", "test"), [("slip", 10, 5), ("pull", 2.0, 0.4)])
def test_what_a_fold_needs_of_a_bin(by: str, train: float, test: float) -> None:
    """By slip all samples to learn and half of them to judge; by pull half of the metres and a tenth."""
    amounts = np.array([[train, train * 0.99, 20.0, 20.0], [20.0, 20.0, test, test * 0.99]])
    bins = replace(
        bin_pairs(*two_runs()), settings=BinSettings(by=by, minimum=10, metres=4.0), slip=np.full(4, 0.2), mean=np.full(4, 0.3),
        std=np.zeros(4), count=np.full(4, 9), cluster_count=amounts, cluster_sum=0.3 * amounts, cluster_slip=0.2 * amounts,
    )  # fmt: skip
    _, _, trained, _, _, judged = _split(bins, np.array([0]), np.array([1]))
    assert trained.tolist() == [1.0, 0.0, 1.0, 1.0]
    assert judged.tolist() == [1.0, 1.0, 1.0, 0.0]


def test_a_score_is_the_mean_error_of_the_folds_with_its_standard_error() -> None:
    slip = np.linspace(0.05, 0.55, 12)
    mean = CURVES["exponential"].value(slip, {"a": 0.8})
    one = np.ones(12)
    half = np.r_[np.ones(6), np.zeros(6)]
    splits = [
        (slip, mean, one, slip, mean + off, weight)
        for off, weight in ((0.03, one), (-0.01, half), (0.02, one))
    ]
    score = _score("exponential", splits)
    errors = [0.03, 0.01, 0.02]
    assert score.error == pytest.approx(np.mean(errors), abs=1e-6)
    assert score.standard_error == pytest.approx(np.std(errors) / np.sqrt(3), abs=1e-6)
    assert score.parameters == 1
    none = (slip, mean, 0 * one, slip, mean, one), (slip, mean, one, slip, mean, 0 * one)
    assert _score("exponential", [*splits, *none]) == score
    with pytest.raises(InputError, match="too unlike"):
        _score("exponential", none)


@pytest.mark.parametrize(
    ("mine", "spread", "follows"),
    [(0.0124, 0.0, True), (0.0126, 0.0, False), (0.0199, 0.01, True), (0.0201, 0.01, False)],
)
def test_a_form_cannot_follow_beyond_a_quarter_and_the_spread(
    monkeypatch: pytest.MonkeyPatch, mine: float, spread: float, follows: bool
) -> None:
    scores = {
        "exponential": FormScore("exponential", mine, 0.6 * spread, 1),
        "pacejka": FormScore("pacejka", 0.01, 0.8 * spread, 3),
    }
    monkeypatch.setattr("terragrip.soil.choice._score", lambda form, _: scores[form])
    verdict = compare_forms(bin_pairs(*two_runs()), candidates=list(scores))
    assert verdict.follows == follows
    assert verdict.proposal == (None if follows else "pacejka")
    assert [score.form for score in verdict.ranking] == ["pacejka", "exponential"]


@pytest.mark.parametrize(("levels", "forms"), [(3, 0), (4, 2), (5, 3), (6, 5)])
def test_forms_take_part_that_leave_two_bins_free(levels: int, forms: int) -> None:
    """They have 1, 2, 3, 4 and 4 parameters."""
    slip, mu, run = two_runs()
    few = slip < 0.04 + 0.05 * levels
    bins = bin_pairs(slip[few], mu[few], run[few])
    if not forms:
        with pytest.raises(InputError, match="3 slip bins are too few"):
            compare_forms(bins)
        return
    verdict = compare_forms(bins)
    assert len(verdict.ranking) == forms
    assert ("cannot distinguish forms" in verdict.sentence) is (len(verdict.ranking) < len(FORMS))
