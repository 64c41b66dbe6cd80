"""A source's clock against the machine's: one time base for all sources, and jumps noticed.

``lead`` is stamp less arrival. It wanders with the transport's delay: down while samples are held up, and back step by
step when they arrive in a burst. A stamp that is more than AHEAD of what is expected waits for a second one that agrees,
or for time to reach it, and is refused without: all behind it would count as late until time has caught up. Beyond JUMP,
or back by as much, the clock has jumped where samples agree on the new lead, and advance, for AGREEMENT seconds: then time
goes on without the jump. Where samples are known to be lost, stamps are taken as they are: what looks like a jump is the
hole they left.

Drift: delays only lower the lead, so a clock shows in the greatest leads of a while (Moon, Skelly and Towsley, INFOCOM 1999), after what
was corrected so far. Greater than before may be a clock that gains or a network that became faster, less a clock that loses or a slower
one: both are followed no faster than crystals drift. Greater than 0 is certain: nothing arrives before it was measured.
"""

from __future__ import annotations

from bisect import insort
from dataclasses import asdict, dataclass, field
from typing import Any

from terragrip.live.outputs import Values

AHEAD = 1.0  # s
JUMP = 10.0  # s
AGREEMENT = 1.0  # s, and how closely in s leads must agree
LOSS = 10.0  # s after samples were dropped, in which stamps may lead on by any step
SYNCHRONISED = -1.0, 0.02  # s: first leads in which a source counts as on the machine's clock already
LATE = 2.0  # s of arrivals, all behind rows already released, after which that is reported
_WAITING = 5000
_MARKS, _APART, _TOO_FAST = 4, 0.5, 50.0  # of `Pace`: marks, s between them, s a second

BLOCK = 10.0  # s of arrivals that are judged together
RATE = 2e-4  # s in a second: two crystals, 100 ppm each
_FRESHEST = 3  # the least of so many counts, so that two wild stamps do not
_LEAST = 1e-3  # s that are worth a correction
_REPORTED = 0.02  # s

Stamped = tuple[float, float, Values]  # arrival, time (or stamp while waiting), values


@dataclass(slots=True)
class Pace:
    """How fast a source's stamps advance in its first seconds, by arrivals: a time in milliseconds runs 1000 times too fast."""

    marks: list[tuple[float, float]] = field(default_factory=list)  # arrival, stamp

    def wrong(self, arrival: float, stamp: float) -> float | None:
        """Seconds of stamps in a second of arrivals, where four marks half a second apart agree on far too many; once."""
        if len(self.marks) == _MARKS or (self.marks and arrival - self.marks[-1][0] < _APART):
            return None
        self.marks.append((arrival, stamp))
        if len(self.marks) < _MARKS:
            return None
        pairs = zip(self.marks, self.marks[1:], strict=False)
        paces = [(later[1] - one[1]) / (later[0] - one[0]) for one, later in pairs]
        return paces[-1] if min(paces) > _TOO_FAST and max(paces) < 2 * min(paces) else None


@dataclass(slots=True)
class Drift:
    """How a clock runs, by its freshest samples: what drifts is followed, what is behind is set.

    ``usual`` [s]: the lead that is kept, as transport takes some time; None during the first block.
    """

    usual: float | None = None
    start: float = 0.0  # arrival of the block's first sample
    leads: list[float] = field(default_factory=list)  # the block's greatest, ascending
    total: float = 0.0  # s corrected
    reported: float = _REPORTED  # s of `total` that are next worth an event

    def correction(self, arrival: float, lead: float) -> float:
        """What stamps are to be corrected by from the next sample on [s]: 0 but at a block's end."""
        if not self.leads:
            self.start = arrival
        insort(self.leads, lead)
        del self.leads[:-_FRESHEST]
        span = arrival - self.start
        if span < BLOCK:
            return 0.0
        freshest, self.leads = self.leads[0], []
        if self.usual is None:
            self.usual = min(freshest, 0.0)
        step = self.usual - freshest
        if freshest <= 0.0:
            step = max(-RATE * span, min(step, RATE * span))
        if abs(step) < _LEAST:
            return 0.0
        self.total += step
        return step

    def behind(self) -> float:
        """s that the samples since `restart` are behind the usual lead, now corrected: all of them came too late."""
        if self.usual is None:
            self.usual = 0.0
        step = self.usual - self.leads[0]
        self.restart()
        return step

    def restart(self) -> None:
        """Begin a block: earlier leads say nothing of the coming ones."""
        self.leads = []

    def is_news(self) -> bool:
        """Whether the drift has become worth an event: at 20 ms, and where it has doubled."""
        if abs(self.total) < self.reported:
            return False
        self.reported = 2.0 * abs(self.total)
        return True


