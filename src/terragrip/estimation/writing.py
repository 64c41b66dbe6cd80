"""Tables of estimates to a file, block by block: Parquet, or CSV by the suffix."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import replacing

if TYPE_CHECKING:
    import pyarrow as pa

    from terragrip.estimation.estimates import Estimates

SUFFIXES = (".parquet", ".csv")
"""Of the files that estimates are written to; a CSV holds the columns alone, not what they were made from."""


def require_suffix(path: str | os.PathLike[str]) -> None:
    """Raise InputError where a file of this name cannot be written."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        problem = f"estimates cannot be written as {suffix!r}" if suffix else "the name has no suffix"
        named = " or ".join(SUFFIXES)
        raise InputError(problem, file=path, hint=f"name it {Path(path).stem}{SUFFIXES[0]}, or any {named}")


def write_parts(parts: Iterable[Estimates], path: str | os.PathLike[str]) -> None:
    """Write consecutive parts of one table of estimates to a file, which appears whole or not at all.

    A part is written while the next one is made. Raises InputError where the file cannot be written, its suffix is none of
    `SUFFIXES`, or there is no part.
    """
    require_suffix(path)
    with replacing(path) as temporary, _Writer(temporary) as writer:
        for part in parts:
            writer.write(part)
        if writer.is_empty:
            raise InputError("there is no row to estimate", hint="give a log with at least one row")


class _Writer:
    """Writes one part in a thread of its own while the caller works on the next."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._pool = ThreadPoolExecutor(1)
        self._writer: Any = None  # of Parquet or CSV, by Arrow
        self._schema: pa.Schema | None = None
        self._pending: Future[None] | None = None

    def __enter__(self) -> _Writer:
        return self

    @property
    def is_empty(self) -> bool:
        """Whether no part was handed over."""
        return self._pending is None and self._writer is None

    def write(self, part: Estimates) -> None:
        """Hand over a part; waits for the one before it and raises what went wrong with that."""
        table = part.to_arrow()
        self._wait()
        self._pending = self._pool.submit(self._write, table)

    def _write(self, table: pa.Table) -> None:
        if self._writer is None:
            self._schema = table.schema
            self._writer = _opened(self._path, table.schema)
        self._writer.write_table(table.cast(self._schema))

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __exit__(self, *failure: object) -> None:
        try:
            if failure[0] is None:
                self._wait()
        finally:
            self._pool.shutdown(wait=True, cancel_futures=True)
            if self._writer is not None:
                self._writer.close()


def _opened(path: Path, schema: pa.Schema) -> Any:
    if path.suffix.lower() == ".csv":
        from pyarrow import csv

        return csv.CSVWriter(path, schema, write_options=csv.WriteOptions(quoting_style="needed"))
    import pyarrow.parquet as pq

    return pq.ParquetWriter(path, schema, **parquet_options(schema))


def parquet_options(schema: pa.Schema) -> dict[str, Any]:
    """How estimates are stored: noisy floats do not repeat, so no dictionary; split by bytes they compress."""
    import pyarrow as pa

    floats = [f.name for f in schema if pa.types.is_floating(f.type)]
    texts = [f.name for f in schema if not pa.types.is_floating(f.type)]
    return {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": texts or False,
        "use_byte_stream_split": floats,
    }
