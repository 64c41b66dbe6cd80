"""Digitised points of a printed curve: CSV files of WebPlotDigitizer, Engauge and others."""

from __future__ import annotations

import csv
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.files import refuse_missing, unreadable
from terragrip.recording.schema import is_channel
from terragrip.soil.bins import BinSettings
from terragrip.soil.fit import AdhesionCurve, explaining
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.text import to_text

_STAMPS = ("time", "timestamp", "zeit")
_PER_CENT = re.compile(r"(?:^|[^\W\d])\W*%\W*$")
"""A column's unit, as in 'slip [%]'; not a soil's name, as 'clay 20 %'."""


@dataclass(frozen=True)
class DigitisedCurve:
    """Points of one curve: slip (n,) as a fraction, value (n,) [-], the curve's name, notes on assumptions."""

    name: str
    slip: Floats
    value: Floats
    notes: tuple[str, ...] = ()


def read_points(path: str | os.PathLike[str]) -> list[DigitisedCurve]:
    """Read pairs of columns (slip, value), several curves side by side as WebPlotDigitizer writes them; header rows are optional.

    Comma, semicolon, tab or spaces; decimal comma where the separator is not a comma. Slips are per cent where their header says [%], or
    one is above 1.5 (noted).
    InputError: no such file, not text, no numbers, a cell that is not a number (row and cell named), an odd number of columns.
    """
    file = os.fspath(path)
    refuse_missing(file)
    try:
        text = to_text(Path(file).read_bytes(), file).decode()
    except OSError as error:
        raise unreadable(file, error) from error
    rows = _rows(text)
    first = next((i for i, row in enumerate(rows) if any(_plain(cell) is not None for cell in row)), None)
    if first is None:
        raise InputError(
            "holds no numbers", file=file, hint="export the points as CSV, a pair of columns a curve"
        )
    body, head = rows[first:], rows[:first]
    _refuse_a_log(head, file)
    width = max(len(row) for row in body)
    if width % 2:
        raise InputError(
            f"has {width} columns", file=file, hint="give a pair of columns (slip, value) for each curve"
        )
    columns = [_numbers(body, i, first, file) for i in range(width)]
    return [
        _curve(columns[i], columns[i + 1], _title(head, i), file, per_cent=_is_per_cent(head, i))
        for i in range(0, width, 2)
    ]


def _refuse_a_log(head: list[list[str]], file: str) -> None:
    """A log's first column is time: of a short one the seconds would pass for slip in per cent."""
    names = [cell.split("[")[0].strip() for row in head for cell in row]
    found = next((name for name in names if is_channel(name) or name.casefold() in _STAMPS), None)
    if found is not None:
        hint = "estimate it first ('terragrip estimate'), and give the file of estimates"
        raise InputError("is a log, not points of curves", file=file, place=f"column {found}", hint=hint)


def _rows(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    sample = "\n".join(lines[:20])
    for separator in (";", "\t", ","):
        if separator in sample:
            decimal = separator != ","
            split = csv.reader(lines, delimiter=separator)
            return [
                [cell.strip().replace(",", ".") if decimal else cell.strip() for cell in row] for row in split
            ]
    return [re.split(r"\s+", line.strip()) for line in lines]


def _plain(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _numbers(body: list[list[str]], column: int, first: int, file: str) -> Floats:
    out = []
    for i, row in enumerate(body):
        cell = row[column] if column < len(row) else ""
        value = _plain(cell) if cell else float("nan")
        if value is None or np.isinf(value):
            place = f"row {first + i + 1}, column {column + 1}"
            raise InputError(
                f"{cell!r} is not a number", file=file, place=place, hint="correct or delete that row"
            )
        out.append(value)
    return np.array(out)


def _title(head: list[list[str]], column: int) -> str:
    for row in head:
        name = row[column] if column < len(row) else ""
        if (
            name
            and not _PER_CENT.search(name)
            and name.split("[")[0].strip().casefold() not in ("x", "slip", "s")
        ):
            return name
    return f"curve {column // 2 + 1}"


def _is_per_cent(head: list[list[str]], column: int) -> bool:
    return any(_PER_CENT.search(cell) for row in head for cell in row[column : column + 1])


def _curve(slip: Floats, value: Floats, name: str, file: str, *, per_cent: bool) -> DigitisedCurve:
    good = np.isfinite(slip) & np.isfinite(value)
    slip, value = slip[good], value[good]
    if slip.size < 2:
        raise InputError(f"{name} has {slip.size} points", file=file, hint="digitise at least two")
    notes: tuple[str, ...] = ()
    if per_cent or np.abs(slip).max() > 1.5:
        slip, notes = slip / 100, ("slip was read as per cent",)
    if np.abs(slip).max() > 1.05:
        raise InputError(
            f"{name} has a slip of {np.abs(slip).max():g}",
            file=file,
            hint="slip lies between -1 and 1 (or -100 and 100 %)",
        )
    order = np.argsort(slip, kind="stable")
    return DigitisedCurve(name, slip[order], value[order], notes)


def soils_of_points(
    path: str | os.PathLike[str], curve: AdhesionCurve | None = None, soil: str | None = None
) -> SoilLibrary:
    """A soil for each digitised curve of a file (see `read_points`), each point a bin of its own; curves without a fit are in `not_fitted`.

    curve: an unfitted AdhesionCurve with the model and range of slips to use (default: the paper's, 5-60 %). Points of one curve are not
    repetitions, so there are no intervals. soil: the name of the file's one curve. Raises InputError as `read_points`, on two curves of
    one name, and if `soil` would name several.
    """
    template = curve or AdhesionCurve()
    soils: dict[str, Soil] = {}
    missed: dict[str, str] = {}
    result = read_points(path)
    if soil is not None:
        if len(result) > 1:
            raise InputError(
                f"holds {len(result)} curves, and --soil names one",
                file=os.fspath(path),
                hint="leave --soil out: the header names them",
            )
        result = [replace(one, name=soil) for one in result]
    for one in result:
        if one.name in soils or one.name in missed:
            raise InputError(
                f"two curves are named {one.name!r}", file=os.fspath(path), hint="rename one in its header"
            )
        inside = one.slip[(one.slip >= template.bins.lower) & (one.slip < template.bins.upper)]
        steps = np.diff(np.unique(inside))
        width = max(float(steps.min()) / 2, 1e-5) if steps.size else template.bins.width
        bins = BinSettings(width, template.bins.lower, template.bins.upper, 1)
        fitted = template.unfitted(bins=bins, bootstrap=0)
        try:
            soils[one.name] = Soil.from_curve(
                one.name,
                explaining(fitted.fit(one.slip, one.value)),
                f"digitised, {os.path.basename(os.fspath(path))}",
            )
        except InputError as error:
            missed[one.name] = str(error)
    return SoilLibrary(soils, {"digitised": [os.fspath(path)]}, missed)
