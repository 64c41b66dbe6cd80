"""What objects of MATLAB classes hold, as plain structs, lists, texts and arrays, so that signals are found in them.

The layouts are those of the classes' own MATLAB code (R2010b to R2023b): ``timeseries`` keeps ``Data_``, and in ``TimeInfo``
either ``Time_`` or ``Start_``, ``Increment_`` and ``Length``; ``Simulink.SimulationData.Dataset`` saves a struct with ``Storage``,
whose ``Elements`` are signals, states and the like, each with ``Name`` and ``Values``; ``Simulink.SimulationOutput`` keeps
``Data``. Any other object is taken as a struct of its properties. A Dataset that was saved with ``-v7.3`` has structs in place of
its series, which `terragrip.formats.matlab_records` reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.matlab_values import Opaque

_DEEPEST = 24
_MOST = 1 << 16  # parts of all cells, structs and objects
TICKS = {"weeks": 604_800.0, "days": 86_400.0, "hours": 3600.0, "minutes": 60.0, "seconds": 1.0,
         "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}  # fmt: skip
"""Seconds by the names of MATLAB's units of time."""
_SERIES = ("timeseries", "Simulink.Timeseries")


@dataclass
class _Room:
    """How much deeper a value may go, and how many parts all of it may have: handles can refer to each other."""

    depth: int = _DEEPEST
    parts: list[int] = field(default_factory=lambda: [_MOST])

    def inner(self) -> _Room:
        return _Room(self.depth - 1, self.parts)

    def taken(self) -> bool:
        self.parts[0] -= 1
        return self.depth < 0 or self.parts[0] < 0


def plain(value: Any, room: _Room | None = None) -> Any:
    """A value as mat-io gives it, without objects: mapping, list, text, numeric array, `Opaque` or None.

    A series becomes ``{"Time": (n,) s, "Data": (n, columns), "Unit": text}``, a Dataset ``{"Elements": [...]}``, a table a
    mapping of its columns with its row times as ``time`` [s]. What cannot be read is `Opaque` with its class.
    """
    room = room or _Room()
    if room.taken():
        return None
    if hasattr(value, "classname") and hasattr(value, "properties"):
        return _of_object(value, room)
    if hasattr(value, "columns") and hasattr(value, "index"):
        return _of_table(value)
    if hasattr(value, "categories"):
        return list(map(_text, value.tolist()))
    if isinstance(value, Mapping):
        return {str(key): plain(part, room.inner()) for key, part in value.items()}
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return _of_array(np.asarray(value), room)
    return (
        Opaque("sparse")
        if hasattr(value, "nnz")
        else Opaque(type(value).__name__.removeprefix("Matlab").lower())
    )


def _of_array(value: npt.NDArray[Any], room: _Room) -> Any:
    if value.dtype.names:
        structs = [
            {name: plain(part[name], room.inner()) for name in value.dtype.names}
            for part in value.ravel(order="F")[:_MOST]
        ]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype.kind == "O":
        texts = list(map(_text, value.ravel(order="F")))
        if len(texts) > 1 and None not in texts:
            return texts
        return [plain(part, room.inner()) for part in value.ravel(order="F")[:_MOST]]
    if value.dtype.kind in "UST":
        texts = list(map(_text, value.ravel(order="F")))
        return texts[0] if len(texts) == 1 else texts or ""
    if value.dtype.kind in "mM":
        return _seconds(value)
    return np.asarray(value) if value.dtype.kind in "fiub" else Opaque("complex")


def _text(part: Any) -> str | None:
    """A text in a cell or an array, empty where it is missing; None of anything else."""
    if isinstance(part, np.ndarray) and part.dtype.kind in "UT" and part.size < 2:
        part = part.item() if part.size else ""
    if isinstance(part, float) and np.isnan(part):  # <missing>, <undefined>
        return ""
    return str(part) if isinstance(part, str) else None


def _of_object(value: Any, room: _Room) -> Any:
    kind, held = str(value.classname), value.properties
    if isinstance(held, Mapping) and kind in _SERIES:
        return _series(held) or Opaque(kind)
    if not isinstance(held, Mapping):
        return Opaque(kind)
    if set(held) == {"any"}:  # what the class's own saveobj made of it
        held = held["any"]
    content = plain(held, room.inner())
    if not isinstance(content, Mapping):
        return content
    for key in ("Storage", "Storage_"):  # of a Dataset
        if isinstance(content.get(key), Mapping | Opaque):
            return content[key]
    elements = content.get("Elements_", content.get("Elements"))
    if isinstance(elements, list):
        return _storage(elements)
    if kind == "Simulink.SimulationOutput":
        return content.get("Data")
    if "Values" in content:
        return {"Name": _name_of(content), "Values": content["Values"]}
    held_more = (isinstance(v, Mapping | list | str | Opaque) or np.size(v) > 1 for v in content.values())
    return content if any(held_more) else Opaque(kind)


