"""Tables in files, which are read in blocks of rows; a short one is one block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.table import LogTable, Sparse, Wanted, every_of

Column = npt.NDArray[Any]
Columns = dict[str, Column]


@dataclass(frozen=True)
class TableOnDisk:
    """A table in a file: its columns' ``names`` and ``units``, about how many ``rows`` it has, and what gives its blocks.

    ``blocks`` takes the names that are wanted, and of how many blocks one is read; it may add to ``notes`` as the blocks come.
    ``clocked``: as in `LogTable`, time is none of the names, and the blocks have it all the same. ``is_long``: it should not be held in
    memory where that can be helped. ``unreadable``: columns that are refused where they are asked for by name; ``twice``: so are those
    whose name another one has.
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
    twice: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.twice:
            which = ", ".join(self.twice)
            self.notes.append(f"Columns that occur twice are left out: {which}. Rename one to use it.")

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the file, computed once however often it is gone through."""
        return sha256(self.source)

    def read(self, chosen: list[str], every: int = 1) -> Iterator[Columns]:
        """The chosen columns, block by block; raises InputError where the name of one is another's, and as the blocks do."""
        for name in (name for name in chosen if name in self.twice):
            hint = "keep one of them"
            raise InputError("occurs twice", file=self.source, place=f"column {name}", hint=hint)
        return self.blocks(chosen, every)

    def whole(self, wanted: Wanted) -> LogTable:
        """The wanted columns of all blocks; raises InputError as these do."""
        every = every_of(wanted)
        if isinstance(wanted, Sparse):
            chosen = [name for name in self.names if name not in (*self.unreadable, *self.twice)]
        else:
            chosen = [name for name in self.names if wanted(name)]
        parts: dict[str, list[Column]] = {name: [] for name in chosen}
        for block in self.read(chosen, every):
            for name, values in block.items():
                parts[name].append(values)
        joined = {
            name: _joined(parts.pop(name)) for name in chosen
        }  # one by one, so that none stands twice for long
        notes = tuple(dict.fromkeys(self.notes))
        return LogTable(self.names, joined, self.units, self.source, self.digest, notes)


def _joined(parts: list[Column]) -> Column:
    """A column of its blocks; of numbers and texts, all become objects. One without rows, as a cut line leaves it, has no type."""
    parts = [part for part in parts if len(part)]
    kinds = {part.dtype.kind for part in parts}
    if len(kinds) > 1 and not kinds <= set("fiu"):
        parts = [part.astype(object) for part in parts]
    return np.concatenate(parts) if parts else np.empty(0)
