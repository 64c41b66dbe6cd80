"""Rows of a log that bear one and the same stamp: a logger that writes twice, or whose clock is coarser than its rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.recording.columns import label_of

Column = npt.NDArray[Any]
Bools = npt.NDArray[np.bool_]

_COARSE = 0.1  # of the rows; with more, it is the clock and no slip of the logger


@dataclass(frozen=True)
class Repeats:
    """Of ``rows`` those that repeat the stamp before them, and its values (``same``) or not (``other``)."""

    rows: int = 0
    same: int = 0
    other: int = 0

    def __add__(self, more: Repeats) -> Repeats:
        return Repeats(self.rows + more.rows, self.same + more.same, self.other + more.other)

    @property
    def instants(self) -> int:
        """How many rows are left."""
        return self.rows - self.same - self.other

    def notes(self) -> list[str]:
        """One sentence for the user, or none."""
        parts = []
        if self.same:
            parts.append(
                f"{_counted(self.same)} the row before, time and values, and {_are(self.same)} left out"
            )
        if self.other:
            parts.append(
                f"{_counted(self.other)} the time of the row before: of each column the last value counts"
            )
        if self.same + self.other > _COARSE * self.rows:
            parts.append("the stamps are coarser than the rows: log them finer")
        return [f"{'; '.join(parts)}."] if parts else []


def once_each(columns: Mapping[str, Column], stamp: str) -> tuple[dict[str, Column], Repeats]:
    """Columns (n,) with one row for each run of equal stamps in the column ``stamp``, and what was repeated.

    Of each column the last value of the run that is not missing counts, as of signals with clocks of their own: rows that a logger
    writes for one message each are put together.
    """
    stamps = columns[stamp]
    again = np.r_[False, stamps[1:] == stamps[:-1]] if len(stamps) else np.zeros(0, dtype=bool)
    if not again.any():
        return dict(columns), Repeats(len(stamps))
    rows, starts = np.arange(len(stamps)), np.flatnonzero(~again)
    same, result = again.copy(), {}
    for name, column in columns.items():
        known, alike = _known(column), _alike(column)
        last = np.maximum.reduceat(np.where(known, rows, -1), starts)
        result[name] = column[np.maximum(last, starts)]
        same[1:] &= alike | ~(known[1:] | known[:-1])
    count = int(same.sum())
    return result, Repeats(len(stamps), count, int(again.sum()) - count)


def _known(column: Column) -> Bools:
    if column.dtype.kind == "O":
        return np.array([label_of(cell) != "" for cell in column], dtype=bool)
    return np.asarray(column == column)  # what is missing is unequal to itself


def _alike(column: Column) -> Bools:
    """Which cells equal the one before (n - 1,)."""
    if column.dtype.kind == "O":
        return np.array(
            [label_of(a) == label_of(b) for a, b in zip(column[1:], column[:-1], strict=True)], dtype=bool
        )
    return np.asarray(column[1:] == column[:-1])


def _counted(count: int) -> str:
    return "1 row repeats" if count == 1 else f"{count} rows repeat"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"
