"""Logs of a machine whose every number is known, quasi-static, with noise only where a test asks for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).parent))  # for window_table.py

Floats = npt.NDArray[np.float64]
Make = Callable[..., Recording]

RADIUS = 0.2


@pytest.fixture
def vehicle() -> Vehicle:
    """A four-wheeled robot whose load does not move (no heights), so that logs are easy to write down."""
    return Vehicle.from_dict(
        {
            "mass": 140.0,
            "wheelbase": 0.6,
            "track": 0.5,
            "center_of_gravity_height": 0.0,
            "hitch_height": 0.0,
            "axles": {
                "front": {"mass": 60.0, "wheels": ["fl", "fr"]},
                "rear": {"mass": 80.0, "wheels": ["rl", "rr"]},
            },
            "wheel": {"radius": RADIUS, "inertia": 0.15},
            "tire_rolling_resistance": 0.02,
            "bearing_resistance": 2.0,
            "uncertainty": {
                "drive_torque_gain": 0.02,
                "drive_torque_offset": 0.3,
                "drawbar_offset": 3.0,
                "vertical_load": 0.0,
            },
        }
    )


def adhesion(slip: Floats) -> Floats:
    """The soil: 0.5 (1 - exp(-10 s)), odd."""
    return np.sign(slip) * 0.5 * -np.expm1(-10 * np.abs(slip))


@pytest.fixture
def drive() -> Make:
    """Return a function that makes a log of driving, after a standstill if one is asked for."""

    def make(
        seconds: float = 120.0,
        *,
        gain: Any = 1.0,
        offset: Any = 0.0,
        radius: Any = RADIUS,
        drawbar_offset: float = 0.0,
        slip: tuple[float, float] = (0.05, 0.30),
        resistance: float = 0.06,
        standing: float = 0.0,
        held_torque: float = 0.0,
        bar_tension: float = 0.0,
        patches: float = 0.0,
        noise: float = 0.0,
        rate: float = 50.0,
        seed: int = 0,
        soil: str = "field",
    ) -> Recording:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, standing + seconds, 1 / rate)
        driving = t >= standing
        low, high = slip
        s = 0.5 * (low + high) + 0.5 * (high - low) * np.sin(t / 3.1 + seed)
        rim = np.where(driving, 0.6 + 0.1 * np.sin(t / 7.0), 0.0)
        v = np.where(driving, rim * (1 - s), 0.0)
        a = np.where(driving, np.gradient(v, t), 0.0)
        wheels = np.broadcast_to(np.asarray(radius, dtype=float), 4)
        omega = np.repeat((rim / RADIUS)[:, None], 4, axis=1)
        spin = np.where(driving[:, None], np.gradient(omega, t, axis=0), 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            own_slip = np.where(driving[:, None], 1 - v[:, None] / (wheels * omega), 0.0)
        load = np.array([30.0, 30.0, 40.0, 40.0]) * GRAVITY
        local = _local(rng, np.cumsum(v) / rate, patches)
        mu = adhesion(own_slip) * local
        torque = 0.15 * spin + wheels * load * (mu + 0.02 * driving[:, None]) + wheels * 2.0 * omega
        pull = (mu * load).sum(axis=1) - resistance * 140 * GRAVITY * driving - 140 * a
        torque = torque + held_torque * ~driving[:, None]
        pull = pull + bar_tension * ~driving
        white = rng.standard_normal
        channels = {
            "ground_speed": v + 0.02 * noise * white(len(t)),
            "drawbar_force": pull + drawbar_offset + 4 * noise * white(len(t)),
        }
        gains, offsets = (np.broadcast_to(np.asarray(x, dtype=float), 4) for x in (gain, offset))
        for i, wheel in enumerate(("fl", "fr", "rl", "rr")):
            channels[f"wheel_speed_{wheel}"] = omega[:, i] + 0.03 * noise * white(len(t))
            channels[f"drive_torque_{wheel}"] = gains[i] * torque[:, i] + offsets[i] + noise * white(len(t))
        labels = {"soil": np.full(len(t), soil, dtype=object)}
        return Recording(t, channels, labels, source=f"log {seed}")

    return make


def _local(rng: np.random.Generator, place: Floats, spread: float) -> Floats:
    """Factor (n, 4) of local adhesion: patches of a metre, the rear wheels 0.6 m behind on the same track."""
    factor = np.ones((len(place), 4))
    if spread == 0:
        return factor
    nodes = np.arange(-3.0, place[-1] + 3.0, 0.5)
    for side in (0, 1):
        raw = np.convolve(rng.standard_normal(len(nodes)), [0.5, 1.0, 0.5], mode="same")
        values = 1 + spread * raw / np.sqrt(1.5)
        factor[:, side] = np.interp(place, nodes, values)
        factor[:, side + 2] = np.interp(place - 0.6, nodes, values)
    return factor
