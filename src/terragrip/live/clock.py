"""A source's clock against the machine's: one time base for all sources, and jumps noticed.

``lead`` is stamp less arrival. It wanders with the transport's delay, by far less than JUMP; a clock that was set changes
it by more, and keeps the new lead. A backlog that arrives in a burst changes it too, but does not keep it: so a jump
counts only when samples agree on the new lead for AGREEMENT seconds. Until then they wait; what disagrees is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

JUMP = 10.0  # s
AGREEMENT = 1.0  # s, and how closely in s leads must agree
SYNCHRONISED = 1.0  # s: stamps this close to the machine's clock are on it already
_WAITING = 5000

Values = dict[str, float]
Stamped = tuple[float, float, Values]  # arrival, time (or stamp while waiting), values


@dataclass(slots=True)
class SourceClock:
    """``align``: set this clock against the machine's, as several sources need; alone, stamps stay as they are."""

    align: bool = False
    offset: float | None = None  # s, added to a stamp
    lead: float = 0.0
    newest: float = float("-inf")  # stamp
    time: float = float("-inf")
    arrival: float = 0.0
    waiting: list[Stamped] = field(default_factory=list)

    def steady(self, arrival: float, stamp: float) -> float | None:
        """The time of a sample where its stamp is as expected and none waits, as nearly always; None where `take` must look."""
        lead = stamp - arrival
        if self.offset is None or self.waiting or not -JUMP <= lead - self.lead <= JUMP:
            return None
        self.lead = lead
        if stamp > self.newest:
            self.newest = stamp
        time = stamp + self.offset
        if time > self.time:
            self.time, self.arrival = time, arrival
        return time

    def take(self, arrival: float, stamp: float, values: Values) -> tuple[list[Stamped], list[Values], float]:
        """One sample: what may go on (arrival, time, values), values refused, and by how much the clock jumped (0: not)."""
        lead = stamp - arrival
        if self.offset is None:
            self.offset = -lead if self.align and abs(lead) > SYNCHRONISED else 0.0
            self.lead = lead
        if abs(lead - self.lead) <= JUMP:
            refused = [waiting[2] for waiting in self.waiting]
            self.waiting.clear()
            return [self._accept(arrival, stamp, values)], refused, 0.0
        refused = []
        if self.waiting and abs(lead - (self.waiting[0][1] - self.waiting[0][0])) > AGREEMENT:
            refused = [waiting[2] for waiting in self.waiting]
            self.waiting.clear()
        if len(self.waiting) >= _WAITING:
            refused.append(self.waiting.pop(1)[2])
        self.waiting.append((arrival, stamp, values))
        if arrival - self.waiting[0][0] < AGREEMENT:
            return [], refused, 0.0
        jump = lead - self.lead
        return self._jump(), refused, jump

    def _accept(self, arrival: float, stamp: float, values: Values) -> Stamped:
        assert self.offset is not None
        time = stamp + self.offset
        self.lead, self.newest = stamp - arrival, max(self.newest, stamp)
        if time > self.time:
            self.time, self.arrival = time, arrival
        return arrival, time, values

    def _jump(self) -> list[Stamped]:
        """Let time go on as the arrivals say, on the new stamps."""
        arrival, stamp, _ = self.waiting[0]
        self.offset = self.time + (arrival - self.arrival) - stamp
        self.newest = float("-inf")
        held, self.waiting = self.waiting, []
        return [self._accept(*one) for one in held]

    def state(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {name: getattr(self, name) for name in self.__slots__}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> SourceClock:
        """The inverse of `state`."""
        found = cls(**state)
        found.waiting = [(a, s, v) for a, s, v in state["waiting"]]
        return found
