"""Turns on the spot: tyres of the inner side roll backwards, and loads that a chassis shifts show otherwise than on a straight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.estimation.drives import BEARING, MASS, RADIUS, TIRE, robot

from terragrip.arrays import Floats
from terragrip.estimation import estimate
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

RIM, HUB, TRACK = 0.4, 0.32, 0.554  # m/s, m/s, m
SIDES = np.array([1.0, -1.0])
TIME = np.arange(0, 14.0, 0.02)


def vehicle(axles: int, **changes: Any) -> Any:
    """The robot with equal axle loads."""
    names = {f"axle{k}": {"mass": MASS / axles, "wheels": [f"l{k}", f"r{k}"]} for k in range(axles)}
    return robot(axles=names, **changes)


def on_the_spot(adhesion: Any, load: Any = 1.0, tyre: float = TIRE) -> Recording:
    """A turn to the right. ``adhesion`` (n, axles): left; the right side's opposes it. ``load`` (n, axles, 2): of the file's."""
    noise = np.random.default_rng(1)
    axles = adhesion.shape[1]
    force = load * MASS * GRAVITY / (2 * axles)
    torque = RADIUS * (adhesion[..., None] + tyre) * SIDES * force + BEARING * RIM * SIDES
    channels = {
        "ground_speed": 0.02 + 0.01 * noise.standard_normal(len(TIME)),
        "drawbar_force": 0 * TIME,
        "angular_velocity_z": np.full(len(TIME), -2 * HUB / TRACK),
    }
    for k in range(axles):
        for j, side in enumerate("lr"):
            channels[f"wheel_speed_{side}{k}"] = SIDES[j] * RIM / RADIUS + 0.01 * noise.standard_normal(
                len(TIME)
            )
            channels[f"drive_torque_{side}{k}"] = torque[:, k, j] + 0.3 * noise.standard_normal(len(TIME))
    return Recording(TIME, channels)


def found(log: Recording, machine: Any, axles: int) -> Floats:
    """Adhesions (n, axles, 2), each in its own wheel's direction."""
    told = estimate(log, machine)
    return (
        np.stack([[told[f"adhesion_{side}{k}"] for side in "lr"] for k in range(axles)]).transpose(2, 0, 1)
        * SIDES
    )


def test_a_tyres_resistance_opposes_a_wheel_that_rolls_backwards() -> None:
    log = on_the_spot(np.full((len(TIME), 2), 0.4), tyre=0.06)
    late = found(log, vehicle(2, tire_rolling_resistance=0.06), 2)[TIME > 8]
    np.testing.assert_allclose(late.mean(axis=0), 0.4, atol=0.02)


def test_loads_that_a_chassis_shifts_between_diagonals_are_no_adhesion() -> None:
    """30 % to and fro, once on four wheel radii of the hubs' way: front and rear seem to differ, on both sides oppositely."""
    by = 0.3 * np.sin(2 * np.pi * HUB * TIME / (4 * RADIUS))
    load = 1 + by[:, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    apart = found(on_the_spot(np.full((len(TIME), 2), 0.4), load), vehicle(2), 2)[TIME > 6] - 0.4
    assert np.std(apart) < 0.35 * 0.4 * np.std(by)


@pytest.mark.parametrize("ends", [(0.1, -0.1), (-0.08, 0.16, -0.08)])
def test_front_middle_and_rear_may_differ_at_once(ends: tuple[float, ...]) -> None:
    """What a wheel shears sideways it does not push: in a turn those of the middle pull more."""
    axles = len(ends)
    true = 0.4 + np.array(ends) * (TIME[:, None] > 7)
    soon = (TIME > 7.5) & (TIME < 8.5)
    differ = found(on_the_spot(true), vehicle(axles), axles)[soon].mean(axis=0) - 0.4
    np.testing.assert_allclose(differ, np.array(ends)[:, None] * [1, 1], atol=0.03)
