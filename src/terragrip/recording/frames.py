"""Tables in memory of any kind: their columns as NumPy arrays, without copies where the type allows, and the units that they state."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.recording.columns import numbers, stamps_of
from terragrip.recording.schema import TIME, unit_of
from terragrip.units import UnitError, factor_to, is_common

WITH_UNIT = re.compile(r"(.+?)\s*(?:\[\s*([^\]]*?)\s*\]|\(\s*([^)]*?)\s*\))$")

_EMPTY = re.compile(r"|nan|Unnamed: \d+_level_\d+")  # levels without a name, as pandas makes and reads them


@dataclass(frozen=True, eq=False)
class Frame:
    """Columns (n,) of a table in memory, by their names without units, the units that it states, and sentences on them."""

    columns: dict[str, npt.NDArray[Any]]
    units: dict[str, str]
    notes: tuple[str, ...] = ()


def frame_of(table: Any, source: str | None) -> Frame:
    """A table in memory with its units: ``speed [km/h]``, ``attrs["units"]`` of pandas or xarray, an Arrow field's ``unit``.

    A unit behind a name counts before one beside it, since renaming leaves ``attrs`` as they were. Raises InputError as `columns_of`.
    """
    columns = columns_of(table, source)
    names, behind = names_and_units(list(columns))
    stated = _beside(table, source)
    beside = {name: stated[whole] for whole, name in zip(columns, names, strict=True) if whole in stated}
    beside = {name: unit for name, unit in beside.items() if unit and name not in behind}
    foreign = [f"{n} in {u}" for n, u in beside.items() if _is_foreign(n, u)]
    notes: tuple[str, ...] = (
        (f"Units by the table's attributes, which its arithmetic keeps: {', '.join(foreign)}.",)
        if foreign
        else ()
    )
    indices = (
        [one.index for one in table.values() if hasattr(one, "iloc")] if isinstance(table, Mapping) else []
    )
    if any(not one.equals(indices[0]) for one in indices):
        notes += ("The indices of the table's Series differ: rows are taken by their place, not by index.",)
    bare = [name for name in names if name not in {**beside, **behind}]
    return Frame(
        dict(zip(names, columns.values(), strict=True)),
        {**beside, **behind},
        notes + _of_no_column({name: unit for name, unit in stated.items() if name not in columns}, bare),
    )


def _of_no_column(lost: Mapping[str, str], bare: Iterable[str]) -> tuple[str, ...]:
    """A sentence on units whose column is misspelt or renamed, where a channel without a unit may be meant."""
    channels = [name for name in bare if unit_of(name) is not None]
    meant = {
        f"{name} in {unit}": near
        for name, unit in lost.items()
        if (near := [c for c in channels if _is_foreign(c, unit, other=False)])
    }
    if not meant:
        return ()
    counted = list(dict.fromkeys(f"{c} in {unit_of(c)}" for near in meant.values() for c in near))
    more = ", ..." if len(counted) > 3 else ""
    return (
        f"The table states {', '.join(meant)}, but has no such column; what it has counts as {', '.join(counted[:3])}{more}. "
        "Write units under the columns' own names.",
    )


def in_si(
    columns: Mapping[str, npt.NDArray[Any]], units: Mapping[str, str], source: str | None
) -> dict[str, npt.NDArray[Any]]:
    """The columns, those of the schema in its units; raises InputError where the table states a unit of another quantity."""
    result = dict(columns)
    for name in [name for name in columns if name in units]:  # in order: an error names the first
        target, column = unit_of(name), columns[name]
        if name == TIME:
            column = stamps_of(column, source)
        if target is None or column.dtype.kind in "mM" or (name == TIME and column is not columns[name]):
            continue
        try:
            factor = factor_to(units[name], target)
        except UnitError as error:
            raise InputError(error.problem, file=source, place=f"column {name}", hint=error.hint) from error
        if factor != 1.0:
            result[name] = numbers(name, column, None, source) * np.float64(factor)
    return result


def units_of_fields(schema: Any) -> dict[str, str]:
    """The units that an Arrow schema states, by column: its fields' metadata ``unit``, or pandas' ``attrs["units"]``."""
    try:
        pandas = json.loads((schema.metadata or {}).get(b"pandas", b"{}"))
        result = _texts(stated_unit(pandas["attributes"]))
    except (ValueError, KeyError, TypeError, RecursionError):  # damaged, or none stated
        result = {}
    units = {
        field.name.strip(): stated_unit(
            {k.decode("utf-8", "replace"): v for k, v in (field.metadata or {}).items()}
        )
        for field in schema
    }
    return result | {name: unit.decode("utf-8", "replace") for name, unit in units.items() if unit}


def stated_unit(attributes: Mapping[Any, Any]) -> Any:
    """What stands under ``units``, ``unit``, ``Units`` ... of a table's or a column's attributes; None if nothing, or nothing in it."""
    found = [attributes[k] for k in attributes if str(k).strip().lower() in ("unit", "units")]
    return next(
        (x for x in found if not isinstance(x, str | bytes | Mapping | list | tuple | None) or x), None
    )


def _beside(table: Any, source: str | None) -> dict[str, str]:
    """The units that a table, or each of its columns, states beside the names.

    Raises InputError where its attributes state them in another way than by a column's name, which would be a unit dropped.
    """
    if hasattr(table, "column_names"):
        return units_of_fields(table.schema)
    attributes = getattr(table, "attrs", {})
    units = stated_unit(attributes)
    channels = [name for name in getattr(table, "columns", ()) if unit_of(str(name)) is not None]
    stray = [name for name in channels if is_common(str(attributes.get(name, " ")))]
    if stray or isinstance(units, list | tuple) or (isinstance(units, str) and is_common(units)):
        name, unit = (stray[0], attributes[stray[0]]) if stray else ("ground_speed", "km/h")
        raise InputError(
            "attrs states units otherwise than by column",
            file=source,
            hint=f"write attrs['units'] = {{{str(name)!r}: {str(unit)!r}, ...}}",
        )
    stated = _texts(units)
    if isinstance(table, Mapping):  # of xarray's variables, pandas' Series, pint's quantities
        return stated | _texts({name: _of_column(name, column) for name, column in _variables(table)})
    kinds = getattr(table, "dtypes", None)
    own = kinds.items() if kinds is not None and hasattr(kinds, "items") else ()  # pint-pandas
    return stated | _texts({name: getattr(kind, "units", None) for name, kind in own})


def _of_column(name: Any, column: Any) -> Any:
    """The unit that a column of a mapping states; a Series of a frame has that frame's ``attrs``, the units of all columns."""
    units = stated_unit(getattr(column, "attrs", {}))
    units = getattr(column, "units", None) if units is None else units
    if not isinstance(units, Mapping):
        return units
    return units.get(column.name, units.get(name))


