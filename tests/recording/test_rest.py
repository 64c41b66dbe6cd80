"""A ground speed, or torques, that are not 0 where the wheels stand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from steady_drive import TIME, log
from terragrip.estimation.noise import settings_in
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.rest import noise_at_rest, rest_warnings, torque_rest_warnings, turn_rest_warnings
from terragrip.vehicle import Vehicle

STOPS = (np.abs(TIME - 60) < 8) | (np.abs(TIME - 140) < 6)


WHEEL = {"wheel": {"radius": 0.3, "inertia": 0.5}}


def stopping(shift: float = 0.0, noise: np.ndarray | float = 0.0) -> Recording:
    """The drive with two stops more; the ground speed reads ``shift`` [m/s] too much."""
    drive = {n: v for n, v in log().channels.items() if n != "acceleration_x"}  # it would see other stops
    held = {n: np.where(STOPS, 0.0, v) for n, v in drive.items() if "speed" in n}
    draws = 0.005 * np.random.default_rng(3).standard_normal(len(TIME))
    return Recording(TIME, drive | held | {"ground_speed": held["ground_speed"] + shift + draws + noise})


@pytest.mark.parametrize("shift", [0.15, -0.15, 0.1])
def test_a_zero_that_is_off_is_named_with_its_size(shift: float) -> None:
    """Slip was .08 off at 1.9 m/s, and the zero-slip radius of a tractor 15 %, without a word."""
    (note,) = unit_warnings(stopping(shift), None)
    assert note.startswith(f"ground_speed reads {shift:.2g} m/s in 3 stops of all wheels")
    off = float(note.split("at usual speed by ")[1].split(",")[0])
    assert off == pytest.approx(abs(shift) / 2, rel=0.15)


def test_a_right_zero_noise_without_a_sign_and_creeping_are_left_alone() -> None:
    assert rest_warnings(stopping()) == []
    assert rest_warnings(stopping(0.03)) == []
    receiver = np.abs(np.random.default_rng(4).normal(0, 0.1, (2, len(TIME)))).max(axis=0)
    assert rest_warnings(stopping(0.0, np.where(STOPS, receiver, 0.0))) == []
    creep = np.where(np.abs(TIME - 60) < 8, 0.2, 0.0)  # in one stop of three: it slid
    assert rest_warnings(stopping(0.0, creep)) == []


@pytest.mark.parametrize("shift", [0.0, 0.1])
def test_the_error_of_a_filtered_receiver_shows_where_the_wheels_stand(shift: float) -> None:
    """It lasts for seconds, so fast changes show a fifth of it; a zero that is off is no noise."""
    step = float(np.median(np.diff(TIME)))
    kept, draws = np.exp(-step / 1.5), np.random.default_rng(5).standard_normal(len(TIME))
    error = lfilter([0.04 * np.sqrt(1 - kept**2)], [1, -kept], draws)
    vehicle = Vehicle.from_dict(
        {"name": "cart", "mass": 300, "axles": {"a": {"mass": 300, "wheels": ["l", "r"]}}} | WHEEL
    )
    noise = settings_in(stopping(shift, error), vehicle)[0]["ground_speed"]
    assert 0.025 < noise < 0.055
    assert settings_in(stopping(shift), vehicle)[0]["ground_speed"] < 0.015


def test_where_the_vehicle_drives_by_its_ground_speed_no_noise_is_shown() -> None:
    """Wheel speeds of 0 for 15 s of driving made it .95 m/s, of .02, where there was one true stop."""
    time = np.arange(0, 200, 0.05)
    speed = np.where((time > 50) & (time < 65), 0.0, 2 + 0.3 * np.sin(time / 3))
    lost = np.where((time > 120) & (time < 135), 0.0, speed) / 0.3
    noisy = speed + 0.02 * np.random.default_rng(0).standard_normal(len(time))
    log = Recording(time, {"ground_speed": noisy, "wheel_speed_l": lost, "wheel_speed_r": lost})
    assert noise_at_rest(log) == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("zero", [0.03, -0.03, 0.002])
def test_a_gyroscope_whose_zero_is_off_is_named_with_its_size(zero: float) -> None:
    """Hubs seemed to differ by .03 of the speed: slip .015 off on both sides, without a word; of small machines' .02 rad/s came to .024."""
    axles = {"rear": {"mass": 2000, "wheels": ["l", "r"]}}
    vehicle = Vehicle.from_dict(
        {"mass": 2000, "track": 1.6, "axles": axles, "wheel": {"radius": 0.4, "inertia": 10}}
    )
    log = stopping()
    turn = zero + 0.02 * np.random.default_rng(6).standard_normal(len(TIME))
    found = turn_rest_warnings(Recording(TIME, log.channels | {"angular_velocity_z": turn}), vehicle)
    named = [float(note.split(" reads ")[1].split()[0]) for note in found]
    assert named == ([pytest.approx(zero, abs=0.002)] if abs(zero) > 0.01 else [])


