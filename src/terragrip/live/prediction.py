"""Estimates while nothing comes in: ahead of the last row, with growing intervals, on a copy of the filter.

The filter itself does not move: samples that were only delayed find it as if nothing had happened.
"""

from __future__ import annotations

from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.slip_estimator import SlipEstimator, restored
from terragrip.live.core import Core, Row

_PATIENCE = 0.3  # s of silence, or
_PERIODS = 5.0  # rows' periods


class Prediction:
    """Predicted rows, at most one a call."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._copy: TractionEstimator | SlipEstimator | None = None
        self._rows = -1

    def at(self, now: float, last_arrival: float, period: float) -> Row | None:
        """The row at the arrival clock's ``now``, or None: nothing came yet, or it came just now."""
        core = self._core
        silence = now - last_arrival
        if core.estimator is None or not core.rows or silence < max(_PATIENCE, _PERIODS * period):
            return None
        if self._copy is None or self._rows != core.rows:
            self._copy, self._rows = restored(core.estimator.snapshot()), core.rows
        estimate = self._copy.update({"time": core.time + silence})
        return Row(now, {}, estimate, predicted=True)
