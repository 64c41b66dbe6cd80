"""NMEA 0183 logs: the sentences of `terragrip.formats.nmea_sentences`, each at the time of the last one that has a time.

Time is the receiver's UTC, not the logger's: a stamp that a logger wrote before a sentence is left out.
"""

from __future__ import annotations

import datetime as dt
import re
from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from terragrip.errors import InputError
from terragrip.formats.can.text_logs import lines_are_like
from terragrip.formats.nmea_sentences import UNITS, Sentence, sentences
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted, skips

_BLOCK = 20_000  # lines that are read or left out together, where a log is looked at in parts
_LONGEST = 4096  # characters of a line
_DAY = 86400.0


@dataclass
class _Track:
    """Values by name with their stamps; ``now`` is the last stamp [s], ``day`` that of the last date [s since 1970].

    ``untimed`` counts speeds after the first one (VTG has no time) at a stamp, ``vtg``.
    """

    columns: dict[str, tuple[array[float], array[float]]] = field(default_factory=dict)
    now: float | None = None
    day: float | None = None
    bad: int = 0
    no_fix: int = 0
    untimed: int = 0
    vtg: float | None = None

    def add(self, name: str, value: float) -> None:
        """Keep a value at the present stamp."""
        if self.now is None:
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


def read_nmea(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Read an NMEA 0183 log: ground_speed, course, latitude, longitude, altitude, hdop, quality and satellites.

    Sentences with a wrong checksum are left out and counted; without a fix values are missing. Raises InputError if no
    sentence is readable.
    """
    track = _Track()
    with Path(path).open(encoding="ascii", errors="replace", newline="\n") as stream:
        for number, line in enumerate(iter(lambda: stream.readline(_LONGEST), "")):
            if not skips(number, _BLOCK, wanted):
                good, bad = sentences(line)
                track.bad += bad
                for sentence in good:
                    _add(sentence, track)
    if not track.columns:
        problem = (
            f"has no usable RMC, VTG or GGA sentence ({track.bad} damaged, {track.no_fix} without a fix)"
        )
        raise InputError(problem, file=path, hint="check that the receiver sent them, and had a fix")
    notes = []
    if track.bad:
        notes.append(f"{track.bad} sentences are damaged and were left out.")
    if track.no_fix:
        notes.append(f"{track.no_fix} sentences have no fix: their values are missing.")
    speeds = track.columns.get("ground_speed")
    if speeds is not None and track.untimed > len(speeds[0]):
        notes.append(
            f"{track.untimed} VTG sentences came between two times and were left out: they have no time of their own. "
            "Let the receiver send RMC or GGA as often."
        )
    signals = {
        name: Signal(np.array(stamps), np.array(values), UNITS[name])
        for name, (stamps, values) in track.columns.items()
        if wanted(name)
    }
    return SignalLog(tuple(track.columns), signals, notes=tuple(notes))


def _add(sentence: Sentence, track: _Track) -> None:
    track.set_time(sentence.clock, sentence.date)
    track.no_fix += not sentence.has_fix
    speeds = track.columns.get("ground_speed")
    if sentence.kind == "VTG":
        track.untimed += track.now is not None and track.vtg == track.now
        track.vtg = track.now
        if speeds is not None and speeds[0][-1] == track.now:
            return  # RMC has given speed and course of this instant
    for name, value in sentence.fields.items():
        track.add(name, value)


_LINE = re.compile(r"[^$!\r\n]{0,60}[$!](?:[A-Z]{2}[A-Z]{3}|P[A-Z]{3,}),[\x20-\x7e]*\*?[0-9A-Fa-f]{0,2}\r?$")
FORMATS = (
    Format(
        "nmea", "NMEA 0183 log", read_nmea, (".nmea",), recognises=lambda head: lines_are_like(head, _LINE)
    ),
)
