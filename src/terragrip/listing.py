"""CSV tables that list logs, one a row, with what belongs to each."""

from __future__ import annotations

import csv
import os
from collections.abc import Collection
from pathlib import Path

from terragrip.errors import InputError
from terragrip.files import refuse_missing, unreadable
from terragrip.text import to_text


def listed(
    table: str | os.PathLike[str], needed: Collection[str], known: Collection[str] = ()
) -> list[tuple[int, dict[str, str]]]:
    """The rows of a CSV by their line, as text without blanks about it; separated by commas, semicolons or tabs, in any encoding.

    Raises InputError where it is missing, is no such table, lacks one of the ``needed`` columns, has one that is not ``known`` (empty:
    any other will do) or a row that is longer than its header.
    """
    refuse_missing(table, suffixes=(".csv",))
    try:
        text = to_text(Path(table).read_bytes(), os.fspath(table)).decode()
    except OSError as error:
        raise unreadable(table, error) from error
    separator = max(",;\t", key=text.partition("\n")[0].count)
    try:
        rows = list(csv.reader(text.splitlines(), delimiter=separator))
    except csv.Error as error:
        raise InputError(f"is no table ({error})", file=table, hint="write it as CSV") from error
    names = [cell.strip().lower() for cell in rows[0]] if rows else []
    columns = ", ".join(known or needed)
    for name in needed:
        if name not in names:
            hint = f"its columns are {columns}"
            raise InputError(f"has no column {name}", file=table, place="line 1", hint=hint)
    odd = next((name for name in names if known and name not in known), None)
    if odd is not None:
        hint = f"its columns are {columns}"
        raise InputError(f"has an unknown column {odd!r}", file=table, place="line 1", hint=hint)
    result = []
    for number, cells in enumerate(rows[1:], 2):
        cells = [cell.strip() for cell in cells]
        if len(cells) > len(names):
            problem, hint = (
                f"has {len(cells)} cells for {len(names)} columns",
                "put texts with separators in quotes",
            )
            raise InputError(problem, file=table, place=f"row {number}", hint=hint)
        if any(cells):
            result.append(
                (number, dict(zip(names, [*cells, *[""] * (len(names) - len(cells))], strict=True)))
            )
    return result


def listed_logs(table: Path, columns: tuple[str, ...]) -> list[tuple[int, dict[str, str]]]:
    """The rows of a table with the column `log` and any of ``columns``. Raises InputError as `listed`, and where a row names no log."""
    rows = listed(table, ("log",), columns)
    if not rows:
        raise InputError("names no log", file=table, hint="write a log in each line")
    for number, row in rows:
        if not row["log"]:
            raise InputError("names no log", file=table, place=f"row {number}", hint="write its path")
    return rows


def profile_in(table: Path, name: str) -> Path | None:
    """A profile that a table names: by its path from the table's folder, or one that comes with Terragrip; None: none."""
    if not name:
        return None
    return table.parent / name if Path(name).suffix or (table.parent / name).exists() else Path(name)
