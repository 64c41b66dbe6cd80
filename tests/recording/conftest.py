"""A recording of four wheels at 100 Hz to bend out of shape."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from terragrip.vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).parent))  # steady_drive, development_machine

WHEELS = ("fl", "fr", "rl", "rr")
Columns = dict[str, np.ndarray]


@pytest.fixture
def vehicle() -> Vehicle:
    """The paper's robot."""
    return Vehicle.from_dict(
        {
            "mass": 139,
            "wheelbase": 0.638,
            "center_of_gravity_height": 0.3,
            "hitch_height": 0.25,
            "axles": {
                "front": {"mass": 54, "wheels": ["fl", "fr"]},
                "rear": {"mass": 85, "wheels": ["rl", "rr"]},
            },
            "wheel": {"radius": 0.2, "inertia": 0.15},
        }
    )


@pytest.fixture
def columns() -> Columns:
    """A steady pull at 5 to 10 % slip, 60 s."""
    rng = np.random.default_rng(3)
    time = np.arange(6000) / 100
    speed = 0.6 + 0.05 * np.sin(time / 7)
    result: Columns = {"time": time, "ground_speed": speed + 0.02 * rng.standard_normal(6000)}
    for wheel in WHEELS:
        result[f"wheel_speed_{wheel}"] = speed / 0.2 / 0.93 + 0.03 * rng.standard_normal(6000)
        by_load = 10 if wheel.startswith("f") else 20
        result[f"drive_torque_{wheel}"] = by_load + rng.standard_normal(6000)
    result["drawbar_force"] = 200 + 4 * rng.standard_normal(6000)
    return result
