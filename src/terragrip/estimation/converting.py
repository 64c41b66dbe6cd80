"""A file of estimates as a file of another kind, block by block."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from terragrip.estimation.estimates import Estimates, opened
from terragrip.estimation.export import require_room
from terragrip.estimation.writing import write_parts

if TYPE_CHECKING:
    import pyarrow.parquet as pq

ROWS = 100_000
"""Rows of a block: what is held in memory at a time."""


def convert(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str],
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a Parquet file of estimates as a file of another suffix, whole or not at all; ``progress``: rows done, rows in all.

    Raises InputError where ``source`` is missing, damaged or no table of estimates, and where ``output`` cannot hold it.
    """
    import pyarrow.parquet as pq

    with opened(source, lambda path: pq.ParquetFile(path, pre_buffer=False)) as file:
        Estimates.from_arrow(file.schema_arrow.empty_table(), os.fspath(source))  # refuses what is none
        require_room(output, file.metadata.num_rows, tuple(file.schema_arrow.names))
        write_parts(_parts(file, os.fspath(source), progress), output)


def _parts(
    file: pq.ParquetFile, source: str, progress: Callable[[int, int], None] | None
) -> Iterator[Estimates]:
    import pyarrow as pa

    done = 0
    # A row group at a time, which threads only slow: over all of them Arrow reads ahead.
    groups = [[k] for k in range(file.num_row_groups)]
    batches = (b for one in groups for b in file.iter_batches(ROWS, row_groups=one, use_threads=False))
    while (batch := opened(source, lambda _: next(batches, None))) is not None:
        yield Estimates.from_arrow(pa.Table.from_batches([batch], file.schema_arrow), source)
        done += batch.num_rows
        if progress is not None:
            progress(done, file.metadata.num_rows)
