"""What in a MATLAB file is a signal.

A numeric column that has a time vector beside it (in the same struct, or at the top), Simulink's "structure with time" and
arrays with ``tout``, a struct with Time and Data as a timeseries is exported, and lists of these with names, as the elements
of a Dataset; dSPACE's X and Y.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from terragrip.formats.matlab_values import Array, Opaque, read_array, texts_of
from terragrip.recording.columns import DATENUM, DATENUM_1970, DAY, DAY_STEP
from terragrip.recording.frames import names_and_units
from terragrip.recording.schema import LABELS, is_own
from terragrip.units import UnitError, factor_to, is_common

_TIMES = ("time", "t", "tout", "timestamp", "time_s", "t_s", "time_ms", "t_ms", "time_us", "time_ns")
_SCALES = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_DATA = ("data", "values")
_UNITS = ("unit", "units", "dataunits")
_NAMES = ("name", "label", "signalname", "blockname")
_PORT = re.compile(r"/Out1$")  # the first output of a block, which is named by the block
_OTHER_TIMES = re.compile(
    r"(t|time|tout|timestamp)_\w+|\w+_(t|time|timestamp)", re.IGNORECASE
)  # t_gps: of signals at another rate
_WIDEST = 256  # columns of a matrix that are signals: a logger's channels, no image
_SHORTEST = 20  # rows of a matrix with its time in it: lookup tables are shorter
_DEEPEST = 12
_HEADS = re.compile(r"name|head|label|col|var|chan|sig|wheel", re.IGNORECASE)  # a cell of names of columns


@dataclass
class Contents:
    """Signals by name, with what their clock and column are read from; ``opaque`` objects with their class; ``loose`` vectors without
    a clock, ``texts`` likewise; ``odd`` ones of another length than their clock, with both lengths; ``matrices`` without a clock.

    ``runs``: arrays of drives, and how many they hold; ``notes`` say which of several vectors was taken for time.
    """

    signals: dict[str, tuple[Any, Any, int | None]] = field(default_factory=dict)
    scales: dict[int, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    opaque: dict[str, str] = field(default_factory=dict)
    loose: dict[str, Any] = field(default_factory=dict)
    texts: dict[str, Any] = field(default_factory=dict)
    odd: dict[str, tuple[int, int]] = field(default_factory=dict)
    matrices: dict[str, Any] = field(default_factory=dict)
    runs: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


class Around(NamedTuple):
    """What a struct has from those around it: their time vector, where it has none, and the units that they state by name."""

    clock: Any = None
    units: Mapping[str, Any] = {}


def walk(value: Any, name: str, contents: Contents, depth: int, above: Around = Around()) -> None:  # noqa: B008  (immutable)
    """Find the signals under a value; ``above``: what the structs around it say."""
    if depth > _DEEPEST:
        return
    if isinstance(value, Opaque):
        contents.opaque[name] = value.kind
    elif isinstance(value, Mapping):
        _walk_struct(value, name, contents, depth, above)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        parts = list(np.ravel(value)) if isinstance(value, np.ndarray) else value
        if len(parts) > 1 and all(_is_run(part, parts[0]) for part in parts):
            contents.runs[name] = len(parts)
        for k, part in enumerate(parts):
            own = _own_name(part)
            walk(part, _joined(name, own) if own else f"{name}[{k}]", contents, depth + 1, above)


def _is_run(part: Any, first: Any) -> bool:
    """Whether a struct has a time of its own and the signals of the first: one drive of several."""
    if not isinstance(part, Mapping) or _own_name(part) or part.keys() != first.keys():
        return False
    vectors = [key.lower() for key in part if _is_vector(part[key])]
    return len(vectors) > 2 and any(key in _TIMES for key in vectors)


def _walk_struct(struct: Mapping[str, Any], name: str, contents: Contents, depth: int, above: Around) -> None:
    if _x_and_y(struct, name, contents):
        return
    struct = _with_named_columns(struct, contents)
    own_units = _value(struct, _UNITS)
    units = own_units if isinstance(own_units, Mapping) else above.units
    clocks = _clocks(struct, name, contents, Around(above.clock, units))
    if clocks and _structure_with_time(_value(struct, ("signals",)), clocks, name, contents):
        return
    clock = next(iter(clocks.values()), None)
    _add_those_beside(clocks, struct, name, contents, units)
    for key, part in struct.items():
        own, texts = _joined(name, key), texts_of(part)
        if _is_numeric(part):
            if clock is None:
                (contents.loose if _is_vector(part) else contents.matrices)[own] = part
                _add_unit(contents, own, units.get(key))
        elif texts is not None:
            if clock is None:
                contents.texts[own] = texts
        elif not isinstance(part, str):
            if key.lower() == "values" and isinstance(part, Mapping | Opaque):
                own = name  # a Dataset's element: its name is the signal's
            elif key.lower() in ("elements", "signals"):
                own = _joined(name, _own_name(part))  # one element alone is no list
            below = Around(clock, units[key] if isinstance(units.get(key), Mapping) else units)
            walk(part, own, contents, depth + 1, below)


def _with_named_columns(struct: Mapping[str, Any], contents: Contents) -> Mapping[str, Any]:
    """A struct with the columns of its matrices by the texts beside them, of which there are as many: ``data`` and ``colheaders``, as
    importdata makes both, or any cell of names; of several matrices, or beside a time, ``omega_fl``. A cell of units gives theirs."""
    wide = {
        key: part
        for key, part in struct.items()
        if _is_numeric(part) and len(part.shape) == 2 and 1 < min(part.shape) < max(part.shape)
    }
    lists = {
        key: texts
        for key, part in struct.items()
        if (texts := texts_of(part)) is not None
        and any(len(texts) == min(matrix.shape) for matrix in wide.values())
    }
    stated = next((key for key, texts in lists.items() if all(map(is_common, filter(None, texts)))), "")
    named = next((key for key in lists if key != stated and _HEADS.search(key)), "")
    if not named:
        return struct
    heads, units = names_and_units(lists[named].tolist())
    if stated and len(lists[stated]) == len(heads):
        units |= dict(zip(heads, lists[stated], strict=True))
    twice = dict.fromkeys(head for head in heads if heads.count(head) > 1)
    if twice:  # as of a CSV
        contents.notes.append(
            f"Columns that occur twice are left out: {', '.join(twice)}. Rename one to use it."
        )
    own = {key: part for key, part in wide.items() if min(part.shape) == len(heads)}
    used = {*own, named, stated}
    rest = {key: part for key, part in struct.items() if key not in used and key.lower() != "textdata"}
    whole = len(own) == 1 and (
        any(head.lower() in _TIMES for head in heads) or _DATA[0] in map(str.lower, own)
    )
    columns: dict[str, Any] = {}
    stated_units: dict[str, str] = {}
    for key, part in own.items():
        table = read_array(oriented(part, max(part.shape)))
        for k, head in enumerate(heads):
            name = head if whole and head not in rest else f"{key}_{head}"
            if head not in twice:
                columns[name] = table[:, k]
                stated_units |= {name: units[head]} if head in units else {}
    around = _value(struct, _UNITS)
    return {**rest, **columns, "units": {**(around if isinstance(around, Mapping) else {}), **stated_units}}


def _clocks(struct: Mapping[str, Any], name: str, contents: Contents, above: Around) -> dict[int, Any]:
    """The time vectors of a struct's signals by their length: first its own, or the one ``above``; empty if there is none."""
    own = _clock_name(struct, name, contents)
    clock = above.clock if own is None else struct[own]
    others = _other_clocks(struct, clock)
    if clock is None and len(others) < 2:
        return {}
    for key in filter(None, (own, *others.values())):
        scale, unit = _SCALES.get(key.rpartition("_")[2].lower(), 1.0), above.units.get(key)
        if isinstance(unit, str) and unit.strip():
            try:
                scale = factor_to(unit, "s")
            except UnitError as error:
                contents.notes.append(f"The unit of {_joined(name, key)} is not used: {error.problem}.")
        contents.scales[id(struct[key])] = scale
    first = {} if clock is None else {int(np.prod(clock.shape)): clock}
    return first | {length: struct[key] for length, key in others.items()}


