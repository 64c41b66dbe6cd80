"""Efficiency and net traction of one soil over slip, from the drives themselves or from a soil library."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.advice.curves import DRAWS, draw_curves, lasting_sd
from terragrip.advice.optimum import GRID, OverSlip, over_slip
from terragrip.advice.samples import Samples
from terragrip.arrays import Floats
from terragrip.estimation.consistency import NORMAL_95
from terragrip.soil.estimates import torque_scale_sd, zero_slip_sd
from terragrip.soil.library import Soil
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

SHARE_OF_VARIATION = 0.5
"""Relative SD of a library's resistance where it does not say."""
GROWTH = (0.06, 0.05)
"""Mean and SD of what resistance grows by over all of slip, where only its mean is known (Brixius: .5/sqrt(Bn))."""


@dataclass(frozen=True)
class SoilCurves:
    """What is known of one soil: ``over`` its curves; ``adhesion`` (draws, slips) behind them; ``reach``: highest mean slip in the data."""

    over: OverSlip
    adhesion: Floats
    reach: float


def of_drives(samples: Samples, vehicle: Vehicle) -> SoilCurves | None:
    """From the drives' own rows; None where they hold too little way."""
    known = vehicle.uncertainty
    stated = np.hypot((known.drawbar_offset or 0.0) / (vehicle.mass * STANDARD_GRAVITY), known.slope or 0.0)
    draws = draw_curves(
        samples,
        common_sd=torque_scale_sd(vehicle),
        radius_sd=zero_slip_sd(vehicle),
        wheel_radius=float(vehicle.wheel_radius[vehicle.driven].mean()),
        offset_sd=float(max(np.nanmedian(samples.resistance_std), stated)),
    )
    if draws is None:
        return None
    mu, rho = draws.adhesion_at(GRID), draws.resistance_at(GRID)
    share = driven_share(vehicle, samples)
    return SoilCurves(over_slip(mu, rho, GRID, vehicle.tire_rolling_resistance, *share), mu, draws.reach)


def of_library(soil: Soil, samples: Samples | None, vehicle: Vehicle, seed: int = 0) -> SoilCurves | None:
    """From a library's curve with its interval; resistance from the rows where there are some. None where neither tells the resistance.

    The library's slips err alike by what they were learned with (its ``slip_noise``, else the rows'), as a drive's own do.
    """
    rng = np.random.default_rng(seed)
    off = rng.standard_normal((DRAWS + 1, 1)) / NORMAL_95
    growth = np.maximum(GROWTH[0] + GROWTH[1] * rng.standard_normal((DRAWS + 1, 1)), 0.0)
    shift = rng.standard_normal((DRAWS + 1, 1))
    slip_sd = float(soil.fit.get("slip_noise", {}).get("slip_std", np.nan))
    if not np.isfinite(slip_sd):
        slip_sd = 0.0 if samples is None else float(np.median(samples.slip_std))
    known = float(soil.fit.get("common_slip_sd") or 0.0)  # in the soil's own interval
    beyond = np.sqrt(max(lasting_sd(zero_slip_sd(vehicle), slip_sd) ** 2 - known**2, 0.0))
    error = beyond * rng.standard_normal((DRAWS + 1, 1))
    off[0], growth[0], shift[0], error[0] = 0.0, GROWTH[0], 0.0, 0.0
    if samples is not None:
        level = float(np.average(samples.resistance, weights=samples.metres))
        at = max(float(np.average(samples.slip, weights=samples.metres)), 0.0)
        spread = float(np.nanmedian(samples.resistance_std))
    elif soil.resistance is not None:
        level, at = soil.resistance[0], 0.05
        spread = soil.resistance[1] if np.isfinite(soil.resistance[1]) else SHARE_OF_VARIATION * level
    else:
        return None
    measured = GRID + error
    (low, high), mean = soil.band(measured), soil.value(measured)
    mu = mean + off * np.where(off > 0, high - mean, mean - low)
    rho = np.maximum(level + spread * shift + growth * (GRID - at), 0.0)
    reach = min(soil.reach, float(GRID[-1]))
    share = driven_share(vehicle, samples)
    return SoilCurves(over_slip(mu, rho, GRID, vehicle.tire_rolling_resistance, *share), mu, reach)


def driven_share(vehicle: Vehicle, samples: Samples | None) -> tuple[float, float]:
    """The driven axles' share of the weight without a pull, and what each pull of the weight adds (physics.md 3); by the rows' loads
    where there are some, else at rest."""
    weight = float(vehicle.mass) * STANDARD_GRAVITY
    load = vehicle.axle_loads(drawbar=np.array([0.0, weight]))
    drives = np.array([axle.driven for axle in vehicle.axles.values()])
    share = load[:, drives].sum(axis=1) / load.sum(axis=1)
    rest, transfer = float(share[0]), float(share[1] - share[0])
    if samples is None:
        return rest, transfer
    return samples.driven - transfer * float(np.average(samples.pull, weights=samples.metres)), transfer
