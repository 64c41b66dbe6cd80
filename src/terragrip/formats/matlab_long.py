"""Large MATLAB files of version 7.3 in blocks of rows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

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
        contents = _on_one_clock(tree_of(file, h5py))
        if contents is None or not _runs_forward(*contents.clock):
            return None
        rows, names, units = contents.clock[1], tuple(contents.signals), contents.units

    def blocks(chosen: list[str], every: int) -> Iterator[dict[str, npt.NDArray[Any]]]:
        origin = None
        with h5py.File(path, "r") as file:
            with reading(path, "MATLAB file", RuntimeError):
                held = _on_one_clock(tree_of(file, h5py))
            for part in _parts_of(rows):
                with reading(path, "MATLAB file", RuntimeError):
                    block = _block(held, chosen, part)
                origin = float(block[TIME][0]) if origin is None else origin
                yield {**block, TIME: block[TIME] - origin}

    return TableOnDisk(names, units, path, rows, blocks, clocked=True, is_long=True)


@dataclass(frozen=True)
class _OneClock:
    """Signals, each as its array and column there, on one ``clock`` of so many rows, whose unit has ``scale`` seconds."""

    clock: tuple[Array, int]
    scale: float
    signals: dict[str, tuple[Array, int]]
    units: dict[str, str]


def _on_one_clock(tree: dict[str, Any]) -> _OneClock | None:
    """The signals of a file if all of them share one clock, and parts of each can be read."""
    contents = Contents()
    walk(tree, "", contents, 0)
    clocks = {id(clock): clock for clock, _, _ in contents.signals.values()}
    if len(clocks) != 1 or contents.opaque:
        return None
    ((key, clock),) = clocks.items()
    arrays = {name: (values, column or 0) for name, (_, values, column) in contents.signals.items()}
    if any(not isinstance(a, Array) or a.part is None for a in (clock, *(a for a, _ in arrays.values()))):
        return None
    return _OneClock(
        (clock, int(np.prod(clock.shape))), contents.scales.get(key, 1.0), arrays, contents.units
    )


def _block(held: _OneClock | None, chosen: list[str], part: slice) -> dict[str, npt.NDArray[np.float64]]:
    """Some rows of the chosen signals, and their stamps [s]; raises ValueError where the file has changed."""
    if held is None:
        raise ValueError("it changed while it was read")
    clock, rows = held.clock
    block = {TIME: seconds_of(clock.column(0, rows, part), held.scale)}
    for name in chosen:
        values, column = held.signals[name]
        block[name] = np.asarray(values.column(column, rows, part), np.float64)
    return block


def _parts_of(rows: int) -> Iterator[slice]:
    return (slice(first, min(first + ROWS, rows)) for first in range(0, rows, ROWS))


def _runs_forward(clock: Array, rows: int) -> bool:
    """Whether no stamp repeats, runs back or is missing, so that the rows are in the order of time."""
    last = -np.inf
    for part in _parts_of(rows):
        time = np.asarray(clock.column(0, rows, part), np.float64)
        if not (np.isfinite(time).all() and time[0] > last and bool((np.diff(time) > 0).all())):
            return False
        last = float(time[-1])
    return True
