"""Means of a channel, or of a whole log, over windows of time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


def window_means(values: Floats, place: Ints, count: int) -> Floats:
    """Mean of the measured ``values`` (n,) in each of ``count`` windows, NaN where there are none; ``place`` (n,): each value's window,
    never less than the one before."""
    known = np.isfinite(values)
    if not known.all():
        values, place = values[known], place[known]
    edges = np.searchsorted(place, np.arange(count + 1))
    number, used = np.diff(edges), edges[:-1] < len(values)
    total = np.zeros(count)
    total[used] = np.add.reduceat(values, edges[:-1][used])
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def averaged(recording: Recording, step: float) -> Recording:
    """Time and channels of a log as means over windows of ``step`` [s], NaN without a value; as it is where most windows have one row."""
    place = np.floor((recording.time - recording.time[:1]) / step)
    starts = np.flatnonzero(np.diff(place, prepend=np.nan))
    if 2 * len(starts) > len(place):
        return recording
    count = len(starts)
    place = np.repeat(np.arange(count), np.diff(starts, append=len(place)))
    channels = {name: window_means(values, place, count) for name, values in recording.channels.items()}
    time = window_means(recording.time, place, count)
    return replace(recording, time=time, channels=channels, labels={})
