"""Motion by positions on paths whose speed and turn are known in closed form."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from terragrip.recording import Recording
from terragrip.recording.track import Track, _fitted, _grade, track_of

METRES = 111_132.954 - 559.822 + 1.175  # m a degree of latitude at the equator (series of the meridian arc)
Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def positions(time: np.ndarray, path: Path, **more: np.ndarray) -> Recording:
    """A path north and east [m] beside the equator, where a degree of longitude is 111 320 m."""
    north, east = path(time)
    return Recording(time, {"latitude": north / METRES, "longitude": 179.9999 + east / 111_319.491, **more})


def circle(turn: float, speed: float) -> Path:
    return lambda t: (speed / turn * np.sin(turn * t), -speed / turn * (np.cos(turn * t) - 1))


def tracked(recording: Recording) -> Track:
    track = track_of(recording)
    assert track is not None
    return track


def test_a_parabola_and_its_deviations_are_those_of_numpy() -> None:
    draws = np.random.default_rng(5)
    ago = np.sort(draws.uniform(-3.0, 3.0, 11))
    values = 1.0 - 2.0 * ago + 0.5 * ago**2 + 0.1 * draws.standard_normal(11)
    for degree in (1, 2, 3):
        result, spread = _fitted(ago, values, np.array([5]), 11, degree)
        expected, covariance = np.polyfit(ago - ago[5], values - values[5], degree, cov=True)
        np.testing.assert_allclose(result[0], expected[::-1], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(spread[0], np.sqrt(np.diag(covariance))[::-1], rtol=1e-9)


def test_windows_are_looked_at_in_blocks_that_give_the_same_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fixes at 300 Hz, as a time in minutes makes them: all windows together would take 19 MB for each of ten arrays."""
    time = np.arange(0.0, 15.0, 1 / 300)
    recording = positions(time, circle(0.3, 2.0), altitude=100 + 0.05 * time**2)
    found = []
    for block in (10**9, 200_000):
        monkeypatch.setattr("terragrip.recording.track._BLOCK", block)
        tracemalloc.start()
        try:
            track = tracked(recording)
            found.append([track.speed, track.turn, track.grade])
            most = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
    assert most < 25e6
    assert np.isfinite(found[0]).any(axis=1).all()
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize("turn", [0.3, -0.3, 0.1])
@pytest.mark.parametrize("speed", [2.0, -2.0])
def test_on_a_circle_turn_is_to_the_left_and_speed_what_is_driven(turn: float, speed: float) -> None:
    """At 5 Hz; forward to the right is north to east, so minus; driving it in reverse turns the machine alike."""
    time = np.arange(0.0, 20.0, 0.2)
    track = tracked(positions(time, circle(turn, speed)))
    np.testing.assert_allclose(track.turn, -turn, rtol=0.02)
    np.testing.assert_allclose(track.speed, 2.0, rtol=0.02)
    np.testing.assert_array_equal(track.time, time[5:-5])  # 11 fixes a window of 2 s
    north, east = circle(turn, speed)(time[5:-5])
    np.testing.assert_allclose(track.north - track.north[0], north - north[0], atol=0.01)
    np.testing.assert_allclose(track.east - track.east[0], east - east[0], atol=0.01)
    assert not track.gap.any()


def test_speed_on_a_straight_line_is_exact_where_it_changes_evenly_and_stamps_are_uneven() -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(0.8, 1.2, 40))
    track = tracked(positions(time, lambda t: (1.0 * t + 0.05 * t**2, 0 * t)))
    np.testing.assert_allclose(track.speed, 1.0 + 0.1 * time[2:-2], rtol=1e-3)
    np.testing.assert_allclose(track.turn, 0.0, atol=1e-9)


def test_repeated_positions_are_no_fixes_and_missing_ones_no_rows() -> None:
    time = np.arange(0.0, 60.0, 0.2)
    updates = np.arange(len(time)) // 5 * 5
    log = positions(time, circle(0.1, 2.0))
    held = {name: values[updates] for name, values in log.channels.items()}
    held["latitude"] = np.where(np.arange(len(time)) % 10 == 7, np.nan, held["latitude"])
    track = tracked(Recording(time, held))
    np.testing.assert_array_equal(track.time, time[::5][2:-2])
    np.testing.assert_allclose(track.turn, -0.1, rtol=0.02)
    # a path along one meridian or one parallel has fixes too
    for path in (lambda t: (t, 0 * t), lambda t: (0 * t, t)):
        assert len(tracked(positions(np.arange(20.0), path)).time) == 16


