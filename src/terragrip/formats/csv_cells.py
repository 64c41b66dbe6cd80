"""The rows of a text table as columns: numbers, texts, times; what is wrong with a row is said by its number."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.formats.dialect import Dialect, split
from terragrip.formats.table import from_arrow
from terragrip.recording.schema import LABELS, TIME, is_channel
from terragrip.thousands import complaint, is_grouped, unit_in
from terragrip.written_times import FORMS, doubt, times_of

if TYPE_CHECKING:
    import pyarrow as pa

_REMARKS = re.compile(rb"^# .*(?:\n|\Z)", re.MULTILINE)  # not #N/A
_BLANKS = re.compile(rb"[ \t]+")
_MISSING = [
    *("", "NaN", "nan", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "#N/A", "<NA>", "null", "NULL", "None"),
    *("-", "--", "---", "1.#QNAN", "-1.#IND", "nan(ind)", "-nan(ind)"),
]


def body_of(
    data: bytes, dialect: Dialect, start: int, *, more: bool = False
) -> tuple[bytes | memoryview, Dialect, list[str]]:
    """The rows from ``start`` on, how they are then written, and notes: a last line that was cut off while writing is left out, and so
    are empty lines of a spreadsheet at the end, remarks between the rows (``# Lap 1 ...``), and lines that repeat the header's; runs of
    blanks become tabs.

    ``more``: there are rows before these.
    """
    body: bytes | memoryview = memoryview(data)[start:]
    notes = []
    if not data.endswith(b"\n"):
        last = data.rfind(b"\n") + 1
        cells = split(data[last:].decode("utf-8", "replace"), dialect.separator)
        if (last > start or more) and data[last:].strip() and len(cells) < len(dialect.names):
            body = memoryview(data)[start:last]
            notes.append("The last row is cut off and was left out.")
    ends = data.find(b"\n", len(data.rstrip(b" \t\r\n" + dialect.separator.encode()))) + 1
    if ends:  # what stands behind is lines of separators
        body = body[: max(ends - start, 0)]
    if data.startswith(b"# ", start) or data.find(b"\n# ", start) >= 0:
        body = _REMARKS.sub(b"", bytes(body))
    again = 0
    for line in (line.encode() for line in dialect.header):
        if data.startswith(line, start) or data.find(b"\n" + line, start) >= 0:
            body, count = re.subn(
                rb"^" + re.escape(line) + rb"[ \t\r]*(?:\n|\Z)", b"", bytes(body), flags=re.M
            )
            again = max(again, count)
    if again:
        times = "once" if again == 1 else f"{again} times"
        notes.append(
            f"The header stands {times} more between the rows, as where a logger begins anew: left out."
        )
    if dialect.separator == " ":
        body = b"\n".join(_BLANKS.sub(b"\t", line.strip()) for line in bytes(body).splitlines())
        dialect = replace(dialect, separator="\t")
    return body, dialect, notes


def parse(
    body: bytes | memoryview, dialect: Dialect, chosen: list[int], source: str, first: int = 0
) -> dict[str, npt.NDArray[Any]]:
    """The chosen columns by name; ``first``: rows before these."""
    import pyarrow as pa

    names = dialect.names
    if not bytes(body[:1024]).strip() and not bytes(body).strip():
        return {names[k]: np.empty(0) for k in chosen}
    types = {_field(k): pa.float64() for k in chosen if _is_number_column(names[k], body, dialect, k)}
    types |= {_field(k): pa.string() for k in chosen if names[k] in LABELS or k in dialect.in_cells}
    try:
        table = _arrow(body, dialect, chosen, types)
        # Arrow takes 05:03, minutes and seconds, for hours and minutes
        clocks = {field.name: pa.string() for field in table.schema if pa.types.is_time(field.type)}
        if clocks:
            table = _arrow(body, dialect, chosen, types | clocks)
    except (pa.ArrowInvalid, pa.ArrowKeyError) as error:
        texts = _arrow_of_texts(body, dialect, chosen, error, source, first)
        return {
            names[k]: _numbers_of_texts(k, texts.column(_field(k)), dialect, source, first) for k in chosen
        }
    result = {
        names[k]: _numbers_of_texts(k, table.column(_field(k)), dialect, source, first)
        if k in dialect.in_cells
        else from_arrow(names[k], table.column(_field(k)), source)
        for k in chosen
    }
    return {name: _as_times(name, column) for name, column in result.items()}


def _as_times(name: str, column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A column, with times and dates that Arrow took for text."""
    if column.dtype != object or name in LABELS:
        return column
    times = times_of(column.tolist())
    return column if times is None else times


def _is_number_column(name: str, body: bytes | memoryview, dialect: Dialect, index: int) -> bool:
    if name == TIME:  # may be dates: leave those to Arrow
        line = bytes(body[:4096]).lstrip().partition(b"\n")[0].decode("utf-8", "replace")
        cells = split(line, dialect.separator)
        return not (index < len(cells) and re.match(r"\d{4}-\d\d-\d\d", cells[index]))
    return is_channel(name)


def _field(index: int) -> str:
    return f"c{index}"  # by position, since names may repeat or be empty


def _arrow(body: bytes | memoryview, dialect: Dialect, chosen: list[int], types: dict[str, Any]) -> pa.Table:
    import pyarrow as pa
    from pyarrow import csv

    return csv.read_csv(
        pa.BufferReader(pa.py_buffer(body)),
        # Threads of a read that failed may still start while the process ends, and abort it (apache/arrow#34314).
        read_options=csv.ReadOptions(
            column_names=[_field(k) for k in range(len(dialect.names))], use_threads=False
        ),
        parse_options=csv.ParseOptions(delimiter=dialect.separator),
        convert_options=csv.ConvertOptions(
            column_types=types,
            include_columns=[_field(k) for k in chosen],
            null_values=[*_MISSING, *(f" {mark}" for mark in _MISSING)],  # of rows "1, -, 2"
            strings_can_be_null=True,
            decimal_point=dialect.decimal,
        ),
    )


def _arrow_of_texts(
    body: bytes | memoryview, dialect: Dialect, chosen: list[int], error: Exception, source: str, first: int
) -> pa.Table:
    """The columns as texts, where they cannot be read as numbers; raises InputError where rows do not fit."""
    import pyarrow as pa

    try:
        return _arrow(body, dialect, chosen, {_field(k): pa.string() for k in chosen})
    except (pa.ArrowInvalid, pa.ArrowKeyError):
        raise _ragged(bytes(body), dialect, error, source, first) from error


def _ragged(body: bytes, dialect: Dialect, error: Exception, source: str, first: int) -> InputError:
    """The InputError that names the first row of another width than the header."""
    lines = (line for line in body.decode("utf-8", "replace").splitlines() if line.strip())
    width = len(dialect.names)
    for row, line in enumerate(lines, start=first + 1):
        cells = len(split(line, dialect.separator))
        if cells != width:
            problem = f"has {cells} cell{'s' * (cells != 1)}, the header {width}"
            return InputError(
                problem, file=source, place=f"row {row}", hint="give every row the same number of cells"
            )
    problem = f"is not a regular table ({str(error)[:80]})"
    return InputError(problem, file=source, hint="look for unbalanced quotes")


def _numbers_of_texts(
    index: int, column: pa.ChunkedArray, dialect: Dialect, source: str, first: int
) -> npt.NDArray[Any]:
    """Texts as numbers; a schema column raises InputError at the first that is none, another stays text."""
    name = dialect.names[index]
    cells = [cell.strip() or None if cell is not None else None for cell in column.to_pylist()]
    if index in dialect.in_cells:
        cells = _without_unit(cells, dialect.in_cells[index], name, first, source)
    is_own = is_channel(name) or name == TIME
    times = times_of(cells) if name == TIME or not (is_own or name in LABELS) else None
    if times is not None:
        return times
    if name == TIME and doubt(cells) is not None:  # a profile may say how they are written
        return np.array(cells, dtype=object)
    result = np.full(len(cells), np.nan)
    doubtful = _doubtful(cells, dialect.decimal)
    for row, cell in enumerate(cells):
        number = None if row == doubtful else number_in(cell)
        if number is not None:
            result[row] = number
        elif cell is not None and is_own:
            raise _no_number(cell, name, first + row, source)
        else:
            return np.array(cells, dtype=object)
    return result


def _without_unit(cells: list[str | None], unit: str, name: str, first: int, source: str) -> list[str | None]:
    """Cells without the unit that those of the first rows have; raises InputError at one with another."""
    for row, cell in enumerate(cells):
        own = unit_in(cell) if cell is not None else None
        if own not in (None, unit):
            raise InputError(
                f"is in {own}, the first rows in {unit}",
                file=source,
                place=f"column {name}, row {first + row + 1}",
                hint="write all in one unit",
            )
    return [cell.removesuffix(unit).strip() if cell is not None and unit_in(cell) else cell for cell in cells]


def number_in(cell: str | None) -> float | None:
    """The number in a cell by either decimal sign, NaN in an empty one; None where there is another text."""
    try:
        return np.nan if cell is None else float(cell.replace(",", "."))
    except ValueError:
        return None


def _doubtful(cells: list[str | None], decimal: str) -> int | None:
    """The first cell of a column in which a sign, other than the table's ``decimal``, may stand between thousands; None if in none."""
    other = "," if decimal == "." else "."
    signed = [row for row, cell in enumerate(cells) if cell is not None and other in cell]
    return signed[0] if signed and all(is_grouped(str(cells[row]), other) for row in signed) else None


def _no_number(cell: str, name: str, row: int, source: str) -> InputError:
    shown = repr(cell) if len(cell) <= 30 else repr(cell[:27] + "...")
    hint = FORMS if name == TIME else "leave the cell empty or give a number"
    if name == TIME and row == 0 and cell[:1].isalpha():
        hint = "delete lines of types, units or sources under the names (a profile states units)"
    problem, hint = complaint(cell) or (f"{shown} is not a number", hint)
    return InputError(problem, file=source, place=f"column {name}, row {row + 1}", hint=hint)
