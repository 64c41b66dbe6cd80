"""Estimates while nothing comes in: ahead of the last row, with growing intervals, on a copy of the filter.

The filter itself does not move: samples that were only delayed find it as if nothing had happened.
"""

from __future__ import annotations

from terragrip.estimation.engine_estimator import restored
from terragrip.estimation.estimator import TractionEstimator
from terragrip.live.core import Core
from terragrip.live.outputs import Row

_PATIENCE = 0.3  # s of silence, or
_PERIODS = 5.0  # rows' periods


class Prediction:
    """Predicted rows, at most one a call, and none after ``longest`` s of silence."""

    def __init__(self, longest: float = float("inf")) -> None:
        self._longest = longest
        self._copy: TractionEstimator | None = None
        self._rows, self._time = -1, float("-inf")

    def at(self, core: Core, now: float, last_arrival: float, period: float) -> Row | None:
        """The row at the arrival clock's ``now``, or None: nothing came yet, or something came just now."""
        silence = now - last_arrival
        if core.estimator is None or not core.rows or silence < max(_PATIENCE, _PERIODS * period):
            return None
        if silence > self._longest:
            self._copy = None
            return None
        if self._copy is None or self._rows != core.rows:
            self._copy, self._rows = restored(core.estimator.snapshot()), core.rows
            self._time = core.time
        time = core.time + silence
        if time <= self._time:  # what came meanwhile was no row: the silence counts anew
            return None
        self._time = time
        return Row(now, {}, self._copy.update({"time": time}), predicted=True)
