"""Sentences of a GNSS receiver, NMEA 0183, from a line or in datagrams, to a feed: ground speed, position, altitude."""

from __future__ import annotations

import re

from terragrip.formats.nmea_sentences import sentences
from terragrip.live.feed import Feed

_BEGUN = re.compile(rb"[$!][A-Z][A-Z0-9]{3,},")
_FRAME = re.compile(rb"[$!][A-Z][A-Z0-9]+,[^$!*]*\*[0-9A-Fa-f]{2}")  # a sentence of any kind


def holds_sentences(data: bytes) -> bool:
    """Whether bytes begin as a sentence does, of any kind."""
    return _BEGUN.match(data) is not None


class Sentences:
    """Feeds sentences, each as it comes, and says what is none."""

    def __init__(self, feed: Feed) -> None:
        self._feed, self._has_said = feed, False

    def line(self, line: bytes) -> None:
        """A line, whatever a logger wrote before its sentences; raises InputError where pynmea2 is not installed."""
        line, feed = line.strip(), self._feed
        feed.one_layout = False
        good, damaged = sentences(line.decode("ascii", "replace"))
        if damaged or (line and not _FRAME.search(line)):
            feed.reject(f"not a whole NMEA sentence: {line[:30].decode('ascii', 'replace')!r}")
        for sentence in good:
            if sentence.kind == "VTG" and self._has_said:
                self._has_said = False  # it repeats the speed of the RMC before it; more of them are new
                continue
            self._has_said |= sentence.kind == "RMC" and "ground_speed" in sentence.fields
            feed.excuse("" if sentence.has_fix else "its sentences have no fix")
            if sentence.fields:
                feed.fields(sentence.fields)
