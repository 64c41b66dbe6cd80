"""How a text table is written: encoding, separator, decimal sign, header, units row."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, zip_longest

from terragrip.errors import InputError
from terragrip.recording.frames import WITH_UNIT, names_and_units
from terragrip.recording.schema import TIME
from terragrip.text import HEAD
from terragrip.thousands import has_thousands, unit_in
from terragrip.units import is_common
from terragrip.written_times import times_of

_SEPARATORS = (",", ";", "\t", "|")
_COMMENTS = (b"#", b"%", b"//")
_LONGEST_PREAMBLE = 30  # lines
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?$")
_NAME = re.compile(r"[^\W\d]|[/\[]")
_EMPTY = ("", "nan", "na", "n/a", "null", "none", "-", "--", "---", "inf", "-inf")


@dataclass(frozen=True)
class Dialect:
    """How a text table is written. ``separator`` " " stands for any run of blanks; ``start`` is where rows begin.

    ``in_cells``: the columns whose numbers have their unit behind them, by place, and that unit, which is also in ``units``.
    ``unnamed``: how many columns of the first rows have values, but no name. ``header``: its lines, as they stand in the table.
    """

    separator: str
    decimal: str
    names: tuple[str, ...]
    units: dict[str, str]
    start: int
    in_cells: dict[int, str] = field(default_factory=dict)
    unnamed: int = 0
    header: tuple[str, ...] = ()


def detect(data: bytes, source: str) -> Dialect:
    """Detect how the table in ``data`` (UTF-8) is written; raises InputError where it is none.

    The separator and decimal sign that make the most cells of the first rows numbers win; before the header, lines that begin
    with ``#``, ``%`` or ``//`` are passed over, and so are lines that are no rows of the table, as loggers write them.
    """
    start = _start_of(data)
    lines = _first_lines(data, start)
    _require_table(lines, source)
    if lines[0].lower().startswith("sep="):  # Excel's own hint
        start, lines = _after_lines(data, start, 1), lines[1:] or [""]
    before = _preamble(lines)
    start, lines = _after_lines(data, start, before), lines[before:]
    separator, decimal = _best(lines)
    table = [split(line, separator) for line in lines]
    table[0] = split(_without_mark(lines[0]), separator)
    joined, over = _of_two_levels(table, decimal) or (_under_groups(table, decimal), 2)
    if joined is not None:
        start, table = _after_lines(data, start, over - 1), [joined, *table[over:]]
    header, second = table[0], table[1] if len(table) > 1 else []
    if sum(_is_number(cell, decimal) for cell in header) > len(header) / 2:
        hint = "put a header row above the numbers"
        raise InputError("the first row has numbers, not column names", file=source, hint=hint)
    if len(second) == len(header) + 1 and not second[-1]:
        header.append("")
    names, units = names_and_units(header)
    rows = _header_rows(table, decimal)
    if rows > 1:  # of short names one may be a unit, too: t
        row = max(table[1:rows], key=lambda row: sum(is_common(_bare(cell)) for cell in row))
        units |= {name: stated for name, cell in zip(names, row, strict=False) if (stated := _bare(cell))}
    columns = list(zip_longest(*table[rows:], fillvalue=""))
    in_cells = {
        k: unit
        for k, (name, column) in enumerate(zip(names, columns, strict=False))
        if (unit := _unit_in_all(column)) and units.get(name, unit) == unit
    }
    units |= {names[k]: unit for k, unit in in_cells.items()}
    dates = list(columns[0]) if columns and not names[0] and TIME not in names else []
    if any(dates) and times_of(dates) is not None:
        names = (TIME, *names[1:])  # pandas' index
    others = zip(columns[1:], names[1:], strict=False)  # the first may be an index
    unnamed = sum(any(column) for column, name in others if not name)
    written = () if joined is not None else tuple(lines[:rows])
    return Dialect(
        separator, decimal, names, units, _after_lines(data, start, rows), in_cells, unnamed, written
    )


def _first_lines(data: bytes, start: int) -> list[str]:
    """The first lines from ``start`` that are not blank, 60 at most."""
    head = data[start : start + HEAD]
    if len(head) == HEAD and b"\n" in head:
        head = head[: head.rindex(b"\n")]
    return [line for line in head.decode("utf-8", "replace").splitlines() if line.strip()][:60]


def _require_table(lines: list[str], source: str) -> None:
    if not lines:
        raise InputError("is empty", file=source, hint="give a table with a header and rows")
    if lines[0].lstrip().startswith(("{", "[{")):
        hint = "save it as CSV or Parquet, e.g. by pandas.read_json(FILE, lines=True).to_parquet(...) if each line is an object"
        raise InputError("is JSON", file=source, hint=hint)
    if kinds := _kinds(lines):
        hint = "make a table of each kind, with a header of names and one column of time, and join them by --with"
        problem = f"has rows of several kinds ({', '.join(kinds)}), each with columns of its own"
        raise InputError(problem, file=source, hint=hint)


def _kinds(lines: list[str]) -> list[str]:
    """The first cells of records of several kinds: a few words, each with rows of one width, not all of the same; empty of a table."""
    for separator in _SEPARATORS:
        widths: dict[str, list[int]] = {}
        for line in lines:
            cells = split(line, separator)
            widths.setdefault(cells[0], []).append(len(cells))
        of_one_width = all(len(own) > 1 and len(set(own)) == 1 and own[0] > 1 for own in widths.values())
        if of_one_width and len({own[0] for own in widths.values()}) > 1 and all(map(_NAME.match, widths)):
            return sorted(widths)
    return []


def _header_rows(table: list[list[str]], decimal: str) -> int:
    """How many rows the header has: names, and up to two more without a number, one of which has units: types, short names, sources."""
    for rows in range(2, min(4, len(table))):
        if any(_is_number(cell, decimal) for cell in table[rows - 1]):
            break
        if any(_is_number(cell, decimal) for cell in table[rows]):
            return rows if any(_is_units_row(row, table[rows], decimal) for row in table[1:rows]) else 1
    return 1


def _unit_in_all(cells: tuple[str, ...]) -> str | None:
    """The one unit that all numbers of a column have behind them."""
    found = {unit_in(cell) for cell in cells if cell.lower() not in _EMPTY}
    return found.pop() if len(found) == 1 else None


def _of_two_levels(table: list[list[str]], decimal: str) -> tuple[list[str], int] | None:
    """The names of a header as pandas writes columns of two levels, ``wheel_speed`` above each of fl, fr ..., and how many rows it has:
    a third one names the index. None of any other."""
    if len(table) < 4 or len(table[0]) != len(table[1]):
        return None
    groups, names, third = table[:3]
    pairs, indexed = list(zip(groups, names, strict=True)), not any(third[1:])
    below, above = ([name for name in level if name] for level in (names, groups))
    if (
        len(set(pairs)) < len(pairs)
        or len(set(above)) == len(above)
        or all(is_common(_bare(n)) for n in below)
    ):
        return None
    if not indexed and any(_is_number(name, decimal) for name in below):
        return None
    joined = ["_".join(filter(None, pair)) for pair in pairs]
    return ([third[0], *joined[1:]], 3) if indexed else (joined, 2)


def _under_groups(table: list[list[str]], decimal: str) -> list[str] | None:
    """The names of a header of two rows, where the first names groups of columns and is empty behind each; None of any other.

    A name that stands in several groups, or alone in one, has its group's before it; below a group of one may stand but a unit, or nothing.
    """
    groups = table[0]
    if len(table) < 4 or "" not in groups[1:] or not groups[0]:
        return None
    names = table[1]
    if len(names) != len(groups) or any(_is_number(name, decimal) for name in names):
        return None
    if not all(
        _NAME.match(name) and not is_common(_bare(name))
        for own, name in zip(groups, names, strict=True)
        if not own
    ):
        return None
    alone = [WITH_UNIT.sub(r"\1", name) for name in names]
    whole, group = [], ""
    for own, name, bare, after in zip(groups, names, alone, [*groups[1:], "end"], strict=True):
        group = own or group
        if own and (not name or is_common(_bare(name))):
            whole.append(f"{own} [{_bare(name)}]" if _bare(name) else own)
        else:
            whole.append(f"{group} {name}" if alone.count(bare) > 1 or (own and after) else name)
    return whole


def _preamble(lines: list[str]) -> int:
    """How many lines stand before the header: far narrower than the table's rows, which begin with names, not with numbers."""
    best = (1, 0)
    for separator in _SEPARATORS:
        widths = [len(split(line, separator)) for line in lines]
        rows = widths[len(widths) // 2 :]
        width = max(set(rows), key=rows.count)
        if width < 2 or rows.count(width) < 0.9 * len(rows):
            continue
        # a spreadsheet fills all lines with separators: what is empty behind the last cell with a text is no width
        filled = [len(split(line.rstrip(f"{separator} \t"), separator)) for line in lines]
        if widths[0] >= 0.75 * width and filled[0] > max(1, 0.5 * width):
            return 0  # the header, though it may lack a name
        usual = zip(widths, filled, strict=True)
        header = next(
            (k for k, (own, to) in enumerate(usual) if own in (width, width + 1) and to > 0.5 * width),
            len(lines),
        )
        if not 0 < header <= min(_LONGEST_PREAMBLE, len(lines) - 2):
            continue
        cells = [cell for cell in split(lines[header], separator) if cell]
        if sum(bool(_NAME.match(cell)) for cell in cells) > len(cells) / 2:
            best = max(best, (width, header))
    return best[1]


def split(line: str, separator: str) -> list[str]:
    """The cells of one line, without quotes and surrounding blanks."""
    if separator == " ":
        return line.split()
    try:
        cells = next(csv.reader(io.StringIO(line), delimiter=separator, skipinitialspace=True), [""])
    except csv.Error:  # a cell beyond the csv module's limit
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def _best(lines: list[str]) -> tuple[str, str]:
    """Separator and decimal sign under which the lines make the best table."""
    best, chosen = (-1.0, -1.0, -1.0, -1.0), (",", ".")
    for separator in (*_SEPARATORS, *" " * (len(lines) > 1)):  # names may have blanks in them
        table = [split(line, separator) for line in lines]
        width = len(table[0])
        body = table[1:]
        widths = [len(row) for row in body]
        # Rows agree among themselves; a header of another width is refused later, by name, and hides no separator.
        usual = max(set(widths), key=widths.count) if body else width
        fitting = sum(abs(own - usual) <= 1 for own in widths) / len(body) if body else 1.0
        fitting *= usual > 1 or abs(usual - width) <= 1
        named = float(abs(usual - width) <= 1)
        for decimal in (".",) if separator == "," else (".", ","):
            cells = [cell for row in body[:20] for cell in row]
            numbers = sum(_is_number(cell, decimal) for cell in cells)
            share = round(numbers / len(cells), 2) if cells else 0.0
            score = (round(fitting, 1) * (width > 1), named, share if width > 1 else 0.0, float(width))
            if score > best:
                best, chosen = score, (separator, decimal)
    # One column has no separator: a comma in its numbers is the decimal sign.
    if best[0] <= 0:
        chosen = ";", "," if any("," in line for line in lines[1:]) else "."
    # Quoted numbers may hold a decimal comma between commas.
    if chosen == (",", ".") or chosen[1] == ",":
        return chosen[0], "," if _has_decimal_commas(lines[1:], chosen[0]) else "."
    return chosen


def _has_decimal_commas(lines: list[str], separator: str) -> bool:
    """Whether some column of the rows has commas in its numbers that cannot all be between thousands."""
    columns = zip_longest(*(split(line, separator) for line in lines), fillvalue="")
    return any(
        any("," in cell and _is_number(cell, ",") for cell in column) and not has_thousands(column, ",")
        for column in columns
    )


def _is_number(cell: str, decimal: str) -> bool:
    return bool(_NUMBER.match(cell)) and ("," if decimal == "." else ".") not in cell


def _is_units_row(cells: list[str], below: list[str], decimal: str) -> bool:
    """Whether the row under the header holds units: no number in it, numbers under it, and units among its cells."""
    if any(_is_number(cell, decimal) for cell in cells):
        return False
    under = [cell for cell, number in zip(cells, below, strict=False) if _is_number(number, decimal)]
    return any(cell.lower() not in _EMPTY for cell in under) and any(is_common(_bare(cell)) for cell in under)


def _bare(cell: str) -> str:
    cell = cell.strip("[]() ")
    return "" if cell in ("-", "--", "none") else cell


def _lines(data: bytes, start: int = 0) -> Iterator[tuple[int, int, bytes]]:
    """Where each line begins and the next one does, and its content without blanks around it."""
    while start < len(data):
        end = data.find(b"\n", start) + 1 or len(data)
        yield start, end, data[start:end].strip()
        start = end


def _start_of(data: bytes) -> int:
    """Where the table starts: after comments, or with the last comment line where that is the header of the rows below it."""
    start = next((at for at, _, line in _lines(data) if line and not line.startswith(_COMMENTS)), len(data))
    above = data[:start].rstrip()
    begin = above.rfind(b"\n") + 1
    last = _without_mark(above[begin:].decode("utf-8", "replace"))
    below = data[start : start + HEAD].split(b"\n", 1)[0].decode("utf-8", "replace")
    if not last or not below.strip():
        return start
    for separator in (*_SEPARATORS, " "):
        names, cells = split(last, separator), split(below, separator)
        numbers = sum(bool(_NUMBER.match(cell)) for cell in cells)
        if (
            len(names) == len(cells) > 1
            and 2 * numbers > len(cells)
            and all(_NAME.search(n) or not n for n in names)
        ):
            return begin
    return start


def _without_mark(line: str) -> str:
    """A header line without the comment mark before it; ``%time`` is a name."""
    return re.sub(r"^\s*(#+|//|%(?=\s))\s*", "", line)


def _after_lines(data: bytes, start: int, count: int) -> int:
    """Position after ``count`` lines that are not blank."""
    ends = (end for _, end, line in _lines(data, start) if line)
    return next(islice(ends, count - 1, None), len(data)) if count else start
