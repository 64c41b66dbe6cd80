"""Read a log of any known format."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.files import sha256, unreadable
from terragrip.formats.conversion import Part, converted
from terragrip.formats.profile import SHIPPED, Profile
from terragrip.formats.registry import Databases, format_of
from terragrip.formats.signals import SignalLog
from terragrip.formats.stamps import Stamps
from terragrip.formats.table import EVERY, LogTable, Wanted, in_si
from terragrip.recording import Recording, checks
from terragrip.recording.alignment import aligned
from terragrip.recording.columns import seconds, start_of
from terragrip.recording.frames import frame_of
from terragrip.recording.repeats import merged
from terragrip.recording.schema import TIME, is_own

PathLike = str | os.PathLike[str]


def read(
    path: PathLike | Sequence[PathLike | Any] | Any,
    profile: Profile | PathLike | Sequence[Profile | PathLike | None] | None = None,
    *,
    dbc: PathLike | Sequence[PathLike] = (),
) -> Recording:
    """Read a log of any known format (docs/formats.md) as a Recording; the format is recognised by its content.

    Without a profile the columns must have the recording's own names; a unit that the file itself states
    (``ground_speed [km/h]``, or a row of units) is converted. With a `Profile`, the path of one, or the name of one
    that comes with Terragrip, the profile defines the columns. ``dbc``: the DBC files of a CAN log, beside the
    profile's own.

    A pandas or polars frame, an Arrow table or a mapping of arrays in place of a path is a log, too.

    Several paths or tables are sources of one drive. Each gives its channels; where several have one, the first source counts.
    A list of profiles has one for each, None for a source with our names. Clocks are aligned by their stamps where both
    count from 1970, then by the correlation of the speeds, and the notes report by how much.

    Raises InputError with file, column, row and hint if the log is unusable.
    """
    if isinstance(profile, Mapping):
        raise InputError("a dict is no profile", hint="give a path, or tg.Profile.from_dict(...) of it")
    if _is_table(path):
        return _of_frame(path, profile)
    databases: Databases = (dbc,) if isinstance(dbc, str | os.PathLike) else tuple(dbc)
    if not isinstance(path, str | os.PathLike):
        from terragrip.formats import sources

        several = hasattr(path, "__iter__") and not (
            isinstance(path, bytes | Recording) or hasattr(path, "read")
        )
        paths: list[Any] = list(path) if several else [path]
        chosen_ones = _each(profile, paths)
        for number, one in enumerate(paths, 1):
            if _is_table(one):
                paths[number - 1] = _in_memory(one, f"table {number}")
            elif not isinstance(one, str | os.PathLike):
                raise InputError(
                    f"{type(one).__name__} is no log", hint="give a path, a DataFrame or a dict of arrays"
                )
        recording = sources.merged(
            [_part(p, own, databases) for p, own in zip(paths, chosen_ones, strict=True)]
        )
        used = {id(own): own.to_dict() for own in chosen_ones if own is not None}
        return replace(recording, profiles=tuple(used.values()))
    if isinstance(profile, list | tuple):
        raise InputError("there are several profiles for one log", file=path, hint="give one profile")
    chosen = loaded(profile)  # type: ignore[arg-type]  # a sequence was refused above
    if chosen is not None:
        return recording_of(read_table(path, chosen.wants, (*databases, *chosen.dbc)), chosen)
    return recording_of(read_table(path, is_own, databases), None)


def _is_table(log: Any) -> bool:
    return isinstance(log, Mapping) or hasattr(log, "columns")


def _of_frame(frame: Any, profile: Any) -> Recording:
    if isinstance(profile, list | tuple):
        raise InputError("there are several profiles for one table", hint="give one profile")
    chosen = loaded(profile)
    return recording_of(_in_memory(frame), chosen)


def _in_memory(table: Any, source: str | None = None) -> LogTable:
    frame = frame_of(table, source)
    return LogTable(tuple(frame.columns), frame.columns, frame.units, source, notes=frame.notes)


def recording_of(table: LogTable, profile: Profile | None) -> Recording:
    """The recording from a table by a profile, or without one by its own names; raises InputError as `read` does."""
    recording = profile.apply(table) if profile is not None else _as_it_stands(table)
    return next(aligned([recording]))


def _as_it_stands(table: LogTable) -> Recording:
    _require(table)
    table = _timed(table)
    notes = [*table.notes, *checks.remarks(table.names)]
    return Recording.from_frame(
        in_si(table), table.source, sha256=table.sha256, notes=notes, start=table.start
    )


def read_channels(
    paths: Sequence[PathLike],
    profile: Profile | PathLike | None = None,
    *,
    dbc: Sequence[PathLike] = (),
    also: tuple[str, ...] = (),
) -> dict[str, np.ndarray]:
    """All channels in one drive's logs as columns by name; a body sensor alone is enough.

    As `read`, but ``ground_speed`` and wheel speeds may be missing, the profile is applied to each log as far as possible, and
    columns whose names begin with one of ``also`` are kept as they are. Raises InputError as `read`.
    """
    chosen = loaded(profile)
    parts = [_part(path, chosen, tuple(dbc), also) for path in paths]
    if len(parts) == 1:
        return {TIME: parts[0].time, **parts[0].columns}
    from terragrip.formats.sources import joined

    return joined(parts)[0]


def read_table(path: PathLike, wanted: Wanted | None = None, databases: Databases = ()) -> LogTable:
    """Read the ``wanted`` columns of a log by their own names (None: all); raises InputError if it is not a log."""
    log = read_log(path, wanted, databases)
    return log.table(release=True) if isinstance(log, SignalLog) else log


def read_log(path: PathLike, wanted: Wanted | None = None, databases: Databases = ()) -> LogTable | SignalLog:
    """Read a log as `read_table` does; signals with clocks of their own keep them."""
    own = format_of(path)
    if databases and not own.takes_databases:
        hint = "leave out --dbc, or 'dbc:' in the profile"
        raise InputError(f"is a {own.title}, which needs no DBC", file=path, hint=hint)
    wanted = EVERY if wanted is None else wanted
    if own.read is not None:
        try:
            log = own.read(os.fspath(path), wanted, databases)
            return replace(log, source=log.source or os.fspath(path), sha256=log.sha256 or sha256(path))
        except OSError as error:
            raise unreadable(path, error) from error
    table = None if own.in_blocks is None else own.in_blocks(os.fspath(path))
    if table is None:
        raise InputError(
            f"is a {own.title}, which its format does not read",
            file=path,
            hint="update the package that provides it",
        )
    return table.whole(wanted)


def loaded(profile: Profile | PathLike | None) -> Profile | None:
    """A profile that is given as such, by its path or by its name; raises InputError as `Profile.load`."""
    return profile if profile is None or isinstance(profile, Profile) else Profile.load(profile)


def _each(
    profile: Profile | PathLike | Sequence[Profile | PathLike | None] | None, paths: Sequence[Any]
) -> list[Profile | None]:
    """The profile of each source."""
    if not paths:
        raise InputError("there is no log", hint="give at least one")
    if profile is None or isinstance(profile, Profile | str | os.PathLike):
        return [loaded(profile)] * len(paths)
    result = [loaded(own) for own in profile]
    if len(result) != len(paths):
        raise InputError(
            f"there are {len(result)} profiles for {len(paths)} logs",
            hint="give one profile, or one for each log",
        )
    return result


def _part(
    path: PathLike | LogTable, profile: Profile | None, databases: Databases, also: tuple[str, ...] = ()
) -> Part:
    """The channels of one of several sources; without a profile also columns whose names begin with one of ``also``."""

    def table_of(wanted: Wanted, every: Databases) -> LogTable:
        if isinstance(path, LogTable):
            return replace(path, columns={name: one for name, one in path.columns.items() if wanted(name)})
        return read_table(path, wanted, every if format_of(path).takes_databases else ())

    if profile is not None:
        return converted(profile, table_of(profile.wants, (*databases, *profile.dbc)), partial=True)
    table = table_of(lambda name: is_own(name) or name.startswith(also), databases)
    if TIME not in table.columns:
        raise InputError(
            "is missing",
            file=table.source,
            place=f"column {TIME}",
            hint="name it in a profile for this source",
        )
    table = _timed(table)
    columns = in_si(table)
    written = columns.pop(TIME)
    time, _ = seconds(written, table.source)
    start = table.start if table.start is not None else start_of(written, time)
    return Part(time, columns, table.source, table.sha256, table.notes, {}, start)


def _timed(table: LogTable) -> LogTable:
    """A table with our own names, its stamps a time base, with a row for each."""
    table = Stamps(TIME, table.units.get(TIME, "s")).corrected(table)
    columns, repeats = merged(table.columns, TIME)
    return replace(table, columns=columns, notes=(*table.notes, *repeats.notes()))


def _require(table: LogTable) -> None:
    profiles = (
        f"map its signals in a profile: {', '.join(SHIPPED)}, or your own ('terragrip inspect' proposes one)"
    )
    hint = profiles if table.clocked else None
    checks.require_columns(table.names, table.source, table.units, where_signals=hint)
