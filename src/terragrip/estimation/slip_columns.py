"""The columns of estimates from speeds alone, of the filter's state and covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.physics.slip import slip

Floats = npt.NDArray[np.float64]

METHOD = "slip-only"
STANDSTILL = 0.05  # m/s
GAP = 2.0  # s


@dataclass(frozen=True)
class Rim:
    """A wheel whose slip is told: its radius [m] and the radius's relative SD."""

    wheel: str
    radius: float
    spread: float


@dataclass(frozen=True)
class Place:
    """Where the machine was before the rows: distance [m], instant [s] (None: there was no row) and ground speed [m/s]."""

    distance: float = 0.0
    time: float | None = None
    speed: float = 0.0


def columns_of(
    state: Floats, covariance: Floats, rims: Sequence[Rim], time: Floats, standstill: float, before: Place
) -> dict[str, Floats]:
    """The table's columns (n,) from the filter's state (n, 2 + wheels) and covariance."""
    v = state[:, 0]
    start, speed = (time[0], v[0]) if before.time is None else (before.time, before.speed)
    steps = np.diff(time, prepend=start)
    found = {
        "distance": before.distance + np.cumsum(steps * (np.abs(v) + np.abs(np.r_[speed, v[:-1]])) / 2),
        "ground_speed": v,
        "ground_speed_std": np.sqrt(np.maximum(covariance[:, 0, 0], 0.0)),
    }
    slips: dict[str, Floats] = {}
    for i, rim in enumerate(rims):
        k = i + 2
        u = v + state[:, k]
        with_v = covariance[:, 0, 0] + covariance[:, 0, k]
        spread = with_v + covariance[:, 0, k] + covariance[:, k, k]
        found[f"wheel_speed_{rim.wheel}"] = u / rim.radius
        found[f"wheel_speed_{rim.wheel}_std"] = np.sqrt(np.maximum(spread, 0.0)) / rim.radius
        slips[f"slip_{rim.wheel}"], slips[f"slip_{rim.wheel}_std"] = _slip(
            v, u, np.stack([covariance[:, 0, 0], with_v, spread], axis=1), rim.spread, standstill
        )
    return found | slips


def _slip(v: Floats, u: Floats, spread: Floats, radius: float, standstill: float) -> tuple[Floats, Floats]:
    """Slip (paper eq. 5) and its SD (n,) by first derivatives; ``spread`` (n, 3): variances of v, of v with u, of u."""
    value = slip(u, v, 1.0, standstill_speed=standstill)
    travel, rim = np.abs(v), np.abs(u)
    driving = rim >= travel
    safe = np.where(np.isfinite(value), np.maximum(travel, rim), 1.0)
    # Driving: 1 - |v|/|u|; braking: -1 + |u|/|v|.
    by_v = -np.sign(v) * np.where(driving, safe, rim) / safe**2
    by_u = np.sign(u) * np.where(driving, travel, safe) / safe**2
    variance = by_v**2 * spread[:, 0] + 2 * by_v * by_u * spread[:, 1] + by_u**2 * spread[:, 2]
    variance += (radius * np.where(driving, travel, rim) / safe) ** 2
    return value, np.where(np.isfinite(value), np.sqrt(np.maximum(variance, 0.0)), np.nan)
