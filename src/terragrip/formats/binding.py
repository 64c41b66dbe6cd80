"""Which columns of a log a profile's names stand for."""

from __future__ import annotations

import numpy as np

from terragrip.errors import InputError, nearest
from terragrip.formats.profile import Profile, Source, matching
from terragrip.formats.table import LogTable
from terragrip.recording.schema import TIME


def bound(profile: Profile, log: LogTable, *, partial: bool = False) -> tuple[Profile, list[str]]:
    """The profile with one existing column for each name, and sentences on what was left out.

    Of several candidates the first with a value counts. Raises InputError at the first column that the log lacks,
    and names the nearest one; an optional channel is left out instead, and of a ``partial`` log any.
    """
    notes: list[str] = []
    absent: list[str] = []
    channels: dict[str, Source] = {}
    for name, origin in profile.channels.items():
        if origin.candidates:
            chosen = _chosen(origin, log)
            if chosen is not None:
                if len(origin.candidates) > 1 or "*" in origin.candidates[0]:
                    notes.append(f"{name} is {chosen}.")
                origin = origin.model_copy(update={"column": chosen})
        lacking = next((column for column in origin.columns if not matching(column, log.columns)), None)
        if lacking is None:
            channels[name] = origin
        elif origin.optional or partial:
            absent.append(name)
        else:
            raise _missing(lacking, log, others=len(origin.candidates) > 1)
    if absent and not partial:
        notes.append(f"Nothing in the log gives {', '.join(absent)}; the profile can do without.")
    time, rows = profile.time, profile.rows
    if time.column not in log.columns:
        if not log.clocked:
            raise _missing(time.column, log)
        time = time.model_copy(update={"column": TIME, "unit": "s"})
    if rows is not None and rows.column not in log.columns:
        if not partial:
            raise _missing(rows.column, log)
        rows = None
    return profile.model_copy(update={"channels": channels, "time": time, "rows": rows}), notes


def _chosen(origin: Source, log: LogTable) -> str | None:
    """The first column that a candidate stands for and that holds a value; else the first that there is."""
    found = [column for name in origin.candidates for column in matching(name, log.columns)]
    return next((column for column in found if _holds(log, column)), found[0] if found else None)


def _holds(log: LogTable, column: str) -> bool:
    values = log.columns[column]
    return values.dtype.kind != "f" or bool(np.isfinite(values).any())


def _missing(column: str, log: LogTable, *, others: bool = False) -> InputError:
    close = nearest(column, log.names)
    mend = f"the nearest column is {close!r}" if close else f"its columns are {', '.join(log.names[:12])}"
    problem = "is missing, but the profile names it"
    if others:
        problem += ", and so are the others that would do"
    return InputError(problem, file=log.source, place=f"column {column}", mend=mend)
