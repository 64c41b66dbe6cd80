"""Tables of estimates to a file, block by block, in the format of its suffix."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.estimation.export import TableWriter, require_room, require_suffix, writer_of
from terragrip.files import replacing

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


def write_parts(parts: Iterable[Estimates], path: str | os.PathLike[str]) -> None:
    """Write consecutive parts of one table of estimates to a file, which appears whole or not at all.

    A part is written while the next one is made. Raises InputError where the file cannot be written or cannot hold the table
    (`require_suffix`, `require_room`), or there is no part.
    """
    require_suffix(path)
    with replacing(path) as temporary, _Writing(temporary, Path(path)) as writing:
        for part in parts:
            if writing.is_empty:
                require_room(path, len(part), part.names)
            writing.add(part)
        if writing.is_empty:
            raise InputError("there is no row to estimate", hint="give a log with at least one row")


class _Writing:
    """Writes one part in a thread of its own while the caller works on the next."""

    def __init__(self, path: Path, target: Path) -> None:
        self._path, self._target = path, target
        self._pool = ThreadPoolExecutor(1)
        self._writer: TableWriter | None = None
        self._pending: Future[None] | None = None

    def __enter__(self) -> _Writing:
        return self

    @property
    def is_empty(self) -> bool:
        """Whether no part was handed over."""
        return self._pending is None and self._writer is None

    def add(self, part: Estimates) -> None:
        """Hand over a part; waits for the one before it and raises what went wrong with that."""
        self._wait()
        self._pending = self._pool.submit(self._write, part)

    def _write(self, part: Estimates) -> None:
        if self._writer is None:
            self._writer = writer_of(self._path, part, self._target)
        self._writer.write(part)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __exit__(self, *failure: object) -> None:
        writer, done = None, False
        try:
            if failure[0] is None:
                self._wait()
                writer, self._writer = self._writer, None
                if writer is not None:
                    writer.close()
                done = True
        finally:
            self._pool.shutdown(wait=True, cancel_futures=True)
            left = writer or self._writer
            if left is not None and not done:
                left.drop()
