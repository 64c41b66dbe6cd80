"""NMEA 0183 logs: RMC, VTG and GGA sentences, by pynmea2.

Time is the receiver's UTC, not the logger's; sentences without a time take that of the last one before. A stamp that a
logger wrote before the sentence is passed over.
"""

from __future__ import annotations

import datetime as dt
import re
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.files import sha256, unreadable
from terragrip.formats.boundary import needed
from terragrip.formats.kind import Databases
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted, skips

_SENTENCE = re.compile(r"\$[A-Z]{2}(RMC|VTG|GGA),[^$!*\r\n]{0,120}\*[0-9A-Fa-f]{2}")
_BLOCK = 20_000  # lines that are read or left out together, where a log is looked at in parts
_LONGEST = 4096  # characters of a line
_DAY = 86400.0
_KNOT, _KMH = 1852 / 3600, 1 / 3.6

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


@dataclass
class _Track:
    """Values by name with their stamps; ``now`` is the last stamp [s], ``day`` that of the last date [s since 1970]."""

    columns: dict[str, tuple[array[float], array[float]]] = field(default_factory=dict)
    now: float | None = None
    day: float | None = None
    sentences: int = 0
    bad: int = 0
    no_fix: int = 0

    def add(self, name: str, value: float | None) -> None:
        """Keep a value at the present stamp."""
        if value is None or self.now is None:
            return
        stamps, values = self.columns.setdefault(name, (array("d"), array("d")))
        stamps.append(self.now)
        values.append(value)

    def set_time(self, clock: dt.time | None, date: dt.date | None) -> None:
        """Set the stamp from a sentence's time of day, and its date where it has one."""
        if clock is None:
            return
        if date is not None:
            self.day = float((date - dt.date(1970, 1, 1)).days) * _DAY
        seconds = 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond
        base = self.day or 0.0
        if self.now is not None and date is None and base + seconds < self.now - _DAY / 2:
            base += _DAY  # past midnight
            self.day = base
        self.now = base + seconds


def read_nmea(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read an NMEA 0183 log: ground_speed, course, latitude, longitude, altitude, hdop, quality and satellites.

    Sentences with a wrong checksum are left out and counted; without a fix values are missing. Raises InputError if no
    sentence is readable.
    """
    pynmea2 = needed("pynmea2", "an NMEA 0183 log")
    track = _Track()
    try:
        with Path(path).open(encoding="ascii", errors="replace", newline="\n") as stream:
            for number, line in enumerate(iter(lambda: stream.readline(_LONGEST), "")):
                if not skips(number, _BLOCK, wanted):
                    _take_line(line, track, pynmea2)
    except OSError as error:
        raise unreadable(path, error) from error
    if not track.columns:
        problem = (
            f"holds no usable RMC, VTG or GGA sentence ({track.bad} damaged, {track.no_fix} without a fix)"
        )
        raise InputError(problem, file=path, mend="check that the receiver sent them, and had a fix")
    notes = []
    if track.bad:
        notes.append(f"{track.bad} sentences are damaged and were left out.")
    if track.no_fix:
        notes.append(f"{track.no_fix} sentences have no fix: their values are missing.")
    signals = {
        name: Signal(np.array(stamps), np.array(values), UNITS[name])
        for name, (stamps, values) in track.columns.items()
        if wanted is None or wanted(name)
    }
    return SignalLog(tuple(track.columns), signals, path, sha256(path), tuple(notes))


def _take_line(line: str, track: _Track, pynmea2: Any) -> None:
    matches = list(_SENTENCE.finditer(line))
    if not matches and re.search(r"\$[A-Z]{2}(RMC|VTG|GGA)", line):
        track.bad += 1
    for match in matches:
        try:
            sentence = pynmea2.parse(match[0], check=True)
            kind = match[1]
            {"RMC": _rmc, "VTG": _vtg, "GGA": _gga}[kind](sentence, track)
            track.sentences += 1
        except (pynmea2.ParseError, ValueError, TypeError, AttributeError, ArithmeticError):
            track.bad += 1


def _rmc(sentence: Any, track: _Track) -> None:
    track.set_time(_clock(sentence.timestamp), _date(sentence.datestamp))
    if sentence.status != "A":
        track.no_fix += 1
        return
    speed = _number(sentence.spd_over_grnd)
    track.add("ground_speed", None if speed is None else speed * _KNOT)
    track.add("course", _number(sentence.true_course))
    track.add("latitude", sentence.latitude)
    track.add("longitude", sentence.longitude)


def _vtg(sentence: Any, track: _Track) -> None:
    """Speed over ground where no RMC of the same instant has given it."""
    if getattr(sentence, "faa_mode", "A") == "N":
        track.no_fix += 1
        return
    known = track.columns.get("ground_speed")
    if known is not None and known[0][-1] == track.now:
        return
    speed = _number(sentence.spd_over_grnd_kmph)
    track.add("ground_speed", None if speed is None else speed * _KMH)
    track.add("course", _number(sentence.true_track))


def _gga(sentence: Any, track: _Track) -> None:
    track.set_time(_clock(sentence.timestamp), None)
    quality = _number(sentence.gps_qual)
    if not quality:
        track.no_fix += 1
        return
    track.add("latitude", sentence.latitude)
    track.add("longitude", sentence.longitude)
    track.add("altitude", _number(sentence.altitude))
    track.add("hdop", _number(sentence.horizontal_dil))
    track.add("quality", quality)
    track.add("satellites", _number(sentence.num_sats))


def _clock(value: Any) -> dt.time | None:
    return value if isinstance(value, dt.time) else None


def _date(value: Any) -> dt.date | None:
    return value if isinstance(value, dt.date) else None


def _number(value: Any) -> float | None:
    if value in (None, ""):
        return None
    found = float(value)
    return found if np.isfinite(found) else None
