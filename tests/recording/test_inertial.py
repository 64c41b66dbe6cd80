"""Gyroscope and accelerometer that are not of the wheels' instant, on simulated machines of several masses and rates."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

MACHINES = [
    (families.Kind("tractor", "saturating", "uncoupled"), 1, 10.0),
    (families.Kind("robot", "saturating", "even"), 17, 20.0),
    (families.Kind("robot", "saturating", "multirate"), 7, 10.0),
    (families.Kind("light", "brixius", "multirate"), 2, 50.0),
]
INERTIAL = ("angular_velocity_z", "acceleration_x", "pitch")


@cache
def drive(kind: families.Kind, seed: int, rate: float | None) -> tuple[Recording, Vehicle]:
    result = families.draw(kind, seed, rate=rate, duration=None if rate is None else 200.0)
    return result.recording, result.vehicle


def later(log: Recording, names: tuple[str, ...], seconds: float) -> Recording:
    """The log with some channels that many seconds late."""
    moved = {}
    for name in names:
        known = np.isfinite(log.channels[name])
        at = log.time[known]
        moved[name] = np.full(len(log), np.nan)
        moved[name][known] = np.interp(at - seconds, at, log.channels[name][known])
    return log.with_channels(**moved)


def lag_notes(log: Recording, vehicle: Vehicle) -> list[str]:
    return [note for note in unit_warnings(log, vehicle) if "the wheel speeds: if" in note]


@pytest.mark.sample(2)
@pytest.mark.parametrize(("kind", "seed", "rate"), MACHINES)
def test_sensors_of_one_instant_are_left_alone(kind: families.Kind, seed: int, rate: float) -> None:
    log, vehicle = drive(kind, seed, rate)
    assert unit_warnings(log, vehicle) == []
    assert lag_notes(later(log, INERTIAL, 0.05), vehicle) == [], "filters and tyres"


@pytest.mark.parametrize("factor", [30.0, 1e3, 1e6])
def test_rows_that_are_too_far_apart_show_no_lag(factor: float) -> None:
    """A log every few seconds, or with milliseconds for seconds: what is too coarse to compare is left out."""
    log, vehicle = drive(*MACHINES[0])
    slow = Recording.from_frame({**log.channels, "time": factor * log.time})
    assert any("time may not be in seconds" in note for note in unit_warnings(slow, vehicle)) == (factor > 30)
    assert not lag_notes(slow, vehicle)


@pytest.mark.sample(3)
@pytest.mark.parametrize(("kind", "seed", "rate"), MACHINES)
@pytest.mark.parametrize("seconds", [0.5, -0.4])
def test_an_inertial_sensor_that_is_late_or_early_is_named(
    kind: families.Kind, seed: int, rate: float, seconds: float
) -> None:
    log, vehicle = drive(kind, seed, rate)
    (note,) = lag_notes(later(log, INERTIAL, seconds), vehicle)
    assert note.startswith("acceleration_x and angular_velocity_z are")
    said = float(note.split(" are ")[1].split(" s ")[0])
    assert said == pytest.approx(abs(seconds), abs=0.06)
    assert ("behind" if seconds > 0 else "ahead of") in note
    assert f"'delay: {said:.2f} s'" in note


def test_a_late_gyroscope_alone_is_named_alone() -> None:
    log, vehicle = drive(*MACHINES[1])
    (note,) = lag_notes(later(log, ("angular_velocity_z",), 0.3), vehicle)
    assert note.startswith(
        "angular_velocity_z is 0.30 s behind the wheel speeds: if it is late, write 'delay: 0.30 s' for it"
    )


def test_the_half_that_the_gyroscope_is_on_turns_before_the_joint_has_bent() -> None:
    """By half the wheelbase over the speed: a loader's was .4 s ahead of its wheels, which were to be late. A later one is named."""
    log, vehicle = drive(*MACHINES[0])
    loader = Vehicle.from_dict({**vehicle.to_dict(), "articulated": True})
    assert loader.wheelbase is not None
    before = 0.5 * loader.wheelbase / float(np.nanquantile(log.channels["ground_speed"], 0.8))
    ahead = later(log, ("angular_velocity_z",), -before)
    assert lag_notes(ahead, vehicle)
    assert lag_notes(ahead, loader) == []
    (note,) = lag_notes(later(log, ("angular_velocity_z",), 2.3 * before), loader)
    assert "behind the wheel speeds" in note
    # of one late IMU, whose gyroscope was left out of the note
    (note,) = lag_notes(later(log, ("acceleration_x", "angular_velocity_z"), 0.5), loader)
    assert "acceleration_x and angular_velocity_z are 0.50 s behind" in note


@pytest.mark.parametrize("seed", [737, 1])
def test_an_accelerometer_that_goes_with_the_ground_speed_is_not_late(seed: int) -> None:
    """Where a tractor pulls near the top of its curve, it follows its wheels .2 s late, and so do both sensors of its motion."""
    log, vehicle = drive(families.Kind("tractor", "saturating", "uncoupled", "rigid"), seed, None)
    assert lag_notes(log, vehicle) == []
    assert lag_notes(later(log, INERTIAL, 0.5), vehicle)


def test_wheel_speeds_that_are_held_are_compared_by_their_updates() -> None:
    """A value held for a quarter of a second is an eighth late on average; that is no lag of a sensor."""
    log, vehicle = drive(*MACHINES[1])
    rows = np.arange(len(log)) // 8 * 8
    held = {n: v[rows] for n, v in log.channels.items() if n.startswith("wheel_speed_")}
    assert lag_notes(log.with_channels(**held), vehicle) == []


def test_a_drive_without_turns_and_changes_of_speed_tells_nothing() -> None:
    log, vehicle = drive(*MACHINES[1])
    calm = {
        n: np.full(len(log), np.nanmean(v)) for n, v in log.channels.items() if n.startswith("wheel_speed_")
    }
    assert lag_notes(log.with_channels(**calm), vehicle) == []


def test_without_a_wheel_speed_or_in_a_short_log_nothing_is_compared() -> None:
    from terragrip.recording.inertial import inertial_warnings

    log, vehicle = drive(*MACHINES[1])
    late = later(log, INERTIAL, 0.5)
    wheelless = {n: v for n, v in late.channels.items() if not n.startswith("wheel_speed_")}
    assert inertial_warnings(replace(late, channels=wheelless), vehicle) == []
    short = late.time < 20
    cut = replace(
        late, time=late.time[short], channels={n: v[short] for n, v in late.channels.items()}, labels={}
    )
    assert inertial_warnings(cut, vehicle) == []