def _is_foreign(name: str, unit: str, *, other: bool = True) -> bool:
    """Whether a channel's unit is not ours; ``other``: what is said of one of another quantity."""
    target = unit_of(name)
    try:
        return target is not None and factor_to(unit, target) != 1.0
    except UnitError:
        return other


def _texts(units: Any) -> dict[str, str]:
    """Units by column as texts, degrees_north as degrees; none of anything but a mapping."""
    if not isinstance(units, Mapping):
        return {}
    return {str(n).strip(): re.sub("_(north|east)$", "", str(u)) for n, u in units.items() if u is not None}


def _variables(table: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """The columns of a mapping; of an xarray Dataset its coordinates, too, and what has one dimension alone."""
    if type(table).__module__.partition(".")[0] != "xarray":
        return list(table.items())
    return [(name, table[name]) for name in getattr(table, "variables", table) if table[name].ndim == 1]


def columns_of(frame: Any, source: str | None) -> dict[str, npt.NDArray[Any]]:
    """The columns of a pandas or polars frame, an Arrow table or a mapping, by name.

    Raises InputError on anything else, on a name that occurs twice and on columns of unlike length.
    """
    pairs: list[tuple[Any, Any]]
    lazy = next((way for way in ("collect", "compute") if {way, "columns"} <= {*dir(frame)}), None)
    if isinstance(frame, Mapping):
        pairs = _variables(frame)
    elif not lazy and hasattr(getattr(frame, "columns", None), "nlevels"):  # pandas, GeoPandas
        if frame.columns.nlevels > 1:
            frame = frame.set_axis([of_levels(levels) for levels in frame.columns], axis=1)
        index = frame.index
        if TIME not in frame.columns and index.nlevels == 1 and index.dtype.kind in "mM":
            if index.name not in (None, TIME, *frame.columns):  # a profile may name it as it is called
                frame = frame.assign(**{str(index.name): index})
            frame = frame.rename_axis(TIME)
        if TIME not in frame.columns:
            levels = [str(name) for name in frame.index.names]
            if TIME in names_and_units(levels)[0]:
                frame = frame.reset_index(
                    level=[name for name in levels if name not in (*frame.columns, "None")]
                )
        pairs = [(name, _from_pandas(series)) for name, series in frame.items()]
    elif hasattr(frame, "__arrow_c_stream__") and hasattr(frame, "columns"):  # Arrow, polars, DuckDB
        import pyarrow as pa

        frame = pa.table(frame)
        pairs = [(name, frame.column(k).to_numpy()) for k, name in enumerate(frame.column_names)]
    else:
        problem = f"{type(frame).__name__} is not a table"
        hint = "give what tg.read(path) returns, a DataFrame or a dict of arrays"
        raise InputError(problem, file=source, hint=f"give what its .{lazy}() returns" if lazy else hint)
    columns: dict[str, npt.NDArray[Any]] = {}
    for label, values in pairs:
        name = str(label).strip()
        if name in columns:
            raise InputError("occurs twice", file=source, place=f"column {name}", hint="keep one of them")
        column = _array(name, values, source)
        if columns and len(column) != len(next(iter(columns.values()))):
            problem = f"has {len(column)} rows, the first column {len(next(iter(columns.values())))}"
            raise InputError(problem, file=source, place=f"column {name}", hint="give columns of one length")
        columns[name] = column
    return columns


def of_levels(levels: Iterable[Any]) -> str:
    """The name of a column of several levels in one: ``wheel_speed_fl`` of ``("wheel_speed", "fl")``."""
    return "_".join(text for text in map(str, levels) if not _EMPTY.fullmatch(text))


def names_and_units(header: list[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Column names without ``[unit]`` or ``(unit)`` behind them, where what stands there is a unit.

    A number or a letter is none where a column of the same name has another one that is no unit: ``speed[1]`` beside ``speed[0]``,
    ``torque (L)`` beside ``torque (R)``.
    """
    bare: list[tuple[str, str]] = []
    labels = set()
    for cell in header:
        match = WITH_UNIT.match(cell)
        name, unit = (match[1], match[2] or match[3] or "") if match else (cell, "")
        if unit and not is_common(unit):
            labels.add((name, _shape(unit)))
            name, unit = cell, ""
        bare.append((name, unit))
    bare = [
        (cell, "") if len(unit) == 1 and (name, _shape(unit)) in labels else (name, unit)
        for cell, (name, unit) in zip(header, bare, strict=True)
    ]
    names = [name for name, _ in bare]
    chosen = [cell if names.count(name) > 1 else name for cell, name in zip(header, names, strict=True)]
    return tuple(chosen), {c: u for c, (_, u) in zip(chosen, bare, strict=True) if u}


def _shape(label: str) -> str:
    return "number" if label.isdigit() else "letter" if len(label) == 1 and label.isalpha() else "text"


def _from_pandas(series: Any) -> Any:
    if hasattr(series.dtype, "units"):  # pint-pandas
        return series.pint.magnitude
    if getattr(series.dtype, "tz", None) is not None:
        series = series.dt.tz_convert("UTC").dt.tz_localize(None)
    return series.to_numpy()


def _array(name: str, values: Any, source: str | None) -> npt.NDArray[Any]:
    values = getattr(values, "magnitude", values)  # pint
    try:
        array = (
            np.ma.filled(values.astype(float), np.nan) if np.ma.isMaskedArray(values) else np.asarray(values)
        )
    except (TypeError, ValueError) as error:
        raise InputError(
            f"is not a column ({error})",
            file=source,
            place=f"column {name}",
            hint="give a 1-D array of numbers",
        ) from error
    if array.ndim != 1:
        problem = f"has {array.ndim} dimensions"
        raise InputError(problem, file=source, place=f"column {name}", hint="give a 1-D array of numbers")
    return array
