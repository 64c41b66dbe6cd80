"""Which windows count, at the bounds: one window of many is changed and the others are left as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation.calibration import gains, radii, torque_scale, zeros
from terragrip.estimation.calibration.plausible import turns_unseen
from terragrip.estimation.calibration.windows import Windows, track_blocks
from terragrip.estimation.calibration.zeros import evidence, resting, rows_of, spells, standstills
from terragrip.vehicle import Vehicle
from window_table import RADIUS, N, stopped, table

ODD = 7  # the window that is changed


def with_one(name: str, value: float, wheel: int | None = None) -> Windows:
    """The windows with one column of window ODD (of one wheel) changed."""
    whole = table()
    column = getattr(whole, name).copy()
    column[ODD if wheel is None or column.ndim == 1 else (ODD, wheel)] = value
    return replace(whole, **{name: column})


def rim(speed: float) -> float:
    return speed / RADIUS


def passes(windows: Windows, vehicle: Vehicle) -> np.ndarray:
    return radii._passes(windows, vehicle)


def driving(windows: Windows, vehicle: Vehicle) -> np.ndarray:
    return np.isin(windows.start, gains._driving(windows, vehicle).start)


def usable(windows: Windows, vehicle: Vehicle) -> np.ndarray:
    return torque_scale._usable(windows, vehicle)


CASES = [
    (passes, "count", 26.0, None, True),
    (passes, "count", 25.0, None, False),  # half of what is usual
    (passes, "wheel_speed", rim(0.21), 0, False),  # far from the others: no straight line
    (passes, "ground_speed", 0.9, None, True),
    (passes, "wheel_speed", rim(1.1111 * 1.03), 2, True),  # sides 1.5 % apart
    (passes, "wheel_speed", rim(1.1111 * 1.05), 2, False),
    (driving, "count", 26.0, None, True),
    (driving, "count", 25.0, None, False),
    (driving, "ground_speed", 0.16, None, True),
    (driving, "ground_speed", 0.14, None, False),
    (driving, "torque", np.nan, 1, False),
    (driving, "load", np.nan, 3, False),
    (driving, "wheel_acceleration", np.nan, 3, False),
    (driving, "hub_speed", 1.04, 3, True),
    (driving, "hub_speed", 1.06, 3, False),  # hubs 6 % apart
    (usable, "count", 26.0, None, True),
    (usable, "count", 25.0, None, False),
    (usable, "ground_speed", 0.11, None, True),
    (usable, "ground_speed", 0.09, None, False),
    (usable, "ground_speed", -1.0, None, False),  # wheels go the other way
    (usable, "push", np.nan, None, False),
    (usable, "drawbar", np.nan, None, False),
    (usable, "torque", np.nan, 1, False),
    (usable, "hub_speed", 0.61, 0, True),  # mean slip .19
    (usable, "hub_speed", 0.54, 0, False),  # .203
]


@pytest.mark.parametrize(("of", "name", "value", "wheel", "counts"), CASES)
def test_one_window_counts_or_not(
    vehicle: Vehicle,
    of: Callable[[Windows, Vehicle], np.ndarray],
    name: str,
    value: float,
    wheel: int | None,
    counts: bool,
) -> None:
    assert of(table(), vehicle).all()
    expected = np.ones(N, dtype=bool)
    expected[ODD] = counts
    np.testing.assert_array_equal(of(with_one(name, value, wheel), vehicle), expected)


@pytest.mark.parametrize("of", [passes, driving, usable])
def test_empty_windows_do_not_say_how_many_samples_are_usual(
    vehicle: Vehicle, of: Callable[[Windows, Vehicle], np.ndarray]
) -> None:
    count = np.r_[np.zeros(12), 24.0, np.full(7, 50.0)]
    np.testing.assert_array_equal(of(table(count=count), vehicle), count > 25)


@pytest.mark.parametrize(("slips", "counts"), [(0.59, True), (0.61, False), (-0.09, True), (-0.11, False)])
def test_wheels_share_a_curve_up_to_six_tenths_of_slip(vehicle: Vehicle, slips: float, counts: bool) -> None:
    hub = (1 - slips) / 0.9 if slips >= 0 else 1 / (0.9 * (1 + slips))
    windows = table()
    windows.hub_speed[ODD] = hub
    assert driving(windows, vehicle)[ODD] == counts
    assert driving(windows, vehicle).sum() == N - (not counts)


@pytest.mark.parametrize(("speed", "counts"), [(0.21, True), (0.19, False), (-1.0, False)])
def test_passes_are_forward_and_faster_than_a_fifth_of_a_metre_a_second(
    vehicle: Vehicle, speed: float, counts: bool
) -> None:
    slow = table(ground_speed=np.full(N, speed))
    assert passes(slow, vehicle).all() == counts
    slow = table(wheel_speed=np.full((N, 4), rim(speed)))
    assert passes(slow, vehicle).all() == counts
    assert len(passes(table(1), vehicle)) == 1


@pytest.mark.parametrize(("apart", "counts"), [(0.33, True), (0.34, False)])
def test_where_the_turn_is_known_a_pass_may_bend(vehicle: Vehicle, apart: float, counts: bool) -> None:
    """Hubs may be .3 of the rims' mean speed apart, however far the rims are."""
    wheel_speed = table().wheel_speed * [0.9, 1.1, 0.9, 1.1]
    hub = np.ones((N, 4)) + apart * np.array([-0.5, 0.5, -0.5, 0.5])
    known = table(yaw_rate=np.full(N, 0.1), wheel_speed=wheel_speed, hub_speed=hub)
    assert passes(known, vehicle).all() == counts
    assert not passes(replace(known, yaw_rate=np.full(N, np.nan)), vehicle).any()


