"""Tables in files, which are read in blocks of rows; a short one is one block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.files import sha256
from terragrip.formats.table import LogTable, Wanted, every_of

Column = npt.NDArray[Any]
Columns = dict[str, Column]


@dataclass(frozen=True)
class TableOnDisk:
    """A table in a file: its columns' ``names`` and ``units``, about how many ``rows`` it has, and what gives its blocks.

    ``blocks`` takes the names that are wanted, and of how many blocks one is read; it may add to ``notes`` as the blocks come.
    ``clocked``: as in `LogTable`, time is none of the names, and the blocks have it all the same. ``is_long``: it should not be held in
    memory where that can be helped. ``unreadable``: columns that are refused where they are asked for by name.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    source: str
    rows: int
    blocks: Callable[[list[str], int], Iterator[Columns]]
    notes: list[str] = field(default_factory=list)
    clocked: bool = False
    is_long: bool = False
    unreadable: tuple[str, ...] = ()

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the file, computed once however often it is gone through."""
        return sha256(self.source)

    def whole(self, wanted: Wanted | None) -> LogTable:
        """The wanted columns (None: all) of all blocks; raises InputError as these do."""
        every = every_of(wanted)
        chosen = [n for n in self.names if (n not in self.unreadable if wanted is None else wanted(n))]
        columns = {name: _Growing(self.rows // every) for name in chosen}
        for block in self.blocks(chosen, every):
            for name, values in block.items():
                columns[name].add(values)
        joined = {name: column.whole() for name, column in columns.items()}
        notes = tuple(dict.fromkeys(self.notes))
        return LogTable(self.names, joined, self.units, self.source, self.digest, notes)


class _Growing:
    """A column that grows by blocks. Blocks are copied as they come: kept and joined at the end, they would stand twice."""

    def __init__(self, rows: int) -> None:
        self._rows, self._count = int(1.05 * rows) + 1000, 0
        self._values: Column | None = None

    def add(self, block: Column) -> None:
        """Append a block; of numbers and texts, all become objects."""
        if self._values is None:
            self._values = np.empty(max(self._rows, len(block)), block.dtype)
        known = self._values
        kind = known.dtype if known.dtype == block.dtype else _common(known.dtype, block.dtype)
        end = self._count + len(block)
        if kind != known.dtype or end > len(known):
            self._values = np.empty(max(end + end // 4, len(known)), kind)
            self._values[: self._count] = known[: self._count]
        self._values[self._count : end] = block
        self._count = end

    def whole(self) -> Column:
        """The column so far."""
        return np.empty(0) if self._values is None else self._values[: self._count]


def _common(first: np.dtype[Any], second: np.dtype[Any]) -> np.dtype[Any]:
    if {first.kind, second.kind} <= set("fiu") or first.kind == second.kind:
        return np.promote_types(first, second)
    return np.dtype(object)
