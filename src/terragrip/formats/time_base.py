"""The time base of a log, from the stamps that a profile names."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.formats.profile_parts import TimeSource
from terragrip.formats.table import LogTable
from terragrip.recording.columns import (
    DATENUM_1970,
    DAY,
    SINCE_1970,
    SPREADSHEET_1970,
    numbers,
    seconds,
    stamps_of,
    start_of,
)
from terragrip.units import factor_to


def with_nanoseconds(column: str, nanoseconds: str | None, log: LogTable) -> LogTable:
    """A log whose stamps in ``column``, whole seconds, have the ``nanoseconds`` beside them added; raises InputError without these, or
    where they are no part of a second."""
    if nanoseconds is None:
        return log
    if nanoseconds not in log.columns:
        hint = "correct 'nanoseconds:' of the profile's time"
        raise InputError("is missing", file=log.source, place=f"column {nanoseconds}", hint=hint)
    whole, rest = (numbers(n, log.columns[n], None, log.source) for n in (column, nanoseconds))
    wrong = np.flatnonzero((rest < 0) | (rest > 1e9) | (whole != np.floor(whole)) & np.isfinite(whole))
    if len(wrong):
        problem = (
            f"{whole[wrong[0]]:.10g} s and {rest[wrong[0]]:.10g} ns are not whole seconds and a part of one"
        )
        hint = "leave 'nanoseconds:' out of the profile where the stamps are whole without it, or correct the row"
        raise InputError(
            problem, file=log.source, place=f"column {nanoseconds}, row {wrong[0] + 1}", hint=hint
        )
    seconds = len(np.unique(whole))
    if 2 <= seconds <= 0.5 * len(whole) and 0 < np.nanmax(rest, initial=0.0) < 1e6:
        problem = "has all stamps in the first thousandth of their seconds: it is in microseconds, it seems"
        hint = "add both to one column of seconds, and name that in the profile"
        raise InputError(problem, file=log.source, place=f"column {nanoseconds}", hint=hint)
    return replace(log, columns={**log.columns, column: whole + 1e-9 * rest})


def time_base(origin: TimeSource, log: LogTable) -> tuple[Floats, float | None, list[str]]:
    """The time base [s], when its zero was [s since 1970] if that is known, and the notes on it."""
    stamps = written = stamps_of(log.columns[origin.column], log.source, origin.column, origin.dates)
    notes: list[str] = []
    start = log.start
    if stamps.dtype.kind in "Mm":
        time, notes = seconds(stamps, log.source)
        start = start_of(stamps, time)
    else:
        if origin.zero == "first" and stamps.dtype.kind in "iu" and len(stamps):
            stamps = stamps.astype(np.int64) - np.int64(stamps[0])  # nanoseconds since 1970 need all 64 bits
        time = numbers(origin.column, stamps, None, log.source) * factor_to(origin.unit, "s")
        if start is None:
            start = _since_1970(written, origin)
    if origin.zero == "first" and len(time):
        time = time - time[0]
    return time, start, notes


def first_start(origin: TimeSource, stamps: npt.NDArray[Any]) -> float | None:
    """When time 0 was [s since 1970] of a log whose first stamps (n,) these are, if they say."""
    if stamps.dtype.kind in "Mm":
        return start_of(stamps, np.empty(0))
    return _since_1970(stamps, origin)


def _since_1970(stamps: npt.NDArray[Any], origin: TimeSource) -> float | None:
    """When time 0 was [s since 1970], where the stamps (n,), numbers, are so large that they count from then."""
    unit = factor_to(origin.unit, "s")
    first = float(stamps[0]) * unit if len(stamps) else np.nan
    if not SINCE_1970 < first < np.inf:
        return None
    before = (
        (SPREADSHEET_1970 if first < DATENUM_1970 * unit else DATENUM_1970) * unit if unit == DAY else 0.0
    )
    return (first if origin.zero == "first" else 0.0) - before
