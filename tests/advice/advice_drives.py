"""Estimates made by hand from a known curve: no estimator, no simulator, so that the truth is exact."""

from __future__ import annotations

import numpy as np

from terragrip.estimation import Estimates
from terragrip.vehicle import Vehicle

VEHICLE = Vehicle.from_dict(
    {
        "name": "test tractor", "mass": 6000.0, "wheelbase": 2.5, "center_of_gravity_height": 0.9, "hitch_height": 0.5, "track": 1.8,
        "axles": {"front": {"mass": 2500.0, "wheels": ["fl", "fr"]}, "rear": {"mass": 3500.0, "wheels": ["rl", "rr"]}},
        "wheel": {"radius": 0.7, "inertia": 50.0}, "tire_rolling_resistance": 0.02,
        "uncertainty": {"wheel_radius": 0.005},
    }
)  # fmt: skip


def drive(
    a: float = 0.9,
    k: float = 11.36,
    resistance: float = 0.07,
    growth: float = 0.0,
    top: float = 0.16,
    seed: int = 0,
    metres: float = 600.0,
    soil: str | None = None,
    vehicle: Vehicle = VEHICLE,
    spread: float = 0.05,
    hyperbola: bool = False,
    before_slip: float = 0.0,
    slip_off: float = 0.0,
    slip_std: float = 0.004,
) -> Estimates:
    """Pulls that come and go on ground of mu = A(1 - e^{-k s}), A = .48 a, whose strength varies by ``spread`` along the way.

    ``hyperbola``: A k s/(1 + k s) instead; ``before_slip``: adhesion needed before any slip; ``slip_off``: error of slip all the
    drive, of which ``slip_std`` is the estimates' SD.
    """
    rng = np.random.default_rng(seed)
    n, speed = int(metres * 5), 1.5
    distance = np.arange(n) * 0.2
    patches = np.repeat(rng.standard_normal(int(metres / 2) + 1), 10)[:n]
    strength = 0.48 * a * (1 + spread * patches)
    height = 0.48 * a
    pulls = np.repeat(rng.uniform(0.01, 1.0, int(metres / 8) + 1), 40)[:n]
    wanted = pulls * top
    mu = height * (k * wanted / (1 + k * wanted) if hyperbola else -np.expm1(-k * wanted))
    share = np.minimum(mu / strength, 0.95)
    slip = (share / (1 - share) if hyperbola else -np.log1p(-share)) / k
    mu = mu + before_slip
    rho = resistance + growth * slip + 0.005 * np.repeat(rng.standard_normal(int(metres / 3) + 1), 15)[:n]
    columns = {
        "distance": distance, "ground_speed": np.full(n, speed), "soil_resistance": rho, "soil_resistance_std": np.full(n, 0.004),
    }  # fmt: skip
    for wheel in vehicle.wheels:
        noise = 0.004 * rng.standard_normal(n)
        columns |= {
            f"adhesion_{wheel}": mu + 0.01 * rng.standard_normal(n), f"adhesion_{wheel}_std": np.full(n, 0.01),
            f"slip_{wheel}": slip + noise + slip_off, f"slip_{wheel}_std": np.full(n, slip_std),
        }  # fmt: skip
    for axle, mass in zip(vehicle.axle_names, vehicle.axle_mass, strict=True):
        columns[f"vertical_load_{axle}"] = np.full(n, mass * 9.80665)
    labels = {} if soil is None else {"soil": np.full(n, soil, dtype=object)}
    return Estimates(distance / speed, columns, np.zeros(n, np.uint8), labels, {"vehicle": vehicle.to_dict()})


def slip_only(slip: np.ndarray, vehicle: Vehicle = VEHICLE, std: float = 0.004) -> Estimates:
    """A stock tractor's estimates: slip with its SD, and speed, a row a second."""
    n = len(slip)
    columns = {"distance": np.arange(n) * 2.0, "ground_speed": np.full(n, 2.0)}
    for wheel in vehicle.wheels:
        columns[f"slip_{wheel}"] = np.asarray(slip, dtype=float)
        columns[f"slip_{wheel}_std"] = np.full(n, std)
    return Estimates(
        np.arange(n, dtype=float), columns, np.zeros(n, np.uint8), {}, {"vehicle": vehicle.to_dict()}
    )
