"""Stretches of a channel in which something lasts, and values that move once and stay: what the checks of parts of a drive share."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from terragrip.arrays import Bools, Floats
from terragrip.recording.noise import MAD_TO_SD
from terragrip.recording.ranks import median, quantile

LONG = 5.0
"""s that a value may be repeated."""
DRIVING = 0.3
"""Of the speed that a twentieth of the drive exceeds."""

_GAP, _APART = 1.0, 3.0  # s, and times the usual distance of samples
# Within `LONG`: samples; a value that is repeated for so long is found at half of them in succession.
_LOOKS = 8
_FEW = 4000  # rows that show how far rows are apart
_STAYS = 3.0  # times what it changes from half to half of either side
_ALONE = 4.0  # standard deviations of what means of a moment differ by


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


def without_pauses(time: Floats, longest: float) -> Floats:
    """Instants (n,) [s] whose pauses are cut to ``longest`` [s]: as they are without any."""
    steps = np.diff(time, prepend=time[:1])
    return time if steps.max(initial=0.0) <= longest else time[0] + np.cumsum(np.minimum(steps, longest))


def gaps(when: Floats) -> Bools:
    """Where samples at these instants (n,) are missing (n - 1,): no value is repeated across."""
    steps = np.diff(when)
    if steps.max(initial=0.0) <= _GAP:  # of most logs
        return np.zeros(len(steps), dtype=bool)
    return steps > max(_GAP, _APART * median(steps))


def is_one_value(values: Floats) -> bool:
    """Whether the finite values, three at least, are all equal."""
    for part in (values[:_LOOKS], values):  # the first show of most that they are not
        known = part[np.isfinite(part)]
        if len(known) > 1 and np.ptp(known) != 0.0:
            return False
    return len(known) > 2


def step_of(values: Floats, least: float, *, beyond: float, long: int) -> tuple[int, float] | None:
    """The place from which on the median of values (n,) is another, and by how much: by more than ``least``, than ``beyond`` standard
    deviations of a value about both medians, and than `_STAYS` times what they change within either side. None where there is none, or
    less than ``long`` of them on either side."""
    count = len(values)
    if count < 2 * long:
        return None
    place = np.arange(long, count - long + 1)
    total = np.cumsum(values)
    apart = (total[-1] - total[place - 1]) / (count - place) - total[place - 1] / place
    at = int(place[np.argmax(np.abs(apart) * np.sqrt(place * (count - place)))])
    sides = values[:at], values[at:]
    low, high = (median(side) for side in sides)
    scatter = MAD_TO_SD * median(np.abs(np.r_[sides[0] - low, sides[1] - high]))
    halves = [part for side in sides for part in np.array_split(side, 2)]
    drift = max(abs(median(halves[k]) - median(halves[k + 1])) for k in (0, 2))
    size = high - low
    return (at, size) if abs(size) > max(least, beyond * scatter, _STAYS * drift) else None


def instant_of(
    time: Floats, values: Floats, size: float, *, gap: float, span: float, share: float
) -> float | None:
    """When values (n,), NaN where unknown, step at once by about ``size``: where the means of ``span`` [s] before and after differ most
    in its way, ``gap`` [s] left out on both sides. None where that is not between ``share`` and 1/share of it, or not beyond what such
    means usually differ by there, as those of torques do that ripple lug by lug."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < 3:
        return None
    total = np.r_[0.0, np.cumsum(values)]
    middle = (time[1:] + time[:-1]) / 2

    def mean(begin: float) -> Floats:
        """Of the values within ``span`` from ``begin`` after each middle; NaN where half of the usual number is not known."""
        first, last = np.searchsorted(time, middle + begin), np.searchsorted(time, middle + begin + span)
        count = last - first
        return np.where(
            count > median(count) / 2, (total[last] - total[first]) / np.maximum(count, 1), np.nan
        )

    steps = np.nan_to_num(mean(gap) - mean(-gap - span)) * np.sign(size)
    k, usual = int(np.argmax(steps)), MAD_TO_SD * median(np.abs(steps))
    return (
        float(middle[k])
        if max(share, _ALONE * usual / abs(size)) < steps[k] / abs(size) < 1 / share
        else None
    )
