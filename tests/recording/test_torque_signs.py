"""Torques without a sign are named where the vehicle brakes or drives backward; signed ones, and those that only pull, are not."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.torques import sign_warnings
from terragrip.vehicle import Vehicle

MASS, RADIUS, G = 800.0, 0.35, 9.80665
WHEELS = ("fl", "fr", "rl", "rr")
Columns = dict[str, np.ndarray]


def machine() -> Vehicle:
    axles = {"front": {"mass": 400, "wheels": ["fl", "fr"]}, "rear": {"mass": 400, "wheels": ["rl", "rr"]}}
    base = {"mass": MASS, "wheelbase": 1.3, "track": 1.1, "center_of_gravity_height": 0.5, "axles": axles}
    return Vehicle.from_dict(base | {"wheel": {"radius": RADIUS, "inertia": 4}})


def drive(
    *, stop: float = 1.5, backward: bool = False, resistance: float = 0.05, downhill: float = 0.0
) -> Columns:
    """Ten minutes of starts and stops at 10 Hz; ``stop`` [s]: how long one takes from 2 m/s; ``downhill`` [rad]."""
    draws, time = np.random.default_rng(5), np.arange(0, 600, 0.1)
    speed = np.interp(time % 30, [0, 4, 20, 20 + stop], [0, 2.0, 2.0, 0])
    speed = speed * np.where(backward & (time % 60 > 30), -1.0, 1.0)
    pitch = np.where((time % 60 > 8) & (time % 60 < 18), -downhill, 0.0)
    thrust = MASS * (np.gradient(speed, time) + G * np.sin(pitch) + G * resistance * np.sign(speed))
    result = {
        "time": time,
        "ground_speed": speed + 0.01 * draws.standard_normal(len(time)),
        "pitch": pitch,
    }
    for wheel in WHEELS:
        turning = speed / RADIUS * (1 + thrust / (MASS * G) / 5)
        result[f"wheel_speed_{wheel}"] = turning + 0.02 * draws.standard_normal(len(time))
        result[f"drive_torque_{wheel}"] = thrust / 4 * RADIUS + 2 * draws.standard_normal(len(time))
    return result


def unsigned(columns: Columns) -> Columns:
    return {name: np.abs(v) if name.startswith("drive_torque") else v for name, v in columns.items()}


def notes_on(columns: Columns) -> list[str]:
    return sign_warnings(Recording.from_frame(columns), machine())


@pytest.mark.parametrize("case", [{}, {"backward": True, "stop": 8.0}, {"downhill": 0.15, "stop": 8.0}])
def test_torques_without_a_sign_are_named(case: dict[str, float]) -> None:
    """In stops, in reverse, downhill."""
    assert notes_on(drive(**case)) == []  # type: ignore[arg-type]
    (note,) = notes_on(unsigned(drive(**case)))  # type: ignore[arg-type]
    assert note.startswith(
        "drive_torque_fl, drive_torque_fr, drive_torque_rl, drive_torque_rr are never below 0"
    )
    notes = unit_warnings(Recording.from_frame(unsigned(drive(**case))), machine())  # type: ignore[arg-type]
    assert note in notes


def test_noise_that_turns_back_at_0_shows_a_missing_sign_where_nothing_brakes() -> None:
    """At rest. Torques that stay above 0, such as an idle drive's, and those that a logger cuts at 0 do not turn back there."""
    gentle = drive(stop=8.0)
    (note,) = notes_on(unsigned(gentle))
    assert (
        "times they fall to 0 from one sample to the next and rise again as far: the torques have no sign"
        in note
    )
    for other in (lambda v: np.abs(v) + 8.0, lambda v: np.maximum(v, 0.0)):
        assert notes_on({n: other(v) if n.startswith("drive_torque") else v for n, v in gentle.items()}) == []


def test_brakes_that_the_torques_do_not_see_are_no_missing_sign() -> None:
    """A motor without current while a mechanical brake stops the vehicle."""
    columns = {n: np.maximum(v, 0.0) if n.startswith("drive_torque") else v for n, v in drive().items()}
    assert notes_on(columns) == []


def test_without_a_torque_of_each_driven_wheel_or_motion_nothing_is_told() -> None:
    columns = unsigned(drive())
    assert notes_on({n: v for n, v in columns.items() if n != "drive_torque_fl"}) == []
    assert notes_on({n: v[:100] for n, v in columns.items()}) == []
