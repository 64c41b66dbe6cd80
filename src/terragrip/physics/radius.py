"""Deflection and radii of a loaded tire (physics.md 4).

The paper's own formula ("Guskov p. 40") is not public.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def hadekel_deflection(
    vertical_load: ArrayLike, *, unloaded_radius: float, width: float, inflation_pressure: float
) -> NDArray[Any]:
    """Tire deflection on firm ground, m: h = F_z/(2π p sqrt(r0 b/2)) (Hadekel).

    vertical_load N, any shape; unloaded_radius r0 and width b m; inflation_pressure p Pa over the atmosphere.
    """
    return np.asarray(vertical_load) / (2 * np.pi * inflation_pressure * np.sqrt(unloaded_radius * width / 2))


def biderman_deflection(
    vertical_load: ArrayLike, *, inflation_pressure: float, carcass_pressure: float, c1: float, c2: float
) -> NDArray[Any]:
    """Tire deflection on firm ground, m: h = A + sqrt(A² + C1 F), A = C2 F/(2 (p + p0)) (Biderman).

    vertical_load F N, any shape; inflation_pressure p and carcass_pressure p0 Pa; c1 m²/N and c2 1/m of the
    tire.
    """
    load = np.asarray(vertical_load)
    half = c2 * load / (2 * (inflation_pressure + carcass_pressure))
    return half + np.sqrt(half**2 + c1 * load)


def loaded_radius(unloaded_radius: ArrayLike, deflection: ArrayLike) -> NDArray[Any]:
    """Height of the axle over firm ground, the torque arm, m: r0 - h."""
    return np.subtract(unloaded_radius, deflection)


def rolling_radius(unloaded_radius: ArrayLike, loaded: ArrayLike) -> NDArray[Any]:
    """Travel per radian of the free-rolling wheel, m: 2.5 r0 r_loaded/(1.5 r0 + r_loaded).

    Brixius and Wismer-Luth; unloaded_radius r0 and loaded radius in m.
    """
    free, loaded = np.asarray(unloaded_radius), np.asarray(loaded)
    return 2.5 * free * loaded / (1.5 * free + loaded)