def _add_those_beside(
    clocks: Mapping[int, Any],
    struct: Mapping[str, Any],
    name: str,
    contents: Contents,
    units: Mapping[str, Any],
) -> None:
    """Add the signals of a struct that have as many instants as one of the clocks (by length, the first before others)."""
    first = next(iter(clocks), 0)
    for key, part in struct.items() if clocks else ():
        texts = texts_of([part] * first if key in LABELS and isinstance(part, str) else part)
        if texts is not None:
            part = texts
        elif not _is_numeric(part) or any(part is clock for clock in clocks.values()):
            continue
        length = next((n for n in clocks if n in part.shape), None)
        if texts is not None and length is not None:
            contents.signals[_joined(name, key)] = clocks[length], texts, None
        elif length is not None:
            plain = key.lower() in _DATA and name
            own = name if plain else _joined(name, key)
            stated = _value(struct, _UNITS) if plain else None
            unit = (
                stated if isinstance(stated, str) and is_common(stated) else units.get(own.rpartition(".")[2])
            )
            _add(contents, own, clocks[length], part, length, unit)
        elif (max(part.shape) > first / 2 or is_own(key)) and (texts is not None or _is_vector(part)):
            # shorter ones of other names are parameters
            contents.odd[_joined(name, key)] = max(part.shape), first


