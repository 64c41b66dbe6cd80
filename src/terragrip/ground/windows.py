"""Windows in time: where they lie in a recording, and the samples of a channel in each of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from terragrip.ground.channels import Channel

Floats = npt.NDArray[np.float64]

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
    channel: Channel, starts: Floats, window: float, period: float, anchor: Channel | None = None
) -> Floats:
    """Values (windows, samples) of a channel every ``period`` [s] from its first sample in each window.

    Between samples they are interpolated, so a regular channel comes out as it was measured. ``anchor`` gives
    the instants in place of the channel itself, so that channels can be compared. A window that is measured
    in less than four fifths of its samples is NaN throughout.
    """
    count = max(round(window / period), 1)
    lead = (anchor or channel).time
    first = np.minimum(np.searchsorted(lead, starts - 1e-6 * period), len(lead) - 1)
    instants = lead[first][:, None] + period * np.arange(count)
    values = np.interp(instants, channel.time, channel.values)
    right = np.searchsorted(channel.time, instants)
    before = channel.time[np.maximum(right - 1, 0)]
    after = channel.time[np.minimum(right, len(channel.time) - 1)]
    near = np.minimum(np.abs(instants - before), np.abs(after - instants))
    inside = (instants > starts[:, None] - period) & (instants < starts[:, None] + window + period)
    measured = (near <= _NEAR * max(period, channel.period)) & inside
    values[measured.mean(axis=1) < _MEASURED] = np.nan
    return values
