"""Fuel as it was measured: between a bus's messages by line, across holes not at all."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.estimation import Estimates

LONGEST = 5.0
"""Seconds between two messages from which the rate between them is not known."""
LEAST_KNOWN = 0.5
"""Share of the time for which the rate must be known for a figure."""


def fuel_rate_of(estimates: Estimates) -> Floats:
    """Fuel burnt at each row (n,) [m³/s]; NaN where the log does not tell."""
    time = np.asarray(estimates.time)
    if "fuel_rate" not in estimates.names:
        return np.full(len(time), np.nan)
    rate = np.asarray(estimates["fuel_rate"], dtype=float)
    known = np.flatnonzero(np.isfinite(rate))
    if known.size < 2:
        return np.full(len(time), np.nan)
    at = time[known]
    out = np.interp(time, at, rate[known], left=np.nan, right=np.nan)
    behind = np.clip(np.searchsorted(at, time), 1, known.size - 1)
    hole = (at[behind] - at[behind - 1] > LONGEST) & ~np.isin(time, at)
    out[hole] = np.nan
    return out


def burnt(rate: Floats, seconds: Floats, metres: Floats, width: float | None) -> dict[str, float]:
    """Litres per hour of driving, and per hectare with a tool of ``width`` [m], over rows (n,) whose rate [m³/s] is known; empty
    where it is known for less than `LEAST_KNOWN` of the time."""
    known = np.isfinite(rate)
    if not known.any() or seconds[known].sum() < LEAST_KNOWN * seconds.sum():
        return {}
    litres = 1e3 * float(rate[known] @ seconds[known])
    out = {"litres_per_hour": litres / (float(seconds[known].sum()) / 3600)}
    if width is not None and metres[known].sum() > 0:
        out["litres_per_hectare_measured"] = litres / (float(metres[known].sum()) * width / 1e4)
    return out
