"""The balance of forces in windows: fits, means and limits against closed forms and NumPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from terragrip.recording import Recording
from terragrip.recording.mechanics import (
    Fit,
    Means,
    _balance_warnings,
    _dead_warnings,
    _scale_sentence,
    _thrust_warnings,
    means_of,
    motion_warnings,
    thrusts_of,
)
from terragrip.recording.pitch import pitch_warnings
from terragrip.recording.rolling import radius_warnings
from terragrip.recording.window_means import window_means
from terragrip.vehicle import Vehicle

G = 9.80665
WHEELS = ("fl", "fr", "rl", "rr")
RADIUS, MASS = 0.2, 139.0


def windows(n: int, climb: np.ndarray | None = None) -> Means:
    """n windows of one row each, all of them used."""
    return Means(np.arange(n), np.arange(float(n)), np.ones(n, dtype=bool), np.zeros(n), np.ones(n), climb)


@pytest.mark.parametrize(
    ("slope", "error", "alike", "off", "another"),
    [
        (1.3, 0.1, 0.9, False, False),
        (1.31, 0.1, 0.9, True, False),
        (0.69, 0.1, 0.9, True, False),
        (2.125, 0.1, 0.9, True, True),  # surely above 1.8
        (2.05, 0.1, 0.9, True, False),
        (2.125, 0.1, 0.69, True, False),  # not alike
        (0.3, 0.02, 0.9, True, True),  # 0.3/.81 + .06 is below 1/1.8
        (0.42, 0.02, 0.9, True, False),  # noise may have flattened it
        (0.42, 0.02, 1.0, True, True),
        (-1.0, 0.1, -0.9, True, True),
        (-1.0, 0.1, -0.69, True, False),
        (0.5, np.inf, 1.0, False, False),
    ],
)
def test_a_slope_is_another_one_beyond_three_errors_and_what_noise_flattens(
    slope: float, error: float, alike: float, off: bool, another: bool
) -> None:
    fit = Fit(slope, error, alike)
    assert (fit.is_off(), fit.is_another_scale) == (off, another)


def test_how_far_a_slope_is_from_one_is_a_factor() -> None:
    assert Fit(4.0).distance == pytest.approx(np.log(4.0)) == Fit(0.25).distance
    assert Fit(-4.0).distance == np.inf
    assert Fit(0.0).distance == np.inf
    assert Fit() == Fit(0.0, np.inf, 0.0)


def test_without_a_ground_speed_there_are_no_means() -> None:
    time = np.arange(0.0, 100.0, 0.1)
    assert means_of(Recording(time, {"ground_speed": np.full(1000, np.nan)})) is None
    assert means_of(Recording(time, {"wheel_speed_l": np.ones(1000)})) is None
    assert means_of(Recording(time, {"ground_speed": np.ones(1000)})) is not None


def test_means_of_windows_with_holes() -> None:
    place = np.array([0, 0, 1, 1, 1, 3])
    values = np.array([1.0, 3.0, np.nan, 5.0, 7.0, np.nan])
    np.testing.assert_array_equal(window_means(values, place, 4), [2.0, 6.0, np.nan, np.nan])


def test_a_channel_is_averaged_like_the_change_of_speed() -> None:
    """(v[k+1] - v[k-1])/2 is the mean of the acceleration with weights 1, 2, 1 over the windows."""
    values = np.array([1.0, 5.0, 2.0, 8.0, np.nan, 3.0])
    np.testing.assert_array_equal(windows(6).of(values), [np.nan, 3.25, 4.25, np.nan, np.nan, np.nan])


@pytest.mark.parametrize("climbing", [False, True])
def test_slope_and_error_are_those_of_a_regression_and_a_jackknife(climbing: bool) -> None:
    draws = np.random.default_rng(4)
    x, climb = draws.normal(3.0, 1.0, 64), draws.normal(size=64)
    y = 2.0 + 1.5 * x + 0.7 * climb + 0.1 * draws.normal(size=64)
    y[5] = x[9] = np.nan
    fit = windows(64, climb).fit(y, x, beside=climb if climbing else None)
    known = np.isfinite(y + x)
    common = np.column_stack([np.ones(62), *((climb[known],) if climbing else ())])
    y, x = (v - common @ np.linalg.lstsq(common, v, rcond=None)[0] for v in (y[known], x[known]))
    block = np.repeat(np.arange(10), 7)[: len(y)]
    block = np.arange(62) * 10 // 62
    without = [np.polyfit(x[block != k], y[block != k], 1)[0] for k in range(10)]
    assert fit.slope == pytest.approx(np.polyfit(x, y, 1)[0])
    assert fit.error == pytest.approx(np.sqrt(9 / 10 * np.sum((without - np.mean(without)) ** 2)))
    assert fit.alike == pytest.approx(np.corrcoef(x, y)[0, 1])


def test_under_25_windows_or_without_change_nothing_is_fitted() -> None:
    x = np.arange(25.0)
    assert windows(25).fit(2 * x, x).slope == pytest.approx(2.0)
    assert windows(24).fit(2 * x[:24], x[:24]) == Fit()
    assert windows(25).fit(np.ones(25), x) == Fit()
    assert windows(25).fit(x, np.ones(25)) == Fit()
    climb = np.where(x == 3, np.nan, x**2)
    assert windows(25, climb).fit(2 * x, x).slope == pytest.approx(2.0)
    assert windows(25, climb).fit(2 * x, x, beside=climb) == Fit()


@pytest.mark.parametrize(("step", "length"), [(0.1, 1.0), (0.5, 1.0), (1.0, 2.0)])
def test_windows_last_a_second_and_two_samples(step: float, length: float) -> None:
    time = 50.0 + step * np.arange(round(60 * length / step))
    speed = 1.0 + 0.03 * (time - 50.0)
    pitch = np.full(len(time), 0.1)
    means = means_of(Recording(time, {"ground_speed": speed, "pitch": pitch}))
    assert means is not None
    assert means.count == 60
    assert means.rows.sum() == 58
    np.testing.assert_allclose(means.change, 0.03)
    np.testing.assert_allclose(means.speed, speed.reshape(60, -1).mean(axis=1)[1:-1])
    np.testing.assert_allclose(means.climb, G * np.sin(0.1))


def test_standing_windows_and_backward_driving_do_not_count() -> None:
    time = np.arange(0.0, 60.0, 0.5)
    for slow, count in ((0.14, 29), (0.16, 58)):
        means = means_of(Recording(time, {"ground_speed": np.where(time < 30, 1.0, slow)}))
        assert means is not None
        assert means.rows.sum() == count
        assert means.climb is None
    assert means_of(Recording(time, {"ground_speed": np.full(120, -1.0)})) is None
    backward = np.where(time < 29, 1.0, -1.0)  # more backward than forward
    assert means_of(Recording(time, {"ground_speed": backward})) is None
    assert means_of(Recording(time[:20], {"ground_speed": np.ones(20)})) is None
    assert means_of(Recording(time, {})) is None
    for seconds, enough in ((26.0, False), (26.5, True)):
        rows = time < seconds
        assert (means_of(Recording(time[rows], {"ground_speed": np.ones(rows.sum())})) is not None) is enough
    assert means_of(Recording(np.r_[time[1:], 0.0], {"ground_speed": np.ones(120)})) is None


def test_thrust_of_a_wheel_is_torque_over_radius_less_its_share_of_the_pull(vehicle: Vehicle) -> None:
    time = np.arange(0.0, 60.0, 0.5)
    channels = {"ground_speed": np.ones(120), "drawbar_force": np.full(120, 200.0)}
    channels |= {f"drive_torque_{w}": np.full(120, 10.0 + k) for k, w in enumerate(WHEELS)}
    log = Recording(time, channels)
    means = means_of(log)
    assert means is not None
    thrusts = thrusts_of(log, vehicle, means)
    for k, wheel in enumerate(WHEELS):
        np.testing.assert_allclose(thrusts[wheel], ((10.0 + k) / RADIUS - 50.0) / MASS)
    free = Recording(time, {n: v for n, v in channels.items() if n != "drawbar_force"})
    np.testing.assert_allclose(thrusts_of(free, vehicle, means)["fl"], 10.0 / RADIUS / MASS)
    assert (
        thrusts_of(
            Recording(time, {n: v for n, v in channels.items() if n != "drive_torque_rr"}), vehicle, means
        )
        == {}
    )


X = np.sin(np.arange(80) / 3.0) + 0.3 * np.sin(np.arange(80))


def torques(turned: tuple[str, ...] = (), **more: np.ndarray) -> Recording:
    """Wheels that drive on average and push by X in all, but those of a wrong sign."""
    torque = 10.0 + X / 4 * RADIUS * MASS
    mine = {f"drive_torque_{w}": -torque if w in turned else torque for w in WHEELS}
    return Recording(np.arange(80.0), mine | more)


@pytest.mark.parametrize(
    ("forward", "thrust", "words"),
    [  # what accelerometer and torques make of a change of speed of 1
        (1.0, 1.0, ""),
        (1.0, 1.7, ""),
        (1.0, 1.9, "radius are 1.9 times the force that moves 139 kg"),
        (1.0, 0.5, "radius are 0.5 times the force"),
        (1.0, -1.0, "The drive torques fall where the vehicle is driven harder"),
        (-1.0, 1.0, "acceleration_x is not the change of ground speed but its opposite, and the drive torques contradict it"),
        (0.1, 1.0, "acceleration_x is not the change of ground speed but 0.1 times what the drive torques give for 139 kg"),
        (3.0, 1.0, "but 3 times what the drive torques give"),
        (2.0, 0.5, "The drive torques over radius and mass and acceleration_x go 0.25 times apart"),
    ],
)  # fmt: skip
def test_which_of_torques_and_accelerometer_is_wrong_the_speed_decides(
    vehicle: Vehicle, forward: float, thrust: float, words: str
) -> None:
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80))
    log = torques()
    thrusts = dict.fromkeys(WHEELS, thrust * X / 4)
    notes = _balance_warnings(log, replace(means, thrusts=thrusts), forward * X, vehicle)
    assert " ".join(notes) == "" if not words else words in " ".join(notes)
    alone = _balance_warnings(log, means, forward * X, vehicle)
    assert ("but its opposite: forward is positive" in " ".join(alone)) is (forward < 0)


@pytest.mark.parametrize(("slope", "opposite"), [(-0.29, False), (-0.31, True)])
def test_an_accelerometer_alone_is_backward_from_three_errors_below_none(
    slope: float, opposite: bool
) -> None:
    class Fits(Means):
        def fit(self, *values: Any, **options: Any) -> Fit:
            return Fit(slope, 0.1, -0.5)

    means = Fits(np.arange(3), 3, np.ones(3, dtype=bool), np.zeros(3), np.ones(3), None)
    notes = _balance_warnings(Recording(np.arange(3.0), {}), means, np.zeros(3), None)
    assert [note.startswith("acceleration_x is not the change") for note in notes] == [True] * opposite


@pytest.mark.parametrize(
    ("turned", "words"), [(("rl", "fr"), "drive_torque_fr, drive_torque_rl: the other"), ((), "")]
)
def test_wheels_that_drive_against_the_others_are_named(
    vehicle: Vehicle, turned: tuple[str, ...], words: str
) -> None:
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80))
    thrusts = {w: (-1 if w in turned else 1) * X / 4 for w in WHEELS}
    notes = " ".join(_balance_warnings(torques(turned), replace(means, thrusts=thrusts), X, vehicle))
    assert notes == "" if not words else words in notes


def test_wheels_without_a_drive_beside_a_trailer_have_no_wrong_sign(vehicle: Vehicle) -> None:
    """Four-wheel drive is off: their sensors' zeros, less their share of what a trailer pulls, fall as the others' thrust rises."""
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80))
    free = {f"drive_torque_{w}": np.full(80, -0.1) - 0.01 * X for w in WHEELS[:2]}
    pull, rough = 2 * X, 1.5 * np.cos(np.arange(80) * 2.1)
    thrusts = dict.fromkeys(WHEELS[:2], -pull / 4) | dict.fromkeys(
        WHEELS[2:], (X + pull + rough) / 2 - pull / 4
    )
    assert _balance_warnings(torques(**free), replace(means, thrusts=thrusts), X, vehicle) == []


def test_no_wheel_goes_against_the_others_where_all_are_turned(vehicle: Vehicle) -> None:
    """Less a pull that is as large they do not go with the motion; turned, the torques alone would."""
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80))
    pull = 3 * np.cos(np.arange(80) / 7)
    log = torques(**{f"drive_torque_{w}": -10.0 - (X + pull) / 4 * RADIUS * MASS for w in WHEELS})
    thrusts = dict.fromkeys(WHEELS, -(X + pull) / 4 - pull / 4)
    assert _balance_warnings(log, replace(means, thrusts=thrusts), X, vehicle) == []


def test_torques_that_go_with_the_other_axis_are_told(vehicle: Vehicle) -> None:
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80))
    log = torques(acceleration_y=np.convolve(X, [0.0, 1.0, 0.0], "same"))
    sideways = np.random.default_rng(1).normal(size=80)
    (note,) = _balance_warnings(log, replace(means, thrusts=dict.fromkeys(WHEELS, X / 4)), sideways, vehicle)
    assert note.startswith("acceleration_y varies with the drive torques")


@pytest.mark.parametrize(
    ("slope", "with_roll", "words"),
    [(1.0, False, ""), (-1.0, False, "pitch falls"), (0.0, True, "vary with roll")],
)
def test_pitch_is_held_against_what_the_accelerometer_reads_beyond_the_speed(
    slope: float, with_roll: bool, words: str
) -> None:
    climb, roll = 0.3 * X, 0.1 * np.cos(np.arange(80) / 5.0)
    means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80), climb)
    log = Recording(np.arange(80.0), {"roll": roll, "pitch": np.arcsin(climb / G)})
    seen = means.of(np.sin(roll)) if with_roll else slope * climb
    notes = pitch_warnings(log, means, np.nan_to_num(X + seen))
    assert " ".join(notes) == "" if not words else words in notes[0]
    assert pitch_warnings(log, windows(80), X) == []


def test_what_a_wrong_scale_is_told_by() -> None:
    vehicle = Vehicle.from_dict(
        {
            "mass": 139,
            "axles": {"a": {"mass": 139, "wheels": ["l"]}},
            "wheel": {"radius": 0.2, "inertia": 0.1},
        }
    )
    assert "are 0.033 times the force that moves 139 kg" in _scale_sentence(1 / 30, vehicle)
    assert "A trailer whose drawbar_force is not in the log looks the same" in _scale_sentence(4.8, vehicle)
    assert "fall where" in _scale_sentence(-0.1, vehicle)


def test_a_channel_that_never_changes_beside_others_that_do(vehicle: Vehicle) -> None:
    moving, still = np.arange(50.0), np.where(np.arange(50) % 2, 3.25, np.nan)
    names = [f"wheel_speed_{w}" for w in WHEELS]

    def notes(*dead: str) -> list[str]:
        return _dead_warnings(Recording(moving, {n: still if n in dead else moving for n in names}), vehicle)

    assert notes() == []
    assert notes(*names) == []
    torques = Recording(moving, {f"drive_torque_{w}": 0.0 * moving for w in WHEELS})
    assert "drive_torque_rr (0) never change while the vehicle drives" in _dead_warnings(torques, vehicle)[0]
    assert notes(names[1]) == [
        "wheel_speed_fr (3.25) never changes while the vehicle drives: the sensor is dead, or the column is wrong."
    ]
    assert notes(*names[:2])[0].startswith(
        "wheel_speed_fl (3.25) and wheel_speed_fr (3.25) never change while"
    )
    empty = Recording(moving, {names[0]: np.full(50, np.nan), names[1]: moving})
    assert _dead_warnings(empty, vehicle) == []


LIGHT = 0.12 * RADIUS * MASS * G / 4  # N m that no ground lets a wheel slip by


@pytest.mark.parametrize(
    ("ratio", "torque", "doubted"),
    [
        (1.0, 0.5, False),
        (0.72, 0.5, False),  # rolls .28 too little
        (0.6, 0.5, True),
        (0.58, 0.95, True),  # .42, where a torque of .114 of the load may slip it by as much
        (0.68, 1.05, False),  # a torque that may slip it
        (0.68, -0.95, True),
        (1.28, 0.5, False),
        (1.32, 0.5, True),
        (0.44, 0.5, False),  # 1/.44 > 2.2: a unit, which is told elsewhere
        (1.7, 0.5, False),  # 1/1.7 < .6
    ],
)
def test_slip_at_hardly_a_torque_is_a_wrong_radius(
    vehicle: Vehicle, ratio: float, torque: float, doubted: bool
) -> None:
    time = np.arange(0.0, 60.0, 0.5)
    channels = {"ground_speed": np.full(120, 1.0)}
    for wheel in WHEELS:
        channels[f"wheel_speed_{wheel}"] = np.full(120, 1.0 / (ratio * RADIUS))
        channels[f"drive_torque_{wheel}"] = np.full(120, torque * LIGHT)
    log = Recording(time, channels)
    means = means_of(log)
    assert means is not None
    notes = [note for note in radius_warnings(log, vehicle, means) if note.startswith("With hardly")]
    assert bool(notes) is doubted
    if doubted:
        assert f"the wheels fl, fr, rl, rr slip by {1 - ratio:.2f}" in notes[0]
        assert f"they roll {ratio * RADIUS:.3g} m per radian, but the stated radius is 0.2 m" in notes[0]
    few = Recording(time, {n: v for n, v in channels.items() if n != "drive_torque_fl"})
    assert ("fr, rl, rr slip" in " ".join(radius_warnings(few, vehicle, means))) is doubted


def test_without_motion_or_vehicle_nothing_is_said(vehicle: Vehicle) -> None:
    time = np.arange(0.0, 60.0, 0.5)
    for speed in (np.zeros(120), np.ones(120)):
        log = Recording(time, {"ground_speed": speed})
        assert motion_warnings(log, vehicle, means_of(log)) == []
    change = np.sin(time / 3)
    speed = 10.0 + np.cumsum(change) * 0.5
    log = Recording(time, {"ground_speed": speed, "acceleration_x": -change})
    notes = motion_warnings(log, None, means_of(log))
    assert notes == [
        "acceleration_x is not the change of ground speed but its opposite: forward is positive; write 'sign: -1' for it in the profile."
    ]


@pytest.mark.parametrize(
    ("scale", "words"), [(1.0, ""), (1.9, "are 1.9 times the force"), (-1.0, "fall where")]
)
def test_without_an_accelerometer_change_of_speed_and_climb_tell(
    vehicle: Vehicle, scale: float, words: str
) -> None:
    climb = np.cos(np.arange(80) / 5.0)
    for grade in (None, climb):
        means = Means(np.arange(80), np.arange(80.0), np.ones(80, dtype=bool), X, np.ones(80), grade)
        force = X + (0.0 if grade is None else grade)
        notes = " ".join(
            _thrust_warnings(replace(means, thrusts=dict.fromkeys(WHEELS, scale * force / 4)), vehicle)
        )
        assert notes == "" if not words else words in notes
    assert _thrust_warnings(means, vehicle) == []
