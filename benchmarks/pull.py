"""A made-up pull that obeys the model: what the speed benchmark filters. No claim on accuracy rests on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from peer import GRAVITY, FloatArray, Machine, Problem
from terragrip.physics.loads import axle_loads
from terragrip.vehicle import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
RATE = 100.0
VEHICLE = """name: benchmark
mass: 139 kg
wheelbase: 0.638 m
track: 0.554 m
center_of_gravity_height: 0.30 m
hitch_height: 0.25 m
axles:
  front: {mass: 54 kg, wheels: [fl, fr]}
  rear: {mass: 85 kg, wheels: [rl, rr]}
wheel: {radius: 0.20 m, inertia: 0.15 kg m^2}
tire_rolling_resistance: 0.02
bearing_resistance: 2.0 N s/rad
sensors: {wheel_speed: 0.03 rad/s, ground_speed: 0.02 m/s, drive_torque: 1 N m, drawbar_force: 4 N}
uncertainty: {drive_torque_gain: 0.02, drawbar_offset: 3 N, slope: 0.5 deg}
"""
NOISE = {"wheel_speed": 0.03, "ground_speed": 0.02, "drive_torque": 1.0, "drawbar_force": 4.0}


def vehicle(folder: Path) -> tuple[Vehicle, Path]:
    """The vehicle and its file."""
    path = folder / "vehicle.yaml"
    path.write_text(VEHICLE, encoding="utf-8")
    return Vehicle.load(path), path


def recording(machine: Vehicle, seconds: float, seed: int = 0) -> tuple[pd.DataFrame, FloatArray]:
    """A noisy log with every channel in every row, and the true wheel loads (rows, 4) behind it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE)
    mu = 0.28 + 0.06 * np.sin(time[:, None] / (3.0 + np.arange(4.0))) + 0.05 * (time[:, None] % 20 > 10)
    rho_s = 0.08 + 0.02 * np.sin(time / 11.0)
    speed = 0.6 + 0.05 * np.sin(time / 7.0)
    turning = speed[:, None] / machine.wheel_radius / (1.0 - 0.4 * mu)
    drawbar = np.zeros(len(time))
    acceleration = np.gradient(speed, time)
    for _ in range(4):  # the pull moves the loads, which carry the pull: a fast contraction
        axles = axle_loads(
            machine.axle_mass, [float(machine.wheelbase or 0.0), 0.0], center_of_gravity_height=0.30,
            hitch_height=0.25, drawbar=drawbar, acceleration=acceleration,
        )  # fmt: skip
        load = np.repeat(axles / 2.0, 2, axis=1)
        drawbar = (mu * load).sum(axis=1) - machine.mass * (rho_s * GRAVITY + acceleration)
    drag = mu * load + 0.02 * load + 2.0 * turning
    torque = machine.wheel_inertia * np.gradient(turning, time, axis=0) + machine.wheel_radius * drag
    columns = {"time": time, "ground_speed": speed, "drawbar_force": drawbar}
    for i, wheel in enumerate(WHEELS):
        columns[f"wheel_speed_{wheel}"] = turning[:, i]
        columns[f"drive_torque_{wheel}"] = torque[:, i]
    for name in list(columns)[1:]:
        sd = next(sd for quantity, sd in NOISE.items() if name.startswith(quantity))
        columns[name] = columns[name] + sd * rng.standard_normal(len(time))
    return pd.DataFrame(columns), load


def problem(machine: Vehicle, log: pd.DataFrame, load: FloatArray) -> Problem:
    """The same log as a bare filtering problem for the peer: inputs of a row lead to the next row."""
    wheel_speed = log[[f"wheel_speed_{wheel}" for wheel in WHEELS]].to_numpy()
    torque = log[[f"drive_torque_{wheel}" for wheel in WHEELS]].to_numpy()
    return Problem(
        Machine(machine.mass, machine.wheel_radius, machine.wheel_inertia, np.full(4, 2.0), 0.02),
        1.0 / RATE,
        torque[:-1],
        load[:-1],
        log["drawbar_force"].to_numpy()[:-1],
        np.column_stack([wheel_speed, log["ground_speed"]])[1:],
        np.array([1e-2] * 4 + [1e-3] + [1e-2] * 4 + [1e-3]),
        np.array([NOISE["wheel_speed"] ** 2] * 4 + [NOISE["ground_speed"] ** 2]),
        np.concatenate([wheel_speed[0], [log["ground_speed"][0]], np.full(4, 0.3), [0.08]]),
        np.diag([1e-2] * 5 + [1e-1] * 4 + [1e-2]),
    )
