"""Tables too long to be held in memory, in blocks of rows, with or without a profile: text, Parquet and MATLAB 7.3."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from terragrip.formats.blocks import Columns, recordings
from terragrip.formats.conversion import converted_block, settled
from terragrip.formats.profile import Profile
from terragrip.formats.registry import format_of
from terragrip.formats.table import LogTable, in_si, since_clock_was_set
from terragrip.recording import Recording
from terragrip.recording.columns import seconds
from terragrip.recording.schema import TIME, has_torque, is_own

ROWS = 200_000  # of a block


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


def recordings_of(
    log: LongLog, profile: Profile | None = None, *, with_torque: bool = False
) -> Iterator[Recording] | None:
    """The recording that `terragrip.formats.read` gives, in blocks; None where a profile needs the whole log at once.

    ``with_torque``: None, too, of a log without any, since slip alone takes the whole of it. Raises InputError as `read` does,
    each where its block is reached; that a channel is empty over the whole file shows at the end only.
    """
    table = LogTable(log.names, {}, log.units, log.source, clocked=log.clocked)
    if profile is None:
        chosen = [name for name in log.names if is_own(name)]
        if with_torque and not has_torque(chosen):
            return None
        own = (
            in_si(block)
            for block in _since_set(log, log.blocks(chosen), table, TIME, log.units.get(TIME, "s"))
        )
        return recordings(own, log.names, chosen, log.source, log.notes)
    found = settled(profile, table)
    if found is None or (with_torque and not has_torque(found[0].channels)):
        return None
    ready, notes = found
    log.notes.extend(notes)
    names = [TIME, *ready.channels]
    return recordings(_converted(log, ready, table), tuple(names), names, log.source, log.notes)


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
