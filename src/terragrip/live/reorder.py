"""Samples into rows in the order of time, as soon as nothing earlier can be expected, and never later than a window.

Each channel of each source is a stream; regular ones have a period, the median of their last steps. The earliest row
waits for streams that are due by its instant, for at most ``window`` seconds after it came. So in good order nothing waits
(an estimate follows its sample at once), a sample out of order finds its place, and parts of one instant that come in
several messages become one row. A stream that stays away for LOST periods is no longer waited for.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

from terragrip.live.counts import Counts

LOST = 5  # periods
_STEPS = 15  # of which the median is the period
_FEWEST = 4  # steps before a period is known
_LEARNING = 2.0  # s after which a stream without a period counts as irregular
_RECENT = 512  # rows remembered to tell a doubled sample from a late one
_BEGINNING = float("-inf")

Values = dict[str, float]


@dataclass(slots=True)
class Stream:
    """One channel of one source, in the order of time."""

    first: float
    last: float
    due_from: float  # instant from which the next sample is one period away
    period: float = 0.0  # s; 0 = not known yet, inf = irregular
    tolerance: float = 0.0  # s
    steps: list[float] = field(default_factory=list)
    count: int = 0
    overdue: int = 0

    def step_to(self, time: float) -> int:
        """A sample at ``time``; returns how many are missing before it."""
        step = time - self.last
        missing = 0
        if 0.0 < self.period < float("inf") and step > 1.5 * self.period:
            missing = round(step / self.period) - 1
        self.steps.append(step)
        if len(self.steps) > _STEPS:
            del self.steps[0]
        self.count += 1
        # Often at first, then now and then: a period hardly changes.
        if self.count >= _FEWEST and (self.count < 2 * _STEPS or self.count % 8 == 0):
            self._learn()
        self.last = self.due_from = time
        return missing

    def _learn(self) -> None:
        steps = sorted(self.steps)
        period = steps[len(steps) // 2]
        spread = sorted(abs(step - period) for step in steps)[len(steps) // 2]
        self.tolerance = 4.0 * spread + 1e-6 * period
        self.period = period if self.tolerance < 0.4 * period else float("inf")

    def awaited(self, time: float, present: bool) -> bool:
        """Whether a row at ``time``, with or without a sample of this stream, should wait for it."""
        if self.overdue >= LOST:
            return False
        if self.period == 0.0:
            return time - self.first < _LEARNING
        if present:
            return time - self.due_from > 1.5 * self.period
        return self.due_from + self.period - self.tolerance <= time


@dataclass(slots=True)
class Pending:
    """A row to be: ``values`` by channel, ``origin`` the source of each."""

    time: float
    arrival: float
    values: Values
    origin: dict[str, int]


class Reorder:
    """The buffer; ``counts`` is told what is late, doubled and missing."""

    def __init__(self, window: float, counts: Counts) -> None:
        self.window = window
        self.counts = counts
        self.streams: dict[tuple[int, str], Stream] = {}
        self.pending: list[Pending] = []
        self.released = _BEGINNING
        self._recent: deque[tuple[float, tuple[str, ...]]] = deque(maxlen=_RECENT)
        self.changes: list[tuple[str, int, str]] = []  # ("channel_lost" | "channel_back", source, channel)

    def add(self, arrival: float, source: int, time: float, values: Values) -> Values:
        """Take a sample; returns the values that found no place (late or doubled)."""
        if time <= self.released:
            return self._refuse(time, values)
        pending = self.pending
        place = len(pending)
        while place and pending[place - 1].time > time:
            place -= 1
        if not place or pending[place - 1].time != time:
            pending.insert(place, Pending(time, arrival, dict(values), dict.fromkeys(values, source)))
            return {}
        row, doubled = pending[place - 1], {}
        for name, value in values.items():
            if name in row.values:
                doubled[name] = value
            else:
                row.values[name], row.origin[name] = value, source
        self.counts.add("doubled", doubled)
        return doubled

    def _refuse(self, time: float, values: Values) -> Values:
        known: tuple[str, ...] = next((names for when, names in self._recent if when == time), ())
        for name in values:
            self.counts.add("doubled" if name in known else "late", (name,))
        return values

    def ready(self, now: float) -> list[Pending]:
        """The rows whose time has come, in order."""
        out = []
        while self.pending:
            row = self.pending[0]
            expired = now - row.arrival >= self.window
            if not expired and not self._complete(row):
                break
            out.append(self._release(row, expired))
        return out

    def _complete(self, row: Pending) -> bool:
        """Whether nothing is due that the row lacks, and each of its streams was met before (a new one may bring brothers)."""
        time, origin, streams = row.time, row.origin, self.streams
        met = 0
        for (source, name), stream in streams.items():
            present = origin.get(name) == source
            if present:
                met += 1
                if time <= stream.due_from + 1.5 * stream.period and stream.period:
                    continue  # regular, and in its turn: the common case
            if stream.awaited(time, present):
                return False
        return met == len(origin)

    def _release(self, row: Pending, expired: bool) -> Pending:
        del self.pending[0]
        self.released = row.time
        self._recent.append((row.time, tuple(row.values)))
        for name, source in row.origin.items():
            stream = self.streams.get((source, name))
            if stream is None:
                self.streams[source, name] = Stream(row.time, row.time, row.time)
                continue
            if stream.overdue >= LOST:
                self.changes.append(("channel_back", source, name))
            stream.overdue = 0
            missing = stream.step_to(row.time)
            if missing:
                self.counts.add("missing", (name,), missing)
        if expired:
            self._give_up(row)
        return row

    def _give_up(self, row: Pending) -> None:
        """Streams that were due and did not come in time are not waited for at this instant again."""
        for (source, name), stream in self.streams.items():
            if row.origin.get(name) == source or not stream.awaited(row.time, present=False):
                continue
            if stream.period == 0.0:
                continue
            while stream.due_from + stream.period - stream.tolerance <= row.time and stream.overdue < LOST:
                stream.due_from += stream.period
                stream.overdue += 1
            if stream.overdue >= LOST:
                self.changes.append(("channel_lost", source, name))

    def flush(self) -> list[Pending]:
        """All that is left, in order: the source has ended."""
        return [self._release(self.pending[0], expired=False) for _ in range(len(self.pending))]

    def state(self) -> dict[str, Any]:
        """As JSON holds it, to the last bit."""
        return {
            "released": self.released,
            "streams": [
                [*key, {n: getattr(s, n) for n in Stream.__slots__}] for key, s in self.streams.items()
            ],
            "pending": [{n: getattr(p, n) for n in Pending.__slots__} for p in self.pending],
            "recent": list(self._recent),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what `state` gave."""
        self.released = state["released"]
        self.streams = {(source, name): Stream(**one) for source, name, one in state["streams"]}
        self.pending = [Pending(**one) for one in state["pending"]]
        self._recent = deque(((when, tuple(names)) for when, names in state["recent"]), maxlen=_RECENT)
