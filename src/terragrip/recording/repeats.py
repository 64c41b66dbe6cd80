"""Rows of a log with one and the same stamp: a logger that writes twice, or a row for each message."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools
from terragrip.recording.columns import label_of

Column = npt.NDArray[Any]


@dataclass(frozen=True)
class Repeats:
    """How many rows repeat the stamp before them: ``merged`` with it, or ``other``, left as they are because values differ."""

    merged: int = 0
    other: int = 0

    def __add__(self, more: Repeats) -> Repeats:
        return Repeats(self.merged + more.merged, self.other + more.other)

    def notes(self) -> list[str]:
        """One sentence for the user, or none."""
        if not self.merged:
            return []
        counted = "1 row repeats" if self.merged == 1 else f"{self.merged} rows repeat"
        return [f"{counted} the time of the row before without another value: merged with it."]


def merged(columns: Mapping[str, Column], stamp: str) -> tuple[dict[str, Column], Repeats]:
    """Columns (n,) with one row for each run of equal stamps in the column ``stamp`` whose values do not differ, and the repeats.

    A value missing in one row of a run is filled from the others: a logger writes a row for each message, or writes twice.
    A run with two different values in a column is left as it is, for the recording to refuse: nothing shows which was measured when.
    """
    stamps = columns[stamp]
    again = np.r_[False, stamps[1:] == stamps[:-1]]
    if not again.any():
        return dict(columns), Repeats()
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
    return result, Repeats(len(stamps) - int(kept.sum()), int((again & differs[run]).sum()))


def _known(column: Column) -> Bools:
    if column.dtype.kind == "O":
        return np.array([label_of(cell) != "" for cell in column], dtype=bool)
    return np.asarray(column == column)  # a missing value is unequal to itself


def _alike(column: Column, other: Column) -> Bools:
    if column.dtype.kind == "O":
        return np.array([label_of(a) == label_of(b) for a, b in zip(column, other, strict=True)], dtype=bool)
    return np.asarray(column == other)
