"""The zero of slip step by step: modes, their judgement and the windows that count, by hand and by the likelihood itself."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from terragrip.estimation.calibration.result import Evidence
from terragrip.estimation.calibration.speeds import _evidence
from terragrip.estimation.zero_slip import (
    Zero,
    _error,
    _fit,
    _judged,
    _means,
    _modes,
    _spread,
    _starts,
    _windows,
    zero_of,
)
from terragrip.recording import Recording

NONE = np.zeros(60, dtype=bool)


def around(value: float, count: int, spread: float = 0.001) -> np.ndarray:
    return value + spread * np.linspace(-1.0, 1.0, count)


def test_the_error_of_a_median_counts_half_the_windows_and_the_place() -> None:
    ratio = np.r_[np.full(10, 0.9), np.full(11, 1.0), np.full(11, 1.1)]
    assert _spread(ratio) == pytest.approx(1.4826 * 0.1)
    assert _spread(np.ones(9)) == 0.003
    assert _error(ratio) == pytest.approx(np.hypot(1.2533 * 0.14826 / 4.0, 0.002))


@pytest.mark.parametrize(
    ("value", "expected", "std", "doubt"),
    [
        (0.98, 0.98, np.sqrt(0.003**2 / 30 + 0.002**2 + 0.012**2 + 0.03**2), "all windows slip alike, so"),
        (0.955, 0.955, np.sqrt(0.003**2 / 30 + 0.002**2 + 0.012**2 + 0.03**2), "all windows slip alike, so"),
        (0.9, 1.0, 0.03, "all windows slip alike and are 10% below the supposed radius"),
        (1.1, 1.0, 0.03, "all windows slip alike and are 10% above the supposed radius"),
        (0.84, 1.0, 0.03, "ground speed is 0.84 times wheel speed even in the lightest work"),
        (1.2, 1.0, 0.03, "ground speed is 1.2 times wheel speed even in the lightest work"),
    ],
)
def test_where_all_windows_slip_alike_a_radius_is_in_doubt(
    value: float, expected: float, std: float, doubt: str
) -> None:
    zero = _judged(around(value, 60), NONE)
    assert zero.ratio == pytest.approx(expected, abs=1e-4)
    assert zero.std == pytest.approx(std, rel=0.01)
    assert zero.windows >= 59
    assert zero.doubt.startswith(doubt)


def test_of_two_modes_the_upper_is_light_work() -> None:
    zero = _judged(np.r_[around(0.9, 40), around(0.99, 20)], NONE)
    assert not zero.doubt
    assert zero.ratio == pytest.approx(0.99, abs=1e-4)
    assert zero.windows == 20
    assert zero.std == pytest.approx(np.sqrt(0.003**2 / 10 + 0.002**2 + 0.012**2), rel=0.01)


@pytest.mark.parametrize(
    ("road", "value", "own_slip"),
    [
        (around(1.01, 8), 1.01, 0.003),
        (around(0.992, 7), 0.99, 0.012),  # too little of it
        (around(0.95, 12), 0.99, 0.012),  # it slips more than the headland does
    ],
)
def test_a_road_counts_before_a_headland(road: np.ndarray, value: float, own_slip: float) -> None:
    field = np.r_[around(0.9, 40), around(0.99, 20)]
    zero = _judged(np.r_[field, road], np.r_[NONE, np.ones(len(road), dtype=bool)])
    assert zero.ratio == pytest.approx(value, abs=2e-3)
    assert zero.std == pytest.approx(
        np.sqrt(0.003**2 / (zero.windows / 2) + 0.002**2 + own_slip**2), rel=0.01
    )
    assert (zero.windows == 8) is (own_slip == 0.003)


@pytest.mark.parametrize(("fast", "doubt"), [(49, False), (47, True)])
def test_a_log_of_roads_needs_no_second_mode(fast: int, doubt: bool) -> None:
    """Where four fifths are of a road, its median may be below that of the rest."""
    ratio = np.r_[around(0.981, 60 - fast, 1e-5), around(0.98, fast, 1e-5)]
    zero = _judged(ratio, np.arange(60) >= 60 - fast)
    assert bool(zero.doubt) is doubt


def test_starts_are_quantiles_with_one_at_what_slips_least() -> None:
    ratio = np.arange(101.0)
    assert [s.tolist() for s in _starts(ratio, 1)] == [[50.0]]
    np.testing.assert_allclose(_starts(ratio, 2), [[25.0, 75.0], [45.0, 97.0]])
    np.testing.assert_allclose(_starts(ratio, 3), [[100 / 6, 50.0, 500 / 6], [22.5, 67.5, 97.0]])


def log_likelihood(ratio: np.ndarray, modes: list[tuple[float, float, float]]) -> float:
    """Of Gaussians beside a floor over .2, or over what the windows span."""
    floor = (1 - sum(share for _, _, share in modes)) / max(np.ptp(ratio), 0.2)
    parts = [p * np.exp(-0.5 * ((ratio - m) / s) ** 2) / (s * np.sqrt(2 * np.pi)) for m, s, p in modes]
    return float(np.sum(np.log(floor + np.sum(parts, axis=0))))


@pytest.mark.parametrize("span", [0.05, 0.5])
def test_a_mixture_is_one_of_most_likelihood_and_its_score_schwarz(span: float) -> None:
    draws = np.random.default_rng(8)
    ratio = np.r_[0.9 + 0.01 * draws.standard_normal(200), 0.98 + 0.006 * draws.standard_normal(100)]
    ratio = np.r_[ratio, draws.uniform(0.9 - span / 2, 0.9 + span / 2, 12)]
    score, modes = _fit(ratio, 2, np.array([0.91, 0.97]))
    best = log_likelihood(ratio, modes)
    assert score == pytest.approx(6 * np.log(len(ratio)) - 2 * best, abs=0.01)
    for k, (mean, spread, share) in enumerate(modes):
        for by in (-1, 1):
            assert log_likelihood(ratio, [modes[1 - k], (mean + by * 2e-3, spread, share)]) < best
            assert log_likelihood(ratio, [modes[1 - k], (mean, spread + by * 1e-3, share)]) < best
            other = (*modes[1 - k][:2], modes[1 - k][2] - by * 0.05)
            assert log_likelihood(ratio, [other, (mean, spread, share + by * 0.05)]) < best
    assert [m[0] for m in modes] == pytest.approx([0.9, 0.98], abs=0.003)
    assert [m[1] for m in modes] == pytest.approx([0.01, 0.006], rel=0.25)
    assert [m[2] for m in modes] == pytest.approx([200 / 312, 100 / 312], abs=0.05)


def test_strays_take_no_modes_windows_and_no_mode_is_sharper_than_three_thousandths() -> None:
    ratio = np.r_[np.full(60, 0.95), np.random.default_rng(1).uniform(0.5, 1.5, 40)]
    _, modes = _fit(ratio, 1, np.array([0.95]))
    assert sum(share for _, _, share in modes) > 0.8  # of 0.6, had the floor no bound
    _, ((mean, spread, _),) = _fit(np.full(50, 0.95), 1, np.array([0.95]))
    assert (mean, spread) == (pytest.approx(0.95), 0.003)


def test_modes_that_run_into_each_other_are_one_and_few_windows_none() -> None:
    draws = np.random.default_rng(2)
    one = _modes(0.95 + 0.01 * draws.standard_normal(300))
    assert len(one) == 1
    assert one[0][:2] == pytest.approx((0.95, 0.01), rel=0.15)
    skewed = 1 + 0.03 * np.log(
        1 - (np.arange(300) + 0.5) / 300
    )  # would be three, nearer than their SDs together
    assert all(b[0] - a[0] > a[1] + b[1] for a, b in pairwise(_modes(skewed)))
    three = np.r_[around(0.85, 60), around(0.92, 60), around(0.99, 60)]
    assert [m[0] for m in _modes(three)] == pytest.approx([0.85, 0.92, 0.99], abs=1e-3)
    assert [m[0] for m in _modes(np.r_[around(0.9, 60), around(1.0, 3)])] == pytest.approx([0.9], abs=1e-3)
    assert [m[0] for m in _modes(np.r_[around(0.9, 60), around(1.0, 5)])] == pytest.approx(
        [0.9, 1.0], abs=1e-3
    )
    assert [m[2] for m in _modes(np.tile(three, 40))] == pytest.approx([1 / 3] * 3, abs=0.01)


def test_means_and_least_magnitudes_of_windows() -> None:
    mean, least = _means(np.array([1.0, -3.0, np.nan, 4.0, np.nan]), np.array([0, 0, 0, 1, 2]), 4)
    np.testing.assert_array_equal(mean, [-1.0, 4.0, np.nan, np.nan])
    np.testing.assert_array_equal(least, [1.0, 4.0, np.inf, np.inf])


TIME = np.arange(0.0, 60.0, 0.5)  # 12 windows of 5 s


def counted(
    ground: np.ndarray, rim: np.ndarray, span: tuple[float, float] | None = None, **more: np.ndarray
) -> tuple:
    log = Recording(7.0 + TIME, {"ground_speed": ground, "wheel_based_speed": rim / 0.5, **more})
    channel = "wheel_speed_l" if "wheel_speed_l" in more else "wheel_based_speed"
    return _windows(log, channel, 0.5, span)


def test_windows_are_of_driving_without_a_stop_either_way() -> None:
    wave = 1 + 1e-3 * np.sin(TIME)  # no two rows alike
    ground, rim = 2.0 * wave, 2.5 * wave
    ratio, fast = counted(ground, rim)
    np.testing.assert_allclose(ratio, 0.8)
    assert not fast.any()
    assert len(ratio) == 12
    assert len(counted(-ground, -rim)[0]) == 12
    assert len(counted(ground, -rim)[0]) == 0
    assert len(counted(0.14 * ground, rim)[0]) == 0  # .28 m/s
    assert len(counted(0.16 * ground, rim)[0]) == 12
    assert len(counted(ground, 0.11 * rim)[0]) == 0
    assert counted(2.51 * ground, rim)[1].all()  # over 5 m/s
    assert not counted(2.49 * ground, rim)[1].any()
    slow = np.where(np.arange(120) == 35, 0.4, 1.0)  # a stop in the fourth window, in either speed
    assert len(counted(ground * slow, rim)[0]) == 11
    assert len(counted(ground, rim * slow)[0]) == 11
    assert len(counted(ground * np.where(slow < 1, 0.6, 1.0), rim)[0]) == 12
    missing = np.where((TIME >= 10) & (TIME < 15), np.nan, 1.0)
    assert len(counted(ground * missing, rim)[0]) == 11
    assert len(counted(ground, rim, (17.0, 37.0))[0]) == 5  # both ends are in
    assert len(counted(ground, rim, (500.0, 600.0))[0]) == 0


@pytest.mark.parametrize(("yaw", "used"), [(0.049, 12), (-0.051, 0), (np.nan, 12)])
def test_a_yaw_rate_says_what_is_straight(yaw: float, used: int) -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    sides = {"wheel_speed_l": 5.0 * wave, "wheel_speed_r": 4.0 * wave, "angular_velocity_z": yaw * wave}
    assert len(counted(2.0 * wave, 2.5 * wave, **sides)[0]) == used


@pytest.mark.parametrize(("half_track", "used"), [(0.8, 12), (0.84, 0)])
def test_a_turn_that_moves_the_outermost_hub_by_two_hundredths_is_none(half_track: float, used: int) -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    channels = {"ground_speed": 2 * wave, "wheel_speed_l": 5 * wave, "angular_velocity_z": -0.0485 + 0 * wave}
    assert len(_windows(Recording(TIME, channels), "wheel_speed_l", 0.5, None, {}, half_track)[0]) == used


@pytest.mark.parametrize(("apart", "used"), [(0.049, 12), (0.051, 0)])
def test_without_one_the_wheels_do(apart: float, used: int) -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    sides = {"wheel_speed_l": -5.0 * (1 + apart / 2) * wave, "wheel_speed_r": -5.0 * (1 - apart / 2) * wave}
    assert len(counted(-2.0 * wave, -2.5 * wave, **sides)[0]) == used


def test_eight_windows_are_enough_of_all_logs_together_and_declared_rows_alone_count() -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    log = Recording(TIME, {"ground_speed": 1.6 * wave, "wheel_based_speed": 4.0 * wave})
    part = log.select(slice(0, 40))
    assert zero_of([part], "wheel_based_speed", 0.4) is None
    both = zero_of([part, part], "wheel_based_speed", 0.4)
    assert both is not None
    assert both.windows == 8
    assert zero_of([log], "wheel_speed_l", 0.4) is None
    declared = zero_of([log, part], "wheel_based_speed", 0.4, [(0.0, 50.0), None])
    assert declared == Zero(
        pytest.approx(1.0), pytest.approx(np.hypot(1.2533 * 0.003 / np.sqrt(5.5), 0.002)), 11
    )
    with pytest.raises(ValueError, match="shorter"):  # a span for each log, or none at all
        zero_of([log, part], "wheel_based_speed", 0.4, [(0.0, 50.0)])


def test_evidence_of_a_speeds_gain_is_each_log_that_has_it_with_its_windows() -> None:
    """Whole windows of 5 s from the first to the last row."""
    ones = np.ones(4)
    logs = [
        Recording(np.array([1.0, 7.0, 13.0, 20.9]), {name: ones})
        for name in ("wheel_based_speed", "ground_speed")
    ]
    assert _evidence(logs, ("a.csv", "b.csv"), "wheel_based_speed") == (Evidence("a.csv", 1.0, 20.9, 3),)
