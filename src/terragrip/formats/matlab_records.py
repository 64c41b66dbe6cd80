"""The samples of a Simulink Dataset that was saved with ``-v7.3``: records beside the variables, in the group ``#sigstream#``.

A series in such a Dataset is a struct that says how to read it: ``DataR2`` and ``TimeR2`` are numbers of records, ``CompressedTime``
is start, step and count of a regular clock, ``SignalAttributes`` tells class and dimension of a sample. Record k is
``/#sigstream#/k`` with ``#data#`` (bytes), ``#length#`` (samples) and ``#sampleSize#`` (bytes of one). docs/formats.md says what this
rests on.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.boundary import DAMAGE
from terragrip.formats.matlab_objects import TICKS
from terragrip.formats.matlab_values import Array, Opaque

STREAM = "#sigstream#"
"""The group of a file that holds its records."""
_CLASSES = {"double": "f8", "single": "f4", "half": "f2", "logical": "u1", "boolean": "u1", "int8": "i1", "uint8": "u1",
            "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8"}  # fmt: skip
_FIXED = ("fixed-point", "scaled-double")
_WIDEST = 1 << 16  # numbers of a sample
_DAYS_TO_1970, _DAY = 719_529.0, 86_400.0

IN_RECORDS = "Dataset saved with -v7.3"
"""Stands for a series whose samples are in records that are not there, or cannot be read."""


def resolved(value: Any, records: Any) -> Any:
    """A value of `terragrip.formats.matlab_objects.plain` in which series stand where structs described records.

    A series is ``{"Time": (n,) s, "Data": (n, columns), "Unit": text}``; its samples are read when they are asked for.
    """
    if isinstance(value, list):
        return [resolved(part, records) for part in value]
    if not isinstance(value, Mapping):
        return value
    if _is_series(value):
        try:
            return _series(value, records)
        except DAMAGE:
            return Opaque(IN_RECORDS)
    return {key: resolved(part, records) for key, part in value.items()}


def _is_series(struct: Mapping[str, Any]) -> bool:
    return "SignalAttributes" in struct or any(
        key in struct for key in ("DataR2", "TimeR2", "CompressedTime")
    )


def _series(struct: Mapping[str, Any], records: Any) -> dict[str, Any]:
    """The series that a struct tells of; raises ValueError or LookupError where it cannot be read."""
    about = struct.get("SignalAttributes")
    if not isinstance(about, Mapping):
        raise ValueError("a series without attributes")
    time, count = _time(struct, records)
    result = {"Time": time, "Data": _data(struct, about, records, count)}
    unit = struct.get("DataUnits", struct.get("Units"))
    if isinstance(unit, Mapping):
        unit = unit.get("Value")
    properties = struct.get("TableProps")
    if isinstance(properties, Mapping):
        unit = properties.get("VariableUnits")
        unit = unit[0] if isinstance(unit, list) and unit else unit
    return result | ({"Unit": unit} if isinstance(unit, str) and unit.strip() else {})


def _time(struct: Mapping[str, Any], records: Any) -> tuple[Array, int]:
    """The instants [s], and how many there are."""
    regular, kept, written = (struct.get(key) for key in ("CompressedTime", "TimeR2", "Time"))
    scale, zero = _clock(struct)
    if _held(regular) == 3:
        start, step, counted = (float(x) for x in np.ravel(np.asarray(regular)))
        if not 0 < counted <= 1e10:
            raise ValueError("a clock without samples")
        count = int(counted)
        return Array((count, 1), lambda: scale * (start + step * np.arange(count) - zero)), count
    if _held(regular):  # so few instants that they are written out
        written = regular
    if not _held(kept) and _held(written):
        instants = np.ravel(np.asarray(written, dtype=np.float64))
        return Array((len(instants), 1), lambda: scale * (instants - zero)), len(instants)
    count, size, read = _record(records, kept)
    if size != 8:
        raise ValueError("its instants are no doubles")
    return Array((count, 1), lambda: scale * (read().view("<f8") - zero)), count


def _clock(struct: Mapping[str, Any]) -> tuple[float, float]:
    """Seconds of a unit of time, and which number of units is zero: days count from the year 0 in a timetable of dates."""
    properties = struct.get("TableProps")
    if isinstance(properties, Mapping):
        return (_DAY, _DAYS_TO_1970) if properties.get("TimeFormat") == "datetime" else (1.0, 0.0)
    unit = struct.get("TimeUnits")
    unit = unit.get("Value") if isinstance(unit, Mapping) else unit
    return TICKS.get(unit.strip().lower(), 1.0) if isinstance(unit, str) else 1.0, 0.0


def _data(struct: Mapping[str, Any], about: Mapping[str, Any], records: Any, count: int) -> Array:
    """The samples (count, columns) of a series."""
    if _true(about.get("Complexity")):
        raise ValueError("complex numbers")
    width = int(np.prod(np.asarray(about.get("Dimension", 1), dtype=np.float64)))
    if not 0 < width <= _WIDEST:
        raise ValueError("a sample of an odd size")
    kind = next(
        (k for k in (about.get("ClassName"), about.get("ResolvedClassName")) if k in (*_CLASSES, *_FIXED)),
        None,
    )
    if kind is None:
        raise ValueError("a class that is not known")
    slope, bias = _fixed_point(about) if kind in _FIXED else (1.0, 0.0)
    if "DataR2" not in struct:
        values = np.asarray(struct["Data"], dtype=np.float64).ravel(order="F")
        if values.size != count * width:
            raise ValueError("not as many samples as instants")
        return Array((count, width), lambda: slope * values.reshape(count, width) + bias)
    length, size, read = _record(records, struct["DataR2"])
    if length != count or size % width:
        raise ValueError("not as many samples as instants")
    dtype = np.dtype(f"<{_fixed_kind(about, size // width) if kind in _FIXED else _CLASSES[kind]}")
    if dtype.itemsize * width != size:
        raise ValueError("a record of another class")
    return Array(
        (count, width), lambda: slope * read().view(dtype).reshape(count, width).astype(np.float64) + bias
    )


def _fixed_kind(about: Mapping[str, Any], size: int) -> str:
    """The integers that a fixed-point signal is stored as; a scaled double is stored as such."""
    if about.get("ClassName") == "scaled-double":
        return "f8"
    parameters = about.get("FixedPointParameters")
    signed = isinstance(parameters, Mapping) and _true(parameters.get("isSigned"))
    return f"{'i' if signed else 'u'}{size}"


def _fixed_point(about: Mapping[str, Any]) -> tuple[float, float]:
    """Slope and bias of a fixed-point signal."""
    held = about["FixedPointParameters"]
    slope, exponent, bias = (_number(held[key]) for key in ("SlopeAdjustmentFactor", "Exponent", "Bias"))
    return (1.0, 0.0) if about.get("ClassName") == "scaled-double" else (slope * 2.0**exponent, bias)


def _record(records: Any, number: Any) -> tuple[int, int, Any]:
    """Samples, bytes of a sample and what reads the bytes of a record."""
    if records is None:
        raise LookupError("no records")
    record = records[str(int(_number(number)))]
    count, size = (int(np.ravel(record[key][()])[0]) for key in ("#length#", "#sampleSize#"))
    data = record["#data#"]
    held = int(np.prod(data.shape)) * data.dtype.itemsize
    if count < 1 or size < 1 or held < count * size:
        raise ValueError("a record that is shorter than it says")

    def read() -> npt.NDArray[np.uint8]:
        return np.ascontiguousarray(data[()]).reshape(-1).view(np.uint8)[: count * size]

    return count, size, read


def _held(value: Any) -> int:
    return int(np.size(value)) if isinstance(value, np.ndarray) else 0


def _number(value: Any) -> float:
    return float(np.ravel(value)[0])


def _true(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size > 0 and bool(np.ravel(value)[0])