def test_left_middle_and_right_of_an_axle(vehicle: Vehicle) -> None:
    assert radii._sides(vehicle).tolist() == [1, -1, 1, -1]
    six = {"a": {"mass": 70, "wheels": ["l", "m", "r"]}, "b": {"mass": 70, "wheels": ["x"]}}
    other = Vehicle.from_dict({**vehicle.to_dict(), "axles": six, "uncertainty": {}})
    assert radii._sides(other).tolist() == [1, 0, -1, 0]


@pytest.mark.parametrize(("apart", "turning"), [(0.039, False), (0.041, True)])
def test_a_turn_shows_in_either_axle_unless_a_yaw_rate_tells_it(
    vehicle: Vehicle, apart: float, turning: bool
) -> None:
    for wheel in range(4):
        windows = table()
        windows.wheel_speed[ODD, wheel ^ 1] *= 1 - apart / 2
        windows.wheel_speed[ODD, wheel] *= 1 + apart / 2
        shown = turns_unseen(windows, vehicle)
        assert shown[ODD] == turning
        assert shown.sum() == turning
        backward = replace(windows, wheel_speed=-windows.wheel_speed)
        assert turns_unseen(backward, vehicle).sum() == turning
        assert not turns_unseen(replace(windows, yaw_rate=np.zeros(N)), vehicle).any()


@pytest.mark.parametrize("of", [driving, usable])
def test_turns_that_nothing_tells_do_not_count(
    vehicle: Vehicle, of: Callable[[Windows, Vehicle], np.ndarray]
) -> None:
    windows = table()
    windows.wheel_speed[ODD, 0] *= 1.05
    assert of(windows, vehicle).sum() == N - 1
    assert of(replace(windows, yaw_rate=np.zeros(N)), vehicle).all()


def test_windows_near_a_border_of_soils_may_be_on_both(vehicle: Vehicle) -> None:
    """Within a wheelbase of .6 m and .3 m more of the middle between two labels; metres of the front axle."""
    soil = np.array(["a"] * 30 + ["b"] * 20 + [""] * 10, dtype=object)
    place = 0.2 * np.arange(60)
    windows = table(60, soil=soil, position=place[:, None] - np.array([0.0, 0.0, 0.6, 0.6]))
    expected = (np.abs(place - 5.9) < 0.9) | (np.abs(place - 9.9) < 0.9)
    np.testing.assert_array_equal(gains._near_border(windows), expected)
    two = replace(
        windows, recording=np.repeat([0, 1], 30), soil=np.array(["a"] * 30 + ["b"] * 30, dtype=object)
    )
    assert not gains._near_border(two).any()  # between logs there is no border
    assert not gains._near_border(table()).any()


def test_unlabelled_track_is_a_soil_every_twenty_metres_of_a_log() -> None:
    windows = table(50, recording=np.repeat([0, 1], 25))
    windows.position[:, 0] = np.r_[0:25, 0:25]
    windows.soil[:5] = "clay"
    codes = gains._soil_codes(windows)
    groups = [set(np.flatnonzero(codes == c).tolist()) for c in np.unique(codes)]
    expected = [set(range(5)), set(range(5, 20)), set(range(20, 25)), set(range(25, 45)), set(range(45, 50))]
    assert sorted(map(min, groups)) == sorted(map(min, expected))
    assert all(group in expected for group in groups)


