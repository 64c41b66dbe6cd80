"""Held channels: values that a logger repeats between true updates.

To distinguish a held channel from a fresh one: a fresh sample repeats its predecessor exactly only when the
signal moved by less than its quantum (all steps are multiples of it). A run of equal values then
ends in a step of about one quantum, or belongs to a standstill that happens a few times a log. A held
channel shows run after run of two and more equal values that begin and end with steps of several quanta,
alike in length. So only runs between two large steps count, which excludes standstill and slow quantised
signals. There must be eight of them, repeats must be commoner among them than the size of the steps allows by
chance, and three fifths must last between half and twice the median.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.recording.chunks import sampled_rows
from terragrip.recording.ranks import median
from terragrip.recording.schema import REFERENCE

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


_FEWEST_RUNS = 8
_REGULAR_SHARE = 0.6
_LARGE_STEP = 1.5  # quanta: halfway between a single step and a double one
_WORTH_A_LOOK = 0.01  # share of exact repeats below which a channel counts as fresh
_ABSURD = 1e150
_SPIKES = 0.25  # share of steps that may be to spikes and back; of continuous steps .96 are no multiples of anything
_FINER = 4.0  # times a resolution: as much coarser may most steps be by chance
_WILD = 1000.0  # times the usual size of what is not 0: from 100 on no digit of an ordinary log moves
_ENOUGH = 1000  # values that show the usual size


def held_periods(recording: Recording) -> dict[str, float]:
    """Update period [s] of each channel whose values are held between updates; fresh channels are absent."""
    result = {}
    for name, values in recording.channels.items():
        if name.startswith(REFERENCE):
            continue
        period = held_period(recording.time, values)
        if period is not None:
            result[name] = period
    return result


def held_period(time: Floats, values: Floats) -> float | None:
    """Mean time [s] between true updates of one channel (n,), or None if it is fresh (see above)."""
    time, values = measured_part(time, values)
    if len(values) < 2 or np.count_nonzero(values[1:] == values[:-1]) < _WORTH_A_LOOK * len(values):
        return None
    starts = _run_starts(values)
    steps = np.abs(np.diff(values[starts]))
    if len(steps) < _FEWEST_RUNS + 1:
        return None
    resolution = quantum(values)
    in_quanta = steps / resolution if resolution > 0.0 else np.full(len(steps), np.inf)
    large = in_quanta > _LARGE_STEP
    between = large[:-1] & large[1:]
    lengths = np.diff(starts)[1:][between]
    lasting = np.diff(time[starts])[1:][between]
    if len(lengths) < _FEWEST_RUNS:
        return None
    # A Gaussian increment of median size m quanta repeats with probability 0.27/m; three times that is not chance.
    by_chance = 0.8 / median(in_quanta)
    typical = median(lasting)
    alike = (lasting > 0.49 * typical) & (lasting < 2.1 * typical)
    if np.mean(lengths >= 2) <= max(0.2, by_chance) or alike.mean() < _REGULAR_SHARE:
        return None
    # Twice the median is a missed update, unless updates come almost with every row.
    return float(lasting[alike & ((lasting < 1.7 * typical) | (median(lengths) < 2))].mean())


def fresh_samples(time: Floats, values: Floats, period: float) -> Bools:
    """Which samples (n,) of a channel held for ``period`` [s] are true updates.

    A changed value is one. A value held for longer than 1.5 periods counts again, once a period, where
    it is 0 (standstill) or where the channel's steps are so coarse that equal updates are to be
    expected; elsewhere the sensor counts as silent.
    """
    fresh = np.zeros(len(values), dtype=bool)
    rows = np.flatnonzero(np.isfinite(values))
    if not len(rows):
        return fresh
    known, when = values[rows], time[rows]
    starts = _run_starts(known)
    steps = np.abs(np.diff(known[starts]))
    coarse = len(steps) > 0 and bool(np.mean(steps < _LARGE_STEP * quantum(known)) >= 0.1)
    since = when - np.repeat(when[starts], np.diff(np.r_[starts, len(known)]))
    updates = np.maximum(np.floor(since / period - 0.5 + 1e-9), 0)
    again = np.r_[False, np.diff(updates) > 0] & ((known == 0) | coarse)
    again[starts] = True
    fresh[rows] = again
    return fresh


def without_held(recording: Recording, held: dict[str, float] | None = None) -> Recording:
    """The recording with held samples missing (NaN); ``held`` from `held_periods`, None: find it."""
    held = held_periods(recording) if held is None else held
    channels = dict(recording.channels)
    for name, period in held.items():
        fresh = fresh_samples(recording.time, channels[name], period)
        channels[name] = np.where(fresh, channels[name], np.nan)
    return replace(recording, channels=channels)


def quantum(values: Floats) -> float:
    """The quantum of a channel, its resolution: all steps between neighbours (n,) are multiples of it; 0 if there is none.

    By a sample of the steps, without spoiled values. Steps to spikes and back need be no multiples: a quarter of the steps may miss it,
    unless what divides all but one in a hundred kinds of step is not much finer.
    """
    values = usual_values(values)
    steps = np.abs(np.diff(values))
    least = 1e-9 * float(np.max(np.abs(values), initial=0.0))
    steps, count = np.unique(steps[steps > least][:: max(1, len(steps) // 2000)], return_counts=True)
    steps, count = steps[:500], count[:500]
    exact = _common_divisor(steps, np.ones(len(steps)), least, 0.01)
    usual = _common_divisor(steps, count.astype(float), least, _SPIKES)
    return exact if _FINER * exact >= usual else usual


def _common_divisor(steps: Floats, weight: Floats, least: float, odd_share: float) -> float:
    """Euclid's algorithm: a remainder up to 2 % of the divisor counts as none, and steps (n,) of that share of the weight may have one."""
    step = float(steps[0]) if len(steps) else 0.0
    while step > least:
        rest = np.mod(steps, step)
        rest = np.minimum(rest, step - rest)
        odd = rest > 0.02 * step
        if weight[odd].sum() <= odd_share * weight.sum():
            return step
        step = float(rest[odd].min())
    return 0.0


def usual_values(values: Floats) -> Floats:
    """The values (n,) without spoiled ones, beside which all others are alike: `_WILD` times the usual size; the array itself if it has
    none."""
    few = np.abs(values[:: max(1, len(values) // _ENOUGH)])
    few = few[few > 0.0]
    if not len(few):
        return values
    most = _WILD * median(few)
    if not len(values) or max(np.max(values), -np.min(values)) <= most:
        return values
    return values[np.abs(values) <= most]


def measured_part(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The measured samples of a channel; of a long one those in the log's sample (`sampled_rows`)."""
    rows = sampled_rows(len(values))
    return known_part(time[rows], values[rows])


def measurable(values: Floats) -> Floats:
    """A channel's values, NaN where one is so large that its square is infinite, as loggers write where nothing was measured."""
    absurd = np.abs(values) > _ABSURD
    return np.where(absurd, np.nan, values) if absurd.any() else values


def known_part(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The samples of a channel that are numbers; where all are, the arrays themselves."""
    known = np.isfinite(values)
    return (time, values) if known.all() else (time[known], values[known])


def _run_starts(values: Floats) -> Ints:
    return np.r_[0, np.flatnonzero(values[1:] != values[:-1]) + 1]
