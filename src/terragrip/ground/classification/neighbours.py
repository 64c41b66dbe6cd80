"""Evidence of windows near one another in time is shared."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.classification.chances import softmax


def nearby_mean(values: Floats, starts: Floats, reach: float) -> Floats:
    """Mean (n, ...) of the ``values`` (n, ...) of windows that begin within ``reach`` [s] of each; ``starts`` (n,) [s] ascend.

    NaN counts as not there; NaN where nothing is.
    """
    there = np.isfinite(values)
    none = np.zeros((1, *values.shape[1:]))
    total = np.concatenate([none, np.cumsum(np.where(there, values, 0.0), axis=0)])
    count = np.concatenate([none, np.cumsum(there, axis=0)])
    low = np.searchsorted(starts, starts - reach - 1e-9)
    high = np.searchsorted(starts, starts + reach + 1e-9, side="right")
    number = count[high] - count[low]
    return np.asarray((total[high] - total[low]) / np.where(number > 0, number, np.nan))


def smoothed(chances: Floats, starts: Floats, reach: float) -> Floats:
    """Probabilities (n, classes) by the mean log probability of the windows that begin within ``reach`` [s] of each."""
    if reach <= 0 or len(chances) < 2:
        return chances
    return softmax(nearby_mean(np.log(chances + 1e-9), starts, reach))
