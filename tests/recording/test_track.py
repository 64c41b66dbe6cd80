"""Grade by positions and altitude, of slopes that are known."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording
from terragrip.recording.track import Track, track_of

UP = 0.03  # rise over way


def uphill(step: float, fixes: int = 400, noise: float = 0.0) -> Track:
    """Straight north at a fix a second, ``step`` metres apart, up a slope of 3 %, the altitude to ``noise`` [m]."""
    time = np.arange(float(fixes))
    way = step * time
    height = 100.0 + UP * way + noise * np.random.default_rng(14).standard_normal(fixes)
    latitude = 48.0 + way / 111_200.0
    track = track_of(
        Recording(time, {"latitude": latitude, "longitude": np.full(fixes, 11.0), "altitude": height})
    )
    assert track is not None
    return track


@pytest.mark.parametrize("step", [0.5, 2.0, 4.0, 12.0])
def test_a_slope_is_the_grade_however_far_apart_the_fixes_are(step: float) -> None:
    grade = uphill(step).grade
    known = np.isfinite(grade)
    assert known.mean() > 0.9
    np.testing.assert_allclose(grade[known], np.arctan(UP), rtol=0.002)


def test_a_grade_is_given_where_it_is_known_to_two_per_cent_and_not_where_it_is_vaguer() -> None:
    """Of a cubic through many (n) heights over L metres, each to s, the slope is known to s/L (75/n)^(1/2): Legendre's polynomials."""
    step, length = 0.4, 16.0
    n = length / step
    scale = np.sqrt(75 / n) / length  # rad a metre
    certain, vague = 0.5 * 0.02 / scale, 2 * 0.02 / scale
    grade = uphill(step, noise=certain).grade
    known = np.isfinite(grade)
    assert known.mean() > 0.8
    assert np.std(grade[known]) == pytest.approx(0.01, rel=0.3)
    assert certain > 0.02  # the height itself is not known so well
    assert np.isnan(uphill(step, noise=vague).grade).all()


def test_between_fixes_a_track_is_known_for_two_seconds_on_either_side() -> None:
    time = np.r_[0.0:11.0, 20.0:31.0]
    nothing = np.zeros(len(time))
    track = Track(time, nothing, nothing, 1.0 + 0.1 * time, nothing, nothing, nothing.astype(bool))
    when = np.array([-3.0, -1.0, 5.5, 11.9, 12.1, 17.9, 18.1, 31.0, 33.0])
    speed = track.at("speed", when)
    assert np.isnan(speed).tolist() == [True, False, False, False, True, True, False, False, True]
    np.testing.assert_allclose(speed[[2, 3, 6]], 1.0 + 0.1 * when[[2, 3, 6]])


def test_of_a_vehicle_that_turns_on_the_spot_positions_show_no_turn() -> None:
    """They gave a line between the turns before and behind, of either sign: the gyroscope of an outsider's mower, which was right, turned
    'with the wheels' speeds and against the positions: check the positions'."""
    time = np.arange(0.0, 44.0, 0.2)
    north = 0.8 * np.where(
        time < 20, time, np.where(time < 24, 20.0, 44.0 - time)
    )  # there, round in 4 s, and back
    north += 0.01 * np.random.default_rng(3).standard_normal(len(time))
    places = {"latitude": 48.0 + north / 111_200.0, "longitude": np.full(len(time), 11.0)}
    track = track_of(Recording(time, places))
    assert track is not None
    turn = track.at("turn", time)
    assert np.isnan(turn[(time > 20.6) & (time < 23.4)]).all()
    assert np.nanmax(np.abs(turn[(time > 2) & (time < 18)])) < 0.2


def test_where_positions_jump_to_another_correction_no_turn_is_known() -> None:
    """A lane of 3 m for a minute: each jump was a turn, and adhesion three times as far off, without a word."""
    time = np.arange(0.0, 60.0, 0.1)
    aside = np.where((time > 20) & (time < 40), 3.0, 0.0) + 0.02 * np.random.default_rng(3).standard_normal(
        len(time)
    )
    channels = {"latitude": 48.0 + 2.0 * time / 111_200.0, "longitude": 11.0 + aside / 74_400.0}
    track = track_of(Recording(time, channels), 4.0)
    assert track is not None
    np.testing.assert_allclose(track.jumps, [20.1, 40.0], atol=0.11)
    near = (np.abs(track.time[:, None] - [20.05, 39.95]) < 2.1).any(axis=1)
    assert np.isnan(track.turn[near]).mean() > 0.9
    assert np.nanmax(np.abs(track.turn)) < 0.05


@pytest.mark.parametrize(("speed", "rate", "jump"), [(0.6, 5.0, 0.4), (0.3, 2.0, 0.7), (2.5, 5.0, 0.9)])
def test_a_jump_is_one_beside_what_the_vehicle_drives_between_two_fixes(
    speed: float, rate: float, jump: float
) -> None:
    """Under a metre none was: a robot's slip was two to four times as far off, and its interval held in 80 % of the rows."""
    time = np.arange(0.0, 120.0, 1 / rate)
    course = 0.8 * np.sin(time / 6.0)
    way = [np.cumsum(speed / rate * f(course)) for f in (np.cos, np.sin)]
    north, east = np.add(way, 0.01 * np.random.default_rng(9).standard_normal((2, len(time))))

    def of(aside: np.ndarray) -> Track:
        channels = {"latitude": 48.0 + north / 111_200.0, "longitude": 11.0 + (east + aside) / 74_400.0}
        track = track_of(Recording(time, channels), 4.0)
        assert track is not None
        return track

    assert not len(of(np.zeros(len(time))).jumps)
    there = of(np.where((time > 40.0) & (time < 80.0), jump, 0.0))
    np.testing.assert_allclose(there.jumps, [40.0, 80.0], atol=1.01 / rate)
    assert np.nanmax(np.abs(there.turn + 0.8 / 6.0 * np.cos(there.time / 6.0))) < 0.05
