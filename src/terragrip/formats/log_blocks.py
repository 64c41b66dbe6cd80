"""A log as a recording in blocks: tables too long to be held in memory (text, Parquet, MATLAB 7.3), with or without a profile."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from terragrip.errors import InputError
from terragrip.formats.conversion import asked, converted_block, settled
from terragrip.formats.profile import Profile
from terragrip.formats.reading import loaded, read
from terragrip.formats.registry import format_of
from terragrip.formats.stamps import Stamps
from terragrip.formats.table import LogTable, in_si
from terragrip.formats.table_on_disk import Columns, TableOnDisk
from terragrip.formats.time_base import first_start
from terragrip.recording import LogBlocks, Recording, checks
from terragrip.recording.alignment import aligned
from terragrip.recording.columns import seconds, start_of
from terragrip.recording.repeats import LATE, Repeats, merged
from terragrip.recording.schema import TIME, is_own
from terragrip.recording.survey import ROWS

PathLike = str | os.PathLike[str]


def log_in_blocks(
    path: PathLike | Sequence[PathLike],
    profile: Profile | PathLike | Sequence[Profile | PathLike | None] | None = None,
    *,
    dbc: Sequence[PathLike] = (),
) -> LogBlocks:
    """The recording that `terragrip.formats.read` gives of a log, or of several sources of one drive, in blocks.

    A long table is read a block at a time where each of its rows can be determined by itself; any other log is read whole and cut. Raises
    InputError as `read` does, of a long table each where its block is reached.
    """
    if isinstance(profile, list | tuple):
        return LogBlocks.of(read(path, profile, dbc=dbc), ROWS)
    chosen = loaded(profile)  # type: ignore[arg-type]
    log = long_log(path) if isinstance(path, str | os.PathLike) and not dbc else None
    if log is None or recordings_of(log, chosen) is None:
        return LogBlocks.of(read(path, chosen, dbc=dbc), ROWS)

    def blocks() -> Iterator[Recording]:
        return recordings_of(log, chosen) or iter(())

    return LogBlocks(log.rows, blocks, lambda: read(path, chosen), from_disk=True)


def recordings_of(log: TableOnDisk, profile: Profile | None = None) -> Iterator[Recording] | None:
    """The recording that `terragrip.formats.read` gives, in blocks; None where a profile needs the whole log at once.

    Raises InputError as `read` does, each where its block is reached; that a channel is empty over the whole file shows at the end
    only.
    """
    table = LogTable(log.names, {}, log.units, log.source, log.digest, clocked=log.clocked)
    if profile is None:
        chosen = [name for name in log.names if is_own(name)]
        rows = _one_row_an_instant(log, log.read(chosen), TIME)
        based = _with_time_base(log, rows, table, Stamps(TIME, log.units.get(TIME, "s")))
        own = (replace(block, columns=in_si(block)) for block in based)
        return aligned(_checked(log, own, log.names, chosen))
    result = settled(profile, table)
    if result is None:
        return None
    ready, notes = result
    log.notes.extend(notes)
    names = [TIME, *ready.channels]
    blocks = _checked(log, _converted(log, ready, table), tuple(names), names)
    return aligned(replace(block, profiles=(profile.to_dict(),)) for block in blocks)


def _converted(log: TableOnDisk, profile: Profile, table: LogTable) -> Iterator[LogTable]:
    """The blocks of a log as a `settled` profile makes channels of them; the first says when time 0 was."""
    column = profile.time.column
    wanted = asked(profile, log.names)
    blocks = _one_row_an_instant(log, log.read([name for name in log.names if name in wanted]), column)
    first = None
    for block in _with_time_base(log, blocks, table, Stamps(column, profile.time.unit)):
        stamps = block.columns[column]
        if not len(stamps):
            continue
        start = None
        if first is None:
            first, start = stamps[0], first_start(profile.time, stamps)
            log.notes.extend(seconds(stamps[:1], log.source)[1])
        yield replace(block, columns=converted_block(profile, block, first), start=start)


def _with_time_base(
    log: TableOnDisk, blocks: Iterator[Columns], table: LogTable, stamps: Stamps
) -> Iterator[LogTable]:
    """The blocks as tables whose stamps are a time base."""
    for block in blocks:
        part = stamps.corrected(replace(table, columns=block))
        log.notes.extend(note for note in part.notes if note not in log.notes)
        yield part


def _one_row_an_instant(log: TableOnDisk, blocks: Iterator[Columns], column: str) -> Iterator[Columns]:
    """The blocks with rows of one stamp in ``column`` put together, which the log's notes count."""
    repeats = Repeats()
    for block in _whole_instants(blocks, column):
        columns, found = merged(block, column)
        before, repeats = repeats.notes(), repeats + found
        log.notes[:] = [*(n for n in log.notes if n not in before), *repeats.notes()]
        yield columns


