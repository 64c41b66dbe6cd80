"""Rows that repeat earlier ones value for value: a logger that wrote a buffer twice; sentences for the user, never errors.

Noise never repeats, so a run of rows whose channels change as those of an earlier run do, to the last digit, is a copy of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Ints
from terragrip.recording.stretches import is_one_value

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_CHANNELS = 4  # that change within the rows
_CHANGES = 10  # of each of these: a coarse channel has two values to choose from each time, all together 2^40
_MISSING = np.int64(0x7FF8 << 48)


def replay_warnings(recording: Recording) -> list[str]:
    """A sentence on the longest run of rows that are those of an earlier run."""
    values = [v for v in recording.channels.values() if not is_one_value(v)]
    if len(values) < _CHANNELS:
        return []
    coded = np.array([np.where(np.isnan(v), _MISSING, (v + 0.0).view(np.int64)) for v in values])
    differs = coded[:, 1:] != coded[:, :-1]
    kept = np.r_[0, np.flatnonzero(differs.any(axis=0)) + 1]  # a row that keeps all values is none of its own
    first, last, distance = _longest(_hashes(coded[:, kept]))
    if not distance or last - first < _CHANGES:
        return []
    rows = slice(kept[first], kept[last])
    if np.sum(np.count_nonzero(differs[:, rows], axis=1) >= _CHANGES) < _CHANNELS:
        return []
    start, end, before, until = (
        recording.time[kept[k]] for k in (first, last, first - distance, last - distance)
    )
    return [
        f"The rows from {start:.5g} to {end:.5g} s repeat those from {before:.5g} to {until:.5g} s to the last digit: the logger wrote a "
        "buffer twice. Leave the second ones out."
    ]


def _hashes(coded: Ints) -> Ints:
    """A number for each row (n,) of channels (k, n), equal where all values are."""
    factors = np.random.default_rng(0).integers(1 << 62, size=len(coded), dtype=np.int64) | 1
    mixed = coded ^ (coded >> np.int64(29))
    return np.sum(mixed * factors[:, None], axis=0)


def _longest(rows: Ints) -> tuple[int, int, int]:
    """First and last of the longest run of rows (n,) equal to those at one distance before them, and that distance (0: none is)."""
    order = np.argsort(rows, kind="stable")
    again = np.flatnonzero(rows[order[1:]] == rows[order[:-1]])
    distance = np.zeros(len(rows), dtype=np.intp)
    distance[order[again + 1]] = order[again + 1] - order[again]
    cut = np.flatnonzero(np.r_[True, distance[1:] != distance[:-1], True])
    lengths = np.where(distance[cut[:-1]] > 0, np.diff(cut), 0)
    k = int(np.argmax(lengths))
    return int(cut[k]), int(cut[k + 1] - 1), int(distance[cut[k]])
