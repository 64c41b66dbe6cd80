"""A value that moves once in a drive, and stays: what the checks for zeros and scales that change within a log share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.noise import MAD_TO_SD
from terragrip.recording.ranks import median

_STAYS = 3.0  # times what it changes from half to half of either side


@dataclass(frozen=True)
class Step:
    """A series (n,) has its medians ``size`` apart before and from its place ``at`` on."""

    at: int
    size: float


def step_of(values: Floats, least: float, *, beyond: float, long: int) -> Step | None:
    """The step of values (n,) that is larger than ``least``, than ``beyond`` standard deviations of a value about both medians, and than
    `_STAYS` times what they change within either side; None where there is none, or less than ``long`` of them on either side."""
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
    return Step(at, size) if abs(size) > max(least, beyond * scatter, _STAYS * drift) else None


def instant_of(
    time: Floats, values: Floats, size: float, *, gap: float, span: float, share: float
) -> float | None:
    """When values (n,), NaN where unknown, step at once by about ``size``: where the means of ``span`` [s] before and after differ most
    in its way, ``gap`` [s] left out on both sides. None where that is not between ``share`` and 1/share of it."""
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
    k = int(np.argmax(steps))
    return float(middle[k]) if share < steps[k] / abs(size) < 1 / share else None
