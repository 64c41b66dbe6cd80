"""Which supervisor sees what: the paper's by speeds, and the one by drive torque and slip (method aukf-fs-drive)."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from drives import robot

pytestmark = pytest.mark.usefixtures("unchecked")


def test_under_a_speed_loop_a_change_of_soil_shows_in_torque_alone() -> None:
    """Wheels and vehicle go on as before; from 10 s on the soil asks for three times the torque."""
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 20.0, 0.01)
    torque = np.where(time < 10, 8.0, 24.0)
    log = {"time": time, "ground_speed": 0.6 + 0.005 * rng.standard_normal(len(time))}
    for wheel in ("fl", "fr", "rl", "rr"):
        log[f"wheel_speed_{wheel}"] = 3.3 + 0.005 * rng.standard_normal(len(time))
        log[f"drive_torque_{wheel}"] = torque + 0.1 * rng.standard_normal(len(time))
    log["drawbar_force"] = 4 * torque / 0.2 - 160
    recording = tg.Recording(time, {name: values for name, values in log.items() if name != "time"})
    by_speeds, by_drive = (
        tg.estimate(recording, robot(), method)["supervisor"] for method in ("aukf-fs", "aukf-fs-drive")
    )
    steady, change = (time > 5) & (time < 10), (time > 10.1) & (time < 10.4)
    assert max(by_speeds[steady].mean(), by_drive[steady].mean()) < 0.3
    assert by_speeds[change].max() < 0.2
    assert by_drive[change].min() > 0.7
