"""Windows in time: where they lie in a recording, and the samples of a channel in each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.classification.channels import Channel

_MEASURED = 0.8  # share of a window's samples that must lie near a measured one
_NEAR = 1.5  # periods


def window_starts(start: float, end: float, window: float, step: float) -> Floats:
    """Starts (n,) [s] of the whole windows between ``start`` and ``end``, ``step`` apart.

    A recording shorter than one window still has one, so that every recording is given an answer.
    """
    room = end - start - window
    # A hundredth of a window forgives the last sample's period and rounding.
    count = max(int(np.floor((room + 0.01 * window) / step)) + 1, 1)
    return start + step * np.arange(count, dtype=float)


def samples_in(
    channels: Sequence[Channel], starts: Floats, window: float, period: float, lead: Channel
) -> Floats:
    """Values (windows, channels, samples) every ``period`` [s] from the first sample of ``lead`` in each window.

    Between samples they are interpolated, so a regular channel comes out as it was measured. A window that a
    channel was measured in for less than four fifths of the samples is NaN throughout.
    """
    count = max(round(window / period), 1)
    first = np.minimum(np.searchsorted(lead.time, starts - 1e-6 * period), len(lead.time) - 1)
    instants = lead.time[first][:, None] + period * np.arange(count)
    inside = (instants > starts[:, None] - period) & (instants < starts[:, None] + window + period)
    result = np.empty((len(starts), len(channels), count))
    before: Channel | None = None
    measured = np.empty(0, dtype=bool)
    for k, channel in enumerate(channels):
        if before is None or not np.array_equal(channel.time, before.time):
            near = _distance(channel.time, instants) <= _NEAR * max(period, channel.period)
            measured = (near & inside).mean(axis=1) >= _MEASURED
        result[:, k] = np.interp(instants, channel.time, channel.values)
        result[~measured, k] = np.nan
        before = channel
    return result


def _distance(time: Floats, instants: Floats) -> Floats:
    """Time [s] from each instant to the nearest sample."""
    right = np.searchsorted(time, instants)
    before = np.abs(instants - time[np.maximum(right - 1, 0)])
    return np.minimum(before, np.abs(time[np.minimum(right, len(time) - 1)] - instants))
