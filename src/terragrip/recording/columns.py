"""Columns of any table as NumPy arrays, without copies where the type allows."""

from __future__ import annotations

import datetime as dt
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.recording.checks import place
from terragrip.recording.clock import is_date_in_digits
from terragrip.recording.schema import TIME
from terragrip.thousands import complaint, has_thousands
from terragrip.written_times import FORMS, doubt, misfit, times_of


def numbers(name: str, column: npt.NDArray[Any], time: Floats | None, source: str | None) -> Floats:
    """A column as float64, missing = NaN; raises InputError at the first cell that is not a number."""
    if time is not None and len(column) != len(time):
        problem = f"has {len(column)} rows, time has {len(time)}"
        raise InputError(problem, file=source, place=f"column {name}", hint="give one value per instant")
    if column.dtype.kind in "fiub":
        return column.astype(np.float64, copy=False)
    if column.dtype.kind in "OUST":
        _refuse_thousands(name, column, time, source)
        try:
            return column.astype(np.float64)
        except (TypeError, ValueError, OverflowError):
            return _cell_by_cell(name, column, time, source)
    raise InputError(
        f"holds {column.dtype}, not numbers",
        file=source,
        place=f"column {name}",
        hint="give plain numbers in SI",
    )


SINCE_1970 = 1e8
"""Larger stamps [s] count from 1970, smaller ones from some start of their own."""
DAY = 86400.0  # s
SPREADSHEET_1970 = 25569
"""Days of a spreadsheet's dates, which count from 1899-12-30, until 1970."""
DATENUM_1970 = 719529
"""Days of MATLAB's datenum, which counts from the year 0, until 1970."""
DATENUM = (7.24e5, 8e5)
"""Days that are read as such a date: 1982 to 2190,"""
DAY_STEP = 2e-4
"""if rows are as close (17 s): those of a clock in seconds never are."""


def start_of(stamps: npt.NDArray[Any], time: Floats) -> float | None:
    """The clock time of time 0 [s since 1970] from stamps as written and as ``time`` [s]; None if they do not give it.

    Dates without a zone count as UTC.
    """
    if stamps.dtype.kind == "M" and len(stamps):
        found = float((stamps[0] - np.datetime64(0, "s")) / np.timedelta64(1, "s"))
        return None if np.isnan(found) else found
    return 0.0 if len(time) and time[0] > SINCE_1970 else None


def seconds(column: npt.NDArray[Any], source: str | None, name: str = TIME) -> tuple[Floats, list[str]]:
    """The time column [s], with a note where dates became seconds since the first; ``name``: what the log calls it.

    Raises InputError at a text that is no time, and where dates do not show which number is the day.
    """
    column = stamps_of(column, source, name)
    if column.dtype.kind == "m":
        return np.where(np.isnat(column), np.nan, column / np.timedelta64(1, "s")), []
    if column.dtype.kind != "M":
        return numbers(name, column, None, source), []
    since = column - column[0] if len(column) else column.astype("timedelta64[ns]")
    result = np.where(np.isnat(since), np.nan, since / np.timedelta64(1, "s"))
    return result.astype(np.float64), ["time was a date; it counts seconds from the first row."]


def stamps_of(
    column: npt.NDArray[Any], source: str | None, name: str = TIME, order: str | None = None
) -> npt.NDArray[Any]:
    """A time column whose texts are times of day [s] or dates; others as they are. ``order`` as for `times_of`.

    Raises InputError where dates do not show which number is the day, or are numbers of digits.
    """
    if column.dtype.kind not in "OUT":
        if (
            column.dtype.kind in "fiu"
            and len(column)
            and all(map(is_date_in_digits, (column[0], column[-1])))
        ):
            problem = f"is {column[0]:.14g}, a date and a time of day in digits"
            raise InputError(problem, file=source, place=f"column {name}", hint=FORMS)
        return column
    cells = [
        cell if isinstance(cell, str) else cell.isoformat() if isinstance(cell, dt.date | dt.time) else None
        for cell in column.tolist()
    ]
    times = times_of(cells, order)
    if times is not None:
        return times
    doubtful = doubt(cells)
    if doubtful is not None:
        row, problem, hint = doubtful
        page = "formats#in-a-profile"
        raise InputError(problem, file=source, place=place(name, row), hint=hint, page=page)
    odd = misfit(cells)
    if odd is not None:
        problem = f"{_shown(cells[odd])} is not a time, as the rows before have it"
        raise InputError(problem, file=source, place=place(name, odd), hint="correct or delete that row")
    first = next((row for row, cell in enumerate(cells) if cell), None)
    if first is not None and ":" in str(cells[first]):
        problem = f"{_shown(cells[first])} is not a time"
        raise InputError(problem, file=source, place=place(name, first), hint=FORMS)
    return column