@dataclass(slots=True)
class SourceClock:
    """``align``: set this clock against the machine's and follow its drift, as several sources need; alone, stamps stay as they are.

    ``news``: what was corrected, for an event; the core clears it.
    """

    align: bool = False
    offset: float | None = None  # s, added to a stamp
    lead: float = 0.0  # of the newest stamp
    newest: float = float("-inf")  # stamp
    arrival: float = 0.0  # of the newest stamp
    loss_until: float = float("-inf")  # arrival
    waiting: list[Stamped] = field(default_factory=list)
    late_since: float | None = None  # arrival; inf once reported
    drift: Drift = field(default_factory=Drift)
    news: str = ""

    def place(
        self, arrival: float, stamp: float, values: Values
    ) -> tuple[list[Stamped], list[Stamped], float]:
        """One sample: what may go on (arrival, time, values), what is refused, and by how much the clock jumped (0: not)."""
        lead = stamp - arrival
        if self.offset is None:
            self.offset = 0.0
            if self.align and not SYNCHRONISED[0] <= lead <= SYNCHRONISED[1]:
                self.offset, self.drift.usual = -lead, 0.0
                self.news = f"its clock is {lead:+.9g} s against this machine's: corrected by the arrivals"
            self.lead = lead
        step, lossy = lead - self.lead, arrival <= self.loss_until
        if step <= AHEAD and (step >= -JUMP or stamp > self.newest or lossy):
            held, refused = self._judged_by(arrival, stamp) if self.waiting else ([], [])
            return [*held, self._accept(arrival, stamp, values)], refused, 0.0
        refused = self.give_up() if self.waiting and not self._agrees(lead) else []
        if len(self.waiting) >= _WAITING:
            refused.append(self.waiting.pop(1))
        self.waiting.append((arrival, stamp, values))
        first_arrival, first_stamp, _ = self.waiting[0]
        first_step = first_stamp - first_arrival - self.lead
        if first_step > 0.0 and (first_step <= JUMP or lossy):
            return self._accept_waiting() if len(self.waiting) > 1 else [], refused, 0.0
        if arrival - first_arrival < AGREEMENT or stamp - first_stamp < AGREEMENT / 2:
            return [], refused, 0.0
        # Time goes on as the arrivals say, on the new stamps.
        self.offset += self.newest + (first_arrival - self.arrival) - first_stamp
        self.newest = float("-inf")
        self.drift.restart()
        return self._accept_waiting(), refused, step

    def _judged_by(self, now: float, reached: float) -> tuple[list[Stamped], list[Stamped]]:
        """What waits, accepted or refused in view of a stamp as expected; neither while channels may lag by so much."""
        arrival, stamp, _ = self.waiting[0]
        if 0.0 < stamp - arrival - self.lead <= JUMP:
            if stamp <= reached:
                return self._accept_waiting(), []
            if now - arrival <= AGREEMENT:
                return [], []
        return [], self.give_up()

    def _agrees(self, lead: float) -> bool:
        """Whether a lead goes with that of the samples that wait: in a burst of slow samples it is greater by their period."""
        arrival, stamp, _ = self.waiting[0]
        greater = JUMP if 0.0 < stamp - arrival - self.lead <= JUMP else AGREEMENT
        return -AGREEMENT <= lead - (stamp - arrival) <= greater

    def _accept_waiting(self) -> list[Stamped]:
        held, self.waiting = self.waiting, []
        return [self._accept(*one) for one in held]

    def _accept(self, arrival: float, stamp: float, values: Values) -> Stamped:
        assert self.offset is not None
        if stamp > self.newest:
            self.newest, self.arrival, self.lead = stamp, arrival, stamp - arrival
        time = stamp + self.offset
        if self.align and (step := self.drift.correction(arrival, time - arrival)):
            self.offset += step
            if self.drift.is_news():
                self.news = (
                    f"its clock has drifted by {-self.drift.total:+.2g} s against this machine's: corrected"
                )
        return arrival, time, values

    def dropped(self, arrival: float) -> None:
        """Samples were lost on their way up to this arrival."""
        self.loss_until = max(self.loss_until, arrival + LOSS)

    def is_behind(self, arrival: float, late: bool) -> bool:
        """Whether with this sample, ``late`` or not, all have come too late for LATE seconds; once until one is in time."""
        if not late:
            self.late_since = None
        elif self.late_since is None:
            self.late_since = arrival
            self.drift.restart()
        elif arrival - self.late_since >= LATE:
            self.late_since = float("inf")
            return True
        return False

    def set_by_arrivals(self, least: float) -> float:
        """All samples of a while came too late: how far stamps are now set forward [s]; 0 where that is not above ``least``, or alone."""
        assert self.offset is not None
        if not self.align or not self.drift.leads:
            return 0.0
        step = self.drift.behind()
        if step <= least:
            return 0.0
        self.offset += step
        self.late_since = None
        return step

    def give_up(self) -> list[Stamped]:
        """The samples that wait, now refused: no more will come to agree with them."""
        held, self.waiting = self.waiting, []
        return held

    def state(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self)

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> SourceClock:
        """The inverse of `state`."""
        waiting = [(arrival, stamp, values) for arrival, stamp, values in state["waiting"]]
        return cls(**{**state, "waiting": waiting, "drift": Drift(**state["drift"])})
