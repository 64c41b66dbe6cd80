"""Windows as a calibration works on, every number known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from terragrip.estimation.calibration.windows import Windows
from terragrip.physics.loads import GRAVITY
from terragrip.vehicle import Vehicle

RADIUS, N = 0.2, 20
LOAD = np.array([30.0, 30.0, 40.0, 40.0]) * GRAVITY


def table(n: int = N, *, slip: float = 0.1, length: float = 1.0, **columns: np.ndarray) -> Windows:
    """Windows of straight steady driving at 1 m/s on one unlabelled soil; ``columns`` replaces some."""
    speed, none = np.ones(n), np.full(n, np.nan)
    four = np.ones((n, 4))
    base = Windows(
        recording=np.zeros(n, dtype=np.intp), start=length * np.arange(n), count=np.full(n, 50.0),
        torque_count=np.full(n, 50.0), drawbar_count=np.full(n, 50.0), acceleration_count=np.zeros(n),
        ground_speed=speed, drawbar=np.full(n, 100.0), push=np.zeros(n), kinematic_push=np.zeros(n),
        acceleration=none, pitch=none, yaw_rate=none, lateral=none, hub_speed=four.copy(),
        wheel_speed=four / RADIUS / (1 - slip), wheel_acceleration=0 * four, torque=10.0 * four, load=four * LOAD,
        position=length * np.arange(n)[:, None] - np.array([0.0, 0.0, 0.6, 0.6]), soil=np.full(n, "", dtype=object),
        length=length,
    )  # fmt: skip
    return replace(base, **columns)


def stopped(*stops: tuple[int, int], **columns: np.ndarray) -> Windows:
    """Windows of half a second, standing from one row to another (exclusive) at each stop."""
    standing = np.zeros(40, dtype=bool)
    for first, last in stops:
        standing[first:last] = True
    moving = np.where(standing, 0.0, 1.0)
    return table(
        40, length=0.5, ground_speed=moving, wheel_speed=moving[:, None] / RADIUS * np.ones(4), **columns
    )


def stating(vehicle: Vehicle, **uncertainty: float) -> Vehicle:
    """The vehicle with another ``uncertainty`` block."""
    return Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": uncertainty})
