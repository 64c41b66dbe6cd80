"""Rows of a log with one and the same stamp, or a place late: a logger that writes twice, or a row for each message."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools
from terragrip.recording.columns import label_of

Column = npt.NDArray[Any]
LATE = 3
"""Places by which a message may come after later ones. A clock that was set back moves more rows or leaves short steps, and is refused."""
_SHORT = (
    0.75  # of the shortest other step: a clock set back by one to three of them leaves half of one at most
)


@dataclass(frozen=True)
class Repeats:
    """How many rows repeat the stamp before them: ``merged`` with it, or ``other``, left as they are because values differ; and how
    many were ``late``, after rows of later stamps.
    """

    merged: int = 0
    other: int = 0
    late: int = 0

    def __add__(self, more: Repeats) -> Repeats:
        return Repeats(self.merged + more.merged, self.other + more.other, self.late + more.late)

    def notes(self) -> list[str]:
        """A sentence for the user on each."""
        counted = "1 row repeats" if self.merged == 1 else f"{self.merged} rows repeat"
        late = "1 row stands" if self.late == 1 else f"{self.late} rows stand"
        sentences = [f"{counted} the time of the row before without another value: merged with it."]
        return sentences * (self.merged > 0) + [
            f"{late} behind rows of later stamps, by {LATE} places at most: sorted by time."
        ] * (self.late > 0)


def merged(columns: Mapping[str, Column], stamp: str) -> tuple[dict[str, Column], Repeats]:
    """Columns (n,) with one row for each run of equal stamps in the column ``stamp`` whose values do not differ, and the repeats.

    Rows that stand up to `LATE` places too late are sorted before.
    A value missing in one row of a run is filled from the others: a logger writes a row for each message, or writes twice.
    A run with two different values in a column is left as it is, for the recording to refuse: nothing shows which was measured when.
    """
    columns, late = _in_order(columns, stamp)
    stamps = columns[stamp]
    again = np.r_[False, stamps[1:] == stamps[:-1]]
    if not again.any():
        return dict(columns), Repeats(late=late)
    rows, starts = np.arange(len(stamps)), np.flatnonzero(~again)
    run = np.cumsum(~again) - 1
    differs, filled = np.zeros(len(starts), dtype=bool), {}
    for name, column in columns.items():
        known = _known(column)
        last = np.maximum.reduceat(np.where(known, rows, -1), starts)
        filled[name] = np.where(last < 0, starts, last)
        differs[run[known & ~_alike(column, column[filled[name][run]])]] = True
    kept = ~again | differs[run]
    result = {
        name: column[np.where(differs[run], rows, filled[name][run])[kept]]
        for name, column in columns.items()
    }
    return result, Repeats(len(stamps) - int(kept.sum()), int((again & differs[run]).sum()), late)


def _in_order(columns: Mapping[str, Column], stamp: str) -> tuple[Mapping[str, Column], int]:
    """Columns (n,) sorted by stamp where no row stands more than `LATE` places from its own, and how many stood behind it."""
    stamps = columns[stamp]
    if stamps.dtype.kind not in "fiuM" or not (stamps[1:] < stamps[:-1]).any():
        return columns, 0
    order = np.argsort(stamps, kind="stable")
    moved = order - np.arange(len(order))
    if np.abs(moved).max() > LATE or _was_set_back(np.diff(stamps[order]), moved != 0):
        return columns, 0
    return {name: column[order] for name, column in columns.items()}, int((moved > 0).sum())


def _was_set_back(steps: Column, moved: Bools) -> bool:
    """Whether sorted rows (n,) of which some ``moved`` in one place alone are closer to one another there than rows are anywhere else: two
    runs of a clock. A channel whose messages all come late is moved in many."""
    if np.ptp(np.flatnonzero(moved)) > 2 * LATE:
        return False
    goes_on = steps.astype(bool)
    there = (moved[1:] | moved[:-1])[goes_on]
    steps = steps[goes_on]
    return 0 < there.sum() < len(steps) and bool(steps[there].min() < _SHORT * steps[~there].min())


def _known(column: Column) -> Bools:
    if column.dtype.kind == "O":
        return np.array([label_of(cell) != "" for cell in column], dtype=bool)
    return np.asarray(column == column)  # a missing value is unequal to itself


def _alike(column: Column, other: Column) -> Bools:
    if column.dtype.kind == "O":
        return np.array([label_of(a) == label_of(b) for a, b in zip(column, other, strict=True)], dtype=bool)
    return np.asarray(column == other)
