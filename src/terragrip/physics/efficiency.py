"""Traction ratios and tractive efficiency (paper eq. 4, 5, 7), with their names in ASABE S296."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def net_traction(adhesion: ArrayLike, soil_resistance: ArrayLike) -> NDArray[Any]:
    """Net traction ratio κ = μ - ρ_s (paper eq. 5; "net traction ratio" in ASABE S296).

    Dimensionless, broadcast shape.
    """
    return np.subtract(adhesion, soil_resistance)


def gross_traction(adhesion: ArrayLike, tire_resistance: ArrayLike) -> NDArray[Any]:
    """Gross traction ratio μ + ρ_t (ASABE S296): the wheel's torque over rolling radius and load.

    Dimensionless, broadcast shape. By eq. 2 this is (M - J dω/dt - r ρ_w ω)/(r F_z).
    """
    return np.add(adhesion, tire_resistance)


def motion_resistance(soil_resistance: ArrayLike, tire_resistance: ArrayLike) -> NDArray[Any]:
    """Motion resistance ratio ρ = ρ_s + ρ_t (ASABE S296), the unindexed ρ of paper eq. 7 as read here
    (physics.md 2).

    Dimensionless, broadcast shape.
    """
    return np.add(soil_resistance, tire_resistance)


def tractive_efficiency(
    adhesion: ArrayLike, soil_resistance: ArrayLike, tire_resistance: ArrayLike, slip: ArrayLike
) -> NDArray[Any]:
    """Tractive efficiency η = κ/(κ + ρ) (1 - s) (paper eq. 7; "tractive efficiency" in ASABE S296).

    Net traction over gross traction times the travel ratio: pull power out over wheel power in. κ + ρ = μ +
    ρ_t.

    Parameters
    ----------
    adhesion: μ. soil_resistance: ρ_s. tire_resistance: ρ_t. slip: s. Dimensionless; they broadcast.

    Returns
    -------
    The broadcast shape. 0 where κ <= 0, whatever the slip: no pull, no useful power. NaN where there is
    pull but the wheel takes in no power (κ > 0, μ + ρ_t <= 0: it is pushed or runs downhill), and where an
    input is NaN.
    """
    net = net_traction(adhesion, soil_resistance)
    gross = gross_traction(adhesion, tire_resistance)
    net, gross, slip = np.broadcast_arrays(net, gross, np.asarray(slip))
    powered = gross > 0
    pulling = net / np.where(powered, gross, 1) * (1 - slip)
    return np.where(net <= 0, 0.0, np.where(powered, pulling, np.nan))
