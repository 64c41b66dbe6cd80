"""The second plant in pieces is the same drive as in one."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the second plant needs mujoco: install terragrip[dev]")

from dataclasses import replace

from second_plant import draw as second
from second_plant.plant import LOG_RATE, run
from second_plant.stepped import SteppedDrive
from terragrip.simulation.families import Kind


def test_pieces_of_a_drive_are_the_drive_in_one():
    plan = second.plan(Kind("robot", second.CURVE, "even"), 3, task="digging")
    speed, seconds = 0.4, 1.0
    work = replace(
        plan.work, time=np.zeros(1), speed=np.array([speed]), curvature=np.zeros(1), duration=seconds
    )
    whole = run(plan.vehicle, plan.radius, plan.scenario.robot, plan.ground, work, plan.step)
    stepped = SteppedDrive(plan)
    pieces = [stepped.advance(0.02, speed) for _ in range(50)]
    stride = round(1.0 / (LOG_RATE * plan.step))
    rows = np.concatenate([piece.rows for piece in pieces])[::stride]
    np.testing.assert_array_equal(rows, whole.rows[: len(rows)])


def test_a_limit_of_torque_holds_from_then_on():
    stepped = SteppedDrive(second.plan(Kind("robot", second.CURVE, "even"), 3))
    free = np.abs(stepped.advance(1.0, 0.5)["torque"]).max()
    stepped.limit_torque(0.2 * free)
    stepped.advance(1.0, 0.5)
    assert np.abs(stepped.advance(1.0, 0.5)["torque"]).max() <= 0.2 * free * (1 + 1e-6)
