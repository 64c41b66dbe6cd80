"""Checks for an unusable table; each error has column, row and hint."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError, nearest
from terragrip.recording.clock import clock_unit
from terragrip.recording.ranks import median
from terragrip.recording.schema import LABELS, TIME, is_channel, unit_of
from terragrip.units import UnitError, factor_to, is_common

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle


MASSES = (0.2, 10.0)
"""What a measured mass may be of the vehicle file's; the kernel passes over others (loads.c)."""

_ROUNDED = 0.2  # of the stamps repeat the one before: no slip of a logger, but all of its stamps
_HOUR, _ROUGHLY = 3600.0, 30.0  # s
_OF_NAMES = (
    "signal", "signalname", "channel", "channelname", "topic", "parameter", "variable", "series", "sensor", "metric", "tag",
    "field", "measurement", "key", "name", "kanal", "kanalname", "messgröße", "messgroesse", "grandeur", "señal", "segnale",
)  # fmt: skip
_OF_VALUES = (
    "value", "values", "val", "physicalvalue", "wert", "messwert", "valeur", "valor", "valore", "waarde", "reading",
)  # fmt: skip
_NARROW = 6  # columns: time, unit, source and so on may be beside these two
_OF_ESTIMATES = {"ground_speed", "ground_speed_std", "distance", "event"}
_ESSENTIAL = ("wheel_speed_", "wheel_based_speed", "drive_torque_", "ground_speed", "drawbar_force")


def place(column: str, row: int, time: Floats | None = None, *, first_row: int = 0) -> str:
    """The place of a cell: data rows count from 1, as below a header."""
    where = f"column {column}, row {first_row + row + 1}"
    if time is None or not np.isfinite(time[row]):
        return where
    return f"{where} (time {time[row]:.10g} s)"


def require_columns(
    columns: Collection[str],
    source: str | None,
    units: Mapping[str, str] | None = None,
    *,
    where_signals: str | None = None,
) -> None:
    """Raise InputError unless time, ground_speed and a wheel speed are among the columns, and they are not those of estimates.

    ``units``: those that the table states, which a column that is to be renamed should keep. ``where_signals``: the hint where the columns
    are signals, whose names are not easily changed, and none is near.
    """
    if not columns:
        raise InputError("there are no columns", file=source, hint="give a table with a header")
    refuse_estimates(columns, source)
    wheels = "wheel_based_speed" in columns or any(
        c.startswith("wheel_speed_") and len(c) > len("wheel_speed_") for c in columns
    )
    missing = [n for n in (TIME, "ground_speed") if n not in columns] + ["wheel_speed_<wheel>"] * (not wheels)
    if not missing:
        return
    near = {name: nearest(name.replace("_<wheel>", ""), columns) for name in missing}
    pivot = how_to_pivot(columns)
    if pivot is not None:
        raise InputError("is a long table, with a row for each value", file=source, hint=pivot)
    # Name first the missing column that resembles one in the table.
    name = next((n for n in missing if near[n]), missing[0])
    unit = (units or {}).get(near[name] or "") or unit_behind(near[name] or "", name)
    if near[name] is None:
        hint = where_signals or "map the log's columns in a profile ('terragrip inspect' proposes one)"
        if name == TIME and source is None:
            hint = "name the table's column or index of seconds 'time'"
    elif where_signals is not None:
        entry = f"{{from: {near[name]}, unit: {unit}}}" if unit else near[name]
        hint = f"the nearest signal is {near[name]!r}: map it in a profile, '{name}: {entry}'"
    else:
        new = f" '{name} [{unit}]'" if unit else ""
        hint = f"the nearest column is {near[name]!r}: rename it{new}, or map it in a profile"
    page = "formats#in-a-profile"
    raise InputError("is missing", file=source, place=f"column {name}", hint=hint, page=page)


def unit_behind(column: str, channel: str) -> str | None:
    """The unit of a column such as ``speed_kmh`` that stands for a channel, None where its last word is none of the channel's."""
    word, target = column.rpartition("_")[2], unit_of(channel)
    try:
        return word if is_common(word) and target and factor_to(word, target) else None
    except UnitError:
        return None


