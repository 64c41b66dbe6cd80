"""What comes out of the core: rows with their estimates, refusals, states of the ground, and events: a source lost, a clock that jumped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True, slots=True)
class Ground:
    """The ground at the end of half a second: the most probable soil, the probability of each, and a change reported now."""

    time: float
    soil: str
    probabilities: Mapping[str, float]
    change: Mapping[str, float] | None  # time, std, probability

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "time": self.time,
            "soil": self.soil,
            "probability": self.probabilities[self.soil],
            "probabilities": dict(self.probabilities),
            "change": None if self.change is None else dict(self.change),
        }


Output = Row | Event | Refusal | Ground


def of_ground(state: GroundState) -> list[Output]:
    """A block's state as outputs of ours; with an event where the ground changes."""
    change = state.change
    if change is None:
        return [Ground(state.time, state.soil, state.probabilities, None)]
    numbers = {"time": change.time, "std": change.std, "probability": change.probability}
    text = (
        f"the ground changed at {change.time:.1f} ± {change.std:.1f} s, probability {change.probability:.2f}"
    )
    return [
        Ground(state.time, state.soil, state.probabilities, numbers),
        Event(state.time, "ground_change", "ground", text),
    ]
