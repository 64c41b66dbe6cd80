"""A drive in pieces is the drive at once, bit for bit, while nobody changes the command."""

import numpy as np
import pytest

from terragrip.simulation import families, plant, terrain
from terragrip.simulation.families import Kind
from terragrip.simulation.simulate import true_radius
from terragrip.simulation.stepped import SteppedDrive


@pytest.mark.parametrize("task", ["work", "digging"])
def test_in_pieces_it_is_the_same_drive(task):
    scenario = families.scenario(Kind("robot", "sinkage", "plain"), 3, task=task)
    scenario = scenario.model_copy(update={"speed": ((0.0, 0.6),), "duration": 8.0})
    stepped = SteppedDrive(scenario, 3)
    vehicle = stepped.vehicle
    radius = true_radius(scenario, vehicle, 3)
    whole = plant.run(
        plant.make_plant(scenario, vehicle, radius, terrain.build(scenario, vehicle, 3)),
        8.0,
        scenario.step,
        1,
    )
    pieces = np.concatenate([stepped.advance(0.02, 0.6).rows for _ in range(400)])
    np.testing.assert_array_equal(pieces, whole[: len(pieces)])
    assert len(pieces) >= len(whole) - 1


def test_a_new_command_is_followed_from_the_next_piece_on():
    scenario = families.scenario(Kind("robot", "saturating", "plain"), 5)
    stepped = SteppedDrive(scenario, 5)
    for _ in range(200):
        fast = stepped.advance(0.02, 0.6)
    for _ in range(200):
        slow = stepped.advance(0.02, 0.2)
    assert fast["speed"][-1] > 0.4
    assert slow["speed"][-1] == pytest.approx(0.2, abs=0.1)


def test_a_torque_limit_holds():
    scenario = families.scenario(Kind("robot", "saturating", "plain"), 5)
    stepped = SteppedDrive(scenario, 5)
    stepped.limit_torque(2.0)
    trace = [stepped.advance(0.02, 0.6) for _ in range(100)][-1]
    assert np.abs(trace["torque"]).max() <= 2.0 + 1e-6
