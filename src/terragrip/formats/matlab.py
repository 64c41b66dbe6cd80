"""MATLAB files: version 5 by mat-io, version 7.3 (HDF5) by h5py; other HDF5 files of plain datasets too.

mat-io runs in a process of its own, since a damaged file can crash it, and reads version 5 and objects of MATLAB classes (timetable,
timeseries, Simulink's Dataset, datetime) of both; what cannot be read is named in the notes.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import needed, reading
from terragrip.formats.matlab_hdf5 import is_hdf5, tree_of
from terragrip.formats.matlab_records import IN_RECORDS
from terragrip.formats.matlab_signals import Contents, seconds_of, walk
from terragrip.formats.matlab_values import Array, Opaque
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import LogTable, Wanted, kept_rows
from terragrip.formats.worker import Worker

if TYPE_CHECKING:
    from terragrip.formats.table_on_disk import TableOnDisk


_NO_OBJECTS = ("", "function", "sparse", "function_handle")


def read_matlab(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog | LogTable:
    """Read a MATLAB file; raises InputError if it is damaged, or holds no numeric column."""
    if not is_hdf5(path):
        with _worker(path) as worker:
            worker.send(None)
            read = worker.receive()["tree"]
            return _finished({name: _of_worker(part, worker) for name, part in read.items()}, path, wanted)
    h5py = needed("h5py", "a MATLAB 7.3 file")
    with reading(path, "MATLAB file", RuntimeError), h5py.File(path, "r") as file:
        return _with_objects(tree_of(file, h5py), path, wanted)


def _with_objects(tree: dict[str, Any], path: str, wanted: Wanted | None) -> SignalLog | LogTable:
    """The wanted signals of a file's variables; objects of MATLAB classes are read by mat-io, in a process of its own."""
    names = [name for name, value in tree.items() if _holds_object(value)]
    if not names:
        return _finished(tree, path, wanted)
    with ExitStack() as kept:  # the process lives until its arrays were read
        try:
            worker = kept.enter_context(_worker(path))
            worker.send(names)
            read = worker.receive()["tree"]
        except InputError:
            return _finished(tree, path, wanted)  # the notes name what is left
        known = {
            name: value for name, part in read.items() if (value := _of_worker(part, worker)) is not None
        }
        return _finished({**tree, **known}, path, wanted)


def _worker(path: str) -> Worker:
    return Worker("terragrip.formats.matlab_worker", "matio", path, "MATLAB file")


def _holds_object(value: Any) -> bool:
    if isinstance(value, Opaque):
        return value.kind not in _NO_OBJECTS
    parts = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return any(_holds_object(part) for part in parts)


def _of_worker(node: Any, worker: Worker) -> Any:
    """What the worker said of a value, its arrays read when they are asked for."""
    if not isinstance(node, dict):
        return None
    if "struct" in node:
        return {key: _of_worker(part, worker) for key, part in node["struct"].items()}
    if "list" in node:
        return [_of_worker(part, worker) for part in node["list"]]
    if "array" in node:
        return Array(tuple(node["shape"]), partial(_asked, worker, node["array"]))
    return Opaque(node["object"]) if "object" in node else node["text"]


def _asked(worker: Worker, number: int) -> npt.NDArray[Any]:
    worker.send(number)
    return worker.array()


def _finished(tree: Mapping[str, Any], path: str, wanted: Wanted | None) -> SignalLog | LogTable:
    """The wanted signals of what a file holds."""
    contents = Contents()
    walk(tree, "", contents, 0)
    if wanted is None:  # nobody has named a run: signals of two must not be mixed
        later = tuple(f"{name}[{k}]." for name, count in contents.runs.items() for k in range(1, count))
        contents.signals = {n: one for n, one in contents.signals.items() if not n.startswith(later)}
    notes = [*_notes(contents), *contents.notes]
    if not contents.signals and not contents.loose:
        problem = "; ".join(["has no numeric column", *(note.rstrip(".") for note in notes[:1])])
        if contents.odd:
            problem = notes[0].rstrip(".")
        raise InputError(problem, file=path, hint="save arrays or structs with a time vector beside them")
    if not contents.signals:
        return _table_of(contents.loose, path, wanted, notes)
    clocks: dict[int, Floats] = {}
    arrays: dict[int, npt.NDArray[Any]] = {}
    signals = {}
    for name, (clock, values, column) in contents.signals.items():
        if wanted is not None and not wanted(name):
            continue
        length = int(np.prod(clock.shape))
        rows = kept_rows(length, wanted)
        if id(clock) not in clocks:
            whole = seconds_of(_read(clock).ravel(), contents.scales.get(id(clock), 1.0))
            clocks[id(clock)] = whole[rows]
        if isinstance(values, Array) and values.part is not None:
            flat = values.column(column or 0, length)
        else:
            if id(values) not in arrays:
                arrays = {id(values): _read(values)}  # columns of one matrix stand side by side
            flat = arrays[id(values)].reshape(length, -1)[:, column or 0]
        signals[name] = Signal(
            clocks[id(clock)], np.asarray(flat[rows], dtype=np.float64), contents.units.get(name)
        )
    return SignalLog(tuple(contents.signals), signals, path, sha256(path), tuple(notes))


def _notes(contents: Contents) -> list[str]:
    notes = []
    if contents.odd:
        odd = _some([f"{name} ({own})" for name, (own, _) in contents.odd.items()])
        longs = sorted({length for _, length in contents.odd.values()})
        notes.append(
            f"Signals of another length than the time vector beside them ({', '.join(map(str, longs[:3]))}) were left out: {odd}."
        )
    notes += [
        f"{name} holds {count} drives, each with its own time: {name}[0] is the one that is read, or the one that a profile names "
        f"({name}[1] ...). Save each in a file of its own to estimate all."
        for name, count in contents.runs.items()
    ]
    records = [name for name, kind in contents.opaque.items() if kind == IN_RECORDS]
    if records:
        notes.append(
            f"The samples of {_some(records)} are in records that cannot be read here (a Dataset saved with -v7.3): save "
            f"it in MATLAB by save('log.mat', '{records[0].partition('.')[0]}', '-v7')."
        )
    if contents.signals and contents.loose:
        notes.append(f"There is no time vector beside {_some(list(contents.loose))}, which were left out.")
    shown = [f"{n} ({kind})" if kind else n for n, kind in contents.opaque.items() if kind != IN_RECORDS]
    if shown:
        notes.append(
            f"Not series of plain numbers, and left out: {_some(shown)}; save it from MATLAB as arrays or structs, a table by "
            "writetable(x, 'x.csv')."
        )
    return notes


def _some(names: list[str]) -> str:
    """The first of some names, and how many more there are."""
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


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


def _in_blocks(path: str) -> TableOnDisk | None:
    from terragrip.formats.matlab_long import long_matlab

    return long_matlab(path)


FORMATS = (
    Format(
        "matlab",
        "MATLAB file",
        read_matlab,
        (".mat",),
        (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", b"\x89HDF\r\n\x1a\n"),
        in_blocks=_in_blocks,
    ),
)
