"""What stands in a MATLAB file beside structs, lists and texts: numbers that are read when they are asked for, and objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Opaque:
    """A value that holds no signal that can be read; ``kind`` names its MATLAB class where it is known."""

    kind: str = ""


@dataclass(frozen=True, eq=False)
class Array:
    """A numeric array, read when it is asked for; ``shape`` as in MATLAB.

    ``part`` reads what two indices or slices select of a vector or matrix; without it the whole array is read for that.
    """

    shape: tuple[int, ...]
    read: Callable[[], npt.NDArray[Any]]
    part: Callable[[Any, Any], npt.NDArray[Any]] | None = None

    def column(self, number: int, length: int, rows: slice = slice(None)) -> npt.NDArray[Any]:
        """Some rows of a column, where the array has ``length`` rows (or is a vector of as many numbers)."""
        if self.part is not None:
            return self.part(rows, number)
        return self.read().reshape(length, -1)[rows, number]


def texts_of(value: Any) -> npt.NDArray[np.object_] | None:
    """A text for each instant (n,), as a cell of texts or an array of strings holds labels, missing = empty; None of anything else."""
    if not isinstance(value, list) or len(value) < 2 or not any(isinstance(part, str) for part in value):
        return None
    if not all(part is None or isinstance(part, str) for part in value):
        return None
    return np.array([(part or "").strip() for part in value], dtype=object)


def read_array(value: Any) -> npt.NDArray[Any]:
    """The numbers of an `Array`, or of what is one already."""
    return value.read() if isinstance(value, Array) else np.asarray(value)
