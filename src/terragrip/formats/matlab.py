"""MATLAB files: version 5, and version 7.3 (HDF5) by h5py; other HDF5 files of plain datasets too.

What is a signal: a numeric column that has a time vector beside it (in the same struct, or at the top), Simulink's "structure
with time" and arrays with ``tout``, a struct with Time and Data as a timeseries is exported, and lists of these with names
as the elements of a Dataset. Tables and timetables are read by mat-io. Other objects of MATLAB classes (timeseries, Dataset,
datetime) are written in a form that MATLAB keeps to itself: they are named in the notes, with the line that exports them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import needed, reading
from terragrip.formats.kind import Databases
from terragrip.formats.mat5 import Array, Opaque, read_mat5
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import LogTable, Wanted
from terragrip.formats.worker import Worker
from terragrip.recording.schema import TIME

Floats = npt.NDArray[np.float64]

_TIMES = ("time", "t", "tout", "timestamp", "time_s", "t_s", "time_ms", "t_ms", "time_us", "time_ns")
_SCALES = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_DATA = ("data", "values")
_NAMES = ("name", "label", "signalname", "blockname")
_WIDEST = 32  # columns of a matrix that are signals
_DEEPEST = 12
_USER_BLOCK, _HDF5 = 512, b"\x89HDF\r\n\x1a\n"
_DATENUM = (600_000.0, 800_000.0)  # days since year 0: 1642 to 2190
_DATENUM_1970 = 719_529.0


@dataclass
class _Found:
    """Signals by name, with what their clock and column are read from; ``opaque`` objects with their class; vectors without a clock."""

    signals: dict[str, tuple[Any, Any, int | None]] = field(default_factory=dict)
    scales: dict[int, float] = field(default_factory=dict)
    opaque: dict[str, str] = field(default_factory=dict)
    loose: dict[str, Any] = field(default_factory=dict)


def read_matlab(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog | LogTable:
    """Read a MATLAB file; raises InputError if it is damaged, or holds no numeric column."""
    with open(path, "rb") as stream:
        head = stream.read(_USER_BLOCK + len(_HDF5))
    found = _Found()
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
    tree: Mapping[str, Any], path: str, wanted: Wanted | None, found: _Found
) -> SignalLog | LogTable:
    """The wanted signals of what a file holds."""
    _walk(tree, "", found, 0)
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


def _take_tables(path: str, found: _Found) -> None:
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
                _walk_struct(table if clock is None else {**table, TIME: _loaded(clock)}, name, found, 1)
    except InputError:
        return  # the notes name what is left


def _loaded(values: npt.NDArray[Any]) -> Array:
    return Array(values.shape, lambda: values)


def _notes(found: _Found) -> list[str]:
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


def _walk(value: Any, name: str, found: _Found, depth: int) -> None:
    """Find the signals under a value."""
    if depth > _DEEPEST:
        return
    if isinstance(value, Opaque):
        found.opaque[name] = value.kind
    elif isinstance(value, Mapping):
        _walk_struct(value, name, found, depth)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for k, part in enumerate(list(np.ravel(value)) if isinstance(value, np.ndarray) else value):
            own = _own_name(part)
            _walk(part, _joined(name, own) if own else f"{name}[{k}]", found, depth + 1)


def _walk_struct(struct: Mapping[str, Any], name: str, found: _Found, depth: int) -> None:
    lower = {key.lower(): key for key in struct}
    clock_name = next((lower[key] for key in _TIMES if key in lower and _is_vector(struct[lower[key]])), None)
    clock = None if clock_name is None else struct[clock_name]
    if clock is not None and clock_name is not None:
        length = int(np.prod(clock.shape))
        found.scales[id(clock)] = _SCALES.get(clock_name.rpartition("_")[2].lower(), 1.0)
        if "signals" in lower and _structure_with_time(struct[lower["signals"]], clock, length, name, found):
            return
        for key, part in struct.items():
            if key != clock_name and _is_numeric(part) and length in part.shape[:2]:
                plain = key.lower() in _DATA and name
                _add(found, name if plain else _joined(name, key), clock, part, length)
    for key, part in struct.items():
        if _is_numeric(part):
            if clock is None and _is_vector(part):
                found.loose[_joined(name, key)] = part
        elif key.lower() == "values" and isinstance(part, Mapping):
            _walk(part, name, found, depth + 1)  # a Dataset's element: its name is the signal's
        elif key.lower() in ("elements", "signals") and not isinstance(part, str):
            own = _own_name(part)  # one element alone is no list
            _walk(part, _joined(name, own) if own else name, found, depth + 1)
        elif not isinstance(part, str):
            _walk(part, _joined(name, key), found, depth + 1)


def _structure_with_time(signals: Any, clock: Any, length: int, name: str, found: _Found) -> bool:
    """Simulink's "structure with time": whether ``signals`` is such a list, whose values were taken."""
    parts = (
        [signals] if isinstance(signals, Mapping) else list(np.ravel(signals)) if _is_list(signals) else []
    )
    if isinstance(signals, Mapping) and isinstance(
        signals.get("values"), list
    ):  # a struct array of version 7.3
        rows = len(signals["values"])
        parts = [
            {key: part[k] for key, part in signals.items() if _is_list(part) and len(part) == rows}
            for k in range(rows)
        ]
    taken = False
    for k, part in enumerate(parts):
        if (
            isinstance(part, Mapping)
            and _is_numeric(part.get("values"))
            and length in part["values"].shape[:2]
        ):
            own = _own_name(part) or f"signals[{k}]"
            _add(found, _joined(name, own), clock, part["values"], length)
            taken = True
    return taken


def _add(found: _Found, name: str, clock: Any, values: Any, length: int) -> None:
    """Add a vector, or the columns of a matrix with a row for each instant."""
    width = int(np.prod(values.shape)) // max(length, 1)
    if width == 1:
        found.signals[name] = clock, values, None
    elif values.shape[0] == length and len(values.shape) == 2 and width <= _WIDEST:
        for k in range(width):
            found.signals[f"{name}[{k}]"] = clock, values, k


def _own_name(part: Any) -> str:
    """The name that a struct says it has; empty if none."""
    if not isinstance(part, Mapping):
        return ""
    named = (part[key] for key in part if key.lower() in _NAMES)
    return next((text.strip() for text in named if isinstance(text, str) and text.strip()), "")


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray)


def _is_numeric(value: Any) -> bool:
    return isinstance(value, Array) or (
        isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim > 0
    )


def _is_vector(value: Any) -> bool:
    if not _is_numeric(value):
        return False
    size = int(np.prod(value.shape))
    return size > 1 and size == max(value.shape)


def _read(value: Any) -> npt.NDArray[Any]:
    return value.read() if isinstance(value, Array) else value


def _seconds(clock: npt.NDArray[Any], scale: float) -> Floats:
    """A time vector in seconds; days since year 0, as datenum gives them, count from 1970 then."""
    time = np.asarray(clock, dtype=np.float64)
    if len(time) and _DATENUM[0] < time[0] < _DATENUM[1] and np.median(np.abs(np.diff(time[:1000]))) < 0.01:
        return (time - _DATENUM_1970) * 86400.0
    return time * scale
