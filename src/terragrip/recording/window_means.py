"""Means of a channel, or of a whole log, over windows of time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


_PAUSE = 10  # windows: more than any of them is compared with


def windows_of(time: Floats, length: float) -> tuple[Ints, Floats]:
    """The window of ``length`` [s] of each row (n,), and when each window starts [s]. Of a longer pause `_PAUSE` windows are left: a clock
    set from 1970 in the middle of a log would make a thousand million."""
    place = np.floor((time - time[0]) / length)
    shut = np.cumsum(np.maximum(np.diff(place, prepend=0.0) - _PAUSE, 0.0))
    place = (place - shut).astype(np.intp)
    number = np.arange(int(place[-1]) + 1)
    after = np.minimum(np.searchsorted(place, number), len(time) - 1)
    return place, np.asarray(time[0] + length * (number + shut[after]))


def window_means(values: Floats, place: Ints, count: int) -> Floats:
    """Mean of the measured ``values`` (n,) in each of ``count`` windows, NaN where there are none; ``place`` (n,): each value's window,
    never less than the one before."""
    known = np.isfinite(values)
    if not known.all():
        values, place = values[known], place[known]
    return _means(values, np.searchsorted(place, np.arange(count + 1)))


def _means(values: Floats, edges: Ints) -> Floats:
    """Means of values (n,) between ``edges`` (m + 1,), NaN where these are equal."""
    number, used = np.diff(edges), edges[:-1] < len(values)
    total = np.zeros(len(number))
    total[used] = np.add.reduceat(values, edges[:-1][used])
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def averaged(recording: Recording, step: float) -> Recording:
    """Time and channels of a log as means over windows of ``step`` [s], NaN without a value; as it is where most windows have one row."""
    place = np.floor((recording.time - recording.time[:1]) / step)
    starts = np.flatnonzero(np.diff(place, prepend=np.nan))
    if 2 * len(starts) > len(place):
        return recording
    edges = np.r_[starts, len(place)]
    place = np.repeat(np.arange(len(starts)), np.diff(edges))

    def means(values: Floats) -> Floats:
        whole = np.isfinite(values).all()
        return _means(values, edges) if whole else window_means(values, place, len(starts))

    channels = {name: means(values) for name, values in recording.channels.items()}
    return replace(recording, time=means(recording.time), channels=channels, labels={})
