"""A log as it came: columns by their own names, before they mean anything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.recording import frames

Wanted = Callable[[str], bool]
"""Whether a column, or a signal, is wanted."""
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # a second's
_SAMPLES = 10_000  # of a signal that are kept or left out together, where a log is looked at in parts


@dataclass(frozen=True)
class Sparse:
    """All columns; of every ``every`` blocks of records one, for a look at a log that is too long to hold."""

    every: int = 1

    def __call__(self, name: str) -> bool:
        return True


EVERY = Sparse()
"""All columns, and all of each."""


def every_of(wanted: Wanted) -> int:
    """Of how many blocks of records one is read."""
    return wanted.every if isinstance(wanted, Sparse) else 1


def skips(number: int, block: int, wanted: Wanted) -> bool:
    """Whether the record of this ``number`` is in a block, of ``block`` records, that is not read."""
    every = every_of(wanted)
    return (number // block) % every > 0


def kept_rows(count: int, wanted: Wanted) -> npt.NDArray[np.intp] | slice:
    """Which of ``count`` samples of a signal are in a block that is read."""
    every = every_of(wanted)
    if every <= 1:
        return slice(None)
    rows = np.arange(count)
    return rows[(rows // _SAMPLES) % every == 0]


@dataclass(frozen=True, eq=False)
class LogTable:
    """Columns of a log file: ``names`` are all there are, ``columns`` those that were read.

    Numbers are float64 or integers (n,), missing = NaN; texts are objects, missing = None; dates are datetime64.
    ``units`` holds what the file itself says of a column's unit. ``start`` is when time 0 was [s since 1970], where
    the log says. ``clocked``: columns had clocks of their own, so that a missing cell may be a sample between two.
    """

    names: tuple[str, ...]
    columns: dict[str, npt.NDArray[Any]]
    units: dict[str, str] = field(default_factory=dict)
    source: str | None = None
    sha256: str | None = None
    notes: tuple[str, ...] = ()
    start: float | None = None
    clocked: bool = False


def in_si(table: LogTable) -> dict[str, npt.NDArray[Any]]:
    """The columns, in the schema's units where the file states its own; raises InputError where it states another quantity."""
    return frames.in_si(table.columns, table.units, table.source)


def from_arrow(name: str, column: Any, source: str | None) -> npt.NDArray[Any]:
    """An Arrow column as NumPy; raises InputError on a type that holds neither numbers, texts nor dates.

    Reads Arrow's buffers, since its own ``to_numpy`` and its scalars import pandas, and casts and ``is_null`` all of Arrow's functions,
    which takes longer than a small log.
    """
    import pyarrow as pa

    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind):
        return _texts(column)
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        ticks = _numbers(column.cast(pa.int64()), np.iinfo(np.int64).min)  # NumPy's not-a-time
        return ticks.view(f"{'datetime64' if pa.types.is_timestamp(kind) else 'timedelta64'}[{kind.unit}]")
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif pa.types.is_time(kind):  # 10:00:00
        ticks = column.cast(pa.int32() if kind.bit_width == 32 else pa.int64()).cast(pa.float64())
        return _numbers(ticks, np.nan) / _TICKS[kind.unit]
    elif pa.types.is_date(kind):  # a day alone is no instant
        return _texts(column.cast(pa.string()))
    elif not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
        raise InputError(
            f"has {kind}, not numbers", file=source, place=f"column {name}", hint="give one number per row"
        )
    if column.type != pa.float64() and (column.null_count or not pa.types.is_integer(column.type)):
        column = column.cast(pa.float64())
    return _numbers(column, np.nan)


def _numbers(column: Any, missing: float) -> npt.NDArray[Any]:
    """Numbers as NumPy, not copied where they lie in one piece; what is missing becomes ``missing``."""

    whole = _whole(column)
    dtype = np.dtype(whole.type.to_pandas_dtype())
    values = np.frombuffer(whole.buffers()[1] or b"", dtype)[whole.offset :][: len(whole)]
    if not whole.null_count:
        return values
    present = np.unpackbits(np.frombuffer(whole.buffers()[0], np.uint8), bitorder="little")[whole.offset :][
        : len(whole)
    ]
    return np.where(present, values, np.asarray(missing, dtype=dtype))


def _texts(column: Any) -> npt.NDArray[np.object_]:
    """Texts as objects, missing = None; equal texts share one string."""
    coded = _whole(column.dictionary_encode())
    words = np.array([*coded.dictionary.to_pylist(), None], dtype=object)
    return words[_numbers(coded.indices, len(words) - 1)]


def _whole(column: Any) -> Any:
    """A column in one piece."""
    import pyarrow as pa

    if not isinstance(column, pa.ChunkedArray):
        return column
    return (
        column.combine_chunks() if column.num_chunks else pa.nulls(0, column.type)
    )  # none to combine wakes pandas
