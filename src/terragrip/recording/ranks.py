"""Median and quantile as NumPy has them, to the last digit, of finite values, without the checks that a short array waits for.

By sorting: NumPy's takes half the time of its partition by two ranks, and for one rank it has a way that is 50 times slower where
values repeat, as the steps of a clock do.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def median(values: npt.NDArray[Any]) -> float:
    """`np.median` of finite values (n,), n > 0."""
    half = len(values) // 2
    part = np.sort(values)
    upper = float(part[half])
    return upper if len(values) % 2 else (float(part[half - 1]) + upper) / 2


def quantile(values: npt.NDArray[Any], share: float) -> float:
    """`np.quantile` of finite values (n,), n > 0: what a ``share`` of them, from 0 to 1, lies below."""
    place = share * (len(values) - 1)
    rank = int(place)
    above = min(rank + 1, len(values) - 1)
    part = np.sort(values)
    low, high = float(part[rank]), float(part[above])
    weight = place - rank
    return low + (high - low) * weight if weight < 0.5 else high - (high - low) * (1 - weight)
