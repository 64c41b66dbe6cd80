"""Samples of one cycle, stamped milliseconds apart as a bus carries them: to the estimates they are of one instant (decision 0167).

A step then ends with the torque of its own cycle, and what happens to several channels at once is judged at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.recording.ranks import median
from terragrip.recording.schema import CARRIED, REFERENCES

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

CYCLE = 0.05
"""Share of the shortest typical spacing of a channel's samples within which samples of different channels are of one cycle."""


def cycle_of(time: Floats, channels: Mapping[str, Floats]) -> float:
    """Time [s] within which rows (n,) are of one cycle; 0 where no channel has three values."""
    shortest = np.inf
    for values in _measured(channels).values():
        known = ~np.isnan(values)
        if np.count_nonzero(known) > 2:
            shortest = min(shortest, median(np.diff(time[known])))
    return CYCLE * shortest if np.isfinite(shortest) else 0.0


def cycles_in(recording: Recording, cycle: float) -> Ints:
    """The first rows (m,) of the cycles of a recording.

    Rows no further apart than ``cycle`` [s] are one where that joins no two values of a channel.
    """
    apart = np.r_[True, np.diff(recording.time) > cycle]
    starts = np.flatnonzero(apart)
    twice = np.zeros(len(starts), dtype=bool)
    for values in _measured(recording.channels).values():
        twice |= np.add.reduceat(~np.isnan(values), starts, dtype=np.intp) > 1
    return np.flatnonzero(apart | twice[np.cumsum(apart) - 1])


def joined_at(recording: Recording, starts: Ints) -> Recording:
    """One row for each cycle (m,): at the instant of its first row, with the first value that each channel has in it."""
    rows = np.arange(len(recording))
    channels = {}
    for name, values in recording.channels.items():
        first = np.minimum.reduceat(np.where(np.isnan(values), len(rows), rows), starts)
        channels[name] = np.where(first < len(rows), values[np.minimum(first, len(rows) - 1)], np.nan)
    labels = {name: texts[starts] for name, texts in recording.labels.items()}
    return replace(recording, time=recording.time[starts], channels=channels, labels=labels)


def has_full(blocks: Sequence[Recording]) -> bool:
    """Whether a channel was measured in every row of all blocks of a log, so that no two rows can be of one cycle."""
    names = _measured(blocks[0].channels)
    return any(not any(np.isnan(block.channels[name]).any() for block in blocks) for name in names)


def in_cycles(recording: Recording) -> Recording:
    """The recording with one row for each cycle; itself where no two rows are of one."""
    if has_full([recording]):
        return recording
    starts = cycles_in(recording, cycle_of(recording.time, recording.channels))
    return recording if len(starts) == len(recording) else joined_at(recording, starts)


def _measured(channels: Mapping[str, Floats]) -> dict[str, Floats]:
    """What the estimates follow from: neither references nor what is only passed on."""
    return {n: v for n, v in channels.items() if n not in CARRIED and not n.startswith(REFERENCES)}
