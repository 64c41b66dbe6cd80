"""The outline of each column of a log: how it runs, in as few numbers as a small picture needs."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.seen import Seen, read_whole_or_thinned

WIDTH = 80
"""Stretches that a column is cut into."""
Outline = list[tuple[float, float] | None]
"""Of each stretch of a column the smallest and the largest value, in the log's own unit; None where it holds none."""


def outlines(path: str | os.PathLike[str]) -> dict[str, Outline]:
    """The outlines of a log's numeric columns, by name: stretches of equal time, or of equally many rows where there is no time.

    A long log is looked at in parts, as `inspect` does. Raises InputError where it cannot be read.
    """
    log, every = read_whole_or_thinned(path)
    seen = Seen.of(log, whole=every == 1)
    return {name: outline(column, seen.clock_of(name)) for name, column in seen.numbers().items()}


def outline(values: npt.NDArray[Any], time: npt.NDArray[np.float64] | None, width: int = WIDTH) -> Outline:
    """The outline of values (n,) at instants (n,) [s] that run forward; None, or not forward: each row as long as the other."""
    count = len(values)
    known = np.isfinite(values)
    place = np.arange(count, dtype=np.float64)
    if (
        time is not None
        and count > 1
        and np.isfinite(time).all()
        and time[-1] > time[0]
        and np.all(np.diff(time) >= 0)
    ):
        place = time - time[0]
    if not known.any():
        return [None] * width
    span = place[-1] or 1.0
    stretch = np.minimum((place / span * width).astype(np.intp), width - 1)[known]
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    np.minimum.at(low, stretch, values[known])
    np.maximum.at(high, stretch, values[known])
    return [
        (float(f"{a:.5g}"), float(f"{b:.5g}")) if a <= b else None for a, b in zip(low, high, strict=True)
    ]
