"""Instants that a table holds as text: times of day, and dates in the forms that loggers and spreadsheets write."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_CLOCK = r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)(?:[.,](?P<part>\d{1,9}))?"
_FORMS = tuple(
    re.compile(form)
    for form in (
        _CLOCK,
        rf"(?P<day>\d{{1,2}})\.(?P<month>\d{{1,2}})\.(?P<year>\d{{4}})[ T]+{_CLOCK}",
        rf"(?P<year>\d{{4}})[-/](?P<month>\d\d)[-/](?P<day>\d\d)[ T]+{_CLOCK}Z?",
    )
)
_DAY = 86_400.0


def times_of(cells: Sequence[str | None]) -> npt.NDArray[np.float64] | npt.NDArray[np.datetime64] | None:
    """Times of day as seconds (n,), dates with them as datetime64 (n,); None where some cell is neither, or they differ in form.

    A time of day that runs back by more than half a day is of the next day. Empty cells are missing.
    """
    first = next((cell for cell in cells if cell), None)
    form = next((f for f in _FORMS if first is not None and f.fullmatch(first.strip())), None)
    if form is None:
        return None
    matches = [form.fullmatch(cell.strip()) if cell else None for cell in cells]
    if any(match is None and cell for match, cell in zip(matches, cells, strict=True)):
        return None
    seconds = np.array([np.nan if match is None else _seconds(match) for match in matches])
    if "day" not in form.groupindex:
        return _without_midnights(seconds)
    try:
        days = np.array([_day(match) for match in matches], dtype="datetime64[D]")
    except ValueError:  # a thirteenth month
        return None
    since = np.where(np.isnan(seconds), 0.0, seconds)
    return days + np.round(since * 1e9).astype("timedelta64[ns]")


def _seconds(match: re.Match[str]) -> float:
    part = match["part"] or "0"
    whole = 3600 * int(match["hour"]) + 60 * int(match["minute"]) + int(match["second"])
    return whole + int(part) / 10 ** len(part)


def _day(match: re.Match[str] | None) -> str:
    return "NaT" if match is None else f"{match['year']}-{int(match['month']):02d}-{int(match['day']):02d}"


def _without_midnights(seconds: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    known = np.isfinite(seconds)
    days = np.zeros(len(seconds))
    days[known] = np.cumsum(np.diff(seconds[known], prepend=seconds[known][:1]) < -_DAY / 2)
    return seconds + _DAY * days
