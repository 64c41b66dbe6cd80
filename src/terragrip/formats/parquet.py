"""Parquet logs: by column, whole or in blocks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import refuse_missing, sha256
from terragrip.formats.long_logs import LongLog, recordings_of
from terragrip.formats.profile import Profile
from terragrip.formats.registry import Format
from terragrip.formats.table import LogTable, Wanted, every_of, from_arrow
from terragrip.recording import Recording
from terragrip.recording.survey import ROWS

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

MAGIC = b"PAR1"
_LONG = 100_000_000  # bytes; ten times as much in memory
_BLOCK = 20_000  # rows that are read or left out together, where a log is looked at in parts


def read_parquet(path: str | os.PathLike[str], wanted: Wanted | None = None) -> LogTable:
    """Read the wanted columns (None: all) of a Parquet file; raises InputError if it is damaged or none."""
    source = os.fspath(path)
    every = every_of(wanted)
    columns: dict[str, npt.NDArray[Any]] = {}
    with _opened(source) as file:
        names = tuple(str(name) for name in file.schema_arrow.names)
        chosen = [name for name in names if wanted is None or wanted(name)]
        _refuse_twice(names, chosen, source)
        # One by one, so that Arrow's copy of all columns does not stand beside ours; of a part all at once.
        for group in [[name] for name in chosen] if every <= 1 else [chosen]:
            columns |= _columns(file, group, every, source, strict=wanted is not None)
    return LogTable(names, columns, {}, source, sha256(source))


def _columns(
    file: pq.ParquetFile, chosen: list[str], every: int, source: str, *, strict: bool
) -> dict[str, npt.NDArray[Any]]:
    """The chosen columns; those of no known type are left out where it is not ``strict``."""
    table = _guarded(source, lambda: _parts(file, chosen, every))
    found = {}
    for name in chosen:
        try:
            found[name] = from_arrow(name, table.column(name), source)
        except InputError:
            if strict:
                raise
    return found


def _parts(file: pq.ParquetFile, chosen: list[str], every: int) -> pa.Table:
    """The chosen columns, of every ``every`` blocks one."""
    import pyarrow as pa

    if every <= 1:
        return file.read(columns=chosen)
    batches = file.iter_batches(batch_size=_BLOCK, columns=chosen)
    return pa.Table.from_batches([batch for k, batch in enumerate(batches) if k % every == 0])


def iter_parquet(
    path: str | os.PathLike[str], rows: int = ROWS, profile: Profile | None = None
) -> Iterator[Recording] | None:
    """Read a Parquet file in blocks of ``rows``, so that memory stays small; None where rows need others beside them.

    The blocks together are the recording that `terragrip.formats.read` gives, and raise the same InputErrors,
    each when its block is reached; that a channel is empty over the whole file shows at the end only.
    """
    return recordings_of(_as_long_log(os.fspath(path), rows), profile)


def long_parquet(path: str | os.PathLike[str]) -> LongLog | None:
    """A Parquet file as a `LongLog`; None of a short one."""
    source = os.fspath(path)
    return _as_long_log(source, ROWS) if os.path.getsize(source) >= _LONG else None


def _as_long_log(source: str, rows: int) -> LongLog:
    with _opened(source) as file:
        names = tuple(str(name) for name in file.schema_arrow.names)
        count = int(file.metadata.num_rows)

    def blocks(chosen: list[str]) -> Iterator[dict[str, npt.NDArray[Any]]]:
        _refuse_twice(names, chosen, source)
        with _opened(source) as file:
            batches = file.iter_batches(batch_size=rows, columns=chosen)
            while (batch := _guarded(source, lambda: next(batches, None))) is not None:
                yield {name: from_arrow(name, batch.column(name), source) for name in chosen}

    return LongLog(names, {}, source, count, blocks)


def _opened(source: str) -> pq.ParquetFile:
    import pyarrow.parquet as pq

    refuse_missing(source, suffixes=(".parquet", ".pq"))
    # Read ahead, the whole file would stay in memory until it is closed.
    return _guarded(source, lambda: pq.ParquetFile(source, pre_buffer=False))


def _guarded(source: str, work: Callable[[], Any]) -> Any:
    """Do ``work`` on a Parquet file; what is wrong with the file becomes an InputError."""
    import pyarrow as pa

    try:
        return work()
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        problem = f"is a damaged Parquet file, or none ({str(error)[:100]})"
        raise InputError(problem, file=source, mend="write it again, or give a CSV file") from error


def _refuse_twice(names: tuple[str, ...], chosen: list[str], source: str) -> None:
    twice = next((name for name in chosen if names.count(name) > 1), None)
    if twice is not None:
        raise InputError("stands twice", file=source, place=f"column {twice}", mend="keep one of them")


def read_parquet_log(path: str, wanted: Wanted | None, databases: object) -> LogTable:
    """`read_parquet` with the arguments of every kind of log."""
    return read_parquet(path, wanted)


FORMATS = (
    Format(
        "parquet", "Parquet file", read_parquet_log, (".parquet", ".pq"), (b"PAR1",), in_blocks=long_parquet
    ),
)
