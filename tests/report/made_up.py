"""Estimates of drives that never were: adhesion on known curves, errors of known size, no physics."""

from __future__ import annotations

from typing import Any

import numpy as np

from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.vehicle import Vehicle

A = {"hard": 1.42, "fine": 0.85, "grass": 0.40}
WHEELS = ("fl", "fr", "rl", "rr")
VEHICLE: dict[str, Any] = {
    "name": "made up",
    "mass": 139.0,
    "wheelbase": 0.6,
    "track": 0.5,
    "center_of_gravity_height": 0.3,
    "tire_rolling_resistance": 0.02,
    "axles": {
        "front": {"mass": 54.0, "wheels": ["fl", "fr"]},
        "rear": {"mass": 85.0, "wheels": ["rl", "rr"]},
    },
    "wheel": {"radius": 0.2, "inertia": 0.15},
}


def estimates(seed: int, soils: tuple[str, ...], sensor: bool = False, rows: int = 800) -> Estimates:
    """10 Hz, 0.6 m/s, the soils one after the other ("" is unlabelled), slip from 0 to 55 % on each, rho_s = 0.1."""
    rng = np.random.default_rng(seed)
    time = 0.1 * np.arange(rows)
    part = np.minimum(np.arange(rows) * len(soils) // rows, len(soils) - 1)
    a = np.array([A.get(soil, 0.6) for soil in soils])[part] * (1 + 0.02 * rng.standard_normal())
    columns: dict[str, Any] = {
        "distance": 0.6 * time,
        "ground_speed": np.full(rows, 0.6),
        "soil_resistance": 0.1 + 0.005 * rng.standard_normal(rows),
        "soil_resistance_std": np.full(rows, 0.005),
        "curve_a": a + 0.05 * rng.standard_normal(rows),
        "curve_a_std": np.full(rows, 0.05),
        "nis": rng.chisquare(5, rows),
        "channels": np.full(rows, 5.0),
        **{
            f"vertical_load_{axle}": np.full(rows, 9.8 * one["mass"])
            for axle, one in VEHICLE["axles"].items()
        },
    }
    for wheel in WHEELS:
        slip = 0.275 - 0.275 * np.cos(columns["distance"] / 2)
        mu = CURVES["exponential"].value(slip, {"a": 1.0}) * a
        for name, values, std in (
            ("slip", slip, 0.005),
            ("adhesion", mu, 0.02),
            ("net_traction", mu - 0.1, 0.02),
        ):
            columns[f"{name}_{wheel}"] = values + std * rng.standard_normal(rows)
            columns[f"{name}_{wheel}_std"] = np.full(rows, std)
    if sensor:
        load = 400.0 + rng.standard_normal(rows)
        columns["wheel_force_x_rr"] = (columns["net_traction_rr"] + 0.01 * rng.standard_normal(rows)) * load
        columns["wheel_force_z_rr"] = load
        columns["latitude"], columns["longitude"] = np.full(rows, 51.0), 13 + 0.6 * time / 70_000
    labels = {"soil": np.array(soils, dtype=object)[part]} if any(soils) else {}
    about = {"method": "bank", "vehicle": Vehicle.from_dict(VEHICLE).to_dict()}
    return Estimates(time, columns, np.zeros(rows, dtype=np.uint8), labels, about)
