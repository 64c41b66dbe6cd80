"""MATLAB files: version 5 by mat-io, version 7.3 (HDF5) by h5py; other HDF5 files of plain datasets too.

mat-io runs in a process of its own, since a damaged file can crash it, and reads version 5 and objects of MATLAB classes (timetable,
timeseries, Simulink's Dataset, datetime) of both; what cannot be read is named in the notes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.formats.boundary import needed, reading
from terragrip.formats.matlab_hdf5 import is_hdf5, tree_of
from terragrip.formats.matlab_long import long_matlab
from terragrip.formats.matlab_objects import plain
from terragrip.formats.matlab_records import IN_RECORDS, STREAM, resolved
from terragrip.formats.matlab_signals import Contents, matrices_with_time, seconds_of, walk
from terragrip.formats.matlab_values import Array, Opaque, read_array
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import Clock, Samples, SignalLog, signals_of
from terragrip.formats.table import LogTable, Sparse, Wanted
from terragrip.formats.worker import Reading, UnreadableError, Worker
from terragrip.recording.checks import refuse_estimates

_NO_OBJECTS = ("", "function", "sparse", "function_handle")


def read_matlab(path: str, wanted: Wanted, databases: Databases) -> SignalLog | LogTable:
    """Read a MATLAB file; raises InputError if it is damaged, or holds no numeric column."""
    if not is_hdf5(path):
        return _by_matio(path, wanted)
    h5py = needed("h5py", "a MATLAB 7.3 file")
    with reading(path, "MATLAB file", RuntimeError), h5py.File(path, "r") as file:
        tree = tree_of(file, h5py)
        if any(map(_holds_object, tree.values())):
            try:
                return _by_matio(path, wanted)
            except UnreadableError:
                pass  # the notes name what is left
        contents = _contents(tree, path, isinstance(wanted, Sparse))
        outline = _outline(contents)
        return _log(outline, _samples(contents, _chosen(outline, path, wanted)), wanted)


def _chosen(outline: _Outline, path: str, wanted: Wanted) -> list[str]:
    """The signals that are wanted; raises InputError where one of them does not fit its time vector: it would be missing."""
    odd = None if isinstance(wanted, Sparse) else next(filter(wanted, outline.odd), None)
    if odd is not None:
        length, instants = outline.odd[odd]
        problem = f"has {length} samples, and the time vector beside it {instants}"
        hint = "save vectors of one length, or a signal at another rate in a struct with its own time"
        raise InputError(problem, file=path, place=f"signal {odd}", hint=hint)
    return [name for name in outline.names if wanted(name)]


def _by_matio(path: str, wanted: Wanted) -> SignalLog | LogTable:
    with Worker(
        "terragrip.formats.matlab:items_of", "matio", path, "MATLAB file", isinstance(wanted, Sparse)
    ) as worker:
        outline = worker.receive()
        worker.send(_chosen(outline, path, wanted))
        return _log(outline, worker, wanted)


def items_of(path: str, first_run: bool) -> Reading:
    """The outline of a file, then clocks and samples of the signals that are wanted; objects of MATLAB classes are read."""
    matio = needed("matio", "an object of MATLAB")
    tree: dict[str, Any] = {}
    names = records = None
    with ExitStack() as kept:  # the file is open until its arrays were read
        if is_hdf5(path):
            h5py = needed("h5py", "a MATLAB 7.3 file")
            file = kept.enter_context(h5py.File(path, "r"))
            tree, records = tree_of(file, h5py), file.get(STREAM)
            names = [name for name, value in tree.items() if _holds_object(value)]
        loaded = matio.load_from_mat(path, variable_names=names, add_table_attrs=True)
        for name in names or [name for name in loaded if not name.startswith("__")]:
            if name in loaded and (value := resolved(plain(loaded.pop(name)), records)) is not None:
                tree[name] = value
        contents = _contents(tree, path, first_run)
        chosen = yield _outline(contents)
        yield from _samples(contents, chosen)


def _holds_object(value: Any) -> bool:
    if isinstance(value, Opaque):
        return value.kind not in _NO_OBJECTS
    parts = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return any(_holds_object(part) for part in parts)


@dataclass(frozen=True)
class _Outline:
    """What a file holds: the names of all signals or, where none has a clock, of the columns of a table; sentences for the user."""

    names: tuple[str, ...]
    notes: tuple[str, ...]
    is_table: bool
    odd: dict[str, tuple[int, int]]


def _contents(tree: Mapping[str, Any], path: str, first_run: bool) -> Contents:
    """The signals, or the columns without a clock, in a file's variables; ``first_run``: of an array of drives only those of the first.

    Raises InputError where there are none.
    """
    estimates = tree.get("estimates")
    if isinstance(estimates, Mapping):
        refuse_estimates(estimates, path)
    contents = Contents()
    walk(tree, "", contents, 0)
    if first_run:  # nobody has named a run: signals of two must not be mixed
        later = tuple(f"{name}[{k}]." for name, count in contents.runs.items() for k in range(1, count))
        contents.signals = {n: one for n, one in contents.signals.items() if not n.startswith(later)}
    if not contents.signals:
        matrices_with_time(contents)
    if not contents.signals and not contents.loose:
        notes = _notes(contents)
        problem = "; ".join(["has no numeric column", *(note.rstrip(".") for note in notes[:1])])
        if contents.odd:
            problem = notes[0].rstrip(".")
        raise InputError(problem, file=path, hint="save arrays or structs with a time vector beside them")
    if not contents.signals:
        _keep_one_length(contents)
    return contents


def _outline(contents: Contents) -> _Outline:
    notes = (*_notes(contents), *contents.notes)
    return _Outline(tuple(contents.signals or contents.loose), notes, not contents.signals, contents.odd)


def _samples(contents: Contents, chosen: Iterable[str]) -> Iterator[Clock | Samples]:
    """Of these signals each with the clock before it that it needs, of the columns of a table none."""
    clocks: set[int] = set()
    matrix, whole = None, np.empty(0)
    for name in chosen:
        if not contents.signals:
            values = read_array(contents.loose[name]).ravel()
            values = values if values.dtype == object else values.astype(np.float64)
            yield Samples(name, None, values, contents.units.get(name))
            continue
        clock, values, column = contents.signals[name]
        length = int(np.prod(clock.shape))
        if id(clock) not in clocks:
            clocks.add(id(clock))
            yield Clock(id(clock), seconds_of(read_array(clock).ravel(), contents.scales.get(id(clock), 1.0)))
        if isinstance(values, Array) and values.part is not None:
            flat = values.column(column or 0, length)
        else:
            if matrix is not values:
                matrix, whole = values, read_array(values)  # columns of one matrix stand side by side
            flat = whole.reshape(length, -1)[:, column or 0]
        flat = flat if flat.dtype == object else np.asarray(flat, dtype=np.float64)
        yield Samples(name, id(clock), flat, contents.units.get(name))


def _log(outline: _Outline, items: Iterable[Clock | Samples], wanted: Wanted) -> SignalLog | LogTable:
    if not outline.is_table:
        return SignalLog(outline.names, signals_of(items, wanted), notes=outline.notes)
    every = [one for one in items if isinstance(one, Samples)]
    units = {one.name: one.unit for one in every if one.unit}
    return LogTable(outline.names, {one.name: one.values for one in every}, units, notes=outline.notes)


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


def _keep_one_length(contents: Contents) -> None:
    """Of columns without a clock keep those of the length that most have; a note names the others."""
    lengths = {name: int(np.prod(value.shape)) for name, value in contents.loose.items()}
    counts = list(lengths.values())
    length = max(set(counts), key=lambda n: (counts.count(n), n))
    others = [
        f"{name} ({n})" for name, n in lengths.items() if n != length and n > length / 20
    ]  # shorter ones are parameters
    if others:
        contents.notes.append(
            f"No vector is named as time (t, time, tout, t_gps ...), and most have {length} numbers; others were left out: {_some(others)}."
        )
    contents.loose = {name: value for name, value in contents.loose.items() if lengths[name] == length}
    contents.loose |= {name: texts for name, texts in contents.texts.items() if len(texts) == length}


FORMATS = (
    Format(
        "matlab",
        "MATLAB file",
        read_matlab,
        (".mat",),
        (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", b"\x89HDF\r\n\x1a\n"),
        in_blocks=long_matlab,
    ),
)
