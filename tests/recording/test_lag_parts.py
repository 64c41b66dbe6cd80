"""What a lag between two records of a speed is made of: each step against a closed form or a plain loop."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording.lag import (
    Lag,
    Speed,
    _correlation,
    _refined,
    _regular,
    _smooth,
    is_copy,
    lag_between,
    lag_within,
    offset_between,
    speed_of,
)

STEP = 0.05


def wander(time: np.ndarray, seed: int = 3) -> np.ndarray:
    """A speed of many sines up to 1 rad/s, the same function of time wherever it is sampled."""
    draws = np.random.default_rng(seed)
    rates, phases = draws.uniform(0.05, 1.0, 12), draws.uniform(0, 6.28, 12)
    return 2.0 + 0.15 * np.sin(rates * time[:, None] + phases).sum(axis=1)


@pytest.mark.parametrize(
    ("seconds", "std", "explained", "certain"),
    [
        (0.5, 0.125, (0.0, 0.25), False),  # just twice its deviation above what is explained
        (0.5, 0.12, (0.0, 0.25), True),
        (-0.5, 0.125, (-0.25, 0.0), False),
        (-0.5, 0.12, (-0.25, 0.0), True),
        (0.2, 0.01, (0.0, 0.25), False),
        (-0.2, 0.01, (0.0, 0.25), True),
    ],
)
def test_a_lag_is_of_the_clock_beyond_twice_its_deviation_and_what_is_explained(
    seconds: float, std: float, explained: tuple[float, float], certain: bool
) -> None:
    assert Lag(seconds, std, 0.99, explained).is_of_the_clock is certain


@pytest.mark.parametrize(
    ("seconds", "std", "explained", "certain"),
    [
        (0.5, 0.0625, (0.0, 0.25), False),  # just four times its deviation above what is explained
        (0.5, 0.06, (0.0, 0.25), True),
        (-0.5, 0.0625, (-0.25, 0.0), False),
        (-0.5, 0.06, (-0.25, 0.0), True),
        (0.3125, 0.03, (0.0, 0.25), True),  # twice is enough where it is sharp
        (0.3125, 0.031, (0.0, 0.25), False),
        (0.6, 0.02, (0.5, 0.75), False),
    ],
)
def test_a_lag_is_corrected_beyond_four_times_its_deviation_or_twice_a_small_one(
    seconds: float, std: float, explained: tuple[float, float], certain: bool
) -> None:
    assert Lag(seconds, std, 0.99, explained).is_to_correct is certain


@pytest.mark.parametrize(("std", "explained"), [(0.02, (0.0, 0.06)), (0.3, (0.0, 0.06)), (0.01, (-0.2, 0.0))])
def test_a_sensors_delay_is_what_was_found_and_what_is_usual_together(
    std: float, explained: tuple[float, float]
) -> None:
    """Root mean square of a normal prior of .1 s times the likelihood of what was found, summed up on a grid [s]."""
    delay, own = np.linspace(-3.0, 3.0, 60_001), np.var(np.linspace(*explained, 100_001))
    found = 0.1 - np.mean(explained)
    density = np.exp(-0.5 * (delay / 0.1) ** 2 - 0.5 * (delay - found) ** 2 / (std**2 + own))
    expected = np.sqrt(np.sum(delay**2 * density) / np.sum(density))
    assert Lag(0.1, std, 0.9, explained).delay == pytest.approx(expected, rel=1e-3)


def test_why_a_lag_is_left_is_given() -> None:
    assert "no more than twice" in Lag(-0.25, 0.125, 0.9, (0.0, 1.0)).why_not
    assert Lag(0.25, 0.1, 0.9, (-0.375, 0.0)).why_not.endswith("follows its wheels by up to 0.38 s")
    assert Lag(0.25, 0.1, 0.9, (0.0, 0.5)).why_not.endswith("by up to 0.50 s")


def test_a_vehicle_follows_its_wheels_by_its_pace_over_twice_gravity() -> None:
    time = np.arange(0.0, 60.0, STEP)
    wheels, ground = Speed(time, wander(time), None), Speed(time, wander(time), 1.5)
    behind, ahead = lag_between(wheels, ground), lag_between(ground, wheels)
    assert behind is not None
    assert ahead is not None
    assert behind.explained == pytest.approx((0.0, 1.5 / (2 * 9.80665)))
    assert ahead.explained == pytest.approx((-1.5 / (2 * 9.80665), 0.0))
    assert lag_between(Speed(time[:100], wander(time[:100]), None), ground) is None


def test_pace_is_the_median_of_what_is_above_half_of_the_top_speed() -> None:
    time = np.arange(100.0)
    # a tenth at 4, which is the top; of 3, 2.5 and 4 the median is 3; creep at 1.9 does not count
    values = np.repeat([-1.9, 2.5, -3.0, 4.0], [45, 20, 20, 15]) * (1 + 1e-9 * np.arange(100))
    speed = speed_of(time, {"ground_speed": values})
    assert speed is not None
    assert speed.pace == pytest.approx(3.0, rel=1e-6)
    assert np.array_equal(speed.values, np.abs(values))
    still = speed_of(time, {"ground_speed": np.zeros(100)})
    assert still is not None
    assert still.pace == 0.0


def test_a_drive_train_speaks_before_wheels_and_wheels_by_their_mean() -> None:
    time = np.arange(50.0)
    wheels = {
        "wheel_speed_l": -2.0 - 0.01 * time,
        "wheel_speed_r": np.where(time % 2, np.nan, 4.0 + 0.03 * time),
    }
    mean = speed_of(time, wheels)
    assert mean is not None
    assert mean.pace is None
    np.testing.assert_allclose(mean.values[:49], 3.0 + 0.02 * time[:49])
    drive = speed_of(time, {**wheels, "wheel_based_speed": -1.0 - 0.1 * time})
    assert drive is not None
    assert drive.pace is None
    np.testing.assert_array_equal(drive.time, time)
    np.testing.assert_allclose(drive.values, 1.0 + 0.1 * time)
    assert speed_of(time, {"wheel_speed_l": np.full(50, "x", object), "pitch": time}) is None


@pytest.mark.parametrize(
    ("step", "gaps"),
    [
        (0.25, [(9.75, 11.0), (19.75, 21.5)]),  # a second is the longest that is bridged
        (0.25, []),
        (1.0, [(99.0, 104.0)]),  # of slow samples it is three of their steps
    ],
)
def test_comparison_points_stand_on_one_step_and_skip_long_gaps(
    step: float, gaps: list[tuple[float, float]]
) -> None:
    bridged = (40.0, 41.0 if step < 1 else 43.0)
    time = np.arange(0.0, 120.0, step)
    time = 5.0 + time[~np.any([(time > a) & (time < b) for a, b in [*gaps, bridged]], axis=0)]
    start, values = _regular(time, 3.0 * time) or (0.0, np.empty(0))
    points = 5.0 + STEP * np.arange(len(values))
    assert start == 5.0
    assert len(values) == round((time[-1] - time[0]) / STEP)
    within = np.zeros(len(points), dtype=bool)
    for a, b in gaps:
        within |= (points > 5.0 + a + 1e-6) & (points < 5.0 + b + 1e-6)
    np.testing.assert_array_equal(np.isnan(values), within)
    np.testing.assert_allclose(values[~within], 3.0 * points[~within])


@pytest.mark.parametrize(("rows", "enough"), [(2, False), (401, True), (400, False)])
def test_under_twenty_seconds_nothing_is_compared(rows: int, enough: bool) -> None:
    time = STEP * np.arange(rows) if rows > 2 else np.array([0.0, 50.0])
    assert (_regular(time, time) is not None) is enough


@pytest.mark.parametrize(("least", "most"), [(-449, 520), (-20, 21), (60, 90), (-60, -30)])
def test_correlation_is_that_of_numpy_at_every_lag(least: int, most: int) -> None:
    draws = np.random.default_rng(14)
    a, b = draws.normal(1.0, 1.0, 520), draws.normal(-2.0, 3.0, 450)
    a[100:130], b[:7] = np.nan, np.nan
    lags = np.arange(least, most)
    result = _correlation(a, b, lags)
    seen = dict(zip(lags.tolist(), result.tolist(), strict=True))
    for lag in range(least, most):
        rows = np.arange(max(lag, 0), min(len(a), len(b) + lag))
        both = rows[np.isfinite(a[rows]) & np.isfinite(b[rows - lag])]
        if len(both) >= 20 / STEP:
            assert seen[lag] == pytest.approx(np.corrcoef(a[both], b[both - lag])[0, 1], abs=1e-9)
        else:
            assert seen[lag] == -np.inf


def test_of_long_records_three_tenths_of_the_shorter_must_be_common() -> None:
    draws = np.random.default_rng(14)
    a, b = draws.normal(size=4000), draws.normal(size=3000)
    lags = np.arange(-2999, 4000)
    result = _correlation(a, b, lags)
    common = np.minimum(4000, 3000 + lags) - np.maximum(lags, 0)
    np.testing.assert_array_equal(np.isfinite(result), common >= 900)
    assert np.isfinite(_correlation(b, a, -lags[::-1])).sum() == np.isfinite(result).sum()


def test_a_mean_over_a_second_is_that_of_its_21_points() -> None:
    values = np.random.default_rng(1).normal(size=120)
    values[60] = np.nan
    expected = np.full(120, np.nan)
    for k in range(10, 110):
        expected[k] = np.mean(values[k - 10 : k + 11])
    np.testing.assert_allclose(_smooth(values), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("lag", [-0.31, 0.0, 0.013, 0.27])
def test_an_offset_is_refined_to_milliseconds_across_gaps(lag: float) -> None:
    time = STEP * np.arange(2400)
    mine, theirs = wander(time), 5.0 * wander(time + 3.0 - lag)
    mine[300:420] = theirs[900:1000] = np.nan
    seconds, std = _refined((0.0, mine), (3.0, theirs), lag + 0.04)
    assert seconds == pytest.approx(lag, abs=2e-3)
    assert std == 0.005  # the least that is claimed


def test_the_deviation_of_an_offset_is_how_far_it_errs() -> None:
    """Where the second speed wanders off at random, so that its rate is white."""
    time, errors, stds = STEP * np.arange(2400), [], []
    for seed in range(24):
        walk = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.01, 2400))
        seconds, std = _refined((0.0, wander(time)), (0.0, wander(time - 0.2) + walk), 0.2)
        errors.append(seconds - 0.2)
        stds.append(std)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.mean(stds), rel=0.3)


def test_too_little_in_common_is_not_refined_and_known_to_a_second() -> None:
    time = STEP * np.arange(500)
    values = np.where(time < 3.0, wander(time), np.nan)
    assert _refined((0.0, values), (0.0, values), 0.125) == (0.125, 1.0)
    assert _refined((0.0, wander(time)), (0.0, -wander(time)), 0.125) == (0.125, 1.0)


@pytest.mark.parametrize(("noise", "alike"), [(0.5, True), (0.85, False)])
def test_speeds_are_alike_from_a_correlation_of_eight_tenths(noise: float, alike: bool) -> None:
    """Of a signal with white noise of so many of its deviations the correlation is (1 + noise²)^(-1/2): .89 and .76."""
    time = np.arange(0.0, 600.0, STEP)
    speed = wander(time)
    other = speed + noise * speed.std() * np.random.default_rng(2).standard_normal(len(time))
    assert (offset_between((time, speed), (time, other)) is not None) is alike


def test_offsets_beyond_reach_are_not_looked_for() -> None:
    time = np.arange(0.0, 120.0, STEP)
    for ahead in (-4.0, 4.0):
        pair = (time, wander(time)), (time, wander(time - ahead))
        lag = offset_between(*pair, reach=4.5)
        assert lag is not None
        assert lag.seconds == pytest.approx(ahead, abs=0.005)
        nearer = offset_between(*pair, reach=1.0)
        assert nearer is None or abs(nearer.seconds) < 3.9


@pytest.mark.parametrize(("longest", "compared"), [(4900, True), (4700, False)])
def test_records_that_are_too_long_together_are_not_compared(
    monkeypatch: pytest.MonkeyPatch, longest: int, compared: bool
) -> None:
    monkeypatch.setattr("terragrip.recording.lag._LONGEST", longest)  # of twice 2400 points
    time = STEP * np.arange(2400)
    assert (offset_between((time, wander(time)), (time, wander(time))) is not None) is compared


@pytest.mark.parametrize(("late", "certain"), [(0.4, True), (-0.4, True), (0.08, False)])
def test_a_lag_within_a_log_counts_where_a_vehicle_does_not_explain_it(late: float, certain: bool) -> None:
    time = np.arange(0.0, 300.0, STEP)
    wheel = 2.0 * wander(time)
    lag = lag_within(time, {"ground_speed": wander(time - late), "wheel_speed_l": wheel})
    assert lag is not None
    assert lag.is_of_the_clock is certain
    if certain:
        explained = lag.explained[1]
        assert lag.seconds == pytest.approx(late, abs=1e-3)
        assert lag.of_the_clock == pytest.approx(late - explained / 2, abs=1e-3)
        assert explained == pytest.approx(2.0 / (2 * 9.80665), rel=0.1)  # at some 2 m/s
    assert lag_within(time, {"ground_speed": wander(time)}) is None
    assert lag_within(time, {"wheel_speed_l": wheel}) is None


def test_a_wheel_made_of_the_ground_speed_is_a_copy() -> None:
    ground = np.array([0.0, 1.0, np.nan, 2.0])
    assert is_copy(3.0 * ground, ground)
    assert is_copy(np.array([np.nan, 3.0, np.nan, 6.0]), ground)
    assert not is_copy(np.array([0.0, 3.0, 4.0, 6.0]), ground)  # it knows more
    assert not is_copy(3.0 * ground + [0, 1e-3, 0, 0], ground)
    assert not is_copy(np.zeros(3), np.zeros(3))


def test_moments_of_slip_do_not_move_an_offset() -> None:
    """Speed falls by a third for two seconds, ten times, without the wheels: their rates are kept out."""
    time = STEP * np.arange(2400)
    slipping = wander(time - 0.2)
    for start in range(100, 2300, 220):
        slipping[start : start + 40] -= 0.7
    seconds, _ = _refined((0.0, wander(time)), (0.0, slipping), 0.25)
    assert seconds == pytest.approx(0.2, abs=0.01)


def test_points_that_a_wrong_stamp_would_need_are_not_laid_out() -> None:
    """A stamp ten days on would need more points than `_LONGEST`; so far off as this, more than there is memory."""
    time = np.arange(0.0, 60.0, 0.1)
    assert _regular(time, np.ones(600)) is not None
    assert _regular(np.r_[time, 1e12], np.ones(601)) is None


def test_a_pause_of_a_month_hides_no_lag_and_costs_no_points() -> None:
    """Over ten days of points nothing was compared, and of three days it took a minute."""
    time = np.arange(0.0, 200.0, STEP)
    columns = {"wheel_speed_l": wander(time), "ground_speed": wander(time - 0.4)}
    paused = time + 30 * 86400.0 * (time > 90)
    plain, found = lag_within(time, columns), lag_within(paused, columns)
    assert plain is not None
    assert found is not None
    assert found.seconds == pytest.approx(0.4, abs=0.02)
    assert found.std < 2 * plain.std
