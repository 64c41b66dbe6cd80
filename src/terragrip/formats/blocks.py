"""A table that comes in blocks, as a recording in blocks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.recording import Recording, checks
from terragrip.recording.columns import numbers, seconds, texts
from terragrip.recording.schema import LABELS, TIME

Columns = dict[str, npt.NDArray[Any]]


def recordings(
    blocks: Iterable[Columns],
    names: tuple[str, ...],
    chosen: list[str],
    source: str,
    digest: str,
    said: Sequence[str] = (),
) -> Iterator[Recording]:
    """Consecutive blocks of columns as checked recordings; they together are what `Recording.from_frame` makes of all.

    ``names``: all columns of the log, ``chosen``: those in the blocks; ``digest``: SHA-256 of the file; ``said``: notes, to which
    the blocks may add as they come. Raises InputError as that does, each when its block is reached; that a channel is empty over the
    whole file shows at the end only.
    """
    checks.require_columns(names, source)
    notes = list(checks.remarks(names))
    silent, first, after = set(chosen), 0, None
    origin: np.datetime64 | None = None
    for columns in blocks:
        time = columns[TIME]
        if not len(time):
            continue
        if time.dtype.kind == "M":
            if origin is None:
                origin = time[0]
                notes += seconds(time[:1], source)[1]
            columns = {**columns, TIME: time - origin}
        elif origin is not None:
            raise InputError(
                "holds dates and numbers", file=source, place=f"column {TIME}", mend="give one of them"
            )
        block = _block(columns, source, first, after, silent, tuple(dict.fromkeys((*notes, *said))), digest)
        first, after = first + len(block), float(block.time[-1])
        yield block
    if first == 0:
        checks.check_time(np.empty(0), source)
    for name in silent:
        checks.refuse_empty(name, source)


def _block(
    columns: Columns,
    source: str,
    first_row: int,
    after: float | None,
    silent: set[str],
    notes: tuple[str, ...],
    digest: str,
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
    return Recording(time, channels, labels, source, digest, notes)
