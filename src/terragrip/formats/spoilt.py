"""Columns that texts keep from being numbers or times: what stands in them, and what to write; sentences for the user, never errors."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.formats.csv_cells import number_in
from terragrip.formats.vocabulary import Vocabulary
from terragrip.recording.schema import LABELS
from terragrip.thousands import complaint
from terragrip.written_times import FORMS, doubt

_ROWS = 100_000  # of a column that are looked at
_MOST = 0.5  # of the cells are numbers: the column is one of numbers
_JOINT = re.compile(r"(?:^|[^a-z])name[\[_]?\d+\]?$")
"""Of a message of joints, which may be in any order."""
_LIST = re.compile(r"(\w+\()?[\[(].*,.*[\])]$")
_VALUES = re.compile(r"values?|_value|val|wert|valeur|valor", re.IGNORECASE)
_UNITS = re.compile(r"units?|uom|einheit", re.IGNORECASE)
_LISTED = 4  # columns that are named


def numbers_of(column: npt.NDArray[Any]) -> Floats | None:
    """A column (n,) of numbers that are written as texts, with a point; None of any other."""
    if column.dtype.kind != "O" or not any(isinstance(cell, str) for cell in column[:10].tolist()):
        return None
    try:
        return np.array([np.nan if cell in (None, "") else float(cell) for cell in column.tolist()])
    except (TypeError, ValueError):
        return None


def notes_on(texts: Mapping[str, npt.NDArray[Any]], vocabulary: Vocabulary, *, timed: bool) -> list[str]:
    """Sentences on text columns of a log, by name (n,), that would be channels, or, where the log is not ``timed``, its time."""
    notes = []
    for name, column in texts.items():
        cells = [cell.strip() if isinstance(cell, str) else None for cell in column[:_ROWS].tolist()]
        read = vocabulary.read(name)
        found = doubt(cells)
        if found is not None:
            notes += [] if timed else [f"column {name}, row {found[0] + 1}: {found[1]}; {found[2]}."]
        elif any(cell and _LIST.match(cell) for cell in cells[:10]):
            notes.append(f"column {name} has a list in each row: make a column of each of its elements.")
        elif name not in LABELS:
            notes += _of_numbers(name, cells)
            if not notes and not timed and read.has("time") and any(cells):
                first = next(row for row, cell in enumerate(cells) if cell)
                notes.append(f"column {name}, row {first + 1}: {cells[first]!r} is not a time; {FORMS}.")
    return (
        notes[:_LISTED]
        + _of_any_joint(texts)
        + [f"{len(notes) - _LISTED} more columns likewise."] * (len(notes) > _LISTED)
    )


def of_a_long_table(
    texts: Mapping[str, npt.NDArray[Any]], numbers: Iterable[str], time: str | None
) -> list[str]:
    """A sentence on a table with a row for each value: a text column names the signals, and another column holds their values."""
    value = next((name for name in numbers if _VALUES.fullmatch(name)), None)
    if value is None:
        return []
    unit = next((name for name in texts if _UNITS.fullmatch(name)), None)
    for name, cells in texts.items():
        count = len(set(cells[:_ROWS]) - {None, ""})
        if name != unit and name not in LABELS and 1 < count <= 0.1 * len(cells):
            columns = f't["{name}"] + " [" + t["{unit}"] + "]"' if unit else f'"{name}"'
            return [
                f"{value} holds the values of {count} signals, which {name} names, a row for each value. Make a column of each signal, by "
                f't = pandas.read_csv(FILE, sep=None, engine="python"); t.pivot_table(index="{time or "TIME"}", columns={columns}, '
                f'values="{value}").to_csv("wide.csv").'
            ]
    return []


def _of_any_joint(texts: Mapping[str, npt.NDArray[Any]]) -> list[str]:
    """A sentence where columns name another joint from row to row, so that those of its number are of any joint."""
    changing = [
        name
        for name, cells in texts.items()
        if _JOINT.search(name) and len({*cells[:_ROWS]} - {None, ""}) > 1
    ]
    names = ", ".join(changing[:_LISTED])
    sentence = f"{names}: other joints from row to row. Make a column of each joint, or give the bag itself."
    return [sentence] if changing else []


def _of_numbers(name: str, cells: list[str | None]) -> Iterator[str]:
    """A sentence where most of the cells are numbers: on the first that is none, or on their decimal comma."""
    known = [(row, cell) for row, cell in enumerate(cells) if cell]
    good = {cell: number_in(cell) is not None for cell in {cell for _, cell in known}}
    if not known or np.mean([good[cell] or complaint(cell) is not None for _, cell in known]) <= _MOST:
        return
    bad = next(((row, cell) for row, cell in known if not good[cell]), None)
    if bad is None:
        yield f"column {name} has numbers with a decimal comma as texts: write numbers."
        return
    count = sum(not good[cell] for _, cell in known)
    others = f" (and {count - 1} more)" if count > 1 else ""
    problem, hint = complaint(bad[1]) or (
        f"{bad[1][:30]!r} is not a number, though most cells there are",
        "leave it empty, or correct it",
    )
    yield f"column {name}, row {bad[0] + 1}{others}: {problem}; {hint}."
