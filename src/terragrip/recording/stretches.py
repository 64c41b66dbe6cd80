"""Stretches of a channel in which something lasts: what the checks for values that stay, or drop to 0, share."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from terragrip.arrays import Bools, Floats
from terragrip.recording.ranks import median, quantile

LONG = 5.0
"""s that a value may be repeated."""
DRIVING = 0.3
"""Of the speed that a twentieth of the drive exceeds."""

_GAP, _APART = 1.0, 3.0  # s, and times the usual distance of samples
_LOOKS = (
    8  # within `LONG`: samples; a value that is repeated for so long is found at half of them in succession
)
_FEW = 4000  # rows that show how far rows are apart


def longest(time: Floats, rows: Bools, known: Bools) -> tuple[float, float] | None:
    """First and last instant of the longest run of ``rows`` among those that are ``known`` (n,), if it lasts for `LONG`."""
    if not rows.any():
        return None
    when, inside = time[known], rows[known]
    cut = np.flatnonzero(np.r_[True, (inside[1:] != inside[:-1]) | gaps(when), True])
    runs = inside[cut[:-1]]
    starts, ends = cut[:-1][runs], cut[1:][runs] - 1
    if not len(starts):
        return None
    k = int(np.argmax(when[ends] - when[starts]))
    first, last = float(when[starts[k]]), float(when[ends[k]])
    return (first, last) if last - first >= LONG else None


def may_last(when: Floats, what: Floats) -> bool:
    """Whether a value may be repeated for `LONG`: a quick check of some of the samples (n,)."""
    if len(when) < _LOOKS:
        return False
    every = max(1, len(when) // _FEW)
    step = quantile(np.diff(when[::every]), 0.95) / every
    alike = np.diff(what[:: max(1, int(LONG / _LOOKS / max(step, 1e-9)))]) == 0.0
    least = _LOOKS // 2 - 1
    return len(alike) >= least and bool(sliding_window_view(alike, least).all(axis=1).any())


def gaps(when: Floats) -> Bools:
    """Where samples at these instants (n,) are missing (n - 1,): no value is repeated across."""
    steps = np.diff(when)
    return steps > max(_GAP, _APART * median(steps)) if len(steps) else np.zeros(0, dtype=bool)


def is_one_value(values: Floats) -> bool:
    """Whether the finite values, three at least, are all equal."""
    known = values[np.isfinite(values)]
    return len(known) > 2 and bool(np.ptp(known) == 0.0)
