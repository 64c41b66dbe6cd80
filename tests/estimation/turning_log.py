"""A log of a machine with equal sides that turns on hilly ground, every number known (simulated, quasi-static)."""

from __future__ import annotations

import numpy as np

from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

MASS, TRACK, RADIUS = 900.0, 1.6, 0.65
SOIL = (0.6, 6.0)  # level and steepness of the adhesion
EARTH = 6_378_137.0  # m


def machine(**more: object) -> Vehicle:
    """Two wheels, one a side, as the vehicle file has them."""
    return Vehicle.from_dict(
        {
            "mass": MASS,
            "track": TRACK,
            "axles": {"only": {"mass": MASS, "wheels": ["l", "r"]}},
            "wheel": {"radius": RADIUS, "inertia": 12.0},
            "tire_rolling_resistance": 0.02,
            **more,
        }
    )


def turning_log(
    seed: int,
    *,
    radius: float = RADIUS,
    seconds: float = 600.0,
    soft: float = 0.05,
    free: float = 0.5,
    circling: bool = False,
) -> Recording:
    """A field of beds with headland turns, at 10 Hz: speeds, torques, drawbar force, GNSS position and altitude; no gyroscope, no pitch.

    ``radius`` [m] is the true one; ``soft``: growth of soil resistance with slip; ``free``: share of the time without a tool;
    ``circling``: the machine turns to the left all the time.
    """
    draws, time = np.random.default_rng(seed), np.arange(0, seconds, 0.1)
    turn = np.where(time % 40 > 30, np.pi / 10, 0.0) * np.where(time % 80 > 40, 1, -1)
    if circling:  # to the left all the time, tighter and wider
        turn = 0.12 + 0.08 * np.sin(time / 17)
    turn = np.convolve(turn, np.ones(10) / 10, "same")
    v = 1.2 + 0.2 * np.sin(time / 11)
    course = np.cumsum(turn) * 0.1
    east, north = np.cumsum(v * np.cos(course)) * 0.1, np.cumsum(v * np.sin(course)) * 0.1
    up = 1.5 * np.sin(north / 15) + 1.0 * np.sin(east / 12)
    grade = np.gradient(up, 0.1) / v
    slope = np.arctan(grade)
    tool = (time > free * seconds) & ((np.abs(turn) < 0.02) | circling)
    pull = np.where(tool, MASS * GRAVITY * (0.15 + 0.08 * np.sin(time / 5)), 0.0)
    pull = np.convolve(pull, np.ones(20) / 20, "same")
    push = np.gradient(v, 0.1) + GRAVITY * np.sin(slope)
    load = 0.5 * MASS * GRAVITY * np.cos(slope)
    scrub = 0.1 * np.tanh(turn / 0.05)  # what the outer wheel pulls more, of the load
    mean = np.full(len(time), 0.05)
    for _ in range(20):
        slip_mean = -SOIL[0] / SOIL[1] * np.log1p(-np.clip(mean / SOIL[0], -0.9, 0.9))
        mean = (pull + MASS * push) / (2 * load) + 0.06 + soft * np.maximum(slip_mean, 0)
    channels = {
        "ground_speed": v + 0.02 * draws.standard_normal(len(time)),
        "drawbar_force": pull + 10 * draws.standard_normal(len(time)),
    }
    for wheel, side in (("l", 1), ("r", -1)):
        mu = mean - side * scrub
        slip = -SOIL[0] / SOIL[1] * np.log1p(-np.clip(mu / SOIL[0], -0.9, 0.9))
        omega = (v - side * TRACK / 2 * turn) / (1 - slip) / radius
        torque = radius * load * (mu + 0.02) + 12.0 * np.gradient(omega, 0.1)
        channels[f"wheel_speed_{wheel}"] = omega + 0.01 * draws.standard_normal(len(time))
        channels[f"drive_torque_{wheel}"] = torque + 5 * draws.standard_normal(len(time))
    fixes = np.arange(len(time)) % 2 == 0  # 5 Hz
    place = {
        "latitude": np.degrees((north + 0.015 * draws.standard_normal(len(time))) / EARTH),
        "longitude": 11 + np.degrees((east + 0.015 * draws.standard_normal(len(time))) / EARTH),
        "altitude": up + 0.03 * draws.standard_normal(len(time)),
    }
    channels |= {name: np.where(fixes, values, np.nan) for name, values in place.items()}
    return Recording(time, channels, source=f"turning {seed}")
