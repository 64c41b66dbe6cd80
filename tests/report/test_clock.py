"""Times in the report: by the clock where the log has a date, in hours and minutes where the run is long."""

from __future__ import annotations

from datetime import UTC, datetime

from terragrip.figures import new_figure
from terragrip.report.clock import Clock


def axis(clock: Clock, low: float, high: float) -> tuple[str, list[str]]:
    plot = new_figure().subplots()
    plot.set_xlim(low, high)
    clock.mark(plot)
    return plot.get_xlabel(), [label.get_text() for label in plot.get_xticklabels()]


def test_times_are_read_by_the_clock_or_in_hours_or_in_seconds() -> None:
    dated = Clock(datetime(2026, 10, 14, 7, 59, 50, tzinfo=UTC), 40.0)
    assert dated.span(0.0, 10.4) == "07:59:50 to 08:00:00"
    label, marks = axis(dated, 0.0, 40.0)
    assert label == "time of day on 2026-10-14 [UTC]"
    assert marks[:3] == ["07:59:50", "07:59:55", "08:00:00"]
    long = Clock(None, 14_400.0)
    assert long.span(3725.4, 3726.0) == "1:02:05 to 1:02:06"
    label, marks = axis(long, 0.0, 14_400.0)
    assert label == "time [h:mm:ss]"
    assert marks == [f"{k // 2}:{30 * (k % 2):02d}:00" for k in range(9)]
    assert Clock(None, 40.0).span(12.3, 40.0) == "12 to 40 s"
    assert axis(Clock(None, 40.0), 0.0, 40.0)[0] == "time [s]"
