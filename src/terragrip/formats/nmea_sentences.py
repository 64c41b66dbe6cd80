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


@dataclass(frozen=True, slots=True)
class Sentence:
    """``kind`` is RMC, VTG or GGA; ``clock`` and ``date`` are UTC, where it holds them.

    ``fields`` [`UNITS`]: what it holds of them; none without a fix.
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
            good.append(_READERS[match[1]](pynmea2.parse(match[0], check=True)))
        except (pynmea2.ParseError, ValueError, TypeError, AttributeError, ArithmeticError):
            damaged += 1
    return good, damaged


@cache
def _pynmea2() -> Any:
    return needed("pynmea2", "NMEA 0183")


def _rmc(sentence: Any) -> Sentence:
    clock, date = _clock(sentence.timestamp), _date(sentence.datestamp)
    if sentence.status != "A":
        return Sentence("RMC", clock, date, has_fix=False)
    fields = {
        "ground_speed": _number(sentence.spd_over_grnd, _KNOT),
        "course": _number(sentence.true_course),
        "latitude": sentence.latitude,
        "longitude": sentence.longitude,
    }
    return Sentence("RMC", clock, date, fields=_known(fields))


def _vtg(sentence: Any) -> Sentence:
    if getattr(sentence, "faa_mode", "A") == "N":
        return Sentence("VTG", has_fix=False)
    speed = _number(sentence.spd_over_grnd_kmph, _KMH)
    if speed is None:
        speed = _number(sentence.spd_over_grnd_kts, _KNOT)
    return Sentence("VTG", fields=_known({"ground_speed": speed, "course": _number(sentence.true_track)}))


def _gga(sentence: Any) -> Sentence:
    clock, quality = _clock(sentence.timestamp), _number(sentence.gps_qual)
    if not quality:
        return Sentence("GGA", clock, has_fix=False)
    fields = {
        "latitude": sentence.latitude,
        "longitude": sentence.longitude,
        "altitude": _number(sentence.altitude),
        "hdop": _number(sentence.horizontal_dil),
        "quality": quality,
        "satellites": _number(sentence.num_sats),
    }
    return Sentence("GGA", clock, fields=_known(fields))


_READERS = {"RMC": _rmc, "VTG": _vtg, "GGA": _gga}


def _known(fields: dict[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in fields.items() if value is not None}


def _clock(value: object) -> dt.time | None:
    return value if isinstance(value, dt.time) else None


def _date(value: object) -> dt.date | None:
    return value if isinstance(value, dt.date) else None


def _number(value: Any, factor: float = 1.0) -> float | None:
    if value in (None, ""):
        return None
    number = float(value)
    return number * factor if math.isfinite(number) else None
