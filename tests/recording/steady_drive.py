"""A simulated drive in which values are then repeated, or drop to 0."""

from __future__ import annotations

import numpy as np

from terragrip.recording import Recording

RATE = 10
TIME = np.arange(0, 200, 1 / RATE)


def log(**changed: np.ndarray | float) -> Recording:
    """A drive between 1 and 2 m/s with a stop, slip of 5 %, noise (simulated)."""
    draws = np.random.default_rng(1000)
    speed = (1.5 + 0.5 * np.sin(TIME / 6)) * np.clip(np.abs(TIME - 100) - 10, 0, 3) / 3
    columns = {"time": TIME, "ground_speed": np.round(speed + 0.01 * draws.standard_normal(len(TIME)), 3)}
    for wheel in ("l", "r"):
        rims = speed / 0.95 / 0.4
        columns[f"wheel_speed_{wheel}"] = np.round(rims + 0.01 * draws.standard_normal(len(TIME)), 3)
    columns["acceleration_x"] = np.gradient(speed, TIME) + 0.1 * draws.standard_normal(len(TIME))
    full = {name: np.broadcast_to(np.asarray(v, dtype=np.float64), TIME.shape) for name, v in changed.items()}
    return Recording.from_frame(columns | full)


def pulling(**changed: np.ndarray) -> Recording:
    """The same drive with torques and a drawbar force."""
    draws = np.random.default_rng(1001)
    pull = 100 + 40 * np.sin(TIME / 3)
    forces = {
        n: pull + draws.standard_normal(len(TIME))
        for n in ("drive_torque_l", "drive_torque_r", "drawbar_force")
    }
    return log(**(forces | changed))
