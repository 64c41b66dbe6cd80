"""CSV tables that list logs, one a row, with what belongs to each."""

from __future__ import annotations

import csv
from pathlib import Path

from terragrip.errors import InputError
from terragrip.files import refuse_missing


def listed_logs(table: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """The rows of a CSV with the column `log` and any of ``columns``, as text without blanks about it.

    Raises InputError where it is missing, is no such table, has another column, lists nothing, or a row names no log.
    """
    refuse_missing(table)
    try:
        with table.open(encoding="utf-8-sig", newline="") as stream:
            rows = csv.DictReader(stream)
            names = [name.strip() for name in rows.fieldnames or ()]
            odd = next((name for name in names if name not in columns), None)
            if "log" not in names or odd is not None:
                problem = "has no column log" if "log" not in names else f"has an unknown column {odd!r}"
                raise InputError(
                    problem, file=table, place="line 1", hint=f"its columns are {', '.join(columns)}"
                )
            listed = [{k.strip(): (v or "").strip() for k, v in row.items() if k} for row in rows]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is no table ({error})", file=table, hint="write it as CSV, in UTF-8") from error
    listed = [row for row in listed if any(row.values())]
    if not listed:
        raise InputError("names no log", file=table, hint="write a log in each line")
    for number, row in enumerate(listed, 2):
        if not row["log"]:
            raise InputError("names no log", file=table, place=f"row {number}", hint="write its path")
    return listed


def profile_in(table: Path, name: str) -> Path | None:
    """A profile that a table names: by its path from the table's folder, or one that comes with Terragrip; None: none."""
    if not name:
        return None
    return table.parent / name if Path(name).suffix or (table.parent / name).exists() else Path(name)
