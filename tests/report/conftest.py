"""A made-up drive with the contract's column names: no physics, but errors of known size."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.report.runs import Run
from terragrip.vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).parent))

from made_up import VEHICLE, WHEELS

YAW_RATE = 0.1


def drive(name: str = "multi2", method: str = "bank", seconds: float = 120.0, seed: int = 0) -> Run:
    """A run over four sections of two soils, stuck from 60 to 65 s; estimates err by their stated SD."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.05)
    soil = np.array(["fine", "", "grass", ""], dtype=object)[(time // 15).astype(int) % 4]
    level = np.where(soil == "grass", 0.15, 0.30)
    stuck = (time >= 60) & (time < 65)
    estimates = pd.DataFrame({"time": time})
    truth = pd.DataFrame({"time": time})

    def put(column: str, true: np.ndarray, std: float) -> None:
        truth[f"true_{column}"] = true
        estimates[column] = true + std * rng.normal(size=len(time))
        estimates[f"{column}_std"] = std

    for wheel in WHEELS:
        mu = level + 0.05 * np.sin(time / 3)
        put(f"adhesion_{wheel}", mu, 0.02)
        put(f"slip_{wheel}", mu / 2, 0.01)
        put(f"net_traction_{wheel}", mu - 0.08, 0.02)
    put("soil_resistance", np.full(len(time), 0.08) + 0.01 * np.sin(time / 9), 0.01)
    estimates["channels"] = rng.integers(4, 6, len(time))
    estimates["nis"] = rng.chisquare(estimates["channels"])
    truth["stuck"] = stuck
    truth["soil"] = soil
    load = 400 + 10 * rng.normal(size=len(time))
    force = np.where(stuck, -0.1, truth["true_net_traction_rr"]) * load + 4 * rng.normal(size=len(time))
    recording = pd.DataFrame(
        {
            "time": time,
            "ground_speed": 0.6 + 0.02 * rng.normal(size=len(time)),
            "angular_velocity_z": YAW_RATE,
            # a left turn: the right wheel's hub, 0.25 m off the middle, runs ahead
            "wheel_speed_rr": (0.6 + 0.25 * YAW_RATE) / 0.2 / (1 - truth["true_slip_rr"]),
            "wheel_force_x_rr": force,
            "wheel_force_z_rr": load,
            "soil": soil,
        }
    )
    recording.loc[::2, "ground_speed"] = np.nan
    recording.loc[1::2, "wheel_speed_rr"] = np.nan
    return Run(name, estimates, method, truth, recording, Vehicle.from_dict(VEHICLE))


@pytest.fixture(scope="session", name="drive")
def drive_fixture() -> Callable[..., Run]:
    """The maker of made-up drives."""
    return drive
