"""Text tables block by block, cut at the ends of lines; a short one is one block."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.csv import body_of, chosen_of, is_long, parse
from terragrip.formats.dialect import HEAD, Dialect, detect, in_utf8, to_text
from terragrip.formats.long_logs import LongLog, recordings_of
from terragrip.formats.profile import Profile
from terragrip.formats.table import LogTable, Wanted, every_of
from terragrip.formats.text_file import length_of, opened, read
from terragrip.recording import Recording
from terragrip.recording.survey import ROWS

Column = npt.NDArray[Any]

_BLOCK = 16 << 20  # bytes
_LOOK = 2 << 20  # bytes, where only some blocks are looked at


def read_in_blocks(source: str, wanted: Wanted | None) -> LogTable | None:
    """Read the wanted columns of a table, as `terragrip.formats.csv.read_csv` does; None where its lines cannot be told."""
    looked_at = _looked_at(source)
    if looked_at is None:
        return None
    dialect, rows = looked_at
    chosen = chosen_of(dialect, wanted, source)
    every = every_of(wanted)
    parts = {dialect.names[k]: _Growing(rows // every) for k in chosen}
    notes: dict[str, None] = {}
    for columns, said in _blocks(source, dialect, chosen, every):
        notes |= dict.fromkeys(said)
        for name, column in columns.items():
            parts[name].add(column)
    joined = {name: part.whole() for name, part in parts.items()}
    names = tuple(name for name in dialect.names if name)
    return LogTable(names, joined, dialect.units, source, sha256(source), tuple(notes))


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


def iter_csv(path: str | os.PathLike[str], profile: Profile | None = None) -> Iterator[Recording] | None:
    """A table in blocks, so that memory stays small; None where its lines cannot be told, or rows need others beside them.

    The blocks together are the recording that `terragrip.formats.read` gives, and raise the same InputErrors, each when its
    block is reached.
    """
    log = _as_long_log(os.fspath(path))
    return None if log is None else recordings_of(log, profile)


def long_csv(path: str | os.PathLike[str]) -> LongLog | None:
    """A text table as a `LongLog`; None of a short one, or where its lines cannot be told."""
    source = os.fspath(path)
    return _as_long_log(source) if is_long(source) else None


def _as_long_log(source: str) -> LongLog | None:
    looked_at = _looked_at(source)
    if looked_at is None:
        return None
    dialect, rows = looked_at
    size = int(np.clip(ROWS * os.path.getsize(source) / rows, 1 << 20, 4 * _BLOCK))
    said: list[str] = []

    def blocks(names: list[str]) -> Iterator[dict[str, Column]]:
        chosen = chosen_of(dialect, lambda name: name in names, source)
        for columns, notes in _blocks(source, dialect, chosen, 1, size):
            said.extend(notes)
            yield columns

    return LongLog(tuple(n for n in dialect.names if n), dialect.units, source, rows, blocks, said)


def _rows_of(source: str, head: bytes) -> int:
    """About how many rows a long table has, by the length of its first ones."""
    return max(1, round(length_of(source) / max(len(head), 1) * head.count(b"\n")))


def _looked_at(source: str) -> tuple[Dialect, int] | None:
    """How a table is written, and about how many rows it has; None where its lines cannot be told."""
    with closing(opened(source)) as stream:
        head = read(stream, HEAD, source)
    if b"\n" not in head or head.startswith((b"\xff\xfe", b"\xfe\xff")) or head.count(0) > 0.2 * len(head):
        return None
    return detect(to_text(head[: head.rindex(b"\n") + 1], source), source), _rows_of(source, head)


def _blocks(
    source: str, dialect: Dialect, chosen: list[int], every: int, size: int | None = None
) -> Iterator[tuple[dict[str, Column], list[str]]]:
    """The chosen columns in blocks of ``size`` bytes, of every ``every`` blocks one, with notes."""
    row = 0
    for number, (data, is_first) in enumerate(_lines(source, size or (_BLOCK if every == 1 else _LOOK))):
        if number % every:
            continue
        text = in_utf8(data.removeprefix(b"\xef\xbb\xbf"))
        # A byte order mark, comments and the header stand in the first block only.
        start = dialect.start if is_first else 0
        body, notes = body_of(text, dialect, start, more=not is_first)
        columns = parse(body, dialect, chosen, source, row)
        row += max((len(column) for column in columns.values()), default=0)
        yield columns, notes


def _lines(source: str, size: int) -> Iterator[tuple[bytes, bool]]:
    """Blocks of whole lines, and whether each is the first."""
    rest, is_first = b"", True
    with closing(opened(source)) as stream:
        while data := read(stream, size, source):
            data = rest + data
            end = data.rfind(b"\n") + 1
            rest = data[end:]
            if len(rest) > 4 * size:
                raise InputError("has no line ends", file=source, mend="give a table of text, a row a line")
            if end:
                yield data[:end], is_first
                is_first = False
    if rest.strip():
        yield rest, is_first
