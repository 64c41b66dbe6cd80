"""A MATLAB file (version 5, which every MATLAB and Octave opens): plain structs of vectors."""

from __future__ import annotations

from array import array
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.estimation.columns import column_named
from terragrip.estimation.export.about import about_texts

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


class MatFile:
    """Structs ``estimates`` (columns (n, 1)), ``units`` and ``descriptions`` by the same names, ``about``, and ``texts``: a column of
    texts holds numbers from 1, of the texts in its cell there.

    ``struct2table(estimates)`` gives MATLAB's table, ``texts.event(estimates.event)`` its texts. Not a matrix of characters: Octave
    takes its UTF-8 apart byte by byte.
    """

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        self._path, self._first = path, first
        self._columns = {name: array("d") for name in first.names}
        self._texts: dict[str, dict[str, int]] = {name: {} for name in ("event", *first.labels)}

    def write(self, part: Estimates) -> None:
        """Keep the rows of a part: a struct is written whole."""
        for name, column in self._columns.items():
            values = self._coded(name, part) if name in self._texts else part[name]
            column.frombytes(np.ascontiguousarray(values, dtype=np.float64).view(np.uint8).data)

    def _coded(self, name: str, part: Estimates) -> Any:
        """A column of texts as numbers (n,) from 1."""
        known = self._texts[name]
        return np.array([known.setdefault(text, len(known) + 1) for text in part[name].tolist()], dtype=float)

    def close(self) -> None:
        """Write the file."""
        from scipy.io import savemat

        columns = {name: np.frombuffer(column)[:, None] for name, column in self._columns.items()}
        meanings = {name: column_named(name) for name in self._first.names}
        content = {
            "estimates": columns,
            "units": {name: column.unit for name, column in meanings.items()},
            "descriptions": {name: column.description for name, column in meanings.items()},
            "texts": {name: _cell(known) for name, known in self._texts.items()},
            "about": {**about_texts(self._first), "notes": _cell(self._first.notes)},
        }
        with self._path.open("wb") as stream:
            savemat(stream, content, long_field_names=True)

    def drop(self) -> None:
        """Nothing was written."""
        self._columns.clear()


def _cell(texts: Collection[str]) -> Any:
    """Texts as a cell (n, 1)."""
    cell = np.empty((len(texts), 1), dtype=object)
    cell[:, 0] = list(texts)
    return cell