def _whole_instants(blocks: Iterator[Columns], column: str) -> Iterator[Columns]:
    """The blocks cut so that no run of equal stamps in ``column`` is in two of them, nor a row and those that it should precede."""
    held: Columns = {}
    for block in blocks:
        before, stamps = held.get(column, block[column][:0]), block[column]
        if len(before) and len(stamps):
            first = stamps[: LATE + 1].min()
            new_day = len(before) > LATE and first < before[-1 - LATE :].min()  # of a clock of one day
            if first <= before[-1] and not new_day:
                other = np.flatnonzero(before < first)
                cut = int(other[-1]) + 1 if len(other) else 0
                block = {name: np.concatenate([held[name][cut:], values]) for name, values in block.items()}
                held = {name: values[:cut] for name, values in held.items()}
        if held:
            yield held
        held = block
    if held:
        yield held


def long_log(path: str | os.PathLike[str]) -> TableOnDisk | None:
    """A log that is a long table; None of any other, or where its rows cannot be determined beforehand."""
    own = format_of(path)
    result = None if own.in_blocks is None else own.in_blocks(os.fspath(path))
    return result if result is not None and result.is_long else None


def _checked(
    log: TableOnDisk, blocks: Iterable[LogTable], names: tuple[str, ...], chosen: list[str]
) -> Iterator[Recording]:
    """Consecutive blocks of a log as checked recordings; they together are what `Recording.from_frame` makes of all.

    ``names``: all columns of the log, ``chosen``: those in the blocks. Raises InputError as that does, each when its block is reached;
    that a channel is empty over the whole file shows at the end only.
    """
    checks.require_columns(names, log.source, log.units)
    notes = list(checks.remarks(names))
    silent, first, after = set(chosen), 0, None
    origin: np.datetime64 | None = None
    start: float | None = None
    for table in blocks:
        columns, time = table.columns, table.columns[TIME]
        if not len(time):
            continue
        if time.dtype.kind == "M":
            if origin is None:
                origin = time[0]
                notes += seconds(time[:1], log.source)[1]
            columns = {**columns, TIME: time - origin}
        elif origin is not None:
            raise InputError(
                "holds dates and numbers", file=log.source, place=f"column {TIME}", hint="give one of them"
            )
        block, remarks = Recording.of_block(columns, log.source, first_row=first, after=after)
        notes += remarks
        silent -= {
            name for name in silent & block.channels.keys() if not np.isnan(block.channels[name]).all()
        }
        if first == 0:
            start = start_of(time, block.time) if table.start is None else table.start
        # The log's notes grow as its blocks come.
        block = replace(
            block, sha256=log.digest, notes=tuple(dict.fromkeys((*notes, *log.notes))), start=start
        )
        first, after = first + len(block), float(block.time[-1])
        yield block
    if first == 0:
        checks.check_time(np.empty(0), log.source)
    for name in silent:
        checks.refuse_empty(name, log.source)
