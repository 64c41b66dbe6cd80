"""Two courses of one motion on points of one distance in time, compared: which of them is late."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from terragrip.arrays import Floats
from terragrip.recording.ranks import median

STEP = 0.05
"""Time [s] between the points, at least."""
LEAST_TIME, MOST_TIME = 30.0, 1200.0
"""Of a log, from its start [s]."""
CALM = 0.4
"""Time [s] over which a course is smoothed."""

_SLOW = 6.0  # s: slower changes do not show a lag


def points_of(time: Floats, most: float = MOST_TIME) -> tuple[Floats, float] | None:
    """Points (m,) [s] and their distance, as fine as the rows (n,) and no finer than `STEP`; None where the log is short, or its rows
    too far apart to show what changes within seconds."""
    if time[-1] - time[0] < LEAST_TIME:
        return None
    step = max(STEP, median(np.diff(time)))
    if 2 * step >= _SLOW:
        return None
    points = np.arange(time[0], min(time[-1], time[0] + most), step)
    return points, step


def smooth(values: Floats, seconds: float, step: float) -> Floats:
    """Means (n,) over so many seconds; beyond the ends the first and last value are used."""
    half = max(1, round(seconds / step / 2))
    padded = np.cumsum(np.pad(values, (half + 1, half), mode="edge"))
    return (padded[2 * half + 1 :] - padded[: -2 * half - 1]) / (2 * half + 1)


def quick(values: Floats, step: float) -> Floats:
    """The part of a course (n,) that changes within seconds."""
    return smooth(values, CALM, step) - smooth(values, _SLOW, step)


def lag_of(late: Floats, early: Floats, step: float, within: float) -> tuple[float, float, float]:
    """The lag of ``late`` (n,) behind ``early`` (n,) [s], at most ``within``, the correlation there, and without a lag."""
    most = round(within / step)
    late, early = late - late.mean(), (early - early.mean())[most : len(early) - most]
    energy = np.cumsum(np.r_[0.0, late**2])
    size = np.sqrt(
        np.maximum(energy[len(early) :] - energy[: len(late) - len(early) + 1], 0.0) * np.sum(early**2)
    )
    # Not np.correlate: for each lag of a long log BLAS wakes its threads, .2 s in all on a busy machine.
    products = np.einsum("kj,j->k", sliding_window_view(late, len(early)), early)
    found = products / np.where(size > 0, size, np.inf)
    best = int(np.argmax(found))
    return (best - most) * step, float(found[best]), float(found[most])
