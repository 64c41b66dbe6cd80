"""Intervals on the families: what share holds, how good they are (mean interval score), beside an oracle's.

The oracle is the plain filter with the true gains, offsets and radii, its own covariance, and in closed form what the machine's
true load variation adds (and it knows the slope): an adhesion goes by force over load, so a relative load error e shifts
mu + rho_t by e of itself. It takes whichever of its five Q has the best score. No user can have it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle import knowing
from plain_filter import INTENSITIES, plain_filter
from terragrip.estimation import Estimates
from terragrip.simulation import SimulationResult
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

Z, MISS = 1.959964, 0.05
COVERED = ("adhesion", "slip", "soil_resistance", "net_traction", "efficiency")
SCORED = ("adhesion", "slip", "soil_resistance")


@dataclass(frozen=True)
class Intervals:
    """By quantity: share of moving rows that hold the truth, and the mean interval score (width and misses)."""

    covered: dict[str, float]
    score: dict[str, float]


def knowing_nearly(result: SimulationResult) -> Vehicle:
    """The vehicle file as a perfect calibration leaves it: true gains, offsets and radii, a fifth of the prior spreads."""
    data: dict[str, Any] = knowing(result).to_dict()
    still_unknown = ("slope", "vertical_load")
    data["uncertainty"] = {
        key: value if key in still_unknown or value is None else 0.2 * value
        for key, value in data["uncertainty"].items()
    }
    return Vehicle.from_dict(data)


def interval_score(error: Floats, sd: Floats) -> float:
    """Mean score of central 95 % intervals (Gneiting and Raftery 2007, J. Am. Stat. Assoc. 102, eq. 43); less is better."""
    half = Z * sd
    return float(np.mean(2 * half + 2 / MISS * np.maximum(np.abs(error) - half, 0.0)))


def intervals(result: SimulationResult, estimates: Estimates, driven: list[str], moving: Flags) -> Intervals:
    """Those of an estimate, driven wheels together; NaN of what it lacks (from speeds alone all but slip)."""
    covered, score = {}, {}
    for quantity in COVERED:
        errors, sds = [np.empty(0)], [np.empty(0)]
        names = [quantity] if quantity == "soil_resistance" else [f"{quantity}_{w}" for w in driven]
        for name in (name for name in names if name in estimates):
            error = estimates[name] - result.truth[f"true_{name}"].to_numpy()
            rows = moving & np.isfinite(error) & np.isfinite(estimates[f"{name}_std"])
            errors.append(error[rows])
            sds.append(estimates[f"{name}_std"][rows])
        error, sd = np.concatenate(errors), np.concatenate(sds)
        covered[quantity] = float(np.mean(np.abs(error) <= Z * sd)) if len(error) else float("nan")
        score[quantity] = interval_score(error, sd) if len(error) else float("nan")
    return Intervals(covered, score)


def oracle_scores(result: SimulationResult, driven: list[str], moving: Flags) -> dict[str, float]:
    """The oracle's mean interval score of adhesion, slip and soil resistance."""
    vehicle, truth = knowing_nearly(result), result.truth
    plain = plain_filter(result.recording, vehicle)
    n, wheels = len(vehicle.wheels), [vehicle.wheels.index(w) for w in driven]
    best = dict.fromkeys(SCORED, np.inf)
    for q in range(len(INTENSITIES)):
        state, variance = plain.state[q], plain.variance[q]
        errors: dict[str, list[Floats]] = {name: [] for name in SCORED}
        sds: dict[str, list[Floats]] = {name: [] for name in SCORED}
        for i, w in zip(wheels, driven, strict=True):
            rows = moving & np.isfinite(truth[f"true_slip_{w}"].to_numpy())
            off = truth[f"true_vertical_load_{w}"].to_numpy()[rows] / plain.load[q][rows, i] - 1
            mu = state[rows, n + 1 + i]
            shaken = (mu + vehicle.tire_rolling_resistance) * np.sqrt(np.mean(off**2))
            errors["adhesion"].append(mu - truth[f"true_adhesion_{w}"].to_numpy()[rows])
            sds["adhesion"].append(np.sqrt(variance[rows, n + 1 + i] + shaken**2))
            omega, v, r = state[rows, i], state[rows, n], vehicle.wheel_radius[i]
            fine = np.abs(r * omega) > 0.03
            omega, v = omega[fine], v[fine]
            by_v, by_omega = -1 / (r * omega), v / (r * omega**2)
            spread = by_v**2 * variance[rows, n][fine] + by_omega**2 * variance[rows, i][fine]
            spread += 2 * by_v * by_omega * plain.cross[q][rows, i][fine]
            errors["slip"].append((1 - v / (r * omega)) - truth[f"true_slip_{w}"].to_numpy()[rows][fine])
            sds["slip"].append(np.sqrt(np.maximum(spread, 0.0)))
        climbing = np.tan(truth["true_slope"].to_numpy()[moving])  # on the level, to the filter
        errors["soil_resistance"].append(
            state[moving, -1] - climbing - truth["true_soil_resistance"].to_numpy()[moving]
        )
        sds["soil_resistance"].append(np.sqrt(variance[moving, -1]))
        for name in SCORED:
            best[name] = min(
                best[name], interval_score(np.concatenate(errors[name]), np.concatenate(sds[name]))
            )
    return best
