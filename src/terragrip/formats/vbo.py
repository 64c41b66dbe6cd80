"""Racelogic VBO files: sections in square brackets, then rows of numbers apart by blanks.

Positions are minutes of arc with west positive, time is UTC written hhmmss.ss; both become degrees, east positive, and seconds of the day.
Source: Racelogic's description of the VBO file format.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.formats.registry import Databases, Format
from terragrip.formats.table import LogTable, Wanted

_SECTION = re.compile(r"^\[([^\]]+)\]\s*$", re.MULTILINE)
_UNITS = {  # of the receiver's own columns; the file states those of added channels
    "velocity": "km/h", "heading": "deg", "height": "m", "vert-vel": "m/s", "longacc": "g", "latacc": "g", "lat": "deg", "long": "deg",
}  # fmt: skip
_AS_WRITTEN = {"°/s": "deg/s", "°": "deg", "kph": "km/h", "volts": "V"}


def read_vbo(path: str, wanted: Wanted, databases: Databases = ()) -> LogTable:
    """Read a VBO file: ``time`` [s of the day], ``lat`` and ``long`` [deg, east positive], the rest as the file states it.

    Only columns that are ``wanted`` are kept. Raises InputError where the sections are missing or a row does not fit.
    """
    text = Path(path).read_bytes().decode("latin-1")
    sections = _sections(text)
    names = _distinct(sections.get("column names", "").split())
    rows = [line.split() for line in sections.get("data", "").splitlines() if line.strip()]
    if not names or not rows:
        raise InputError("has no [column names] or no [data]", file=path, hint="export it again")
    notes = []
    if len(rows[-1]) < len(names) and not text.endswith("\n"):
        rows.pop()
        notes.append("The last row is cut off and was left out.")
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names):
            problem = f"has {len(row)} cell{'s' * (len(row) != 1)}, the header {len(names)}"
            raise InputError(
                problem, file=path, place=f"row {number}", hint="give every row the same number of cells"
            )
    columns: dict[str, npt.NDArray[Any]] = {}
    for k, name in enumerate(names):
        if wanted(name):
            columns[name] = _column(name, [row[k] for row in rows], path)
    units = _units(names, sections.get("channel units", ""))
    return LogTable(names, columns, units, notes=tuple(notes))


def _sections(text: str) -> dict[str, str]:
    """The text of each section by its lower-case name."""
    parts = _SECTION.split(text.replace("\r\n", "\n"))
    return {name.lower(): body for name, body in zip(parts[1::2], parts[2::2], strict=True)}


def _distinct(names: list[str]) -> tuple[str, ...]:
    """Names that were cut to the same letters get a number."""
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return tuple(result)


def _column(name: str, cells: list[str], path: str) -> npt.NDArray[np.float64]:
    values = np.empty(len(cells))
    for k, cell in enumerate(cells):
        try:
            values[k] = float(cell)
        except ValueError:
            place = f"column {name}, row {k + 1}"
            raise InputError(
                f"{cell!r} is not a number", file=path, place=place, hint="remove the row"
            ) from None
    bare = name.lstrip("_").lower()
    if bare == "time":
        whole = np.floor(values)
        seconds = 3600 * (whole // 10_000) + 60 * (whole // 100 % 100) + whole % 100 + (values - whole)
        return np.asarray(seconds + 86_400.0 * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -43_200))
    if bare in ("lat", "long"):
        return (-values if bare == "long" else values) / 60
    return values


def _units(names: tuple[str, ...], section: str) -> dict[str, str]:
    """Units by column: the receiver's own are fixed; those that the file lists are of the last columns."""
    listed = [line.strip() for line in section.rstrip("\n").split("\n")]
    listed = listed[1:] if listed and not listed[0] else listed
    result = {}
    for name, unit in zip(reversed(names), reversed(listed), strict=False):
        plain = _AS_WRITTEN.get(unit, unit)
        if plain and not plain.startswith("°"):
            result[name] = plain
    own = {name: _UNITS[bare] for name in names if (bare := name.lstrip("_").lower()) in _UNITS}
    return {**result, **own, **({"time": "s"} if "time" in names else {})}


def _is_vbo(head: bytes) -> bool:
    return b"[header]" in head and (head.startswith((b"File created on", b"[header]")))


FORMATS = (Format("vbo", "VBO file", read_vbo, (".vbo",), recognises=_is_vbo),)
