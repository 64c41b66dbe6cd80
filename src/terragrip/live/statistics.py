"""What the service shows of itself: rates, delays, drops, the last estimate and event."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from terragrip.live.core import Core
from terragrip.live.feed import Feed
from terragrip.live.inbox import Inbox
from terragrip.live.outbox import Outbox
from terragrip.live.outputs import Event, Row

if TYPE_CHECKING:
    from terragrip.ground.live import GroundState

_BEHIND = 1.0  # s
_EVERY = 5.0  # s between two events that estimates are behind
_TURNING = ("wheel_speed_", "wheel_based_speed", "engine_speed")


class Statistics:
    """Numbers of the last whole second, and of the run."""

    def __init__(
        self, core: Core, inbox: Inbox, feeds: Sequence[Feed], outboxes: Sequence[Outbox], is_real_time: bool
    ) -> None:
        self._core, self._inbox, self._outboxes = core, inbox, outboxes
        self.is_real_time = is_real_time
        now = inbox.clock()
        self.last_arrival = now
        self.period = 0.0  # s between rows, lately
        self.row_rate = self.sample_rate = self.delay = 0.0
        self.last: Row | None = None
        self.ground: GroundState | None = None
        self.events: deque[Event] = deque(maxlen=50)
        self.event_counts: dict[str, int] = {}
        self.feeds = feeds
        # Of this run, measured rows alone; a record's rows of earlier runs are in `Core.rows`.
        self.rows = self.samples_in = self.predicted_rows = self.filter_restarts = 0
        self.delays = 0.0  # s, the sum over `rows`
        self.nis = self.nis_expected = 0.0  # sums over `rows`; expected: as many as channels were taken
        self.last_row = now
        self._began = now  # the second that runs
        self._before = (0, 0, 0.0)  # rows, samples, delays when it began
        self._behind = now - _EVERY
        self._dropped = 0

    def now(self) -> float:
        """s since 1970, by the clock of arrivals."""
        return self._inbox.clock()

    @property
    def window(self) -> float:
        """s that a row may wait for late samples."""
        return self._core.settings.window

    def samples(self, count: int, arrival: float) -> None:
        """Samples went into the core, the last one of this arrival."""
        self.samples_in += count
        if arrival > self.last_arrival:
            self.last_arrival = arrival

    def row(self, row: Row, now: float) -> None:
        """A row came out of it."""
        before, self.last = self.last, row
        if row.predicted:
            self.predicted_rows += 1
            return
        if before is not None and not before.predicted:
            self.period += 0.1 * (row.estimate.time - before.estimate.time - self.period)
        self.rows += 1
        self.delays += now - row.arrival
        self.last_row = now
        values, places = row.estimate.values, row.estimate.places
        nis = values[places["nis"]]
        if nis == nis:
            self.nis += nis
            self.nis_expected += values[places["channels"]]
        if row.estimate.event == "restart":
            self.filter_restarts += 1

    def event(self, event: Event) -> None:
        """An event was published."""
        self.events.append(event)
        self.event_counts[event.kind] = self.event_counts.get(event.kind, 0) + 1

    def watch(self, now: float) -> None:
        """Report sources that fall silent or send again, and estimates that are behind."""
        for feed in self.feeds:
            feed.watch(now, self.period)
        samples = self._inbox.samples
        lag = now - samples[0][0] if samples else 0.0
        dropped, self._dropped = self._inbox.values_dropped - self._dropped, self._inbox.values_dropped
        if (lag > _BEHIND or dropped) and now - self._behind >= _EVERY:
            self._behind = now
            text = f"estimates are {lag:.2g} s behind; {dropped} values dropped just now"
            self._inbox.event("behind", "service", text)

    def second(self, now: float) -> bool:
        """Whether a second is over; then its rates are worked out."""
        span = now - self._began
        if span < 1.0:
            return False
        rows, samples, delays = self._before
        rows = self.rows - rows
        self.row_rate, self.sample_rate = rows / span, (self.samples_in - samples) / span
        self.delay = (self.delays - delays) / rows if rows else 0.0
        self._began, self._before = now, (self.rows, self.samples_in, self.delays)
        return True

    def to_dict(self) -> dict[str, Any]:
        """The status, as sinks get it."""
        core = self._core
        result: dict[str, Any] = {
            "time": core.time if core.rows else None,
            "rows": core.rows,
            "row_rate": round(self.row_rate, 2),
            "sample_rate": round(self.sample_rate, 2),
            "waiting": len(self._inbox.samples),
            "counts": core.counts.state(),
            "events": dict(self.event_counts),
            "sinks": {box.uri.name: {"sent": box.sent, "dropped": box.dropped} for box in self._outboxes},
        }
        if core.learner is not None and core.estimator is not None:
            result["learned"] = dict(zip(("noise", "held"), core.learner.used(core.estimator), strict=True))
        if self.is_real_time:  # a replay's rows arrive at their own stamps, and its pauses are the file's
            now = self._inbox.clock()
            silent = [why for feed in self.feeds if (why := feed.why_old(now))]
            result |= {"delay": self.delay, "silent": silent}
        return result

    def summary(self) -> str:
        """The run in a few lines of text."""
        core = self._core
        lines = [f"{core.rows} rows estimated" + (f", up to {core.when}" if core.rows else "")]
        if core.rows and not any(name.startswith(_TURNING) for name in core.counts.by_channel):
            lines.append("no wheel's speed came: there is no slip or traction in these rows")
        for fate in ("missing", "late", "doubled", "dropped", "unreadable", "clock"):
            by = {name: mine[fate] for name, mine in core.counts.by_channel.items() if mine[fate]}
            if by:
                lines.append(f"{fate}: " + _by_number(by))
        late, received = core.counts.total("late"), core.counts.total("received")
        if late > 0.01 * received:
            lines.append(f"{late} of {received} values came too late: a longer --window accepts them")
        lossy = {box.uri.name: box.dropped for box in self._outboxes if box.dropped}
        if lossy:
            lines.append("messages dropped by slow sinks: " + _by_number(lossy))
        if core.learner is not None and core.estimator is not None:
            lines += _learned(*core.learner.used(core.estimator))
        if self.event_counts:
            lines.append(
                "events: " + ", ".join(f"{kind} {number}" for kind, number in self.event_counts.items())
            )
        return "\n".join(lines)


def _learned(noise: dict[str, float], held: dict[str, float]) -> list[str]:
    lines = []
    if noise:
        lines.append("noise learned: " + ", ".join(f"{name} {sd:.3g}" for name, sd in noise.items()))
    if held:
        periods = ", ".join(f"{name} {period:.3g} s" for name, period in held.items())
        lines.append("held channels learned, and their periods: " + periods)
    return lines


def _by_number(numbers: dict[str, int]) -> str:
    """``2 each of a, b; 1 of c``."""
    alike: dict[int, list[str]] = {}
    for name, number in numbers.items():
        alike.setdefault(number, []).append(name)
    return "; ".join(
        f"{number} {'each of' if len(names) > 1 else 'of'} {', '.join(names)}"
        for number, names in alike.items()
    )
