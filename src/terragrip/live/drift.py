"""How a source's clock runs against the machine's, by its freshest samples: what drifts is followed, what is behind is set.

``lead`` is stamp less arrival, after what was corrected so far. Delays only lower it, so a clock shows in the greatest leads of
a while (Moon, Skelly and Towsley, INFOCOM 1999). Greater than before may be a clock that gains or a network that became
faster, less a clock that loses or a slower one: both are followed no faster than crystals drift. Greater than 0 is certain:
nothing arrives before it was measured.
"""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field

BLOCK = 10.0  # s of arrivals that are judged together
RATE = 2e-4  # s in a second: two crystals, 100 ppm each
_FRESHEST = 3  # the least of so many counts, so that two wild stamps do not
_LEAST = 1e-3  # s that are worth a correction
_REPORTED = 0.02  # s


@dataclass(slots=True)
class Drift:
    """``usual`` [s]: the lead that is kept, as transport takes some time; None during the first block."""

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
