"""Which slips a soil lacks, and the pull that brings the vehicle there."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.soil.bins import BinSettings, bin_pairs
from terragrip.soil.library import Soil
from terragrip.soil.missing import in_words, missing_slips, what_to_drive

SETTINGS = BinSettings(width=0.05, lower=0.05, upper=0.50, minimum=10)
# mu = 0.6 (1 - e^(-10 s)) - 0.8 s: its top is at ln(6 / 0.8) / 10 = 0.2015
FALLING = Soil("clay", "effective", {"A": 0.6, "k": 10.0, "d": 0.8}, resistance=(0.07, 0.01))


def mu(slip: float) -> float:
    return float(0.6 * (1 - np.exp(-10 * slip)) - 0.8 * slip)


def bins_of(*middles: float):
    """Twelve pairs about each middle of a bin."""
    slip = np.repeat(middles, 12)
    return bin_pairs(slip, 0.5 * slip, None, SETTINGS)


def test_neighbouring_bins_without_pairs_are_one_stretch() -> None:
    bins = bins_of(0.075, 0.125, 0.275, 0.325)
    assert missing_slips(bins) == [
        (pytest.approx(0.15), pytest.approx(0.25)),
        (pytest.approx(0.35), pytest.approx(0.50)),
    ]
    everywhere = bins_of(*(0.075 + 0.05 * np.arange(9)))
    assert missing_slips(everywhere) == []
    assert in_words("clay", what_to_drive(FALLING, everywhere, 1000.0, 0.01, 4)) == [
        "clay: every slip bin has enough samples."
    ]


def test_the_pull_is_the_curves_over_the_resistance_times_weight() -> None:
    bins = bins_of(0.125, 0.175, 0.275, 0.325)
    low, middle, high = what_to_drive(FALLING, bins, 1000.0, 0.1, 4, speed=1.2)
    weight = 1000 * 9.81
    assert low.pull == (
        pytest.approx((mu(0.05) - 0.07) * weight),
        pytest.approx((mu(0.10) - 0.07) * weight),
    )
    # behind the top the smaller pull is that of the larger slip
    assert high.pull == (
        pytest.approx((mu(0.50) - 0.07) * weight),
        pytest.approx((mu(0.35) - 0.07) * weight),
    )
    # the middle gap ends behind the top, where the pull is hardly another than at its start
    assert (low.reachable, middle.reachable, high.reachable) == (True, False, False)
    # one bin needs 10 pairs, four a sample of 0.1 s
    assert (low.seconds, middle.seconds, high.seconds) == pytest.approx((0.25, 0.25, 0.75))
    gross = what_to_drive(Soil("x", FALLING.model, FALLING.parameters), bins, 500.0, 0.1, 2, gravity=10.0)[0]
    assert gross.pull[1] == pytest.approx(mu(0.10) * 5000)
    assert gross.seconds == pytest.approx(0.5)


def test_where_the_curve_is_flat_no_pull_is_named_to_hold_a_slip() -> None:
    """Of a robot of 139 kg it was 'Pull 862 to 863 N' for 52 to 59 %."""
    paper = Soil("hard", "exponential", {"a": 1.4}, resistance=(0.03, 0.01))
    gaps = what_to_drive(paper, bins_of(0.075, 0.125, 0.225), 139.0, 0.1, 4)
    assert [(gap.slip[0], gap.reachable) for gap in gaps] == [
        (pytest.approx(0.15), True),
        (pytest.approx(0.25), True),
    ]
    settings = BinSettings(width=0.05, lower=0.4, upper=0.55, minimum=10)
    (gap,) = what_to_drive(
        paper, bin_pairs(np.repeat(0.425, 12), np.repeat(0.6, 12), None, settings), 139.0, 0.1, 4
    )
    assert not gap.reachable


def test_the_words_name_slip_pull_speed_and_time() -> None:
    bins = bins_of(0.125, 0.175, 0.275, 0.325)
    low, _, high = in_words("clay", what_to_drive(FALLING, bins, 1000.0, 4.0, 4, speed=1.2))
    pulls = [(mu(s) - 0.07) * 9810 for s in (0.05, 0.10, 0.35)]
    assert low == (
        f"clay: no data between 5% and 10% slip. Pull {pulls[0]:.0f} to {pulls[1]:.0f} N at about 1.2 m/s wheel speed, "
        "at least 10 s in all, in two runs or more."
    )
    assert high.startswith("clay: no data between 35% and 50% slip. The curve is flat or falls there")
    assert f"past {pulls[2]:.0f} N at about 1.2 m/s wheel speed and log" in high
    heavy = Soil("bog", FALLING.model, FALLING.parameters, resistance=(0.4, 0.1))
    assert (
        "below the pull needed for rolling" in in_words("bog", what_to_drive(heavy, bins, 1000.0, 0.1, 4))[0]
    )
    short = in_words("clay", what_to_drive(FALLING, bins, 1000.0, 0.1, 4))[0]
    assert short.endswith("N, at least 1 s in all, in two runs or more.")
