"""Drives along lanes whose ground is known: estimates made by hand, so that each test can reckon its map itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.simulation import Scenario

Array = np.ndarray
RATE = 20.0
SPEED = 1.0
EARTH = 6378137.0
REFERENCE = float(CURVES["exponential"].value(0.1, {}))
"""Adhesion at 10 % of slip, at which a drive is and is mapped where nothing else is said."""


def even(east: Array, north: Array) -> Array:
    """A ground of scale 1 everywhere."""
    return np.ones_like(east)


def lanes(count: int, length: float, spacing: float) -> tuple[Array, Array]:
    """East and north [m] every 5 cm along parallel lanes joined by half circles."""
    east, north = [], []
    for k in range(count):
        x = np.arange(0.0, length, SPEED / RATE)
        east.append(x if k % 2 == 0 else length - x)
        north.append(np.full(len(x), k * spacing))
        if k + 1 < count:
            angle = np.arange(0.0, np.pi, SPEED / RATE / (spacing / 2))
            bow = spacing / 2 * np.sin(angle)
            east.append(length + bow if k % 2 == 0 else -bow)
            north.append(k * spacing + spacing / 2 * (1 - np.cos(angle)))
    return np.concatenate(east), np.concatenate(north)


def drive(
    east: Array,
    north: Array,
    a: Callable[[Array, Array], Array] = even,
    slip: float = 0.1,
    noise: float = 0.0,
    std: float = 0.01,
    seed: int = 1,
    antenna: tuple[float, float] = (0.0, 0.0),
    origin: tuple[float, float] = (51.0, 13.5),
) -> Estimates:
    """Estimates of a drive of the rear axle along points [m]: adhesion by the paper's curve of scale ``a(east, north)`` at one slip, with
    white noise and a stated SD; the antenna stands ``antenna`` [m] forward and to the left; ``origin``: latitude and longitude [deg]."""
    vehicle = Scenario.load("multi1").nominal_vehicle()
    data = vehicle.to_dict() | {"antenna": {"x": antenna[0], "y": antenna[1]}, "uncertainty": {}}
    n, rng = len(east), np.random.default_rng(seed)
    way = np.r_[0.0, np.cumsum(np.hypot(np.diff(east), np.diff(north)))]
    time = way / SPEED
    heading = np.unwrap(np.arctan2(np.gradient(north), np.gradient(east)))
    turn = np.gradient(heading) / np.gradient(time)

    def place(forward: float, left: float) -> tuple[Array, Array]:
        return (
            east + forward * np.cos(heading) - left * np.sin(heading),
            north + forward * np.sin(heading) + left * np.cos(heading),
        )

    columns: dict[str, Array] = {
        "distance": way,
        "ground_speed": np.full(n, SPEED),
        "ground_speed_std": np.full(n, 0.01),
    }
    columns |= {
        "soil_resistance": 0.1 + noise * rng.standard_normal(n),
        "soil_resistance_std": np.full(n, std),
    }
    for k, wheel in enumerate(vehicle.wheels):
        side = float(vehicle.wheel_side[k])
        ground = a(*place(float(vehicle.axle_to_rear[vehicle.wheel_axle[k]]), side))
        mu = ground * float(CURVES["exponential"].value(slip, {})) + noise * rng.standard_normal(n)
        columns |= {
            f"wheel_speed_{wheel}": (SPEED - turn * side) / 0.2, f"adhesion_{wheel}": mu, f"adhesion_{wheel}_std": np.full(n, std),
            f"slip_{wheel}": np.full(n, slip), f"slip_{wheel}_std": np.full(n, 1e-4),
            f"efficiency_{wheel}": np.full(n, 0.5), f"efficiency_{wheel}_std": np.full(n, 0.02),
        }  # fmt: skip
    x, y = place(*antenna)
    columns["latitude"] = origin[0] + np.degrees(y / EARTH)
    columns["longitude"] = origin[1] + np.degrees(x / (EARTH * np.cos(np.radians(origin[0]))))
    labels = {"soil": np.full(n, "field", dtype=object)}
    return Estimates(time, columns, np.zeros(n, dtype=np.uint8), labels, {"vehicle": data, "method": "bank"})


def local_east(frame: object) -> Array:
    """Metres east of the drive's origin of each geometry's middle."""
    middle = frame.geometry.representative_point().to_crs(4326)  # type: ignore[attr-defined]
    return np.asarray(np.radians(middle.x - 13.5) * EARTH * np.cos(np.radians(51.0)))
