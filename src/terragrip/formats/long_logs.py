"""Tables too long to be held in memory, in blocks of rows, with or without a profile: text, Parquet and MATLAB 7.3."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from terragrip.files import sha256
from terragrip.formats.blocks import Columns, recordings
from terragrip.formats.conversion import converted_block, settled
from terragrip.formats.profile import Profile
from terragrip.formats.registry import format_of
from terragrip.formats.table import LogTable, in_si, since_clock_was_set
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.columns import seconds
from terragrip.recording.schema import TIME, is_own
from terragrip.recording.survey import ROWS

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class LongLog:
    """A table on disk: its columns' ``names`` and ``units``, about how many ``rows`` it has, and what gives its blocks.

    ``blocks`` takes the names that are wanted; it may add to ``notes`` as the blocks come. ``clocked``: as in `LogTable`, time is
    none of the names, and the blocks have it all the same.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    source: str
    rows: int
    blocks: Callable[[list[str]], Iterator[Columns]]
    notes: list[str] = field(default_factory=list)
    clocked: bool = False

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the file, computed once however often it is gone through."""
        return sha256(self.source)


def log_in_blocks(
    path: PathLike | Sequence[PathLike],
    profile: Profile | PathLike | None = None,
    *,
    dbc: Sequence[PathLike] = (),
) -> LogBlocks:
    """The recording that `terragrip.formats.read` gives of a log, or of several sources of one drive, in blocks.

    A long table is read a block at a time where each of its rows can be told by itself; any other log is read whole and cut. Raises
    InputError as `read` does, of a long table each where its block is reached.
    """
    from terragrip.formats.reading import read

    chosen = profile if profile is None or isinstance(profile, Profile) else Profile.load(profile)
    log = long_log(path) if isinstance(path, str | os.PathLike) and not dbc else None
    if log is None or recordings_of(log, chosen) is None:
        return LogBlocks.of(read(path, chosen, dbc=dbc), ROWS)

    def blocks() -> Iterator[Recording]:
        return recordings_of(log, chosen) or iter(())

    return LogBlocks(log.rows, blocks, lambda: read(path, chosen), from_disk=True)


def recordings_of(log: LongLog, profile: Profile | None = None) -> Iterator[Recording] | None:
    """The recording that `terragrip.formats.read` gives, in blocks; None where a profile needs the whole log at once.

    Raises InputError as `read` does, each where its block is reached; that a channel is empty over the whole file shows at the end
    only.
    """
    table = LogTable(log.names, {}, log.units, log.source, clocked=log.clocked)
    if profile is None:
        chosen = [name for name in log.names if is_own(name)]
        own = (
            in_si(block)
            for block in _since_set(log, log.blocks(chosen), table, TIME, log.units.get(TIME, "s"))
        )
        return recordings(own, log.names, chosen, log.source, log.digest, log.notes)
    found = settled(profile, table)
    if found is None:
        return None
    ready, notes = found
    log.notes.extend(notes)
    names = [TIME, *ready.channels]
    return recordings(_converted(log, ready, table), tuple(names), names, log.source, log.digest, log.notes)


def _converted(log: LongLog, profile: Profile, table: LogTable) -> Iterator[Columns]:
    """The blocks of a log as a `settled` profile makes channels of them."""
    asked = {profile.time.column, *(c for origin in profile.channels.values() for c in origin.columns)}
    first = None
    blocks = log.blocks([name for name in log.names if name in asked])
    for block in _since_set(log, blocks, table, profile.time.column, profile.time.unit):
        stamps = block.columns[profile.time.column]
        if not len(stamps):
            continue
        if first is None:
            first = stamps[0]
            log.notes.extend(seconds(stamps[:1], log.source)[1])
        yield converted_block(profile, block, first)


def _since_set(
    log: LongLog, blocks: Iterator[Columns], table: LogTable, column: str, unit: str
) -> Iterator[LogTable]:
    """The blocks as tables, without first rows from before the logger's clock was set."""
    for number, block in enumerate(blocks):
        part = replace(table, columns=block)
        if number == 0:
            part, said = since_clock_was_set(part, column, unit)
            log.notes.extend(said)
        yield part


def long_log(path: str | os.PathLike[str]) -> LongLog | None:
    """A log that is a long table; None of any other, or where its rows cannot be told beforehand."""
    found = format_of(path)
    return None if found.in_blocks is None else found.in_blocks(os.fspath(path))