def texts(name: str, column: npt.NDArray[Any], rows: int, source: str | None) -> npt.NDArray[np.object_]:
    """A label column as text (n,), empty where there is none; equal labels share one string."""
    if len(column) != rows:
        problem = f"has {len(column)} rows, time has {rows}"
        raise InputError(problem, file=source, place=f"column {name}", hint="give one label per instant")
    if column.dtype.kind == "f" and np.isnan(column).all():
        return np.full(rows, "", dtype=object)
    try:
        changed = np.asarray(column[1:] != column[:-1], dtype=bool)
    except (TypeError, ValueError):  # cells that cannot be compared
        changed = np.ones(max(rows - 1, 0), dtype=bool)
    starts = np.r_[0, np.flatnonzero(changed) + 1] if rows else np.empty(0, dtype=np.intp)
    shared: dict[Any, str] = {}
    result = np.empty(len(starts), dtype=object)
    for k, label in enumerate(column[starts].tolist()):
        try:
            result[k] = shared.setdefault(label, label_of(label))
        except TypeError:  # an unhashable cell
            problem, where = f"holds a {type(label).__name__}", place(name, int(starts[k]))
            raise InputError(problem, file=source, place=where, hint="give text labels") from None
    return np.repeat(result, np.diff(np.r_[starts, rows]))


def label_of(value: Any) -> str:
    """A cell as a label, without the blanks around it; empty where it is missing. 2.0 is 2, which pandas writes so beside missing cells."""
    # test for pandas' NA first: it is neither equal nor unequal to anything
    missing = value is None or type(value).__name__ == "NAType" or value != value
    return "" if missing else re.sub(r"^(\d+)\.0$", r"\1", str(value).strip())


def _refuse_thousands(name: str, column: npt.NDArray[Any], time: Floats | None, source: str | None) -> None:
    """Raise InputError where the points in a column of texts may separate thousands."""
    cells = {row: cell.strip() for row, cell in enumerate(column.tolist()) if isinstance(cell, str)}
    if not has_thousands(list(cells.values()), "."):
        return
    row, cell = next((row, cell) for row, cell in cells.items() if "." in cell)
    problem, hint = complaint(cell) or ("", "")
    raise InputError(problem, file=source, place=place(name, row, time), hint=hint)


def _cell_by_cell(name: str, column: npt.NDArray[Any], time: Floats | None, source: str | None) -> Floats:
    """Convert a column of mixed objects; missing cells become NaN. Refused is the first cell that is not written as most others are."""
    cells = {
        row: cell
        for row, cell in enumerate(column.tolist())
        if cell is not None
        and not (isinstance(cell, str) and not cell.strip())
        and type(cell).__name__ not in ("NAType", "NaTType")
    }
    points = {row: number for row, cell in cells.items() if (number := _number(cell)) is not None}
    commas = [
        row
        for row, cell in cells.items()
        if "." not in str(cell) and _number(str(cell).replace(",", ".")) is not None
    ]
    if len(points) == len(cells):
        result = np.full(len(column), np.nan)
        result[list(points)] = list(points.values())
        return result
    by_comma = len(commas) > len(points)
    usual = set(commas) if by_comma and len(commas) < len(cells) else points
    row = next(row for row in cells if row not in usual)
    problem, hint = f"{_shown(cells[row])} is not a number", "leave the cell empty or give a number"
    if (row in points if by_comma else "," in str(cells[row]) and row in commas) and usual:
        signs = "point, other rows a comma" if by_comma else "comma, other rows a point"
        problem, hint = f"{_shown(cells[row])} has a decimal {signs}", "write all rows alike"
    elif by_comma and usual is points:
        hint = "write numbers with a decimal point"
    problem, hint = (not by_comma and complaint(str(cells[row]))) or (problem, hint)
    raise InputError(problem, file=source, place=place(name, row, time), hint=hint)


def _number(cell: Any) -> float | None:
    try:
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        return None


def _shown(cell: Any) -> str:
    return repr(cell) if len(repr(cell)) <= 30 else repr(cell)[:27] + "..."
