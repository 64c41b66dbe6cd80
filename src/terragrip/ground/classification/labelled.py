"""Labelled drives: from a table of files and labels, or from the label column of the drives themselves."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError, suggestion
from terragrip.listing import listed

Columns = Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class LabelledDrive:
    """The label of one drive, and its logs: the first and others of the same drive (a body sensor's, say)."""

    label: str
    logs: tuple[Path, ...]


def read_labels(path: str | os.PathLike[str], logs: Sequence[Path] = ()) -> list[LabelledDrive]:
    """Read a table (CSV) with columns ``file`` and ``label``, and perhaps ``with``: another log of the same drive.

    Files are relative to the table's folder. Where ``logs`` are given, the table labels those: a row's file is the path or
    the name of one. Raises InputError, naming the row, on a label that names no run, a run without a label or with two, an
    empty label, and a file that is no such table.
    """
    result: list[LabelledDrive] = []
    taken: dict[Path, int] = {}
    folder = Path(path).parent
    for row, cells in listed(path, ("file", "label")):
        place = f"row {row}"
        name, label = cells["file"], cells["label"]
        if not name or not label:
            missing = "label" if name else "file"
            raise InputError(
                f"the {missing} is empty", file=path, place=place, hint="fill it, or leave the row out"
            )
        log = _named(name, logs, path, place) if logs else folder / name
        others = tuple(
            folder / other.strip() for other in (cells.get("with") or "").split("|") if other.strip()
        )
        for file in (log, *others):
            if not file.exists():
                raise InputError(
                    f"there is no run {file}", file=path, place=place, hint="correct the file's name"
                )
        if log in taken:
            problem = f"{name} is labelled in row {taken[log]} too"
            raise InputError(problem, file=path, place=place, hint="name each run once")
        taken[log] = row
        result.append(LabelledDrive(label, (log, *others)))
    for log in logs:
        if log not in taken:
            raise InputError(
                f"holds no label for {log}", file=path, hint="add a row for it, or leave the log out"
            )
    if not result:
        raise InputError("holds no run", file=path, hint="write a row for each run: file,label")
    return result


def stretches(columns: Columns, labels: npt.NDArray[Any], shortest: float) -> list[tuple[Columns, str]]:
    """The stretches [s, at least ``shortest``] of one label of a drive with ``time``, each a table of its own, and its label.

    An empty label is a stretch without one, which is left out.
    """
    time = np.asarray(columns["time"], dtype=float)
    text = np.array(["" if label is None or label != label else str(label) for label in labels], dtype=str)
    borders = np.flatnonzero(text[1:] != text[:-1]) + 1
    result: list[tuple[Columns, str]] = []
    for part in np.split(np.arange(len(text)), borders):
        if len(part) > 1 and text[part[0]] and time[part[-1]] - time[part[0]] >= shortest:
            rows = slice(int(part[0]), int(part[-1]) + 1)
            result.append(({name: values[rows] for name, values in columns.items()}, str(text[part[0]])))
    return result


def _named(name: str, logs: Sequence[Path], path: str | os.PathLike[str], place: str) -> Path:
    """The log that a row names, by path or by file name."""
    wanted = Path(path).parent / name
    for log in logs:
        if name == str(log) or (wanted.exists() and log.exists() and log.samefile(wanted)):
            return log
    same = [log for log in logs if name in (log.name, log.stem)]
    if len(same) == 1:
        return same[0]
    if same:
        raise InputError(f"{len(same)} logs are named {name}", file=path, place=place, hint="write its path")
    hint = suggestion(name, [log.name for log in logs], "name one of the logs given")
    raise InputError(f"{name!r} names no run", file=path, place=place, hint=hint)