def _value(struct: Mapping[str, Any], words: tuple[str, ...]) -> Any:
    """What a struct holds under the first of some words, whatever their case; None if nothing."""
    return next((struct[key] for word in words for key in struct if key.lower() == word), None)


def _clock_name(struct: Mapping[str, Any], name: str, contents: Contents) -> str | None:
    """Which vector of a struct is time, None if none: of names that differ in case only (``t``, ``T``), the one that runs forward."""
    for word in _TIMES:
        alike = [key for key in struct if key.lower() == word and _is_vector(struct[key])]
        if len(alike) > 1:
            alike.sort(key=lambda key: (not _runs_forward(struct[key]), key != word))
            others = ", ".join(_joined(name, key) for key in alike[1:])
            contents.notes.append(f"{_joined(name, alike[0])} is used as time; {others} is a signal.")
        if alike:
            return alike[0]
    return None


def _other_clocks(struct: Mapping[str, Any], clock: Any) -> dict[int, str]:
    """Vectors of time at other rates (``t_gps`` beside ``t``, or ``t_wheels`` and ``t_gps``) by their length, which no other has."""
    taken = 0 if clock is None else int(np.prod(clock.shape))
    found: dict[int, list[str]] = {}
    for key, part in struct.items():
        if (
            _OTHER_TIMES.fullmatch(key)
            and _is_vector(part)
            and max(part.shape) != taken
            and _runs_forward(part)
        ):
            found.setdefault(max(part.shape), []).append(key)
    return {length: keys[0] for length, keys in found.items() if len(keys) == 1}


def matrices_with_time(contents: Contents) -> None:
    """Take the signals of matrices whose first row or column is time, as Simulink's To File block writes its (1 + signals, n)."""
    for name, values in contents.matrices.items():
        if len(values.shape) != 2 or not 1 < min(values.shape) < _SHORTEST + min(values.shape) <= max(
            values.shape
        ):
            continue
        length = max(values.shape)
        table = oriented(values, length)
        stamps = read_array(table)[:, 0]
        if not _runs_forward(stamps):
            continue
        _add(contents, name, stamps, table, length)
        contents.signals.pop(f"{name}[0]")
        place = "row" if values.shape[1] == length else "column"
        contents.notes.append(
            f"The first {place} of {name} is used as time; {name}[1] is the {place} after it."
        )


def _runs_forward(value: Any) -> bool:
    stamps = read_array(value).ravel()
    return bool((stamps[1:] > stamps[:-1]).all())