@pytest.mark.parametrize(("fixes", "known"), [(9, 0), (10, 6), (11, 7)])
def test_under_ten_fixes_nothing_is_known(fixes: int, known: int) -> None:
    track = track_of(positions(np.arange(float(fixes)), lambda t: (t, t)))
    assert (0 if track is None else len(track.time)) == known
    assert track_of(Recording(np.arange(20.0), {"latitude": np.arange(20.0)})) is None
    assert track_of(positions(np.arange(0.0, 1.0, 0.1), lambda t: (t, t))) is None  # shorter than a window


def test_a_creeping_vehicle_has_no_course() -> None:
    for speed, known in ((0.31, True), (0.29, False)):
        track = tracked(positions(np.arange(60.0), circle(0.02, speed), altitude=np.arange(60.0)))
        assert np.isfinite(track.turn).all() == known
        if not known:
            assert np.isnan(track.grade).all()


def test_where_fixes_are_missing_for_long_is_marked() -> None:
    time = np.r_[0.0:30.0, 42.0:80.0, 83.0:100.0]
    track = tracked(positions(time, circle(0.1, 1.0)))
    wide = {
        t
        for t in time
        if np.ptp(np.sort(time[np.argsort(np.abs(np.arange(len(time)) - list(time).index(t)))[:5]])) > 12
    }
    np.testing.assert_array_equal(track.gap, [t in wide for t in track.time])
    assert 2 <= track.gap.sum() <= 4
    assert np.isnan(track.turn[track.gap]).all()
    assert np.isfinite(track.turn[~track.gap]).all()


@pytest.mark.parametrize(("noise", "known"), [(0.028, True), (0.045, False)])
def test_a_turn_is_given_to_three_hundredths_of_a_radian_a_second(noise: float, known: bool) -> None:
    """Of a parabola through 11 positions at 5 Hz, each to s, y'' is known to s/(.04 (858/4)^(1/2)) = 1.7 s (Savitzky and Golay)."""
    time, draws = np.arange(0.0, 60.0, 0.2), np.random.default_rng(3)
    track = tracked(
        positions(time, lambda t: tuple(x + noise * draws.standard_normal(300) for x in circle(0.1, 2.0)(t)))
    )
    assert np.isfinite(track.turn).mean() > 0.99 if known else np.isnan(track.turn).all()


def test_a_grade_needs_four_metres_on_either_side() -> None:
    """Up 3 % at a metre a second, from a stop to a stop."""
    time = np.arange(60.0)
    speed = ((time >= 15) & (time < 45)).astype(float)
    way = np.r_[0.0, np.cumsum((speed[1:] + speed[:-1]) / 2)]
    grade = _grade(time, speed, 0.03 * way)
    known = (way > 4.0) & (way < way[-1] - 4.0)
    np.testing.assert_array_equal(np.isfinite(grade), known)
    np.testing.assert_allclose(grade[known], np.arctan(0.03))


def test_altitude_is_that_of_the_instant() -> None:
    time = np.arange(40.0)
    height = np.where(time % 2 == 0, 100.0 + 3.0 * time, np.nan)
    track = tracked(positions(time, lambda t: (t, t), altitude=height))
    np.testing.assert_allclose(track.altitude, 100.0 + 3.0 * track.time)
    one = np.where(time == 4, 100.0, np.nan)
    assert np.isnan(tracked(positions(time, lambda t: (t, t), altitude=one)).altitude).all()
    assert np.isnan(tracked(positions(time, lambda t: (t, t))).grade).all()


def test_positions_interpolated_to_the_rate_of_the_wheels_turn_as_those_of_the_receiver() -> None:
    """A circle of 10 m at 1 m/s, by a receiver of 10 Hz that errs by 1 cm, in a log of 100 Hz: ten fixes a second are enough."""
    receiver, log = np.arange(0.0, 60.0, 0.1), np.arange(0.0, 59.9, 0.01)
    noise = 0.01 * np.random.default_rng(3).standard_normal((2, len(receiver)))
    east, north = 10.0 * np.cos(receiver / 10.0) + noise[0], 10.0 * np.sin(receiver / 10.0) + noise[1]
    angles = {
        "latitude": 48.0 + north / 111_200.0,
        "longitude": 11.0 + east / (111_320.0 * np.cos(np.radians(48.0))),
    }
    plain = track_of(Recording(receiver, angles), 4.0)
    dense = track_of(Recording(log, {n: np.interp(log, receiver, v) for n, v in angles.items()}), 4.0)
    assert plain is not None
    assert dense is not None
    assert len(dense.time) < 1.1 * len(plain.time)
    when = np.arange(5.0, 55.0)
    np.testing.assert_allclose(dense.at("turn", when), 0.1, atol=0.01)
    np.testing.assert_allclose(dense.at("turn", when), plain.at("turn", when), atol=0.003)
    np.testing.assert_allclose(dense.at("speed", when), 1.0, atol=0.02)
