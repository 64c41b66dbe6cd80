"""Sentences of NMEA 0183, out of a log or off a serial line: RMC, VTG and GGA as fields in SI, by pynmea2."""

from __future__ import annotations

import datetime as dt
import math
import re
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from terragrip.formats.boundary import needed
from terragrip.units import factor_to

_OURS = re.compile(r"\$[A-Z]{2}(RMC|VTG|GGA),[^$!*\r\n]{0,120}\*[0-9A-Fa-f]{2}")
_BEGUN = re.compile(r"\$[A-Z]{2}(RMC|VTG|GGA)")
_KNOT, _KMH = factor_to("knot", "m/s"), factor_to("km/h", "m/s")

_FIELDS = {  # of each kind: our name, pynmea2's, and the factor to our unit; of two ways to a name the first that is there counts
    "RMC": (("ground_speed", "spd_over_grnd", _KNOT), ("course", "true_course", 1.0),
            ("latitude", "latitude", 1.0), ("longitude", "longitude", 1.0)),
    "VTG": (("ground_speed", "spd_over_grnd_kmph", _KMH), ("ground_speed", "spd_over_grnd_kts", _KNOT),
            ("course", "true_track", 1.0)),
    "GGA": (("latitude", "latitude", 1.0), ("longitude", "longitude", 1.0), ("altitude", "altitude", 1.0),
            ("hdop", "horizontal_dil", 1.0), ("quality", "gps_qual", 1.0), ("satellites", "num_sats", 1.0)),
}  # fmt: skip
UNITS = {
    "ground_speed": "m/s",
    "course": "deg",
    "latitude": "deg",
    "longitude": "deg",
    "altitude": "m",
    "hdop": None,
    "quality": None,
    "satellites": None,
}

_UNMEASURED = (None, 0.0, 6.0, 7.0, 8.0)  # qualities of GGA: none, reckoned, typed in, simulated


@dataclass(frozen=True, slots=True)
class Sentence:
    """``kind`` is RMC, VTG or GGA; ``clock`` and ``date`` are UTC, where it holds them.

    ``fields`` [`UNITS`]: what it holds of them; none without a fix by satellites.
    """

    kind: str
    clock: dt.time | None = None
    date: dt.date | None = None
    has_fix: bool = True
    fields: dict[str, float] = field(default_factory=dict)


def sentences(line: str) -> tuple[list[Sentence], int]:
    """The RMC, VTG and GGA sentences of a line, whatever a logger wrote before them; and how many are damaged."""
    matches = list(_OURS.finditer(line))
    if not matches:
        return [], int(_BEGUN.search(line) is not None)
    pynmea2 = _pynmea2()
    good, damaged = [], 0
    for match in matches:
        try:
            good.append(_read(match[1], pynmea2.parse(match[0], check=True)))
        except (pynmea2.ParseError, ValueError, TypeError, AttributeError, ArithmeticError):
            damaged += 1
    return good, damaged


@cache
def _pynmea2() -> Any:
    return needed("pynmea2", "NMEA 0183")


def _read(kind: str, sentence: Any) -> Sentence:
    clock, date = getattr(sentence, "timestamp", None), getattr(sentence, "datestamp", None)
    clock, date = clock if isinstance(clock, dt.time) else None, date if isinstance(date, dt.date) else None
    if not _has_fix(kind, sentence):
        return Sentence(kind, clock, date, has_fix=False)
    fields: dict[str, float] = {}
    for name, attribute, factor in _FIELDS[kind]:
        value = _number(getattr(sentence, attribute), factor)
        if value is not None:
            fields.setdefault(name, value)
    return Sentence(kind, clock, date, fields=fields)


def _has_fix(kind: str, sentence: Any) -> bool:
    """Whether a sentence was measured: what a receiver reckons without satellites (mode E, quality 6) may come from the wheels' speeds."""
    if kind == "GGA":
        return _number(sentence.gps_qual) not in _UNMEASURED
    mode = (sentence.mode_indicator if kind == "RMC" else sentence.faa_mode) or "A"
    return mode not in ("N", "E", "M", "S") and (kind == "VTG" or sentence.status == "A")


def _number(value: Any, factor: float = 1.0) -> float | None:
    if value in (None, ""):
        return None
    number = float(value)
    return number * factor if math.isfinite(number) else None
