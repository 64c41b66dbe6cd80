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
    writer: TableWriter | None = None
    pending: Future[None] | None = None
    rows = 0
    with replacing(path) as temporary:
        try:
            with ThreadPoolExecutor(1) as pool:
                for part in parts:
                    rows += len(part)
                    require_room(path, rows, part.names)
                    if writer is None:
                        writer = writer_of(temporary, part, Path(path))
                    if pending is not None:
                        pending.result()
                    pending = pool.submit(writer.write, part)
            if writer is None or pending is None:
                raise InputError("there is no row to estimate", hint="give a log with at least one row")
            pending.result()
            writer.close()
        except BaseException:
            if writer is not None:
                writer.drop()
            raise