def refuse_estimates(columns: Collection[str], source: str | None) -> None:
    """Raise InputError if the columns are those of estimates."""
    if set(columns) >= _OF_ESTIMATES:
        hint = "give the log that they were made from ('terragrip report' shows estimates)"
        raise InputError("holds estimates, not a log", file=source, hint=hint)


def how_to_pivot(columns: Collection[str]) -> str | None:
    """What to do with a table that has the names of its signals in one column and all values in another; None of any other table."""
    bare = {re.sub(r"[^a-zà-ÿ]", "", name.lower()): name for name in columns}
    names, values = (next((bare[n] for n in known if n in bare), None) for known in (_OF_NAMES, _OF_VALUES))
    influx = {"_field", "_value"} <= set(columns)  # and a column for each of its tags
    if names is None or values is None or (len(columns) > _NARROW and not influx):
        return None
    time = "_time" if influx else next((name for name in columns if name not in (names, values)), TIME)
    return (
        f"make a column of each signal, in pandas: table.pivot_table(index={time!r}, columns={names!r}, values={values!r})"
        ".reset_index().to_csv('wide.csv', index=False)"
    )


UNUSED = "Columns that are not used: "
NOTHING_TOWED = (
    "There is no drawbar_force: the vehicle is assumed to tow nothing. If it does, soil_resistance contains the pull, and net traction and "
    "efficiency are too small: write how large the pull may be as 'uncertainty: {drawbar_force: 3 kN}' in the vehicle file, or 0 if "
    "nothing is towed."
)


def remarks(columns: Collection[str]) -> list[str]:
    """Sentences on uses for which the columns of a table are not enough."""
    notes = []
    known = (TIME, "arrival", *LABELS)  # the second in a live record
    unused = [c for c in columns if c not in known and not is_channel(c)]
    if unused:
        more = f" and {len(unused) - 8} more" if len(unused) > 8 else ""
        notes.append(f"{UNUSED}{', '.join(unused[:8])}{more}.")
    if "drawbar_force" not in columns:
        notes.append(NOTHING_TOWED)
    return notes


_PLACES_OF = {
    "drawbar_force": (
        "hitch_height",
        "the pull moves load between the axles, but the vehicle has no hitch_height",
        "add e.g. 'hitch_height: 0.25 m' to the vehicle file",
    ),
    "hitch_load": (
        "hitch_overhang",
        "it moves load between the axles, but the vehicle has no hitch_overhang",
        "add e.g. 'hitch_overhang: 1.1 m', from the last axle back to the hitch, to the vehicle file",
    ),
}


def require_hitch(vehicle: Vehicle, name: str, channels: Collection[str], source: str | None = None) -> None:
    """Raise InputError if the force ``name`` on the hitch moves load between axles and the vehicle file does not say where it acts."""
    key, problem, hint = _PLACES_OF[name]
    if name in channels and len(vehicle.axles) > 1 and key not in vehicle.model_fields_set:
        raise InputError(problem, file=source, place=f"column {name}", hint=hint, page="vehicle#all-keys")


def refuse_other_mass(vehicle: Vehicle, channels: Mapping[str, Floats], source: str | None = None) -> None:
    """Raise InputError if most of a measured mass is impossible for this vehicle."""
    known = channels.get("mass", np.empty(0))
    known = known[np.isfinite(known)]
    if not len(known):
        return
    middle = median(known)
    if MASSES[0] * vehicle.mass <= middle <= MASSES[1] * vehicle.mass:
        return
    hint = (
        "it is of the whole machine, in kg: give its unit in the profile, or correct the vehicle file's mass"
    )
    for unit, factor in (("t", 1e3), ("lb", 0.45359237), ("g", 1e-3)):
        if 0.7 < middle * factor / vehicle.mass < 4:
            hint = f"in {unit}? write 'unit: {unit}' for it in the profile"
            break
    problem = f"reads {middle:.4g} kg, the vehicle file has {vehicle.mass:.4g} kg"
    raise InputError(problem, file=source, place="column mass", hint=hint, page="vehicle#a-mass-that-changes")


