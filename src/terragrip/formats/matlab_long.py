"""Large MATLAB files of version 7.3 in blocks of rows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.formats.boundary import needed, reading
from terragrip.formats.matlab_hdf5 import is_hdf5, tree_of
from terragrip.formats.matlab_signals import Contents, seconds_of, walk
from terragrip.formats.matlab_values import Array
from terragrip.formats.table_on_disk import TableOnDisk
from terragrip.recording.schema import TIME
from terragrip.recording.survey import ROWS

_LONG = 100_000_000  # bytes


def long_matlab(path: str) -> TableOnDisk | None:
    """A large file of version 7.3 all of whose signals share one clock, as a `TableOnDisk`; None of any other."""
    if os.path.getsize(path) < _LONG or not is_hdf5(path):
        return None
    h5py = needed("h5py", "a MATLAB 7.3 file")
    with reading(path, "MATLAB file", RuntimeError), h5py.File(path, "r") as file:
        contents, clock = _on_one_clock(tree_of(file, h5py))
        if clock is None or not _runs_forward(clock):
            return None

    def blocks(chosen: list[str], every: int) -> Iterator[dict[str, npt.NDArray[Any]]]:
        origin = None
        with h5py.File(path, "r") as file:
            with reading(path, "MATLAB file", RuntimeError):
                contents, clock = _on_one_clock(tree_of(file, h5py))
                if clock is None:
                    raise ValueError("it changed while it was read")
            for part in _parts_of(clock):
                with reading(path, "MATLAB file", RuntimeError):
                    block = _block(contents, clock, chosen, part)
                origin = float(block[TIME][0]) if origin is None else origin
                yield {**block, TIME: block[TIME] - origin}

    names, rows = tuple(contents.signals), int(np.prod(clock.shape))
    return TableOnDisk(names, contents.units, path, rows, blocks, clocked=True, is_long=True)


def _on_one_clock(tree: dict[str, Any]) -> tuple[Contents, Array | None]:
    """What a file holds, and the clock that all its signals share; None where they do not, or where parts of one cannot be read."""
    contents = Contents()
    walk(tree, "", contents, 0)
    arrays = [array for clock, values, _ in contents.signals.values() for array in (clock, values)]
    in_parts = all(isinstance(array, Array) and array.part is not None for array in arrays)
    one = len({id(clock) for clock in arrays[::2]}) == 1
    return contents, arrays[0] if one and in_parts and not (contents.opaque or contents.odd) else None


def _block(contents: Contents, clock: Array, chosen: list[str], part: slice) -> dict[str, Floats]:
    """Some rows of the chosen signals, and their stamps [s]."""
    rows = int(np.prod(clock.shape))
    block = {TIME: seconds_of(clock.column(0, rows, part), contents.scales.get(id(clock), 1.0))}
    for name in chosen:
        _, values, column = contents.signals[name]
        block[name] = np.asarray(values.column(column or 0, rows, part), np.float64)
    return block


def _parts_of(clock: Array) -> Iterator[slice]:
    rows = int(np.prod(clock.shape))
    return (slice(first, min(first + ROWS, rows)) for first in range(0, rows, ROWS))


def _runs_forward(clock: Array) -> bool:
    """Whether no stamp repeats, runs back or is missing, so that the rows are in the order of time."""
    last = -np.inf
    for part in _parts_of(clock):
        time = np.asarray(clock.column(0, part.stop, part), np.float64)
        if not (np.isfinite(time).all() and time[0] > last and bool((np.diff(time) > 0).all())):
            return False
        last = float(time[-1])
    return True