def _x_and_y(struct: Mapping[str, Any], name: str, contents: Contents) -> bool:
    """dSPACE ControlDesk's export: whether the struct is one. ``Y`` are signals, each with the number of its time vector in ``X``."""
    clocks, signals = (_structs(struct.get(key)) for key in ("X", "Y"))
    if not clocks or not signals or not all(_is_vector(one.get("Data")) for one in clocks):
        return False
    for k, one in enumerate(signals):
        index = one.get("XIndex")
        at = int(np.ravel(read_array(index))[0]) - 1 if _is_numeric(index) else 0
        block = _PORT.sub("", _own_name(one).replace('"', ""))
        own, values = _joined(name, block or f"Y[{k}]"), one.get("Data")
        if values is None or not _is_vector(values):
            continue
        if not 0 <= at < len(clocks):
            contents.notes.append(
                f"{own} was left out: its XIndex is {at + 1}, and there are {len(clocks)} time vectors in X."
            )
            continue
        clock = clocks[at]["Data"]
        length, count = max(clock.shape), max(values.shape)
        if count == length:
            unit = one.get("Unit")
            unit = unit if isinstance(unit, str) and is_common(unit) else None
            _add(contents, own, clock, values, length, unit)
        else:
            contents.odd[own] = count, length
    return True


def _structs(value: Any) -> list[Mapping[str, Any]]:
    """The structs of an array of them, or the one; none of anything else."""
    parts = [value] if isinstance(value, Mapping) else list(np.ravel(value)) if _is_list(value) else []
    return parts if all(isinstance(part, Mapping) for part in parts) else []


def _structure_with_time(signals: Any, clocks: Mapping[int, Any], name: str, contents: Contents) -> bool:
    """Simulink's "structure with time": whether ``signals`` is such a list, whose values were taken."""
    length, clock = next(iter(clocks.items()))
    is_used = False
    for k, part in enumerate(_structs(signals)):
        if _is_numeric(part.get("values")) and length in part["values"].shape:
            own = _own_name(part) or f"signals[{k}]"
            _add(contents, _joined(name, own), clock, part["values"], length)
            is_used = True
    return is_used


def _add(contents: Contents, name: str, clock: Any, values: Any, length: int, unit: Any = None) -> None:
    """Add a vector, or the signals of an array with one for each instant along its first or last axis."""
    width = int(np.prod(values.shape)) // max(length, 1)
    if width > _WIDEST:
        contents.notes.append(
            f"{name} has {width} numbers for each instant, and was left out: a signal is one number."
        )
        return
    table = values if width == 1 else oriented(values, length)
    for k in range(width):
        own = f"{name}[{k}]" if width > 1 else name
        contents.signals[own] = clock, table, k if width > 1 else None
        _add_unit(contents, own, unit)


def _add_unit(contents: Contents, name: str, unit: Any) -> None:
    if isinstance(unit, str) and unit.strip():
        contents.units[name] = unit.strip()


def oriented(values: Any, length: int) -> Any:
    """An array with a row of all its numbers for each of ``length`` instants, which are along its first axis or its last one."""
    if values.shape[0] == length and len(values.shape) == 2:
        return values
    axis = 0 if values.shape[0] == length else -1

    def read() -> npt.NDArray[Any]:
        return np.moveaxis(read_array(values), axis, 0).reshape(length, -1)

    if not isinstance(values, Array):
        return read()
    part = values.part
    turned = None if part is None else lambda rows, column: part(column, rows)
    return Array((length, int(np.prod(values.shape)) // length), read, turned)


def _own_name(part: Any) -> str:
    """The name that a struct says it has; empty if none."""
    if not isinstance(part, Mapping):
        return ""
    named = (part[key] for key in part if key.lower() in _NAMES)
    return next((text.strip() for text in named if isinstance(text, str) and text.strip()), "")


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name and key else name or key


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray)


def _is_numeric(value: Any) -> bool:
    return isinstance(value, Array) or (
        isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim > 0 and value.size > 0
    )


def _is_vector(value: Any) -> bool:
    if not _is_numeric(value):
        return False
    size = int(np.prod(value.shape))
    return size > 1 and size == max(value.shape)


def seconds_of(clock: npt.NDArray[Any], scale: float) -> npt.NDArray[np.float64]:
    """A time vector in seconds; days since year 0, as datenum gives them, count from 1970 then."""
    time = np.asarray(clock, dtype=np.float64)
    step = np.median(np.abs(np.diff(time[:1000], prepend=time[:1]))) if len(time) else 0.0
    if len(time) and DATENUM[0] < time[0] < DATENUM[1] and step < DAY_STEP:
        return (time - DATENUM_1970) * DAY
    with np.errstate(invalid="ignore"):  # a damaged file may hold signalling NaNs
        return np.asarray(time * scale)
