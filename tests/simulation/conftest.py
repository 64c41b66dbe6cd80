"""A quiet scenario that tests change where they need to."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from terragrip.simulation import Scenario
from terragrip.simulation import plant as plant_module
from terragrip.simulation import terrain as terrain_module
from terragrip.simulation.trace import Trace

QUIET: dict[str, Any] = {
    "name": "quiet",
    "sensors": {"use": "exact"},
    "route": {"segments": [{"soil": "even", "length": 60}]},
    "soils": {"even": {"curve": {"name": "exponential", "a": 0.85}, "resistance": 0.12}},
    "tools": [{"mass": 60, "length": 2.0, "dig_in": 200}],
    "speed": [[0, 0], [1, 0.6]],
    "duration": 8,
}


@pytest.fixture
def quiet() -> Callable[..., Scenario]:
    """Make the quiet scenario, top-level keys replaced."""

    def make(**changes: Any) -> Scenario:
        return Scenario.from_dict({**copy.deepcopy(QUIET), **changes})

    return make


@pytest.fixture
def drive() -> Callable[..., Trace]:
    """Run a scenario's plant alone; `stride` in steps."""

    def run(scenario: Scenario, seed: int = 0, step: float = 1e-3, stride: int = 1) -> Trace:
        vehicle = scenario.nominal_vehicle()
        ground = terrain_module.build(scenario, vehicle, seed)
        plant = plant_module.make_plant(scenario, vehicle, vehicle.wheel_radius, ground)
        rows = plant_module.run(plant, scenario.duration, step, stride)
        radius = np.array(vehicle.wheel_radius)
        return Trace(rows, vehicle, radius, ground, scenario.robot.wheel_mass, len(scenario.tools))

    return run
