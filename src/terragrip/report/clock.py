"""Times of a run as readers read them: by the clock where the log has a date, else h:mm:ss from ten minutes on, else seconds."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from terragrip.report.page import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LONG = 600.0
"""Runs from here on are read in hours, minutes and seconds [s]."""
STEPS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400)
"""Between the marks of an axis [s]."""
MARKS = 9
"""Of an axis at most."""


@dataclass(frozen=True)
class Clock:
    """`began`: the date of a run's time 0, where its log has one; `seconds`: how long the run lasts."""

    began: datetime | None = None
    seconds: float = 0.0

    def text(self, time: float, digits: int = 0) -> str:
        """A time [s] of the run."""
        if self.began is not None:
            return f"{self.began + timedelta(seconds=round(time)):%H:%M:%S}"
        if self.seconds >= LONG:
            whole = round(abs(time))
            return f"{'−' * (time < 0 < whole)}{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
        return f"{number(time, digits)} s"

    def span(self, start: float, end: float) -> str:
        """From one time [s] to another."""
        return f"{self.text(start).removesuffix(' s')} to {self.text(end)}"

    def mark(self, plot: Axes) -> None:
        """Mark and name a horizontal axis of time whose limits are set [s]."""
        zone = " [UTC]" if self.began is not None and self.began.utcoffset() == timedelta(0) else ""
        low, high = plot.get_xlim()
        if self.began is not None:
            plot.set_xlabel(f"time of day on {self.began + timedelta(seconds=low):%Y-%m-%d}{zone}")
        elif self.seconds >= LONG:
            plot.set_xlabel("time [h:mm:ss]")
        else:
            plot.set_xlabel("time [s]")
            return
        zero = (
            0.0
            if self.began is None
            else (self.began - self.began.replace(hour=0, minute=0, second=0)).total_seconds()
        )
        step = next(
            (one for one in STEPS if (high - low) / one <= MARKS),
            86400 * np.ceil((high - low) / 86400 / MARKS),
        )
        at = np.arange(np.ceil((low + zero) / step), np.floor((high + zero) / step) + 1) * step - zero
        plot.set_xticks(at, [self.text(float(one)) for one in at])
