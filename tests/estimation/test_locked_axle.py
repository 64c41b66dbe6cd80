"""Wheels of one shaft, whose torque and speed are one signal each: in a turn their hubs go at two speeds, so slips and adhesions differ,
and nothing but the turn shows it."""

from __future__ import annotations

import numpy as np
import pytest

from drives import BEARING, INERTIA, MASS, RADIUS, TIRE, WHEELS, robot
from terragrip.estimation import estimate
from terragrip.physics.loads import GRAVITY, axle_loads
from terragrip.physics.slip import slip as slip_of
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

TRACK, RESISTANCE, SLIP = 0.554, 0.06, 0.05  # m; the slip in the mean


@pytest.mark.parametrize(("height", "rise"), [(0.35, 15.0), (0.6, 8.0)])
def test_adhesions_of_a_locked_axle_are_held_in_turns(height: float, rise: float) -> None:
    """They were in 1 to 7 % of rows."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 90.0, 0.05)
    speed = 0.9 + 0.1 * np.sin(time / 4)
    yaw = 0.25 * np.sin(time / 3)
    omega = speed / (1 - SLIP) / RADIUS
    sides = {"l": TRACK / 2, "r": -TRACK / 2}
    slip = {side: slip_of(omega, speed - y * yaw, RADIUS) for side, y in sides.items()}
    mu = {side: np.sign(s) * height * (1 - np.exp(-rise * np.abs(s))) for side, s in slip.items()}
    mean = (mu["l"] + mu["r"]) / 2
    pull = (mean - RESISTANCE) * MASS * GRAVITY - MASS * np.gradient(speed, time)
    spin = INERTIA * np.gradient(omega, time)
    front, rear = axle_loads(
        (54.0, 85.0), (0.638, 0.0), center_of_gravity_height=0.30, hitch_height=0.25,
        drawbar=pull, acceleration=np.gradient(speed, time), spin_torque=4 * spin,
    ).T  # fmt: skip
    channels = {"ground_speed": speed, "drawbar_force": pull, "angular_velocity_z": yaw}
    for wheel in WHEELS:
        load = (front if wheel[0] == "f" else rear) / 2
        channels[f"wheel_speed_{wheel}"] = omega
        channels[f"drive_torque_{wheel}"] = RADIUS * load * (mean + TIRE) + RADIUS * BEARING * omega + spin
    noise = {"wheel": 0.03, "ground": 0.02, "drive": 1.0, "drawbar": 4.0, "angular": 0.005}
    shared = {
        key: rng.standard_normal(len(time))
        for key in ("ground", "drawbar", "angular", "wheelf", "wheelr", "drivef", "driver")
    }
    for name in channels:
        kind = name.split("_")[0]
        channels[name] = (
            channels[name] + noise[kind] * shared[kind + (name[-2] if kind in ("wheel", "drive") else "")]
        )
    vehicle = robot(uncertainty={"drive_torque_gain": 0.02, "drawbar_offset": 3.0, "vertical_load": 0.02})
    estimates = estimate(Recording(time, channels), vehicle)
    turns = (time > 5) & (np.abs(yaw) > 0.1)
    for wheel in WHEELS:
        error = np.abs(estimates[f"adhesion_{wheel}"] - mu[wheel[1]])
        differ = np.std(mu["l"][turns] - mu["r"][turns]) / 2
        assert np.median(estimates[f"adhesion_{wheel}_std"][turns]) < 2.5 * differ
        assert np.mean((error <= 1.96 * estimates[f"adhesion_{wheel}_std"])[turns]) > 0.88
