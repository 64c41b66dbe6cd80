"""A speed derived from positions: its stated standard deviation is its error's, by simulated paths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from terragrip.formats.conversion import converted
from terragrip.formats.derivation import derivative
from terragrip.formats.profile import Profile
from terragrip.formats.table import LogTable

Floats = npt.NDArray[np.float64]


def path(speed: Floats, dt: float) -> Floats:
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2) * dt])


def derived(
    stamp: Floats, when: Floats, distance: Floats, fine: Floats, yaw: Floats, noise: float, seed: int
) -> tuple[Floats, float]:
    """Speed by a profile (n,) of a path, measured at ``when`` and stamped ``stamp``, and its stated standard deviation."""
    rng = np.random.default_rng(seed)
    step = np.diff(distance, prepend=0.0)
    x, y = (np.interp(when, fine, np.cumsum(step * part)) for part in (np.cos(yaw), np.sin(yaw)))
    table = {
        "t": stamp,
        "x": x + noise * rng.standard_normal(len(when)),
        "y": y + noise * rng.standard_normal(len(when)),
        "yaw": np.interp(when, fine, yaw),
    }
    speed = {
        "derivative_of": ["x", "y"],
        "unit": "m",
        "window": "1 s",
        "forward": {"yaw": "yaw", "unit": "rad"},
    }
    profile = Profile.from_dict({"time": {"from": "t", "unit": "s"}, "channels": {"ground_speed": speed}})
    part = converted(profile, LogTable(tuple(table), table))
    return part.columns["ground_speed"], part.noise["ground_speed"]


@pytest.mark.parametrize("case", ["white", "stamps", "starts"])
def test_the_stated_deviation_is_the_errors(case: str) -> None:
    """It was the scatter's alone, by coordinate: two thirds of the error where stamps are off, a twentieth where the window flattens starts
    (now two thirds: a cubic does not follow a sudden start either)."""
    rng = np.random.default_rng(7)
    fine = np.arange(0.0, 300.0, 0.01)
    # Moves of 2 to 6 s with starts and stops of half a second, or an even speed.
    steady = np.full(len(fine), 1.2) + 0.2 * np.sin(0.2 * fine)
    moves = 1.2 * np.clip((np.sin(0.9 * fine) + 0.5 * np.sin(0.37 * fine)) * 2.5, -1, 1)
    speed = moves if case == "starts" else steady
    when = np.arange(0.05, 299.0, 0.1)
    stamp = when + (rng.uniform(-0.04, 0.04, len(when)) if case == "stamps" else 0.0)
    noise = {"white": 0.01, "stamps": 0.0005, "starts": 0.003}[case]
    result, stated = derived(stamp, when, path(speed, 0.01), fine, 0.05 * fine, noise, 1)
    moving = np.isfinite(result) & (np.abs(result) > 0.25)
    error = (result - np.interp(when, fine, speed))[moving]
    assert 0.6 < stated / float(np.sqrt(np.mean(error**2))) < 1.4


def test_a_spoiled_position_is_no_resolution() -> None:
    """Beside 1e30 m all other positions are one, and their resolution would be the speed's error."""
    time = np.arange(0.0, 30.0, 0.1)
    position = 1.5 * time + 0.01 * np.random.default_rng(1).standard_normal(len(time))
    usual = derivative(time, position, 1.0)[1]
    position[100] = 1e30
    speed, deviation = derivative(time, position, 1.0)
    assert deviation == pytest.approx(usual, rel=0.3)
    assert speed[50] == pytest.approx(1.5, abs=0.05)