def _storage(elements: list[Any]) -> Any:
    """The elements of a Dataset, each by its name."""
    return {"Elements": [_element(element) for element in elements]}


def _element(element: Any) -> Any:
    """An element: as an object it is plain already; saved with ``-v7.3`` it is a struct."""
    if not isinstance(element, Mapping) or "ElementType" not in element or "Values" not in element:
        return element
    values = element["Values"]
    if element["ElementType"] == "dataset" and isinstance(values, list):
        return {"Name": _name_of(element), **_storage(values)}
    return {"Name": _name_of(element), "Values": values}


def _name_of(element: Mapping[str, Any]) -> str:
    """The name of a Dataset's element; of one without a name, that of its block."""
    for key in ("Name", "PropagatedName"):
        if isinstance(element.get(key), str) and element[key].strip():
            return str(element[key])
    block = element.get("BlockPath")
    while isinstance(block, Mapping | list) and block:
        parts = block if isinstance(block, list) else list(block.values())
        block = next((part for part in parts if isinstance(part, str | list | Mapping) and part), None)
    return block.rpartition("/")[2].strip() if isinstance(block, str) else ""


def _series(held: Mapping[str, Any]) -> dict[str, Any] | None:
    about = _properties(held.get("TimeInfo"))
    time = _times(held, about)
    data = _first_numeric(held.get("Data_"), held.get("Data"))
    if time is None or data is None:
        return None
    count = len(time)
    if data.ndim == 2 and data.shape[0] == count:
        rows = data
    elif data.shape[-1] == count:
        rows = np.moveaxis(data, -1, 0).reshape(count, -1)
    else:
        return None
    result: dict[str, Any] = {"Time": time, "Data": rows}
    unit = plain(_properties(held.get("DataInfo")).get("Units"))
    if isinstance(unit, Mapping):
        unit = unit.get("Name")  # a Simulink.SimulationData.Unit
    return result | ({"Unit": unit} if isinstance(unit, str) and unit.strip() else {})


def _times(held: Mapping[str, Any], about: Mapping[str, Any]) -> npt.NDArray[np.float64] | None:
    """The instants (n,) [s] of a series, written out or as a regular clock."""
    text = plain(about.get("Units"))
    tick = TICKS.get(text.strip().lower(), 1.0) if isinstance(text, str) else 1.0
    time = _first_numeric(about.get("Time_"), held.get("Time_"), held.get("Time"))
    if time is not None:
        return np.asarray(time, dtype=np.float64).ravel() * tick
    start, step, count = (_scalar(about.get(key)) for key in ("Start_", "Increment_", "Length"))
    if start is None or step is None or count is None or not 0 < count < 1e10:
        return None
    data = _first_numeric(held.get("Data_"), held.get("Data"))
    if data is None or int(count) not in data.shape:
        return None  # a damaged length would ask for any memory
    return np.asarray((start + step * np.arange(int(count))) * tick, dtype=np.float64)


def _properties(value: Any) -> Mapping[str, Any]:
    held = getattr(value, "properties", value)
    return held if isinstance(held, Mapping) else {}


def _first_numeric(*values: Any) -> npt.NDArray[Any] | None:
    """The first of some values that is an array of numbers."""
    return next((v for v in values if isinstance(v, np.ndarray) and v.dtype.kind in "fiub" and v.size), None)


def _scalar(value: Any) -> float | None:
    array = _first_numeric(value)
    return float(array.ravel()[0]) if array is not None and np.isfinite(array.ravel()[0]) else None


def _of_table(frame: Any) -> dict[str, Any]:
    index = frame.index
    columns = {str(name): _of_column(frame[name]) for name in frame.columns}
    units = frame.attrs.get("VariableUnits") or frame.attrs.get("varUnits") or []
    if index.dtype.kind in "mM":
        columns["time"] = _of_column(index.to_series())
    if len(units) == len(frame.columns):  # not where a variable has several columns
        columns.setdefault("units", dict(zip(map(str, frame.columns), map(str, units), strict=True)))
    return {name: column for name, column in columns.items() if column is not None}


def _of_column(column: Any) -> Any:
    if getattr(column.dtype, "tz", None) is not None:
        column = column.dt.tz_convert("UTC").dt.tz_localize(None)
    if column.dtype.kind in "mM":
        return _seconds(column.to_numpy())
    if column.dtype.kind in "fiub":
        return column.to_numpy()
    texts = list(map(_text, column))
    return None if None in texts else texts


def _seconds(value: npt.NDArray[Any]) -> npt.NDArray[np.float64] | Opaque:
    """Spans in seconds, dates since 1970; a missing one is NaN. A span of the calendar has no length in seconds."""
    if value.dtype.kind == "m" and np.datetime_data(value.dtype)[0] in "YM":
        return Opaque("calendarDuration")
    since = value - np.datetime64(0, "s") if value.dtype.kind == "M" else value
    return np.where(np.isnat(value), np.nan, since / np.timedelta64(1, "s")).astype(np.float64)
