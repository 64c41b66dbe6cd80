"""A MATLAB file (version 5, which every MATLAB and Octave opens): plain structs of vectors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.columns import column_named
from terragrip.estimation.export.about import about_texts
from terragrip.estimation.export.limits import struct_rows

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


class MatFile:
    """Structs ``estimates`` (columns (n, 1); texts as rows of characters), ``units`` and ``descriptions`` by the same names, ``about``.

    ``struct2table(estimates)`` gives MATLAB's table, ``cellstr(estimates.event)`` the texts.
    """

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        self._path, self._target, self._first, self._rows = path, target, first, 0
        self._parts: dict[str, list[Any]] = {name: [] for name in first.names}

    def write(self, part: Estimates) -> None:
        """Keep the rows of a part: a struct is written whole."""
        self._rows += len(part)
        most = struct_rows(self._first.names)
        if self._rows > most:
            raise InputError(
                f"the rows are more than the {most} that a MATLAB file takes",
                file=self._target, hint="write .parquet (parquetread), or give a shorter part of the log",
            )  # fmt: skip
        for name, parts in self._parts.items():
            values = part[name]
            parts.append(values.astype(str) if values.dtype.kind == "O" else values)

    def close(self) -> None:
        """Write the file."""
        from scipy.io import savemat

        columns: dict[str, Any] = {}
        for name in self._first.names:  # joined one by one, so that no column stands twice for long
            values = np.concatenate(self._parts.pop(name))
            columns[name] = values if values.dtype.kind == "U" else values[:, None]
        meanings = {name: column_named(name) for name in self._first.names}
        notes = np.empty(len(self._first.notes), dtype=object)
        notes[:] = self._first.notes
        content = {
            "estimates": columns,
            "units": {name: column.unit for name, column in meanings.items()},
            "descriptions": {name: column.description for name, column in meanings.items()},
            "about": {**about_texts(self._first), "notes": notes},
        }
        with self._path.open("wb") as stream:
            savemat(stream, content, long_field_names=True)

    def drop(self) -> None:
        """Nothing was written."""
        self._parts.clear()
