"""Estimates in memory for the pages, and their columns cut to what a screen can show."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt
from starlette.responses import Response

from terragrip.arrays import Floats, Ints

T = TypeVar("T")

KEPT = 4
"""Tables held in memory."""
BLOCK = 16
"""Rows whose smallest and largest value are kept ready."""
LONG = 8
"""Blocks in a bucket from which on they are taken."""


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


def buckets(time: Floats, start: float, end: float, width: int) -> Ints:
    """Row numbers where each of at most `width` buckets of equal time begins, and one past the last row; shape (buckets + 1,).

    Covers the rows with start <= time <= end and one on either side, so that a line reaches the edges. Long buckets begin at a multiple
    of `BLOCK`, where `Extremes` are ready; that moves an edge by less than a tenth of a bucket.
    """
    first = max(int(np.searchsorted(time, start, "left")) - 1, 0)
    last = min(int(np.searchsorted(time, end, "right")) + 1, len(time))
    if last - first <= 2 * width:
        return np.arange(first, last + 1)
    edges = np.linspace(time[first], time[last - 1], width + 1)[1:-1]
    inner = np.searchsorted(time[first:last], edges, "left") + first
    if are_long(last - first, width):
        inner = (inner + BLOCK // 2) // BLOCK * BLOCK
        inner = inner[(inner >= first + 2 * BLOCK) & (inner <= last - BLOCK)]  # a whole block at either end
    return np.unique(np.concatenate(([first], inner, [last])))


def are_long(rows: int, width: int) -> bool:
    """Whether `width` buckets of so many rows are long enough for `Extremes`."""
    return rows > LONG * BLOCK * width


def extremes(values: Floats, starts: Ints) -> tuple[Floats, Floats]:
    """Smallest and largest value of each bucket, shape (buckets,) each; NaN where a bucket holds nothing else."""
    part = values[starts[0] : starts[-1]]
    places = starts[:-1] - starts[0]
    return np.fmin.reduceat(part, places), np.fmax.reduceat(part, places)


class Extremes:
    """Smallest and largest value of each `BLOCK` rows of a column, from which those of long buckets follow fast."""

    def __init__(self, values: Floats) -> None:
        self._low, self._high = extremes(values, np.append(np.arange(0, len(values), BLOCK), len(values)))

    def of(self, values: Callable[[slice], Floats], starts: Ints) -> tuple[Floats, Floats]:
        """As `extremes`, of buckets that begin at multiples of `BLOCK` but for the first; ``values`` gives rows of the column."""
        edges = starts // BLOCK
        edges[0] = -(-starts[0] // BLOCK)
        low, high = (
            reduce.reduceat(part[: edges[-1]], edges[:-1])
            for reduce, part in ((np.fmin, self._low), (np.fmax, self._high))
        )
        for bucket, rows in (
            (0, slice(starts[0], edges[0] * BLOCK)),
            (-1, slice(edges[-1] * BLOCK, starts[-1])),
        ):
            rest = values(rows)
            if len(rest):
                low[bucket] = np.fmin(low[bucket], np.fmin.reduce(rest))
                high[bucket] = np.fmax(high[bucket], np.fmax.reduce(rest))
        return low, high


def packed(head: dict[str, Any], columns: Sequence[npt.NDArray[Any]]) -> Response:
    """A binary message: length of the head (uint32, little-endian), the head as JSON padded to 8 bytes, the columns one after another
    in their own types (float64 first keeps all aligned). The head's ``count`` says how long each is."""
    text = json.dumps({**head, "count": len(columns[0])}).encode()
    text += b" " * (-(len(text) + 4) % 8)
    parts = (len(text).to_bytes(4, "little"), text, *(np.ascontiguousarray(c).tobytes() for c in columns))
    return Response(b"".join(parts), media_type="application/octet-stream")