def check_time(time: Floats, source: str | None, *, first_row: int = 0, after: float | None = None) -> None:
    """Raise InputError unless there is a row and time is finite and increases.

    For a block of a longer table: the number of rows before it, and the time of the last of them. Raises InputError too where the
    last stamp is of a year that no clock shows.
    """
    if len(time) == 0:
        raise InputError("the table is empty", file=source, hint="give a log with at least one row")
    unit = clock_unit(float(time[-1]))
    if unit is not None:
        problem = f"is {time[-1]:.4g} s, past the year 5000: since 1970 in {unit}?"
        hint = f"write 'time: {{from: time, unit: {unit}, zero: first}}' in a profile"
        raise InputError(problem, file=source, place=f"column {TIME}", hint=hint, page="formats#in-a-profile")
    before = time[0] - 1.0 if after is None else after
    with np.errstate(invalid="ignore"):
        forward = np.diff(time, prepend=before) > 0
    if forward.all() and np.isfinite(time[-1]):
        return
    unknown = np.flatnonzero(~np.isfinite(time))
    if len(unknown):
        where = place(TIME, unknown[0], first_row=first_row)
        raise InputError(
            "time is not a finite number", file=source, place=where, hint="drop the row, or correct it"
        )
    row = int(np.argmin(forward))
    last = before if row == 0 else time[row - 1]
    again = float(np.mean(np.diff(time) == 0))
    if time[row] == last and again > _ROUNDED:
        why = "they are rounded, stored with too few digits, or of several machines"
        problem = f"time repeats, as {again:.0%} of the stamps here do: {why}"
        hint = "write time with more digits, or give each machine a table of its own"
    elif time[row] == last:
        problem, hint = "time repeats", "keep one row per instant"
    else:
        problem, hint = f"time goes back from {last:.10g} s", _way_out(float(last - time[row]), time, row)
    raise InputError(problem, file=source, place=place(TIME, row, time, first_row=first_row), hint=hint)


_MIXED = 0.1
"""Share of steps back in time above which a table's rows are in no order, and no other log begins at one of them."""


def _way_out(back: float, time: Floats, row: int) -> str:
    """What to do where time runs back by ``back`` [s] at a row."""
    if abs(back - _HOUR) < _ROUGHLY:
        return "was the clock set to winter time? Write times in UTC, or add 3600 s from there on"
    if np.mean(np.diff(time) < 0) > _MIXED:
        return "sort the rows by time, in pandas: table.sort_values('time')"
    if row > 1 and time[row] <= time[1]:
        return "split the log there: another one seems to begin"
    return "sort the rows, or split the log there"


def refuse_infinite(
    name: str, values: Floats, time: Floats, source: str | None, *, first_row: int = 0
) -> None:
    """Raise InputError at the first infinite value of a channel."""
    if np.isfinite(values).all():
        return
    infinite = np.flatnonzero(np.isinf(values))
    if len(infinite):
        where = place(name, infinite[0], time, first_row=first_row)
        raise InputError("is infinite", file=source, place=where, hint="leave the cell empty instead")


PLACES = {"latitude": 90.0, "longitude": 180.0}
"""The largest degrees of each."""


def refuse_place(name: str, values: Floats, source: str | None, channel: str | None = None) -> None:
    """Raise InputError where values (n,) of a latitude or longitude change, and most are none in degrees (0 stands for no fix);
    ``channel``: where ``name`` is the column of another."""
    limit, places = PLACES.get(channel or name), values[np.isfinite(values) & (values != 0)]
    if limit is None or not len(places) or np.median(np.abs(places)) <= limit or not np.ptp(places):
        return
    known = np.abs(places)
    hint = "give it in degrees: whole numbers of 1e-7 degrees by 'scale: 1e-7' in a profile"
    if not np.all(known == np.round(known)) and known.max() < 100 * limit:
        hint = "give it in degrees: degrees and minutes (ddmm.mmmm) as dd + mm.mmmm/60"
    beyond = places[known > limit]
    if not np.ptp(beyond):
        hint = f"if it stands for 'not measured', leave these cells empty, or write 'invalid: [{beyond[0]:.10g}]' in a profile"
    problem = f"is {beyond[0]:.10g}, and most of its values are no {channel or name} in degrees"
    raise InputError(problem, file=source, place=f"column {name}", hint=hint, page="formats#in-a-profile")


def refuse_empty(name: str, source: str | None) -> None:
    """Raise InputError if a channel without any value is one that estimates need."""
    if name.startswith(_ESSENTIAL):
        hint = "fill it, or remove the column"
        raise InputError("has no value", file=source, place=f"column {name}", hint=hint)