def test_wheels_that_read_0_throughout_show_no_stop() -> None:
    """A dead rim's usual speed is 0: the whole drive was a stop, and an offset of the whole speed was advised."""
    steady = 2 + 0.03 * np.random.default_rng(5).standard_normal(len(TIME))
    dead = np.zeros(len(TIME))
    log = Recording(TIME, {"ground_speed": steady, "wheel_speed_l": dead, "wheel_speed_r": dead})
    assert rest_warnings(log) == []


def test_the_usual_speed_is_that_of_driving_however_long_the_vehicle_stands() -> None:
    moving = TIME < 16
    rim = np.where(moving, 1.5, 0.0)
    ground = np.where(
        moving & (np.arange(len(TIME)) % 4 > 0), np.nan, rim + 0.1
    )  # known in few rows of driving
    log = Recording(TIME, {"ground_speed": ground, "wheel_speed_l": rim / 0.4, "wheel_speed_r": rim / 0.4})
    (note,) = rest_warnings(log)
    assert float(note.split("at usual speed by ")[1].split(",")[0]) == pytest.approx(0.1 / 1.6, rel=0.02)


CART = Vehicle.from_dict(
    {
        "name": "cart",
        "mass": 200,
        "axles": {"a": {"mass": 200, "wheels": ["l", "r"]}},
        "wheel": {"radius": 0.4, "inertia": 1},
        "uncertainty": {"drive_torque_offset": 2.0},
    }
)


def test_torques_that_read_the_same_in_every_stop_are_named() -> None:
    """One pressure of a hydraulic motor in place of the difference of two: soil resistance read .074 for .042, without a word."""
    standing = stopping().channels["wheel_speed_l"] < 0.1

    def with_torque(at_rest: np.ndarray | float, **more: np.ndarray) -> list[str]:
        torque = np.where(standing, 0.0, 60.0) + at_rest + np.random.default_rng(6).standard_normal(len(TIME))
        torques = {"drive_torque_l": torque, "drive_torque_r": torque + 1}
        return torque_rest_warnings(Recording(TIME, {**stopping().channels, **torques, **more}), CART)

    (note,) = with_torque(40.0)
    assert note.startswith(
        "The drive torques read the same in 3 stops of all wheels (l 40, r 41 N m), 0.1 of the weight"
    )
    assert with_torque(1.0) == []
    assert with_torque(np.where(TIME < 80, 40.0, 30.0)) == []  # motors that hold it on two slopes
    assert with_torque(40.0, pitch=np.full(len(TIME), 0.1)) == []  # or on one, as measured
    torque = np.where(standing, 0.0, 60.0)
    one = {"drive_torque_l": torque, "drive_torque_r": torque - 9}  # 2 % of its load, 1 % of the weight
    (note,) = torque_rest_warnings(Recording(TIME, {**stopping().channels, **one}), CART)
    assert "(r -9 N m)" in note
    early = TIME < 120  # two stops: what holds the wheels agrees by chance
    channels = {n: v[early] for n, v in {**stopping().channels, **one}.items()}
    assert torque_rest_warnings(Recording(TIME[early], channels), CART) == []
