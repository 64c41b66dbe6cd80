"""Median and quantile as NumPy has them, to the last digit, of finite values.

NumPy finds one rank several times faster than the two or three that `np.median` and `np.quantile` request at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def median(values: npt.NDArray[Any]) -> float:
    """`np.median` of finite values (n,), n > 0."""
    half = len(values) // 2
    part = np.partition(values, half)
    upper = float(part[half])
    return upper if len(values) % 2 else (float(part[:half].max()) + upper) / 2


def quantile(values: npt.NDArray[Any], share: float) -> float:
    """`np.quantile` of finite values (n,), n > 0: what a ``share`` of them, from 0 to 1, lies below."""
    place = share * (len(values) - 1)
    rank = int(place)
    part = np.partition(values, rank)
    low = high = float(part[rank])
    if rank + 1 < len(part):
        high = float(part[rank + 1 :].min())
    weight = place - rank
    return low + (high - low) * weight if weight < 0.5 else high - (high - low) * (1 - weight)
