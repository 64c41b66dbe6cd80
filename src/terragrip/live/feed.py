"""From the messages of one source to samples in the inbox; and what is to be said of the source."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Protocol

from terragrip.live.decode import Decoder
from terragrip.live.inbox import Inbox
from terragrip.live.outputs import Values
from terragrip.live.payload import Unpack, Unreadable

_EVERY = 5.0  # s between two events of the same kind about the same thing
_SETTLED = 50  # messages after which another set of fields is a change, not one more kind of message
_LAYOUTS = 64
FLOOR = 0.5  # s of silence; the pages' floor too (web/src/live/feed.ts)
_GAPS = 5
_SILENT = 1.0  # s, or ten periods of rows
_UNKNOWN = 3.0  # s, before a second message has shown the period


class Lost(Exception):
    """A source or sink lost its other side; the text says why. It is connected anew after a while."""


class Receiver(Protocol):
    """What a source of topics needs of a `Feed`; that of many vehicles is another."""

    def message(self, data: bytes, arrival: float | None = None, *, topic: str | None = None) -> None: ...

    def dropped(self, number: int) -> None: ...

    def connected(self) -> None: ...

    def lost(self, why: str) -> None: ...


class Feed:
    """The way of source number ``index`` into the inbox."""

    def __init__(
        self, index: int, name: str, decoder: Decoder, unpack: Unpack, inbox: Inbox, *, after: float
    ) -> None:
        self.index, self.name = index, name
        self.decoder, self.inbox = decoder, inbox
        self.after = after  # newest stamp that the record holds: a replay goes on behind it
        self.messages = self.unreadable = 0
        self.is_lost = self.is_silent = False
        self.arrival = inbox.clock()  # when `watch` last saw a new message
        self._seen = 0  # messages that it has seen
        self._gaps: deque[float] = deque(maxlen=_GAPS)  # s between them
        self._excuse, self._excuse_time = "", float("-inf")  # why nothing comes although the other side sends
        self.one_layout = True  # messages are of few kinds, so that another one is worth an event
        self._unpack = unpack
        self._last_events: dict[str, float] = {}
        self._layouts: dict[frozenset[str], None] = {}
        self._last_layout: frozenset[str] = frozenset()
        self._since_layout = 0

    def message(self, data: bytes, arrival: float | None = None, *, topic: str | None = None) -> None:
        """A message as bytes, by the profile's payload; of a ``topic`` where the source has such."""
        try:
            samples = self._unpack(data)
        except Unreadable as error:
            number = None if topic is None else _number(data)
            if number is None:
                self.reject(str(error) if topic is None else f"{error} on {topic}")
                return
            samples = [{str(topic): number}]
        for fields in samples:
            self.fields(fields if topic is None else self._of_topic(topic, fields), arrival)

    def _of_topic(self, topic: str, fields: Mapping[str, Any]) -> Mapping[str, Any]:
        """Fields by their own names, and by ``topic/name`` where the profile asks for that."""
        if self.decoder.profile is None:
            return fields
        long = {f"{topic}/{name}": value for name, value in fields.items()}
        wanted = {name: value for name, value in long.items() if self.decoder.wants(name)}
        return {**fields, **wanted} if wanted else fields

    def fields(self, fields: Mapping[str, Any], arrival: float | None = None) -> None:
        """A message as named fields."""
        self.messages += 1
        if arrival is None:
            arrival = self.inbox.clock()
        samples = self.decoder.samples(fields, arrival)
        for stamp, values in samples:
            self.inbox.put(self.index, stamp, values, arrival)
        if self.decoder.unreadable:
            self._report_unreadable()
        if self.one_layout:
            if fields.keys() == self._last_layout:
                self._since_layout += 1
            else:
                self._watch_layout(frozenset(fields), bool(samples))

    def sample(self, stamp: float | None, values: Values, arrival: float | None = None) -> None:
        """A sample that needs no decoding."""
        self.messages += 1
        self.inbox.put(self.index, stamp, values, arrival)

    def reject(self, why: str) -> None:
        """A message that nobody can read."""
        self.unreadable += 1
        self.inbox.count("unreadable", [f"({self.name})"])
        self._event("unreadable", f"a message was {why}", key="message")

    def dropped(self, number: int) -> None:
        """Messages were dropped before they were read."""
        self.inbox.count("dropped", [f"({self.name})"], number, self.index)
        self._event("behind", f"{number} messages dropped unread", key="dropped")

    def _report_unreadable(self) -> None:
        wrong, self.decoder.unreadable = self.decoder.unreadable, {}
        self.inbox.count("unreadable", wrong)
        for channel, what in wrong.items():
            self._event("unreadable", f"{channel} was {what}, not a number", key=channel)

    def _watch_layout(self, layout: frozenset[str], useful: bool) -> None:
        self._last_layout = layout
        if layout in self._layouts:
            self._since_layout += 1
            return
        if self._layouts and self._since_layout >= _SETTLED:
            before = next(reversed(self._layouts))
            gone, new = sorted(before - layout)[:5], sorted(layout - before)[:5]
            parts = [f"without {', '.join(gone)}"] if gone else []
            parts += [f"with {', '.join(new)}"] if new else []
            self._event("schema", f"messages changed: {' and '.join(parts)}", key="schema")
        elif not useful and not self._layouts:
            self._event("schema", f"no known field among {', '.join(sorted(layout)[:8])}", key="schema")
        if len(self._layouts) < _LAYOUTS:
            self._layouts[layout] = None
        self._since_layout = 0

    def excuse(self, why: str) -> None:
        """The other side has just sent something that holds no sample: ``why``; empty: it held one."""
        self._excuse, self._excuse_time = why, self.inbox.clock()

    def excuse_at(self, now: float) -> str:
        """Why nothing comes although the other side sends; empty where it does not."""
        return self._excuse if now - self._excuse_time < _EVERY else ""

    def watch(self, now: float, rows: float) -> None:
        """Report that the source fell silent, or sends again; looks at it now and then. ``rows`` [s]: their period."""
        silence = self.silence(now)
        if new := self._come - self._seen:
            if self._seen:
                self._gaps.append((now - self.arrival) / new)
            self._seen, self.arrival = self._come, now
            if self.is_silent:
                self.is_silent = False
                self.connected("it sends again")
            return
        longest = max(_SILENT if self.period else _UNKNOWN, 10.0 * rows, 2.0 * self.period)
        if silence > longest and not (self.is_lost or self.is_silent):
            self.is_silent = True
            self.lost(f"{self.excuse_at(now) or 'nothing came'} for {silence:.1f} s")

    @property
    def _come(self) -> int:
        return self.messages + self.unreadable

    @property
    def period(self) -> float:
        """Usual time between two messages [s], 0 before the second: the median of the last gaps, so that one long silence counts little."""
        return sorted(self._gaps)[len(self._gaps) // 2] if self._gaps else 0.0

    def silence(self, now: float) -> float:
        """s since the last message, or since the start where none came."""
        return now - self.arrival if self._come == self._seen else 0.0

    def why_old(self, now: float) -> str | None:
        """What is said where nothing came for twice the period, and `FLOOR`; None where something did."""
        silence, excuse = self.silence(now), self.excuse_at(now)
        why = f": {excuse}" if excuse else ""
        if not self._come:
            return f"nothing has come from {self.name} yet{why}"
        old = silence > max(FLOOR, 2.0 * self.period)
        return f"nothing came from {self.name} for {silence:.1f} s{why}" if old else None

    def connected(self, how: str = "connected again") -> None:
        """The source has its other side (again)."""
        if self.is_lost:
            self.is_lost = False
            self._event("source_back", how)

    def lost(self, why: str) -> None:
        """The source lost its other side."""
        self._event("source_lost", why, key=None if not self.is_lost else "lost")
        self.is_lost = True

    def _event(self, kind: str, text: str, key: str | None = None) -> None:
        """An event; those with the same ``key`` at most every few seconds."""
        now = self.inbox.clock()
        if key is not None:
            if now - self._last_events.get(key, float("-inf")) < _EVERY:
                return
            self._last_events[key] = now
        self.inbox.event(kind, self.name, text)


def _number(data: bytes) -> float | None:
    try:
        return float(data) if len(data) <= 40 else None
    except ValueError:
        return None
