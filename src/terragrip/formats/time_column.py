"""Find the column that holds a foreign log's time, and its unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.candidates import kind_of
from terragrip.formats.vocabulary import GENERAL, Vocabulary
from terragrip.recording.clock import clock_unit
from terragrip.recording.columns import DATENUM, DATENUM_1970, DAY_STEP, SINCE_1970, SPREADSHEET_1970
from terragrip.recording.schema import TIME
from terragrip.units import factor_to

_NANOSECONDS = re.compile(r"(.*?)(?:n|nano)sec(?:s|onds?)?", re.IGNORECASE)
_PLAUSIBLE = (1e-6, 3600.0)  # s between samples
_FINER = ("s", "ms", "us", "ns")
_DAYS = {  # days from, to, and the day that is 1970
    "a spreadsheet's dates do": (3e4, 8e4, SPREADSHEET_1970),  # 1982 to 2119; or seconds of a day
    "MATLAB's datenum does": (*DATENUM, DATENUM_1970),
}
_ALONE = (("ms",), ("us",), ("ns",))
_ROUND = 60.0
_FIELD_RATE = 5.0  # s between samples: no log of a drive has more


class TimeColumn(NamedTuple):
    """The column that holds a log's time, its unit, what is doubtful about that, the order of its dates where they do not show it, and
    the column of the nanoseconds beside whole seconds."""

    name: str
    unit: str
    doubt: str = ""
    dates: str = ""
    nanoseconds: str | None = None


def find_time(
    numbers: Mapping[str, Floats],
    dates: tuple[str, ...],
    units: Mapping[str, str],
    vocabulary: Vocabulary = GENERAL,
) -> TimeColumn | None:
    """The time column, or None: named or stated as a time, and running forward; a unit of ``units`` counts first.

    ``numbers`` are the numeric columns (n,), ``dates`` those that hold dates with a time of day. Of several the one that counts from a
    calendar's zero comes first, then the one that stands first.
    """
    best: tuple[float, TimeColumn, bool] | None = None
    parts = _parts(numbers)
    for column, values in numbers.items():
        if column in parts.values():
            continue
        score, unit, doubt = _score(column, values, units.get(column), vocabulary)
        if score > 0 and (best is None or score > best[0]):
            size = float(np.nanmax(np.abs(values), initial=0.0)) * factor_to(unit, "s")
            own = TimeColumn(column, unit, doubt, nanoseconds=parts.get(column))
            best = score, own, size > SINCE_1970 and bool(np.isfinite(values).all())
    # A date says when it was; a number that counts from 1970 does too.
    if best is not None and (not dates or (best[1].name == TIME and best[0] > 5) or best[2]):
        return best[1]
    return TimeColumn(dates[0], "s") if dates else None


def other_clocks(numbers: Mapping[str, Floats], time: str, units: Mapping[str, str]) -> list[str]:
    """Sentences on further columns of stamps that run forward, but end before those of ``time``: tables of unlike rates, side by side."""
    notes = []
    for column, values in numbers.items():
        measured = np.isfinite(values)
        count = int(measured.sum())
        if column == time or not 2 < count < len(values) or not measured[:count].all():
            continue
        if _score(column, values, units.get(column), GENERAL)[0] > 0 and _forward(values[:count]) > 0.9:
            notes.append(
                f"{column} is another clock, of {count} stamps: the columns that belong to it are not of the instants of {time}. Give "
                f"them a profile of their own with 'time: {{from: {column}}}', and the log once more by --with."
            )
    return notes


def _parts(numbers: Mapping[str, Floats]) -> dict[str, str]:
    """Columns of whole seconds with the columns of the nanoseconds that belong to them: stamp.secs and stamp.nsecs, sec and nanosec."""
    result = {}
    for name, values in numbers.items():
        match = _NANOSECONDS.fullmatch(name)
        if match is None or not (
            np.nanmin(values, initial=0) >= 0 and 1e6 < np.nanmax(values, initial=0) <= 1e9
        ):
            continue
        whole = next(
            (n for n in numbers if n.lower() in (f"{match[1]}sec{s}".lower() for s in ("", "s", "onds"))),
            None,
        )
        if whole is not None and np.all(numbers[whole] == np.round(numbers[whole])):
            result[whole] = name
    return result


def _score(column: str, values: Floats, stated: str | None, vocabulary: Vocabulary) -> tuple[float, str, str]:
    name = vocabulary.read(column)
    words = set(name.words)
    known = values[np.isfinite(values)]
    if column == TIME:
        own = stated if stated is not None and kind_of(stated) == "time" else None
        own, doubt = _unit(known, own)
        return 6.0 if _forward(known) > 0.9 and len(known) == len(values) else 3.0, own, doubt
    first = name.words[:1]
    alone = first in _ALONE and (
        first == name.words or _forward(known) > 0.9
    )  # ms_today; not us_left, an ultrasonic one
    units = (stated, name.unit, _unit_word(name.words, vocabulary), *first * alone)
    unit = next((u for u in units if u and kind_of(u) == "time"), None)
    if (
        not (name.has("time") or words & {"t", "ts"} or unit)
        or name.has("statistic", "command", "distance", "speed")
        or len(known) < 2
    ):
        return 0.0, "s", ""
    if stated is not None and kind_of(stated) != "time":
        return 0.0, "s", ""
    back, most = -float(np.min(np.diff(known))), float(np.max(known))
    if np.min(known) >= 0 and _ROUND - 2 * _step(known) <= most < _ROUND and back > 0.5 * most:
        return 0.0, "s", ""  # the seconds of a minute, the minutes of an hour; not a clock that was set back
    forward, level = _forward(known), float(np.mean(np.diff(known) >= 0))
    if forward < 0.5 and (level < 0.95 or known[-1] <= known[0]):
        return 0.0, "s", ""
    since = clock_unit(float(np.max(np.abs(known))))
    unit, doubt = _unit(known, unit)
    if not _PLAUSIBLE[0] <= _step(known) * factor_to(unit, "s") <= _PLAUSIBLE[1]:
        return 0.0, "s", ""
    score = 2.0 + 2.0 * (forward > 0.9) + 1.0 * (level > 0.95)
    score += (
        0.5 * (since == unit) + 0.3 * bool(words & {"epoch", "unix", "utc"}) + 0.4 * bool(words & {"header"})
    )
    score += 0.2 * (name.unit is not None or stated is not None or bool(since)) - (
        1.0 - len(known) / max(len(values), 1)
    )
    return score - 2.0 * name.has("other"), unit, doubt


def _unit(known: Floats, stated: str | None) -> tuple[str, str]:
    """The unit of stamps: as ``stated``, or as a clock since 1970 has it, or by their spacing, which is a doubt unless it is seconds."""
    most = float(np.max(np.abs(known), initial=0.0))
    unit = stated or clock_unit(most)
    if unit is not None:
        return unit, ""
    step = _step(known)
    for what, (low, high, at_1970) in _DAYS.items():
        if low < np.min(known, initial=np.inf) and most < high and 0 < step < DAY_STEP:
            day = np.datetime64("1970-01-01") + np.timedelta64(int(known[0]) - at_1970, "D")
            return "d", f"counts days, as {what} ({known[0]:.6g} is {day}): d?"
    unit = next((u for u in _FINER if step * factor_to(u, "s") < _FIELD_RATE), "s")
    if unit == "s":
        return unit, ""
    return unit, f"no unit is stated, and in s its samples would be {step:.6g} s apart: {unit}?"


def _step(known: Floats) -> float:
    """The usual spacing of stamps that run forward; 0 where none do."""
    steps = np.diff(known)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def _unit_word(words: tuple[str, ...], vocabulary: Vocabulary) -> str | None:
    """A unit of time that stands anywhere in a name and needs no more than itself (``millisSinceGpsEpoch``)."""
    result = (vocabulary.unit_word(word) for word in words if len(word) > 2)
    return next((unit for unit in result if kind_of(unit) == "time"), None)


def _forward(known: Floats) -> float:
    return float(np.mean(np.diff(known) > 0)) if len(known) > 1 else 0.0
