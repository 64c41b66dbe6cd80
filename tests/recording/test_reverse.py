"""Speeds that lose their sign in reverse are named; signed ones, and turns on the spot, are left alone."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.recording import Recording, unit_warnings

TRACK, RADIUS = 0.8, 0.3
TIME = np.arange(0, 300, 0.1)


def machine() -> tg.Vehicle:
    axles = {"front": {"mass": 60, "wheels": ["fl", "fr"]}, "rear": {"mass": 60, "wheels": ["rl", "rr"]}}
    return tg.Vehicle.from_dict(
        {"mass": 120, "wheelbase": 0.8, "track": TRACK, "center_of_gravity_height": 0.3, "axles": axles,
         "wheel": {"radius": RADIUS, "inertia": 0.3}}
    )  # fmt: skip


def drive(*, backward: bool = True, on_the_spot: bool = False) -> dict[str, np.ndarray]:
    """Forward and backward by turns, with turns to either side, slip of 5 % (simulated)."""
    draws = np.random.default_rng(1000)
    gear = np.where(backward & (TIME % 60 > 40), -1.0, 1.0)
    speed = (
        gear
        * np.clip(np.abs((TIME % 20) - 10) - 1, 0, 2)
        * np.where(on_the_spot & (TIME % 40 > 30), 0.0, 0.6)
    )
    turn = 0.4 * np.sign(np.sin(TIME / 7)) * (np.abs(np.sin(TIME / 7)) > 0.6)
    columns = {
        "time": TIME,
        "ground_speed": speed + 0.01 * draws.standard_normal(len(TIME)),
        "angular_velocity_z": turn + 0.01 * draws.standard_normal(len(TIME)),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        hub = speed + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[f"wheel_speed_{wheel}"] = (hub / 0.95 + 0.01 * draws.standard_normal(len(TIME))) / RADIUS
    return columns


def unsigned(columns: dict[str, np.ndarray], beginning: str) -> dict[str, np.ndarray]:
    return {name: np.abs(v) if name.startswith(beginning) else v for name, v in columns.items()}


def said(columns: dict[str, np.ndarray]) -> str:
    return " ".join(unit_warnings(Recording.from_frame(columns), machine()))


@pytest.mark.parametrize("backward", [True, False])
@pytest.mark.parametrize("on_the_spot", [True, False])
def test_signed_speeds_say_nothing(backward: bool, on_the_spot: bool) -> None:
    assert said(drive(backward=backward, on_the_spot=on_the_spot)) == ""


def test_a_single_turn_among_noise_has_one_sign() -> None:
    """Beside most of a drive without turns the noise of two rates is large, and goes either way."""
    columns = drive(backward=False)
    draws, once = np.random.default_rng(3), (TIME > 200) & (TIME < 208)
    turn = 0.5 * once
    columns["angular_velocity_z"] = turn + 0.02 * draws.standard_normal(len(TIME))
    for wheel in ("fl", "fr", "rl", "rr"):
        hub = 1.0 + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[f"wheel_speed_{wheel}"] = (hub + 0.05 * draws.standard_normal(len(TIME))) / 0.95 / RADIUS
    columns["ground_speed"] = 1.0 + 0.01 * draws.standard_normal(len(TIME))
    assert said(columns) == ""


def test_a_ground_speed_without_a_sign_is_named() -> None:
    """A receiver's speed: the left wheel's slip was .21 and the right one's -.18 in turns backward, surely, for .01."""
    assert "ground_speed has no sign" in said(unsigned(drive(), "ground_speed"))
    assert said(unsigned(drive(backward=False), "ground_speed")) == ""


def test_speeds_without_a_sign_are_named_by_the_gyroscope() -> None:
    both = unsigned(unsigned(drive(), "ground_speed"), "wheel_speed")
    assert "contradicts the wheels' speeds: if these have no sign" in said(both)
    assert said({name: v for name, v in both.items() if name != "angular_velocity_z"}) == ""
