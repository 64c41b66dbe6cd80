"""MATLAB files: version 5, and version 7.3 (HDF5) by h5py; other HDF5 files of plain datasets too.

Tables and timetables are read by mat-io. Other objects of MATLAB classes (timeseries, Dataset,
datetime) are written in a form that MATLAB keeps to itself: they are named in the notes, with the line that exports them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import needed, reading
from terragrip.formats.kind import Databases
from terragrip.formats.mat5 import Array, Opaque, read_mat5
from terragrip.formats.matlab_signals import Found, walk, walk_struct
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import LogTable, Wanted
from terragrip.formats.worker import Worker
from terragrip.recording.schema import TIME

Floats = npt.NDArray[np.float64]

_DEEPEST = 12
_USER_BLOCK, _HDF5 = 512, b"\x89HDF\r\n\x1a\n"
_DATENUM = (600_000.0, 800_000.0)  # days since year 0: 1642 to 2190
_DATENUM_1970 = 719_529.0


def read_matlab(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog | LogTable:
    """Read a MATLAB file; raises InputError if it is damaged, or holds no numeric column."""
    with open(path, "rb") as stream:
        head = stream.read(_USER_BLOCK + len(_HDF5))
    found = Found()
    if not (head.startswith((_HDF5, b"MATLAB 7.3")) or head[_USER_BLOCK:] == _HDF5):
        with reading(path, "MATLAB file"):
            tree = read_mat5(path)
            return _finished(tree, path, wanted, found)
    h5py = needed("h5py", "a MATLAB 7.3 file")
    with reading(path, "MATLAB file", RuntimeError), h5py.File(path, "r") as file:
        tree = {
            name: _of_hdf5(file, item, 0, h5py) for name, item in file.items() if not name.startswith("#")
        }
        return _finished(tree, path, wanted, found)


def _of_hdf5(file: Any, item: Any, depth: int, h5py: Any) -> Any:
    """A group or dataset as mapping, list, text, `Array` or `Opaque`."""
    if depth > _DEEPEST:
        return None
    if "MATLAB_object_decode" in item.attrs:
        kind = item.attrs.get("MATLAB_class", b"")
        return Opaque(kind.decode("ascii", "replace") if isinstance(kind, bytes) else "")
    if isinstance(item, h5py.Group):
        return {name: _of_hdf5(file, part, depth + 1, h5py) for name, part in item.items()}
    if not isinstance(item, h5py.Dataset) or "MATLAB_empty" in item.attrs:
        return None
    kind = item.attrs.get("MATLAB_class", b"")
    if h5py.check_ref_dtype(item.dtype) is not None:
        references = item[()].ravel()[: 1 << 16]
        return [_of_hdf5(file, file[reference], depth + 1, h5py) for reference in references if reference]
    if kind == b"char":
        return "".join(map(chr, item[()].ravel(order="F").tolist()))
    if item.dtype.names:
        return {name: np.asarray(item[name]) for name in item.dtype.names}
    if item.dtype.kind in "fiub":
        if not kind:
            return Array(item.shape, lambda: np.asarray(item[()]))
        return Array(tuple(reversed(item.shape)), lambda: np.asarray(item[()]).T)
    return None


def _finished(
    tree: Mapping[str, Any], path: str, wanted: Wanted | None, found: Found
) -> SignalLog | LogTable:
    """The wanted signals of what a file holds."""
    walk(tree, "", found, 0)
    if any(kind in ("table", "timetable") for kind in found.opaque.values()):
        _take_tables(path, found)
    notes = _notes(found)
    if not found.signals and not found.loose:
        problem = "holds no numeric column"
        if notes:
            problem += f"; {notes[0].rstrip('.')}"
        raise InputError(problem, file=path, mend="save arrays or structs with a time vector beside them")
    if not found.signals:
        return _table_of(found.loose, path, wanted, notes)
    clocks: dict[int, Floats] = {}
    signals = {}
    for name, (clock, values, column) in found.signals.items():
        if wanted is not None and not wanted(name):
            continue
        if id(clock) not in clocks:
            clocks[id(clock)] = _seconds(_read(clock).ravel(), found.scales.get(id(clock), 1.0))
        array = _read(values)
        flat = array.reshape(len(clocks[id(clock)]), -1)[:, column or 0]
        signals[name] = Signal(clocks[id(clock)], np.asarray(flat, dtype=np.float64))
    return SignalLog(tuple(found.signals), signals, path, sha256(path), tuple(notes))


def _take_tables(path: str, found: Found) -> None:
    """Read tables and timetables by mat-io, in a process of its own; those that it cannot read stay opaque."""
    names = [
        name for name, kind in found.opaque.items() if kind in ("table", "timetable") and "." not in name
    ]
    try:
        with Worker("terragrip.formats.matlab_worker", "matio", path, "MATLAB file") as worker:
            worker.say(names)
            while "end" not in (message := worker.hear()):
                columns = {str(column): worker.array() for column in message["columns"]}
                clock = worker.array() if message["clock"] else None
                name = str(message["name"])
                del found.opaque[name]
                table = {key: _loaded(values) for key, values in columns.items()}
                walk_struct(table if clock is None else {**table, TIME: _loaded(clock)}, name, found, 1)
    except InputError:
        return  # the notes name what is left


def _loaded(values: npt.NDArray[Any]) -> Array:
    return Array(values.shape, lambda: values)


def _notes(found: Found) -> list[str]:
    if not found.opaque:
        return []
    shown = [f"{name} ({kind})" if kind else name for name, kind in found.opaque.items()]
    more = f" and {len(shown) - 6} more" if len(shown) > 6 else ""
    return [
        f"Objects that MATLAB alone can read were left out: {', '.join(shown[:6])}{more}; export them there, a timeseries "
        "by s = struct('Time', x.Time, 'Data', x.Data), a Dataset's element by its Values likewise, a timetable by "
        "writetimetable(x, 'x.csv')."
    ]


def _table_of(loose: Mapping[str, Any], path: str, wanted: Wanted | None, notes: list[str]) -> LogTable:
    """Columns of one length without a clock, as a plain table."""
    lengths = [int(np.prod(value.shape)) for value in loose.values()]
    length = max(set(lengths), key=lambda n: (lengths.count(n), n))
    names = [name for name, n in zip(loose, lengths, strict=True) if n == length]
    columns = {
        name: _read(loose[name]).ravel().astype(np.float64)
        for name in names
        if wanted is None or wanted(name)
    }
    return LogTable(tuple(names), columns, {}, path, sha256(path), tuple(notes))


def _read(value: Any) -> npt.NDArray[Any]:
    return value.read() if isinstance(value, Array) else value


def _seconds(clock: npt.NDArray[Any], scale: float) -> Floats:
    """A time vector in seconds; days since year 0, as datenum gives them, count from 1970 then."""
    time = np.asarray(clock, dtype=np.float64)
    if len(time) and _DATENUM[0] < time[0] < _DATENUM[1] and np.median(np.abs(np.diff(time[:1000]))) < 0.01:
        return (time - _DATENUM_1970) * 86400.0
    return time * scale
