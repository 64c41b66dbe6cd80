"""What happens beside the estimates: a source lost, a clock that jumped, a payload nobody can read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from terragrip.log_events import LIVE

KINDS = LIVE


@dataclass(frozen=True, slots=True)
class Event:
    """``time`` [s] on the samples' time base; ``kind`` of `KINDS`; ``source`` or sink it concerns; ``text`` one sentence."""

    time: float
    kind: str
    source: str
    text: str

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it; a time before the first sample is null."""
        time = self.time if self.time == self.time and abs(self.time) != float("inf") else None
        return {"time": time, "kind": self.kind, "source": self.source, "text": self.text}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Event:
        """The inverse of `to_dict`."""
        time = float("nan") if data["time"] is None else float(data["time"])
        return cls(time, data["kind"], data["source"], data["text"])
