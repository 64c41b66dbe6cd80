"""Means of a channel over windows of time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def window_means(values: Floats, place: npt.NDArray[np.intp], count: int) -> Floats:
    """Mean of the measured ``values`` (n,) in each of ``count`` windows, NaN where there are none; ``place`` (n,): each value's window."""
    known = np.isfinite(values)
    if not known.all():
        values, place = values[known], place[known]
    number, total = np.bincount(place, minlength=count), np.bincount(place, values, count)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
