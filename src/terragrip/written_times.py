"""Instants that a table holds as text: times of day, and dates in the forms that loggers and spreadsheets write."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_CLOCK = r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)(?:(?:[.,]|:(?=\d{3}))(?P<part>\d{1,9}))?(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
_TIME = re.compile(_CLOCK)
_SINCE = re.compile(rf"(?P<days>\d+) days?,? \+?{_CLOCK}")
"""Of pandas' and Python's time spans: 0 days 00:00:00.050000."""
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_NAMED = (
    re.compile(rf"(?P<day>\d{{1,2}})\.(?P<month>\d{{1,2}})\.(?P<year>(?:\d\d)?\d\d),?[ T]+{_CLOCK}"),
    re.compile(
        rf"(?P<year>\d{{4}})[-/](?P<month>\d\d)[-/](?P<day>\d\d)[ T]+{_CLOCK}(?P<zone>Z| UTC|[+-]\d\d(?::?\d\d)?)?"
    ),
    re.compile(
        rf"(?P<day>\d\d)-(?P<month>(?i:{'|'.join(_MONTHS)}))-(?P<year>\d{{4}})[ T]+{_CLOCK}"
    ),  # MATLAB's own
)
_EITHER = re.compile(
    rf"(?P<one>\d{{1,2}})(?P<sign>[/-])(?P<two>\d{{1,2}})(?P=sign)(?P<year>\d{{4}}),?[ T]+{_CLOCK}"
)
"""Day and month, or month and day."""
_DAY = 86_400.0

ORDERS = ("dd/mm/yyyy", "mm/dd/yyyy")
"""How a date may be written whose text alone does not tell."""
FORMS = "give seconds, 10:00:00.5 or 2024-04-03 10:00:00.5"
"""What a time may be written as, for a message."""


def moment(seconds: float) -> str:
    """A time [s] as a sentence names it: four digits, and tenths of however many seconds, as a log of a day or since 1970 has them."""
    return f"{seconds:.4g}" if abs(seconds) < 1000 else f"{round(seconds, 1):.12g}"


def span(start: float, end: float) -> str:
    """A stretch of a log [s] as a sentence names it: ``from 12.5 to 20 s``."""
    return f"from {moment(start)} to {moment(end)} s"


def times_of(
    cells: Sequence[str | None], order: str | None = None
) -> npt.NDArray[np.float64] | npt.NDArray[np.datetime64] | None:
    """Times of day as seconds (n,), dates with them as datetime64 (n,), in UTC where they state a zone.

    None where some cell is neither, or they differ in form. A time of day that runs back by more than half a day is of the next day. Empty
    cells are missing. 13/04/2024 shows which number is the day, for all cells; where none does, ``order``, of `ORDERS`, says it, and
    without it the dates are none.
    """
    matches = _matches(cells)
    if matches is None:
        return None
    groups = next(m for m in matches if m is not None).re.groupindex
    try:
        seconds = np.array([np.nan if match is None else _seconds(match) for match in matches])
        if "days" in groups:
            return seconds + _DAY * np.array(
                [0 if match is None else int(match["days"]) for match in matches]
            )
        if "year" not in groups:
            return _without_midnights(seconds)
        if "one" in groups:
            order = order or _order(matches)
            if order is None:
                return None
        days = np.array([_day(match, order) for match in matches], dtype="datetime64[D]")
    except ValueError:  # a thirteenth month, or hour of a half day
        return None
    since = np.where(np.isnan(seconds), 0.0, seconds)
    return days + np.round(since * 1e9).astype("timedelta64[ns]")


def likely_order(cells: Sequence[str | None]) -> str | None:
    """For dates that do not show which number is the day, the order by which they are nearest together; of one day, month first where
    hours are of half days. None for any others."""
    if doubt(cells) is None:
        return None
    half = any(cell and cell.rstrip(".mM ")[-1:] in "aApP" for cell in cells)
    spans: dict[str, float] = {}
    for order in ORDERS[::-1] if half else ORDERS:
        times = times_of(cells, order)
        if times is not None:
            seconds = times.astype("datetime64[s]").astype(np.float64)
            spans[order] = float(np.nanmax(seconds) - np.nanmin(seconds))
    return min(spans, key=lambda order: spans[order], default=None)


def doubt(cells: Sequence[str | None]) -> tuple[int, str, str] | None:
    """The place of a date that does not show which number is the day, what is wrong, and what to write; None where none is among
    ``cells``, or all are shown by one of them."""
    matches = _matches(cells)
    if matches is None:
        return None
    rows = [row for row, match in enumerate(matches) if match is not None]
    if "one" not in matches[rows[0]].re.groupindex or _order(matches) is not None:  # type: ignore[union-attr]
        return None
    row = rows[0]
    cell, (one, two) = str(cells[row]).strip(), _pair(matches[row])
    if one > 12 or two > 12:
        problem = f"{cell!r} and other dates have day and month in different order"
        return row, problem, "write all dates alike, as 2024-04-03"
    problem = f"{cell!r} may be the {one}. of month {two} or the {two}. of month {one}"
    return row, problem, f"write 2024-04-03, or in a profile 'dates: {ORDERS[0]}' (or {ORDERS[1]}) for time"


def misfit(cells: Sequence[str | None]) -> int | None:
    """The place of the first cell that is not written as the times before it are; None where the first is no time either."""
    form = _form(cells)
    rows = (row for row, cell in enumerate(cells) if cell and form and not form.fullmatch(cell.strip()))
    return next(rows, None)


def _form(cells: Sequence[str | None]) -> re.Pattern[str] | None:
    """The form of the first cell that is not empty."""
    first = next((cell for cell in cells if cell), None)
    forms = (_TIME, _SINCE, *_NAMED, _EITHER)
    return next((f for f in forms if first is not None and f.fullmatch(first.strip())), None)


def _matches(cells: Sequence[str | None]) -> list[re.Match[str] | None] | None:
    """The cells by the form of the first that is not empty, None for an empty one; None altogether where one has another form."""
    form = _form(cells)
    if form is None:
        return None
    matches = [form.fullmatch(cell.strip()) if cell else None for cell in cells]
    return (
        None if any(match is None and cell for match, cell in zip(matches, cells, strict=True)) else matches
    )


def _order(matches: Sequence[re.Match[str] | None]) -> str | None:
    """The order of day and month that a number above 12 shows; None where none does, or one in each place."""
    pairs = np.array([_pair(match) for match in matches if match is not None])
    one, two = (bool((pairs[:, k] > 12).any()) for k in (0, 1))
    return None if one == two else ORDERS[0] if one else ORDERS[1]


def _pair(match: re.Match[str] | None) -> tuple[int, int]:
    return (0, 0) if match is None else (int(match["one"]), int(match["two"]))


def _seconds(match: re.Match[str]) -> float:
    part, hour, half = match["part"] or "0", int(match["hour"]), match["half"]
    if half:
        if not 1 <= hour <= 12:
            raise ValueError("not an hour of a half day")
        hour = hour % 12 + 12 * (half in "Pp")
    of_day = 3600 * hour + 60 * int(match["minute"]) + int(match["second"]) + int(part) / 10 ** len(part)
    return of_day - _east(match.groupdict().get("zone"))


def _east(zone: str | None) -> int:
    """By how many seconds a zone's clock (``+02:00``) is ahead of UTC."""
    if zone is None or zone in ("Z", " UTC"):
        return 0
    sign, digits = zone[0], zone[1:].replace(":", "")
    return int(f"{sign}1") * (3600 * int(digits[:2]) + 60 * int(digits[2:] or 0))


def _day(match: re.Match[str] | None, order: str | None) -> str:
    if match is None:
        return "NaT"
    if "one" in match.re.groupindex:
        day, month = _pair(match) if order == ORDERS[0] else _pair(match)[::-1]
    else:
        day, name = int(match["day"]), match["month"].title()
        month = _MONTHS.index(name) + 1 if name in _MONTHS else int(name)
    century = "20" * (len(match["year"]) == 2)  # 13.4.24
    return f"{century}{match['year']}-{month:02d}-{day:02d}"


def _without_midnights(seconds: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    known = np.isfinite(seconds)
    days = np.zeros(len(seconds))
    days[known] = np.cumsum(np.diff(seconds[known], prepend=seconds[known][:1]) < -_DAY / 2)
    return seconds + _DAY * days
