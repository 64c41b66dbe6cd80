"""Estimates in other file formats: what each suffix can hold, and which class writes it.

A writer receives consecutive parts of one table, the first when it is made, and is closed or, after a failure, dropped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from terragrip.errors import InputError, missing_package
from terragrip.files import path_of

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


class TableWriter(Protocol):
    """Writes one file, part by part."""

    def write(self, part: Estimates) -> None:
        """Write the rows of a part."""

    def close(self) -> None:
        """Complete the file; raises InputError where it cannot hold what was written."""

    def drop(self) -> None:
        """Discard the file, which stays incomplete."""


@dataclass(frozen=True)
class FileKind:
    """What a suffix means: its ``title``, the class that writes it (module of this package, name), the ``package`` it needs and the
    extra that brings it, the columns that it ``needs``, and the largest number of rows, ``most``, of a table with those columns."""

    title: str
    writer: tuple[str, str]
    package: str | None = None
    extra: str = ""
    needs: tuple[str, ...] = ()
    most: Callable[[Collection[str]], int] | None = None


SHEET_ROWS = 1_048_576
"""Of an Excel sheet, its header included (Excel specifications and limits, Microsoft)."""
_STRUCT_BYTES = (1 << 31) - (1 << 20)
"""Of a variable of a MATLAB file of version 5 and 7: 2 GB (MAT-File Versions, MathWorks), less the size of the fields' tags."""
_PLACE = ("latitude", "longitude")
KINDS: dict[str, FileKind] = {
    ".parquet": FileKind("Parquet", ("arrow_files", "ParquetFile")),
    ".csv": FileKind("CSV", ("arrow_files", "CsvFile")),
    ".xlsx": FileKind("an Excel sheet", ("spreadsheet", "Spreadsheet"), "xlsxwriter", "formats", most=lambda names: SHEET_ROWS - 1),
    ".mat": FileKind("a MATLAB file", ("matlab", "MatFile"), most=lambda names: _STRUCT_BYTES // (8 * len(names))),
    ".geojson": FileKind("GeoJSON", ("places", "GeoJson"), needs=_PLACE),
    ".gpkg": FileKind("a GeoPackage", ("places", "GeoPackage"), "pyogrio", "geo", needs=_PLACE),
    ".mcap": FileKind("MCAP", ("foxglove", "McapFile"), "mcap", "formats"),
}  # fmt: skip
"""By the suffix of the file."""


def require_suffix(path: str | os.PathLike[str]) -> FileKind:
    """What a file's name means; raises InputError where its suffix is none of `KINDS`, or what it needs is not installed."""
    suffix = Path(path_of(path)).suffix.lower()
    if suffix not in KINDS:
        problem = f"estimates cannot be written as {suffix!r}" if suffix else "the name has no suffix"
        named = f"{', '.join(list(KINDS)[:-1])} or {list(KINDS)[-1]}"
        raise InputError(problem, file=path, hint=f"name it {Path(path).stem}.parquet, or any {named}")
    kind = KINDS[suffix]
    if kind.package is not None and find_spec(kind.package) is None:
        raise missing_package(kind.package, kind.extra, f"write {kind.title}", file=path)
    return kind


def require_room(path: str | os.PathLike[str], rows: int, names: Collection[str]) -> None:
    """Raise InputError where a file of this name cannot hold ``rows`` of a table with those columns, or lacks one that it needs."""
    kind = require_suffix(path)
    missing = next((name for name in kind.needs if name not in names), None)
    if missing is not None:
        problem = f"the log has no {missing}, so {kind.title} would have no places to show"
        raise InputError(problem, file=path, hint="write .parquet, or name the positions in a profile")
    most = None if kind.most is None else kind.most(names)
    if most is not None and rows > most:
        problem = f"{rows} rows are more than {kind.title} can hold ({most})"
        raise InputError(problem, file=path, hint="write .parquet, or give a shorter part of the log")


def writer_of(path: Path, first: Estimates, target: Path) -> TableWriter:
    """The writer of the file ``path`` by its suffix, for a table that begins with ``first``; errors name ``target``, what it becomes."""
    module, name = require_suffix(path).writer
    made: TableWriter = getattr(import_module(f"{__name__}.{module}"), name)(path, first, target)
    return made
