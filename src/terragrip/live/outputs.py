"""What comes out of the core: rows with their estimates, refusals, states of the ground, and events: a source lost, a clock that jumped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from terragrip.estimation.estimator import Estimate
    from terragrip.ground.live import GroundState

Values = dict[str, float]


@dataclass(frozen=True, slots=True)
class Event:
    """``time`` [s] on the samples' time base; ``kind`` of `terragrip.log_events.LIVE`; the ``source`` or sink; ``text`` one sentence."""

    time: float
    kind: str
    source: str
    text: str

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it; a time before the first sample is null."""
        time = self.time if self.time == self.time and abs(self.time) != float("inf") else None
        return {"time": time, "kind": self.kind, "source": self.source, "text": self.text}


@dataclass(slots=True)
class Row:
    """A row that went into the estimator, and its estimate; ``arrival`` [s] of its first sample."""

    arrival: float
    values: Values
    estimate: Estimate
    predicted: bool = False


@dataclass(frozen=True, slots=True)
class Refusal:
    """A sample, or part of one, that did not get to the estimator."""

    arrival: float
    time: float
    source: int
    why: str
    values: Values


Output: TypeAlias = "Row | Event | Refusal | GroundState"
