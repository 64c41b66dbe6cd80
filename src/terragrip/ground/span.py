"""What lasts: sections and events of a drive are spans of its time."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class Span:
    """What lasts from ``start`` to ``end`` [s] of a drive, both included: a `Section`, an `Event`."""

    start: float
    end: float

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return self.end - self.start

    def rows(self, time: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which instants ``time`` (n,) [s] lie in it."""
        return np.asarray((time >= self.start) & (time <= self.end))

    def to_dict(self) -> dict[str, Any]:
        """As ground.json holds it."""
        return dict(vars(self))
