"""Samples into rows in the order of time, as soon as nothing earlier can be expected, and never later than a window.

Channels of a source that have always come together are a stream; a regular one has a period, the median of its last steps.
The earliest row waits for streams that are due by its instant, for at most ``window`` seconds after it came. So in good
order nothing waits (an estimate follows its sample at once), a sample out of order finds its place, and parts of one
instant or of one cycle (`terragrip.recording.cycles`) that come in several messages become one row. A stream that stays away for LOST
periods is no longer waited for.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

from terragrip.live.counts import Counts
from terragrip.live.outputs import Values
from terragrip.recording.cycles import CYCLE

LOST = 5  # periods
DOUBLED = 100  # values of a channel, after which it is reported where they are over half of its own
BUNDLES = 20  # holes behind bundles of samples, after which these are reported
_LONG = 10  # samples that such a hole lacks at least
_LARGEST = 50  # samples of a bundle
_STEPS = 15  # of which the median is the period
_FEWEST = 4  # steps before a period is known
_LEARNING = 2.0  # s after which a stream without a period counts as irregular
_RECENT = 512  # rows remembered to tell a doubled sample from a late one
_LAYOUTS = 256  # sets of channels whose streams are kept
_BEGINNING = float("-inf")
_HOW = "send the time of each"


@dataclass(slots=True)
class Stream:
    """Channels of one source that have always come together, in the order of time."""

    source: int
    channels: tuple[str, ...]
    first: float
    last: float
    due_from: float  # instant from which the next sample is one period away
    period: float = 0.0  # s; 0 = not known yet, inf = irregular
    tolerance: float = 0.0  # s
    steps: deque[float] = field(default_factory=lambda: deque(maxlen=_STEPS))
    count: int = 0
    overdue: int = 0
    hole: float = float("inf")  # s: a longer step is one over missing samples
    calm: float = _BEGINNING  # up to this instant nothing is missing
    holes: int = 0  # that lack `_LONG` samples and more

    def step_to(self, time: float) -> int:
        """A sample at ``time``; returns how many are missing before it."""
        step = time - self.last
        missing = round(step / self.period) - 1 if step > self.hole else 0
        self.holes += missing >= _LONG
        self.steps.append(step)
        count = self.count = self.count + 1
        # Often at first, then now and then: a period hardly changes.
        if not count % 8 or _FEWEST <= count < 2 * _STEPS:
            self._learn()
        self.last = self.due_from = time
        self.calm = time + 1.5 * self.period
        return missing

    def give_up(self) -> None:
        """The sample that is due will not come."""
        self.due_from += self.period
        self.calm += self.period
        self.overdue += 1

    def _learn(self) -> None:
        steps = sorted(self.steps)
        period = steps[len(steps) // 2]
        spread = sorted(abs(step - period) for step in steps)[len(steps) // 2]
        self.tolerance = 4.0 * spread + 1e-6 * period
        regular = self.tolerance < 0.4 * period
        self.period, self.hole = (period, 1.5 * period) if regular else (float("inf"), float("inf"))

    def awaited(self, time: float, present: bool) -> bool:
        """Whether a row at ``time``, with or without a sample of this stream, should wait for it."""
        if self.overdue >= LOST:
            return False
        if self.period == 0.0:
            return time - self.first < _LEARNING
        if present:
            return time > self.calm
        return self.due_from + self.period - self.tolerance <= time

    def without(self, channels: Collection[str]) -> Stream:
        """The same past for the channels that are not among these."""
        rest = tuple(name for name in self.channels if name not in channels)
        return replace(self, channels=rest, steps=deque(self.steps, _STEPS))


Parts = tuple[tuple[int, tuple[str, ...]], ...]
"""Sources and the channels that each gave."""


@dataclass(slots=True)
class Pending:
    """A row to be: ``values`` by channel, and ``parts``, which source gave which."""

    time: float
    arrival: float
    values: Values
    parts: Parts

    def merge(self, source: int, values: Values) -> Values:
        """Add what the row has not yet; returns what it has."""
        new = {name: value for name, value in values.items() if name not in self.values}
        if new:
            self.values = {**self.values, **new}  # not in place: what came in belongs to others too
            self.parts = (*self.parts, (source, tuple(new)))
        return {name: value for name, value in values.items() if name not in new}


_Layout = tuple[list[Stream], list[Stream], bool]


class Reorder:
    """The buffer; ``counts`` counts what is late, doubled and missing.

    ``cycle``: time [s] within which samples of different streams are of one row; None: by the shortest period of the streams.
    """

    def __init__(self, window: float, counts: Counts, cycle: float | None = None) -> None:
        self.window = window
        self.counts = counts
        self.cycle = cycle
        self.streams: list[Stream] = []
        self._layouts: dict[Parts, _Layout] = {}
        self.pending: list[Pending] = []
        self.released = _BEGINNING
        self._recent: deque[tuple[float, tuple[str, ...]]] = deque(maxlen=_RECENT)
        self.changes: list[tuple[str, int, str]] = []  # to be reported: kind of event, source, sentence

    def add(self, arrival: float, source: int, time: float, values: Values) -> Values:
        """Add a sample; returns the values that found no place (late or doubled)."""
        if time <= self.released:
            return self._refuse(source, time, values)
        pending = self.pending
        place = len(pending)
        while place and pending[place - 1].time > time:
            place -= 1
        if not place or pending[place - 1].time != time:
            pending.insert(place, Pending(time, arrival, values, ((source, tuple(values)),)))
            return {}
        doubled = pending[place - 1].merge(source, values)
        self._count_doubled(source, doubled)
        return doubled

    def _refuse(self, source: int, time: float, values: Values) -> Values:
        known: tuple[str, ...] = next((names for when, names in self._recent if when == time), ())
        self._count_doubled(source, [name for name in values if name in known])
        self.counts.add("late", [name for name in values if name not in known])
        return values

    def _count_doubled(self, source: int, names: Collection[str]) -> None:
        self.counts.add("doubled", names)
        by = self.counts.by_channel
        most = [n for n in names if by[n]["doubled"] == DOUBLED and by[n]["received"] < 2 * DOUBLED]
        if most:
            text = f"{', '.join(most)}: over half of the samples have the stamp of the one before, and are refused: {_HOW}"
            self.changes.append(("late", source, text))

    def ready(self, now: float) -> list[Pending]:
        """The rows whose time has come, in order."""
        out = []
        while self.pending:
            row = self.pending[0]
            layout = self._layouts.get(row.parts) or self._streams_of(row)
            expired = now - row.arrival >= self.window
            cycle = self._cycle()
            if not expired and not self._is_complete(row.time, layout, cycle):
                break
            last = self._join_cycle(cycle)
            if last > row.time:
                layout = self._layouts.get(row.parts) or self._streams_of(row)
            out.append(self._release(row, layout, expired, last))
        return out

    def _cycle(self) -> float:
        if self.cycle is not None:
            return self.cycle
        if len(self.streams) < 2:
            return 0.0
        shortest = min((s.period for s in self.streams if s.period > 0.0), default=0.0)
        return CYCLE * shortest if shortest < float("inf") else 0.0

    def _join_cycle(self, cycle: float) -> float:
        """Put the rows of the first one's cycle into it, where no channel is in two of them; returns the instant of the last of them.

        A row as near behind the one before it is of a burst, of which none are joined.
        """
        pending, end = self.pending, 1
        last = pending[0].time
        if last - self.released <= cycle:
            return last
        while end < len(pending) and pending[end].time - pending[end - 1].time <= cycle:
            end += 1
        names = [name for row in pending[:end] for name in row.values]
        if end == 1 or len(set(names)) < len(names):
            return last
        for row in pending[1:end]:
            for source, channels in row.parts:
                pending[0].merge(source, {name: row.values[name] for name in channels})
            last = row.time
            self._recent.append((last, tuple(row.values)))
        del pending[1:end]
        return last

    def _is_complete(self, time: float, layout: _Layout, cycle: float) -> bool:
        """Whether the first row lacks nothing that is due, and its channels were known (a new one may belong to others still to come)."""
        present, absent, known = layout
        for stream in present:
            if time > stream.calm and stream.awaited(time, True):
                return False
        for stream in absent:
            if stream.awaited(time + cycle, False) and not self._has_come(stream):
                return False
        return known

    def _has_come(self, stream: Stream) -> bool:
        """Whether the sample that is due is here, with a stamp behind the first row's: on a bus frames come a little sooner or later."""
        latest, lacking = stream.due_from + 1.5 * stream.period, set(stream.channels)
        for row in self.pending[1:]:
            for source, names in row.parts:
                if row.time <= latest and source == stream.source:
                    lacking.difference_update(names)
        return not lacking

    def _streams_of(self, row: Pending) -> _Layout:
        """The streams that the row holds and those it lacks, and whether these are all its channels.

        A stream of which the row holds a part only becomes two.
        """
        origin = {name: source for source, names in row.parts for name in names}
        present: list[Stream] = []
        absent: list[Stream] = []
        for stream in list(self.streams):
            mine = [name for name in stream.channels if origin.get(name) == stream.source]
            if mine and len(mine) < len(stream.channels):
                rest = stream.without(mine)
                stream.channels = tuple(mine)
                self.streams.append(rest)
                self._layouts.clear()
                absent.append(rest)
            (present if mine else absent).append(stream)
        known = sum(len(stream.channels) for stream in present) == len(origin)
        if len(self._layouts) < _LAYOUTS:
            self._layouts[row.parts] = present, absent, known
        return present, absent, known

    def _release(self, row: Pending, layout: _Layout, expired: bool, last: float) -> Pending:
        present, absent, known = layout
        del self.pending[0]
        self.released = last
        self._recent.append((row.time, row.parts[0][1] if len(row.parts) == 1 else tuple(row.values)))
        holes = []
        for stream in present:
            if stream.overdue >= LOST:
                self._report("channel_back", stream, "again")
            stream.overdue = 0
            holes.append(self._step(stream, row.time))
        if expired:
            self._give_up(row.time, absent, is_hole=bool(holes) and all(holes))
        if not known:
            self._begin(row, {(stream.source, name) for stream in present for name in stream.channels})
        return row

    def _step(self, stream: Stream, time: float) -> int:
        missing = stream.step_to(time)
        if missing:
            self.counts.add("missing", stream.channels, missing)
            if missing >= _LONG and stream.holes == BUNDLES and stream.count <= BUNDLES * _LARGEST:
                self._report("late", stream, f"in bundles, stamped as these arrive: {_HOW}")
        return missing

    def _report(self, kind: str, stream: Stream, how: str) -> None:
        come = "comes" if len(stream.channels) == 1 else "come"
        self.changes.append((kind, stream.source, f"{', '.join(stream.channels)} {come} {how}"))

    def _begin(self, row: Pending, old: Collection[tuple[int, str]]) -> None:
        """Begin a stream for each source's channels that no stream holds yet."""
        for source in dict.fromkeys(source for source, _ in row.parts):
            new = tuple(n for s, names in row.parts for n in names if s == source and (s, n) not in old)
            if new:
                self.streams.append(Stream(source, new, row.time, row.time, row.time))
        self._layouts.clear()

    def _give_up(self, time: float, absent: list[Stream], is_hole: bool) -> None:
        """Streams that were due and did not come in time are not waited for at this instant again.

        ``is_hole``: nothing came before this row, of its own streams neither; so no stream is to blame for more than this instant.
        """
        for stream in absent:
            if stream.period == 0.0 or not stream.awaited(time, present=False):
                continue
            if is_hole:
                stream.due_from, stream.calm = time - stream.period, time + 0.5 * stream.period
            while stream.due_from + stream.period - stream.tolerance <= time and stream.overdue < LOST:
                stream.give_up()
            if stream.overdue >= LOST:
                self._report("channel_lost", stream, "no longer")

    def flush(self) -> list[Pending]:
        """All that is left, in order: the source has ended."""
        out = []
        while self.pending:
            row = self.pending[0]
            last = self._join_cycle(self._cycle())
            out.append(self._release(row, self._streams_of(row), expired=False, last=last))
        return out

    def state(self) -> dict[str, Any]:
        """As JSON holds it, to the last bit."""
        return {
            "released": self.released,
            "streams": [
                {**{n: getattr(s, n) for n in Stream.__slots__}, "steps": list(s.steps)} for s in self.streams
            ],
            "pending": [{n: getattr(p, n) for n in Pending.__slots__} for p in self.pending],
            "recent": list(self._recent),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what `state` gave."""
        self.released = state["released"]
        self.streams = [
            Stream(**{**one, "channels": tuple(one["channels"]), "steps": deque(one["steps"], _STEPS)})
            for one in state["streams"]
        ]
        self._layouts.clear()
        self.pending = [
            Pending(**{**one, "parts": tuple((source, tuple(names)) for source, names in one["parts"])})
            for one in state["pending"]
        ]
        self._recent = deque(((when, tuple(names)) for when, names in state["recent"]), maxlen=_RECENT)
