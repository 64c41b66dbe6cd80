"""Find the column that holds a foreign log's time, and its unit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.candidates import kind_of
from terragrip.formats.vocabulary import GENERAL, Vocabulary
from terragrip.recording.clock import clock_unit
from terragrip.recording.columns import SINCE_1970
from terragrip.recording.schema import TIME
from terragrip.units import factor_to

_PLAUSIBLE = (1e-6, 3600.0)  # s between samples


def find_time(
    numbers: Mapping[str, Floats],
    dates: tuple[str, ...],
    units: Mapping[str, str],
    vocabulary: Vocabulary = GENERAL,
) -> tuple[str, str] | None:
    """The time column and its unit, or None: named or stated as a time, and running forward; a unit of ``units`` counts first.

    ``numbers`` are the numeric columns (n,), ``dates`` those that hold dates with a time of day. Of several the one that counts from a
    calendar's zero comes first, then the one that stands first.
    """
    best: tuple[float, str, str, bool] | None = None
    for column, values in numbers.items():
        score, unit = _score(column, values, units.get(column), vocabulary)
        if score > 0 and (best is None or score > best[0]):
            size = float(np.nanmax(np.abs(values), initial=0.0)) * factor_to(unit, "s")
            best = score, column, unit, size > SINCE_1970 and bool(np.isfinite(values).all())
    # A date says when it was; a number that counts from 1970 does too.
    if best is not None and (not dates or (best[1] == TIME and best[0] > 5) or best[3]):
        return best[1], best[2]
    return (dates[0], "s") if dates else None


def _score(column: str, values: Floats, stated: str | None, vocabulary: Vocabulary) -> tuple[float, str]:
    name = vocabulary.read(column)
    words = set(name.words)
    known = values[np.isfinite(values)]
    if column == TIME:
        own = clock_unit(float(np.max(np.abs(known), initial=0.0))) or "s"
        own = stated if stated is not None and kind_of(stated) == "time" else own
        return 6.0 if _forward(known) > 0.9 and len(known) == len(values) else 3.0, own
    unit = next(
        (u for u in (stated, name.unit, _unit_word(name.words, vocabulary)) if u and kind_of(u) == "time"),
        None,
    )
    if (
        not (name.has("time") or words & {"t", "ts"} or unit)
        or name.has("statistic", "command", "distance", "speed")
        or len(known) < 2
    ):
        return 0.0, "s"
    if stated is not None and kind_of(stated) != "time":
        return 0.0, "s"
    forward, level = _forward(known), float(np.mean(np.diff(known) >= 0))
    if forward < 0.5 and (level < 0.95 or known[-1] <= known[0]):
        return 0.0, "s"
    size = float(np.max(np.abs(known)))
    since = clock_unit(size)
    unit = unit or since or "s"
    step = float(np.median(np.diff(known)[np.diff(known) > 0])) * factor_to(unit, "s")
    if not _PLAUSIBLE[0] <= step <= _PLAUSIBLE[1]:
        return 0.0, "s"
    score = 2.0 + 2.0 * (forward > 0.9) + 1.0 * (level > 0.95)
    score += (
        0.5 * (since == unit) + 0.3 * bool(words & {"epoch", "unix", "utc"}) + 0.4 * bool(words & {"header"})
    )
    score += 0.2 * (name.unit is not None or stated is not None or bool(since)) - (
        1.0 - len(known) / max(len(values), 1)
    )
    return score - 2.0 * name.has("other"), unit


def _unit_word(words: tuple[str, ...], vocabulary: Vocabulary) -> str | None:
    """A unit of time that stands anywhere in a name and needs no more than itself (``millisSinceGpsEpoch``)."""
    result = (vocabulary.unit_word(word) for word in words if len(word) > 2)
    return next((unit for unit in result if kind_of(unit) == "time"), None)


def _forward(known: Floats) -> float:
    return float(np.mean(np.diff(known) > 0)) if len(known) > 1 else 0.0