@pytest.mark.parametrize(("metres", "step"), [(100.0, 4.0), (400.0, 10.0), (4000.0, 20.0)])
def test_stretches_of_track_are_a_fortieth_of_it_within_bounds(metres: float, step: float) -> None:
    windows = table(401)
    windows.position[:] = np.linspace(0.0, metres, 401)[:, None]
    np.testing.assert_array_equal(track_blocks(windows), np.floor(windows.position[:, 0] / step).astype(int))


def test_a_fortieth_is_of_all_logs_together() -> None:
    """Of 300 m and 100 m: 10 m."""
    windows = table(402, recording=np.repeat([0, 1], [301, 101]))
    windows.position[:] = np.r_[0:301, 0:101].astype(float)[:, None]
    expected = np.r_[np.arange(301) // 10, 31 + np.arange(101) // 10]
    np.testing.assert_array_equal(track_blocks(windows), expected)


def test_runs_of_windows_end_with_a_log_and_last_long_enough() -> None:
    wanted = np.array([1, 1, 0, 1, 1, 1, 1, 0, 1], dtype=bool)
    log = np.array([0, 0, 0, 0, 0, 1, 1, 1, 1])
    assert spells(wanted, log, 2) == [slice(0, 2), slice(3, 5), slice(5, 7)]
    assert spells(wanted, log, 1)[-1] == slice(8, 9)
    assert spells(wanted, log, 3) == []
    assert spells(wanted[:0], log[:0], 1) == []


def test_a_standstill_leaves_out_the_windows_of_stop_and_start_but_not_a_logs_own_ends(
    vehicle: Vehicle,
) -> None:
    stops = stopped((0, 4), (10, 14), (20, 23), (36, 40))
    assert standstills(stops, vehicle) == [slice(0, 3), slice(11, 13), slice(37, 40)]
    two = stopped((10, 18), recording=np.repeat([0, 1], [14, 26]))
    assert standstills(two, vehicle) == [slice(11, 14), slice(14, 17)]
    slow = stopped((10, 20))
    for value, count in ((0.029, 1), (0.031, 0)):
        slow.ground_speed[10:20] = -value
        assert len(standstills(slow, vehicle)) == count
        slow.ground_speed[10:20] = 0.0
        slow.wheel_speed[10:20, 2] = value / RADIUS
        assert len(standstills(slow, vehicle)) == count
        slow.wheel_speed[10:20, 2] = 0.0


def test_evidence_is_an_entry_a_log_with_its_span_and_samples() -> None:
    windows = stopped(recording=np.repeat([0, 1], 20), count=np.arange(40.0))
    stops = [slice(2, 4), slice(10, 11), slice(30, 32)]
    first, second = evidence(windows, rows_of(stops), ["a", "b"])
    assert (first.source, first.start, first.end, first.samples) == ("a", 1.0, 5.5, 15)
    assert (second.source, second.start, second.end, second.samples) == ("b", 15.0, 16.0, 61)
    assert evidence(windows, stops[0], ["a", "b"], np.full(40, 3.0))[0].samples == 6


def readings(*means: float, columns: tuple[float, ...] = (1.0,)) -> tuple[Windows, np.ndarray, list[slice]]:
    """Stops of two seconds with a second of driving after each, and what each reads, times each of ``columns``."""
    stops = [slice(6 * k, 6 * k + 4) for k in range(len(means))]
    windows = stopped(*((spell.start, spell.stop) for spell in stops))
    values = np.full(40, 30.0)
    for spell, mean in zip(stops, means, strict=True):
        values[spell] = mean
    return windows, values[:, None] * columns, stops


MOST = np.array([9.0])


@pytest.mark.parametrize(("apart", "alike"), [(0.29, True), (0.31, False)])
def test_stops_are_alike_within_three_errors_of_noise(apart: float, alike: bool) -> None:
    """Of 200 samples with noise of 1 the error of a stop is .0707, and that of a difference .1."""
    windows, values, both = readings(0.0, apart)
    assert resting(windows, values, both, np.full(40, 50.0), 1.0, MOST) == (both if alike else [])
    near = resting(windows, values, both, np.full(40, 50.0), 1.0, MOST, usual=0.1)
    assert near == (both if alike else both[:1])


def test_of_stops_the_most_that_agree_count_and_of_as_many_those_nearest_to_zero() -> None:
    count = np.full(40, 100.0)
    windows, values, five = readings(2.0, 2.0, 2.0, -1.0, 5.0)
    assert resting(windows, values, five, count, 1.0, MOST) == five[:3]
    windows, values, five = readings(2.0, 2.0, -1.0, -1.0, 5.0)
    assert resting(windows, values, five, count, 1.0, MOST) == five[2:4]
    assert resting(windows, values, five, count, 0.0, MOST) == five
    assert resting(windows, values, five, count, 0.0, MOST / 2) == five[:4]
    unread = np.where(np.arange(40)[:, None] >= 24, np.nan, values)
    assert resting(windows, unread, five, count, 0.0, MOST) == five[:4]


def test_of_two_stops_that_agree_the_longer_one_counts_too() -> None:
    """It is surer than the middle between both: of 25 and 400 samples with noise of 1 the errors are .2 and .05."""
    windows, values, both = readings(0.0, 0.5)
    count = np.repeat([6.25, 100.0], [6, 34])
    assert resting(windows, values, both, count, 1.0, MOST) == both


def test_where_one_wheel_holds_the_vehicle_no_wheel_reads_its_zero() -> None:
    windows, values, stops = readings(0.2, 0.2, 0.2, columns=(1.0, 50.0))
    assert resting(windows, values, stops, np.full(40, 100.0), 1.0, np.array([1.0, 9.0])) == []
    assert resting(windows, values, stops, np.full(40, 100.0), 1.0, np.array([1.0, 11.0])) == stops


def test_one_stop_counts_where_it_lasts_and_stops_without_driving_between_are_one() -> None:
    values, count = np.full((40, 1), 0.2), np.full(40, 100.0)
    long, short = [slice(0, 8)], [slice(0, 7)]
    windows = stopped((0, 20))
    assert resting(windows, values, long, count, 1.0, MOST) == long
    assert resting(windows, values, short, count, 1.0, MOST) == []
    assert resting(windows, values, [slice(0, 3), slice(5, 9)], count, 1.0, MOST) == []
    two_logs = replace(windows, recording=np.repeat([0, 1], [4, 36]))
    assert len(resting(two_logs, values, [slice(0, 3), slice(5, 9)], count, 1.0, MOST)) == 2


@pytest.mark.parametrize(("known", "finite"), [(1, False), (2, True)])
def test_a_mean_over_spells_needs_two_windows(known: int, finite: bool) -> None:
    values = np.where(np.arange(4) < known, 2.0, np.nan)
    mean, error = zeros.spell_mean(values, [slice(0, 4)], np.full(4, 100.0), 0.5)
    assert (np.isfinite(mean), np.isfinite(error)) == (finite, finite)


def test_a_yaw_rate_rests_at_its_mean_over_all_samples_of_standstill(vehicle: Vehicle) -> None:
    yaw = np.where(np.arange(40) < 20, 0.02, 0.05)
    yaw[11] = np.nan
    windows = stopped((0, 6), (10, 15), (30, 35), yaw_rate=yaw)
    zero, error = zeros.yaw_rate_zero(windows, vehicle)
    assert zero == pytest.approx((0.02 * (5 + 2) + 0.05 * 3) / 10)
    assert error == pytest.approx(np.std([0.02, 0.02, 0.05], ddof=1) / np.sqrt(3))  # between the stops
    assert zeros.yaw_rate_zero(stopped(yaw_rate=yaw), vehicle) == (0.0, 0.005)  # never stands
    assert zeros.yaw_rate_zero(stopped((0, 6)), vehicle) == (0.0, 0.0)  # no gyroscope


@pytest.mark.parametrize(("scatter", "free"), [(1.9, True), (2.1, False)])
def test_a_bar_that_moves_no_more_than_its_noise_is_free(scatter: float, free: bool) -> None:
    """Windows of 100 samples with noise of 5: .5 each."""
    bar = 3.0 + scatter * 0.5 * np.where(np.arange(40) % 2, 1.0, -1.0)
    windows = stopped(drawbar=bar, drawbar_count=np.full(40, 100.0))
    assert zeros._free_passes(windows, 5.0) == ([slice(0, 40)] if free else [])
    assert zeros._free_passes(stopped((15, 25), drawbar=bar, drawbar_count=np.full(40, 100.0)), 5.0) == []
    slow = replace(windows, ground_speed=np.full(40, 0.09))
    assert zeros._free_passes(slow, 5.0) == []


def test_windows_of_a_single_sample_count_where_all_are_such(vehicle: Vehicle) -> None:
    """A log of 2 Hz."""
    assert driving(table(count=np.ones(N)), vehicle).all()