def test_an_angle_that_begins_anew_after_a_turn_goes_on() -> None:
    """A compass heading: each pass through north was a turn of 13 rad/s, slip .2 off in turns; and a wheel's angle within a turn."""
    time = np.arange(0.0, 120.0, 0.05)
    turn = 0.3 + 0.2 * np.sin(time / 7)
    angle = np.concatenate([[0.0], np.cumsum((turn[1:] + turn[:-1]) / 2) * 0.05])
    table = {"t": time, "heading": np.degrees(-angle) % 360, "wheel": np.angle(np.exp(20j * angle))}
    ticks = table | {"wheel": np.floor(20 * angle / (2 * np.pi) * 1024) % 1024}
    to_left = {"derivative_of": "heading", "unit": "deg", "sign": -1}
    for log, scale in ((table, 1.0), (ticks, 2 * np.pi / 1024)):
        wheel = {"derivative_of": "wheel", "unit": "rad", "scale": scale, "window": "0.3 s"}
        channels = {"angular_velocity_z": to_left, "wheel_speed_d": wheel}
        profile = Profile.from_dict({"time": {"from": "t", "unit": "s"}, "channels": channels})
        part = converted(profile, LogTable(tuple(log), log))
        known = np.isfinite(part.columns["angular_velocity_z"])
        assert known.mean() > 0.95
        np.testing.assert_allclose(part.columns["angular_velocity_z"][known], turn[known], atol=0.002)
        np.testing.assert_allclose(part.columns["wheel_speed_d"][known], 20 * turn[known], atol=0.06)


def heading_notes(heading: Floats, axes: list[str], yaw_unit: str = "deg", crab: float = 0.0) -> list[str]:
    """Notes on a heading beside a drive with turns, a third of it in reverse, ``crab`` [rad] to the left of where it points."""
    time = np.arange(0.0, 200.0, 0.1)
    way = course_of(time) + crab
    step = 0.1 * np.where(time % 60 > 40, -1.5, 1.5)
    noise = np.random.default_rng(5).normal(0.0, 0.02, (2, len(time)))
    east, north = np.cumsum(step * np.cos(way)), np.cumsum(step * np.sin(way))
    log = {"t": time, "east": east + noise[0], "north": north + noise[1], "heading": heading}
    log |= {"lat": 48.0 + log["north"] / 111_195.0, "lon": 11.0 + log["east"] / 74_403.0}
    speed = {
        "derivative_of": axes,
        "unit": "deg" if "lat" in axes else "m",
        "window": "1 s",
        "forward": {"yaw": "heading", "unit": yaw_unit},
    }
    profile = Profile.from_dict({"time": {"from": "t", "unit": "s"}, "channels": {"ground_speed": speed}})
    part = converted(profile, LogTable(tuple(log), log))
    return [note for note in part.notes if "derivative of" not in note]


def course_of(time: Floats) -> Floats:
    """From east to the left [rad]."""
    return 0.5 * np.sin(time / 9) + 0.02 * time


def test_a_heading_of_other_axes_than_the_positions_is_named() -> None:
    """A compass beside east and north: -.6 m/s for 2.0, stated to .01, and the advice was that torques have no sign; 30 deg beside the
    path: slip .22 for .10 without a word."""
    course = course_of(np.arange(0.0, 200.0, 0.1))
    compass = np.degrees(np.pi / 2 - course) % 360
    assert heading_notes(course, ["east", "north"], "rad") == []
    assert heading_notes(compass, ["north", "east"]) == []
    assert heading_notes(compass, ["lat", "lon"]) == []
    assert heading_notes(compass, ["lat", "lon"], crab=0.1) == []
    (note,) = heading_notes(compass, ["east", "north"])
    assert note.startswith(
        "ground_speed is wrong: check heading, which counts from the second axis of east, north"
    )
    assert note.endswith("write 'derivative_of: [north, east]'.")
    (note,) = heading_notes(np.degrees(course), ["lat", "lon"])
    assert note.startswith(
        "ground_speed is wrong: check heading, which does not count from north to the right"
    )
    (note,) = heading_notes(compass + 30, ["lat", "lon"])
    assert note.startswith(
        "The path of lat, lon goes 30 deg beside heading: if the vehicle does not drive in crab, ground_speed"
    )
    assert "13% too small: check the zero of heading" in note
