"""Estimates in memory for the pages, and their columns cut to what a screen can show."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
T = TypeVar("T")

KEPT = 4
"""Tables held in memory."""


class Tables(Generic[T]):
    """A small cache of what a loader reads from files, by path, size and time of change. Thread-safe."""

    def __init__(self, load: Any, kept: int = KEPT) -> None:
        self._load, self._kept = load, kept
        self._lock = threading.Lock()
        self._held: OrderedDict[tuple[str, int, int, str], T] = OrderedDict()

    def get(self, path: Path, *more: str) -> T:
        """What the loader makes of `path` (and further words); raises as the loader."""
        status = path.stat()
        key = (str(path), status.st_size, status.st_mtime_ns, "\0".join(more))
        with self._lock:
            if key not in self._held:
                self._held[key] = self._load(path, *more)
                while len(self._held) > self._kept:
                    self._held.popitem(last=False)
            self._held.move_to_end(key)
            return self._held[key]


def buckets(time: Floats, start: float, end: float, width: int) -> npt.NDArray[np.intp]:
    """Row numbers where each of at most `width` buckets of equal time begins, and one past the last row; shape (buckets + 1,).

    Covers the rows with start <= time <= end and one on either side, so that a line reaches the edges.
    """
    first = max(int(np.searchsorted(time, start, "left")) - 1, 0)
    last = min(int(np.searchsorted(time, end, "right")) + 1, len(time))
    if last - first <= 2 * width:
        return np.arange(first, last + 1)
    edges = np.linspace(time[first], time[last - 1], width + 1)[1:-1]
    inner = np.searchsorted(time[first:last], edges, "left") + first
    return np.unique(np.concatenate(([first], inner, [last])))


def extremes(values: Floats, starts: npt.NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Smallest and largest value of each bucket, shape (buckets,) each; NaN where a bucket holds nothing else."""
    part = values[: starts[-1]]
    return np.fmin.reduceat(part, starts[:-1]), np.fmax.reduceat(part, starts[:-1])


def packed(head: dict[str, Any], columns: Sequence[npt.NDArray[Any]]) -> bytes:
    """A binary message: length of the head (uint32, little-endian), the head as JSON padded to 8 bytes, the columns one after another
    in their own types (float64 first keeps all aligned)."""
    text = json.dumps(head).encode()
    text += b" " * (-(len(text) + 4) % 8)
    return b"".join(
        (len(text).to_bytes(4, "little"), text, *(np.ascontiguousarray(c).tobytes() for c in columns))
    )
