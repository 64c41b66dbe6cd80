"""How far one record of a speed lags behind another, against shifts that are known and NumPy's correlation."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording.lag import Speed, lag_between, lag_within, offset_between, speed_of

TIME = np.arange(0.0, 120.0, 0.05)


def speed_at(time: np.ndarray) -> np.ndarray:
    """A speed that never repeats and rises on the whole, so that parts of it differ in mean."""
    return 1.5 + 0.01 * time + 0.6 * np.sin(time / 9) + 0.3 * np.sin(time / 2.3) + 0.2 * np.sin(time**2 / 500)


@pytest.mark.parametrize("ahead", [-31.0, 0.0, 0.4, 31.0])
def test_a_clock_that_is_ahead_is_seen_whatever_part_is_common(ahead: float) -> None:
    lag = offset_between((TIME, speed_at(TIME)), (TIME, 3 * speed_at(TIME - ahead)))
    assert lag is not None
    assert lag.seconds == pytest.approx(ahead, abs=0.005)
    assert lag.correlation == pytest.approx(1.0, abs=1e-6)
    assert lag.explained == (0.0, 0.0)


def test_the_correlation_is_that_of_the_common_part() -> None:
    rows = 600  # 30 s, which only one of both has, at either end
    noise = np.random.default_rng(14).normal(0, 0.15, len(TIME))
    first, second = speed_at(TIME), speed_at(TIME) + noise
    lag = offset_between((TIME[:-rows], first[:-rows]), (TIME[rows:] + 7.0, second[rows:]))
    assert lag is not None
    assert lag.seconds == pytest.approx(7.0, abs=0.05)
    common = slice(rows, len(TIME) - rows - 1)  # a record's last instant is no point of comparison
    assert lag.correlation == pytest.approx(np.corrcoef(first[common], second[common])[0, 1], abs=1e-4)


def test_speeds_that_fit_at_several_offsets_tell_none() -> None:
    there_and_back = 1.5 + np.sin(2 * np.pi * TIME / 10.0)
    assert offset_between((TIME, there_and_back), (TIME, there_and_back)) is None
    assert offset_between((TIME, there_and_back), (TIME, there_and_back), reach=4.0) is not None


def test_of_a_held_channel_only_the_updates_count() -> None:
    """5 Hz held on rows at 20 Hz: taken as it stands, the speed would be late by half a hold."""
    updates = np.arange(len(TIME)) // 4 * 4
    held = speed_of(TIME, {"ground_speed": speed_at(TIME)[updates]})
    assert held is not None
    assert np.array_equal(held.time, TIME[::4])
    assert np.array_equal(held.values, speed_at(TIME)[::4])


def test_a_channel_of_two_values_tells_no_speed() -> None:
    for known in (0, 1, 2):
        ground = np.where(np.arange(len(TIME)) < known, 1.0, np.nan)
        assert speed_of(TIME, {"ground_speed": ground}) is None


@pytest.mark.parametrize("late", ["ground_speed", "wheels"])
def test_whichever_sensor_is_late_is_found(late: str) -> None:
    ground, wheels = (speed_at(TIME - 0.6 * (name == late)) for name in ("ground_speed", "wheels"))
    lag = lag_within(TIME, {"ground_speed": ground, "wheel_speed_l": 5 * wheels, "wheel_speed_r": 5 * wheels})
    assert lag is not None
    assert lag.seconds == pytest.approx(0.6 if late == "ground_speed" else -0.6, abs=0.02)


def test_between_two_speeds_of_one_kind_the_vehicle_explains_nothing() -> None:
    for pace in (None, 1.5):
        first, second = Speed(TIME, speed_at(TIME), pace), Speed(TIME, speed_at(TIME + 0.3), pace)
        lag = lag_between(first, second)
        assert lag is not None
        assert lag.explained == (0.0, 0.0)
        assert lag.is_of_the_clock


def stopped_log(late: float, wheels_stop: float) -> dict[str, np.ndarray]:
    """Driven off; the vehicle stops from 30 s on, its wheels ``wheels_stop`` [s] after it. The ground speed is ``late`` [s]."""
    ends = np.array([30.0, 31.0])
    speed = np.interp(TIME - late, [2.0, 3.5, *ends], [0.0, 1.0, 1.0, 0.0])
    rims = np.interp(TIME, [2.0, 3.5, *(ends + wheels_stop)], [0.0, 1.05, 1.05, 0.0])
    noise = np.random.default_rng(3).normal(0, 0.01, (2, len(TIME)))
    return {
        "ground_speed": speed + noise[0],
        "wheel_speed_l": rims + noise[1],
        "wheel_speed_r": rims + noise[1],
    }


@pytest.mark.parametrize("noticed", [1.0, 2.0])
def test_a_vehicle_that_digs_in_before_its_wheels_are_stopped_has_no_early_ground_speed(
    noticed: float,
) -> None:
    """The log was shifted by up to that, and its warning and `stuck` came so much later."""
    part = TIME < 45
    lag = lag_within(TIME[part], {n: x[part] for n, x in stopped_log(0.0, noticed).items()})
    assert lag is None or not lag.is_of_the_clock


@pytest.mark.parametrize("spinning", [1.0, 2.0])
def test_a_vehicle_whose_wheels_spin_before_it_starts_has_no_late_ground_speed(spinning: float) -> None:
    """The same run backward: its losses of speed show no lag."""
    part = TIME < 45
    lag = lag_within(TIME[part], {n: x[part][::-1] for n, x in stopped_log(0.0, spinning).items()})
    assert lag is None or not lag.is_of_the_clock


@pytest.mark.parametrize("late", [-1.5, 0.7, 1.5])
def test_a_late_clock_is_off_in_gains_and_losses_of_speed_alike(late: float) -> None:
    lag = lag_within(TIME, stopped_log(late, 0.0))
    assert lag is not None
    assert lag.is_to_correct
    assert lag.seconds == pytest.approx(late, abs=0.1)


@pytest.mark.parametrize("late", [-1.0, 1.5])
def test_of_a_log_that_ends_at_speed_the_gains_alone_tell_a_late_clock(late: float) -> None:
    """Its losses of speed are noise, which contradicts nothing."""
    part = TIME < 28
    lag = lag_within(TIME[part], {n: x[part] for n, x in stopped_log(late, 0.0).items()})
    assert lag is not None
    assert lag.is_to_correct
    assert lag.seconds == pytest.approx(late, abs=0.1)


def road_log(late: float) -> dict[str, np.ndarray]:
    """A tractor with a trailer on a road, nine stops: it gains 6 g of speed per slip, and its receiver is ``late`` [s]."""
    time = np.arange(0.0, 560.0, 0.1)
    start, stop, level = np.random.default_rng(4).uniform([5, 4, 8], [9, 7, 13], (9, 3)).T
    begin = 60.0 * np.arange(9) + 3
    corners = np.stack([begin, begin + start, begin + 40, begin + 40 + stop], axis=1)
    rim = np.interp(time, corners.ravel(), np.outer(level, [0, 1, 1, 0]).ravel())
    speed = np.zeros(len(time))
    for k in range(len(time) - 1):  # a = 6 g (rim - v) / rim, in steps that no speed makes too long
        share = -np.expm1(-0.1 * 6 * 9.81 / max(rim[k + 1], 0.3))
        speed[k + 1] = speed[k] + share * (rim[k + 1] - speed[k])
    noise = np.random.default_rng(5).normal(0, 0.02, (2, len(time)))
    return {
        "time": time,
        "ground_speed": np.interp(time - late, time, speed) + noise[0],
        "wheel_speed_l": rim + noise[1],
        "wheel_speed_r": rim + noise[1],
    }


def test_stops_on_a_road_show_how_late_a_receiver_is() -> None:
    """The softest ground explains half a second at that speed, so no delay of a receiver was ever corrected."""
    for late in (0.25, 0.4):
        log = road_log(late)
        lag = lag_within(log.pop("time"), log)
        assert lag is not None
        assert lag.is_to_correct
        assert lag.of_the_clock == pytest.approx(late, abs=1.96 * lag.delay_left)


def test_a_receiver_that_is_on_time_on_a_road_is_left() -> None:
    log = road_log(0.0)
    lag = lag_within(log.pop("time"), log)
    assert lag is not None
    assert not lag.is_of_the_clock
    assert lag.delay < 0.08  # .11 where the softest ground is possible
