"""Parquet logs: by column, whole or in blocks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import refuse_missing, sha256
from terragrip.formats.table import LogTable, Wanted, from_arrow
from terragrip.recording import Recording, checks
from terragrip.recording.columns import numbers, seconds, texts
from terragrip.recording.schema import LABELS, TIME, is_channel

if TYPE_CHECKING:
    import pyarrow.parquet as pq

MAGIC = b"PAR1"


def read_parquet(path: str | os.PathLike[str], wanted: Wanted | None = None) -> LogTable:
    """Read the wanted columns (None: all) of a Parquet file; raises InputError if it is damaged or none."""
    source = os.fspath(path)
    with _opened(source) as file:
        names = tuple(str(name) for name in file.schema_arrow.names)
        chosen = [name for name in names if wanted is None or wanted(name)]
        _refuse_twice(names, chosen, source)
        table = _guarded(source, lambda: file.read(columns=chosen))
    columns = {}
    for name in chosen:
        try:
            columns[name] = from_arrow(name, table.column(name), source)
        except InputError:
            if wanted is not None:
                raise
    return LogTable(names, columns, {}, source, sha256(source))


def iter_parquet(path: str | os.PathLike[str], rows: int = 500_000) -> Iterator[Recording]:
    """Read a Parquet file with the recording's own columns in blocks of ``rows``, so that memory stays small.

    The blocks together are the recording that `terragrip.formats.read` gives, and raise the same InputErrors,
    each when its block is reached; that a channel is empty over the whole file shows at the end only.
    """
    source = os.fspath(path)
    with _opened(source) as file:
        names = tuple(str(name) for name in file.schema_arrow.names)
        chosen = [name for name in names if name == TIME or name in LABELS or is_channel(name)]
        _refuse_twice(names, chosen, source)
        checks.require_columns(names, source)
        notes, digest = tuple(checks.remarks(names)), sha256(source)
        batches = file.iter_batches(batch_size=rows, columns=chosen)
        silent, first, after = set(chosen), 0, None
        while (batch := _guarded(source, lambda: next(batches, None))) is not None:
            columns = {n: from_arrow(n, batch.column(n), source) for n in chosen}
            if columns[TIME].dtype.kind == "M":
                problem, mend = "holds dates", "give seconds, or read the file whole"
                raise InputError(problem, file=source, place=f"column {TIME}", mend=mend)
            block = _block(columns, source, first, after, silent)
            first, after = first + len(block), float(block.time[-1])
            yield replace(block, sha256=digest, notes=notes)
        if first == 0:
            checks.check_time(np.empty(0), source)
        for name in silent:
            checks.refuse_empty(name, source)


def _block(
    columns: dict[str, npt.NDArray[Any]], source: str, first_row: int, after: float | None, silent: set[str]
) -> Recording:
    """One checked block; takes the channels that hold a value out of ``silent``."""
    time, _ = seconds(columns[TIME], source)
    checks.check_time(time, source, first_row=first_row, after=after)
    channels, labels = {}, {}
    for name, column in columns.items():
        if name in LABELS:
            labels[name] = texts(name, column, len(time), source)
        elif name != TIME:
            values = numbers(name, column, time, source)
            checks.refuse_infinite(name, values, time, source, first_row=first_row)
            channels[name] = values
            if name in silent and not np.isnan(values).all():
                silent.discard(name)
    return Recording(time, channels, labels, source)


def _opened(source: str) -> pq.ParquetFile:
    import pyarrow.parquet as pq

    refuse_missing(source, suffixes=(".parquet", ".pq"))
    return _guarded(source, lambda: pq.ParquetFile(source))


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
