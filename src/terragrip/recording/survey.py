"""A log in blocks, and the result of one pass over it: its length, its channels, a sample of its rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.recording.chunks import CHUNK, CHUNKS, sampled_rows
from terragrip.recording.lag import delay_of, lag_within
from terragrip.recording.schema import speed_names
from terragrip.recording.table import Recording

ROWS = 50_000
"""Rows of a block, where a recording is cut into blocks: its estimates take under 32 MB, which malloc uses again for the next."""
BEGINNING = 200_000
"""First rows of a log whose speeds show a lag."""

Progress = Callable[[int], None]


@dataclass(frozen=True)
class LogBlocks:
    """A recording as consecutive blocks that can be read more than once.

    ``rows``: their approximate number; ``blocks``: gives the blocks again, from the first; ``whole``: gives all rows as one
    recording, for values that cannot be determined block by block; ``from_disk``: each pass reads a file, and so takes time.
    """

    rows: int
    blocks: Callable[[], Iterator[Recording]]
    whole: Callable[[], Recording]
    from_disk: bool = False

    @classmethod
    def of(cls, recording: Recording, rows: int | None = None) -> Self:
        """A recording in memory, in blocks of so many ``rows`` (None: one block); no data are copied."""
        length = rows or max(len(recording), 1)

        def blocks() -> Iterator[Recording]:
            return (recording.select(slice(k, k + length)) for k in range(0, len(recording), length))

        return cls(len(recording), blocks, lambda: recording)


@dataclass(frozen=True)
class Survey:
    """The result of one pass over a log: the number of its ``rows``, and a ``sample`` of them spread over the whole log.

    ``sample`` has the channels with a value anywhere in the log, all remarks of its reader (notes, noise), and the ``delay`` that the
    log's first rows, which are consecutive, show. ``empty``: the channels without any value.
    """

    rows: int
    sample: Recording
    empty: tuple[str, ...]

    def without_empty(self, block: Recording) -> Recording:
        """A block of the log without the channels that have no value anywhere."""
        if not self.empty:
            return block
        return replace(block, channels={n: v for n, v in block.channels.items() if n not in self.empty})


def survey_of(log: LogBlocks, progress: Progress | None = None) -> Survey:
    """Read a log once; its sample is that of `sampled_rows`, whatever the blocks.

    ``progress`` is called with the rows done. Raises InputError as reading the blocks does, and where there is no row.
    """
    kept: dict[int, list[Recording]] = {}
    holding: set[str] = set()
    rows, every, last = 0, 1, None
    beginning: list[Recording] = []
    for last in log.blocks():
        holding |= {n for n, v in last.channels.items() if n not in holding and not np.isnan(v).all()}
        end = rows + len(last)
        for number in range(rows // CHUNK, -(-end // CHUNK)):
            if number % every:
                continue
            part = slice(max(number * CHUNK - rows, 0), min((number + 1) * CHUNK, end) - rows)
            rows_of = _copied if log.from_disk else Recording.select
            kept.setdefault(number, []).append(rows_of(last, part))
            if len(kept) > CHUNKS:
                every *= 2
                kept = {k: parts for k, parts in kept.items() if k % every == 0}
        if rows < BEGINNING and last.delay is None:
            beginning.append(_speeds_of(last))
        rows = end
        if progress is not None:
            progress(rows)
    if last is None:
        raise InputError("there is no row to estimate", hint="give a log with at least one row")
    if len(last) == rows:  # one block: its rows need not be joined
        sample = last.select(sampled_rows(rows))
    else:
        sample = joined([part for number in sorted(kept) for part in kept[number]], last)
    empty = tuple(name for name in sample.channels if name not in holding)
    notes = [f"{name} has no value and is left out." for name in empty]
    if sample.delay is None:
        sample = replace(sample, delay=delay_of(lag_within(*first_speeds(beginning))))
    result = Survey(rows, sample, empty)
    return replace(result, sample=result.without_empty(sample).with_notes(*notes))


def first_speeds(blocks: Sequence[Recording]) -> tuple[Floats, dict[str, Floats]]:
    """Time and speeds of the first `BEGINNING` rows of consecutive blocks."""
    if not blocks:
        return np.empty(0), {}
    parts = [_speeds_of(block) for block in blocks]
    names = [name for name in parts[0].channels if all(name in part.channels for part in parts)]
    time = np.concatenate([part.time for part in parts])[:BEGINNING]
    return time, {n: np.concatenate([part.channels[n] for part in parts])[:BEGINNING] for n in names}


def _speeds_of(block: Recording) -> Recording:
    """A block's speeds alone."""
    return Recording(block.time, {name: block.channels[name] for name in speed_names(block.channels)})


def _copied(block: Recording, rows: slice) -> Recording:
    """Rows of a block copied to memory of their own: the block can then be released."""
    part = block.select(rows)
    return replace(
        part,
        time=part.time.copy(),
        channels={name: values.copy() for name, values in part.channels.items()},
        labels={name: values.copy() for name, values in part.labels.items()},
    )


def joined(parts: Sequence[Recording], last: Recording) -> Recording:
    """Parts of a log as one recording; the reader's remarks are complete with its ``last`` block."""
    return replace(
        last,
        time=np.concatenate([part.time for part in parts]),
        channels={name: np.concatenate([part.channels[name] for part in parts]) for name in last.channels},
        labels={name: np.concatenate([part.labels[name] for part in parts]) for name in last.labels},
    )
