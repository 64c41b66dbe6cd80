"""A small log as text, to be written in many ways."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for can_frames.py


@pytest.fixture
def log() -> pd.DataFrame:
    """Two wheels, 3 s at 100 Hz, with a soil label."""
    rng = np.random.default_rng(5)
    time = np.round(np.arange(300) / 100, 2)
    return pd.DataFrame(
        {
            "time": time,
            "ground_speed": np.round(0.6 + 0.02 * rng.standard_normal(300), 5),
            "wheel_speed_l": np.round(3.2 + 0.03 * rng.standard_normal(300), 5),
            "wheel_speed_r": np.round(3.2 + 0.03 * rng.standard_normal(300), 5),
            "drive_torque_l": np.round(15 + rng.standard_normal(300), 4),
            "drive_torque_r": np.round(15 + rng.standard_normal(300), 4),
            "drawbar_force": np.round(200 + 4 * rng.standard_normal(300), 3),
            "soil": "grass",
        }
    )
