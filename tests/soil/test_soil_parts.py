"""What data tell of a soil, what to drive next, libraries and digitised points, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings, bin_pairs
from terragrip.soil.digitised import _curve, _numbers, _rows, _title
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.identifiability import _sensitivity, _twin
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.missing import Gap, in_words, missing_slips, what_to_drive
from terragrip.soil.slip_noise import _beyond, shifted

EFFECTIVE = CURVES["effective"]
SLIP = np.linspace(0.05, 0.55, 20)
ONES = np.ones((1, 20))


def test_sensitivity_is_the_derivative_by_the_logarithm() -> None:
    truth = {"A": 0.6, "k": 10.0, "d": -0.2}
    np.testing.assert_allclose(
        _sensitivity(EFFECTIVE, truth, "A", SLIP), 0.6 * (1 - np.exp(-10 * SLIP)), rtol=1e-6
    )
    np.testing.assert_allclose(
        _sensitivity(EFFECTIVE, truth, "d", SLIP), -0.2 * SLIP, rtol=1e-6
    )  # by its size
    np.testing.assert_allclose(
        _sensitivity(EFFECTIVE, {**truth, "d": 1e-4}, "d", SLIP), -0.01 * SLIP, rtol=1e-6
    )


def test_a_twin_is_as_far_along_the_flattest_way_as_the_curve_allows() -> None:
    """Along ln A alone the curve moves by A (e^x - 1) (1 - e^(-k s)), so far that it is 1e-4 at most; both ways, within bounds."""
    truth = {"A": 0.6, "k": 10.0, "d": 0.2}
    tiny = np.array([0.001, 0.002])  # where the curve hardly answers
    twin, difference = _twin(EFFECTIVE, truth, ["A"], np.array([1.0]), tiny)
    assert 0.5e-4 < difference <= 1e-4
    assert difference == pytest.approx(abs(twin["A"] - 0.6) * (1 - np.exp(-0.02)))
    assert (twin["k"], twin["d"]) == (10.0, 0.2)
    bounds = {p.name: (p.lower, p.upper) for p in EFFECTIVE.parameters}
    for name, value in twin.items():
        assert bounds[name][0] <= value <= bounds[name][1]
    assert _twin(EFFECTIVE, truth, ["A"], np.array([1.0]), SLIP) == (truth, 0.0)


@pytest.mark.parametrize(
    ("corrected", "matters"), [(0.861, False), (0.872, True), (0.829, True), (0.839, False)]
)
def test_noise_matters_beyond_the_interval_or_a_fiftieth(corrected: float, matters: bool) -> None:
    curve = AdhesionCurve(bootstrap=0).fit(*pairs(1, a=0.85))
    curve.interval_ = {"a": (0.82, 0.9)}
    assert _beyond(curve, "a", 0.85, corrected) is (abs(corrected - 0.85) > 0.017)
    curve.interval_ = {"a": (0.835, 0.865)}
    assert _beyond(curve, "a", 0.85, corrected) is matters
    curve.interval_ = {}
    slip, sd = np.array([0.049, 0.05, 0.3, 0.599, 0.6, 0.2]), np.array([9.0, 0.01, 0.02, 0.03, 9.0, np.nan])
    noise = shifted(curve, {"a": corrected}, {"a": 0.85}, slip, sd, "do this")
    assert noise.slip_std == pytest.approx(0.02)
    assert noise.sentence.startswith(f"Slip noise of 0.020 (SD) moves a 0.85 -> {corrected:.4g}; it ")
    assert ("it matters: do this" in noise.sentence) is (abs(corrected - 0.85) > 0.017)
    assert shifted(curve, {"a": 0.85}, {"a": 0.85}, slip - 1.0, sd, "").slip_std == pytest.approx(0.03)


def test_gaps_are_bins_without_enough_joined_and_the_pulls_that_fill_them() -> None:
    settings = BinSettings(width=0.1, lower=0.1, upper=0.6, minimum=10)
    slip = np.repeat([0.15, 0.35, 0.45], [10, 9, 10])
    bins = bin_pairs(slip, slip, None, settings)
    assert missing_slips(bins) == [pytest.approx((0.2, 0.4)), pytest.approx((0.5, 0.6))]
    soil = Soil("s", "effective", {"A": 0.5, "k": 8.0, "d": 0.3}, resistance=(0.1, 0.0))
    first, last = what_to_drive(soil, bins, 100.0, 0.02, 4, 1.5, gravity=10.0)
    ends = (EFFECTIVE.value(np.array([0.2, 0.4]), soil.parameters) - 0.1) * 1000.0
    assert first.pull == pytest.approx((min(ends), max(ends)))
    assert first.seconds == pytest.approx(2 * 10 * 0.02 / 4)
    assert (first.speed, first.reachable) == (1.5, True)
    top = np.log(8.0 * 0.5 / 0.3) / 8.0  # where the slope is 0: .32
    assert 0.2 < top < 0.5
    assert not last.reachable
    bare = what_to_drive(replace(soil, resistance=None), bins, 100.0, 0.02, 4, gravity=10.0)[0]
    assert bare.pull == pytest.approx((first.pull[0] + 100.0, first.pull[1] + 100.0))


def test_gaps_in_words() -> None:
    gap = Gap((0.2, 0.4), (-20.0, 310.4), 0.3, 1.25, True)
    assert in_words("s", [gap]) == [
        "s: no data between 20% and 40% slip. Pull 0 to 310 N at about 1.2 m/s wheel speed, at least 1 s in all, in two runs or more."
    ]
    assert "at least 7 s in all" in in_words("s", [replace(gap, seconds=7.2, speed=None)])[0]
    assert "raise the pull past 310 N at about" in in_words("s", [replace(gap, reachable=False)])[0]
    for most in (0.0, -3.0):
        assert "drive without a tool, or be pushed" in in_words("s", [replace(gap, pull=(-20.0, most))])[0]
    assert in_words("s", []) == ["s: every slip bin has enough samples."]


def test_libraries_compare_over_five_to_sixty_per_cent_of_slip() -> None:
    def soil(a: float, low: float, high: float) -> Soil:
        return Soil("s", "exponential", {"a": a}, {"a": (low, high)})

    mine = SoilLibrary({"s": soil(0.8, 0.7, 0.85), "t": soil(1.0, 0.9, 1.1)})
    (row,) = mine.compare(SoilLibrary({"s": soil(0.9, 0.85, 1.0)}))
    off = 0.1 * CURVES["exponential"].value(np.linspace(0.05, 0.6, 111), {"a": 1.0})
    assert row == {
        "soil": "s",
        "to": 0.6,
        "largest": pytest.approx(off.max()),
        "mean": pytest.approx(off.mean()),
        "intervals_meet": {"a": True},
    }
    short = replace(soil(0.9, 0.85, 1.0), bins=({"slip": 0.04, "mean": 0.2}, {"slip": 0.2, "mean": 0.4}))
    assert mine.compare(SoilLibrary({"s": short}))[0]["to"] == 0.2
    assert not mine.compare(SoilLibrary({"s": soil(0.9, 0.86, 1.0)}))[0]["intervals_meet"]["a"]
    assert not mine.compare(SoilLibrary({"s": soil(0.6, 0.5, 0.69)}))[0]["intervals_meet"]["a"]
    other = Soil("s", "effective", {"A": 0.4, "k": 9.0, "d": 0.0}, {"A": (0.3, 0.5)})
    assert mine.compare(SoilLibrary({"s": other}))[0]["intervals_meet"] == {}


def test_a_soils_spread_is_that_within_its_bins_and_of_them_about_the_curve() -> None:
    curve = AdhesionCurve(bootstrap=0).fit(*pairs(3, a=0.8))
    bins, used = curve.bins_, curve.bins_.used
    off = bins.mean[used] - curve.predict(bins.slip[used])
    expected = np.sqrt(np.sum(bins.count[used] * (bins.std[used] ** 2 + off**2)) / bins.count[used].sum())
    assert Soil.from_curve("s", curve).spread == pytest.approx(expected)


@pytest.mark.parametrize(
    ("most", "divided", "refused"),
    [
        (1.0, False, False),
        (1.05, False, False),
        (1.06, False, True),
        (1.6, True, False),
        (105.0, True, False),
        (106.0, True, True),
    ],
)
def test_slips_beyond_one_and_a_half_are_per_cent(most: float, divided: bool, refused: bool) -> None:
    slip, value = np.array([most, 0.5, np.nan]), np.array([0.4, 0.2, 0.3])
    if refused:
        with pytest.raises(InputError, match=r"has a slip of 1\.06"):
            _curve(slip, value, "c", "f.csv", per_cent=False)
        return
    curve = _curve(slip, value, "c", "f.csv", per_cent=False)
    np.testing.assert_allclose(curve.slip, sorted(slip[:2] / (100 if divided else 1)))
    assert curve.value.tolist() == [0.2, 0.4]
    assert bool(curve.notes) is divided
    with pytest.raises(InputError, match="c has 1 points"):
        _curve(slip[1:], value[1:], "c", "f.csv", per_cent=False)


def test_separators_decimals_and_titles_of_digitised_points() -> None:
    assert _rows("# by hand\n0,1; 0,2\n\n1;2") == [["0.1", "0.2"], ["1", "2"]]
    assert _rows("0,1\t0,2") == [["0.1", "0.2"]]
    assert _rows("0.1,0.2") == [["0.1", "0.2"]]
    assert _rows("0.1   0.2 ") == [["0.1", "0.2"]]
    head = [["clay", "", "x"], ["Slip [-]", "mu", "s", "loam"]]
    assert [_title(head, k) for k in (0, 2, 3, 4)] == ["clay", "curve 2", "loam", "curve 3"]


def test_a_short_row_of_digitised_points_has_no_value_there() -> None:
    body = [["0.1", "0.2", "0.3"], ["0.2", ""], ["0.3"]]
    np.testing.assert_array_equal(_numbers(body, 1, 0, "f.csv"), [0.2, np.nan, np.nan])
    for cell in ("two", "inf"):
        with pytest.raises(InputError, match=r"row 6, column 2: '.*' is not a number"):
            _numbers([*body, ["0.4", cell]], 1, 2, "f.csv")
