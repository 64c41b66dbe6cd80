"""The running status of many vehicles on a terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from terragrip.estimation.columns import wheels_with

if TYPE_CHECKING:
    from terragrip.live.many.service import ManyService
    from terragrip.live.vehicle_run import VehicleRun

_MOST = 20  # lines


def table(service: ManyService) -> Any:
    """The vehicles that get no data first, then the others by name; and how many there are."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    runs, unready = service.vehicles.runs, service.monitor.unready()
    rate = sum(run.statistics.row_rate for run in runs.values())
    waiting = sum(len(run.inbox.samples) for run in runs.values())
    head = f"{len(runs)} vehicles   {rate:.0f} rows/s   {waiting} waiting   {sum(map(len, service.outboxes))} before sinks"
    shown = Table("vehicle", "rows/s", "delay ms", "speed m/s", "slip up to %", "state")
    names = [*sorted(unready), *sorted(runs.keys() - unready.keys())]
    for name in names[:_MOST]:
        run = runs.get(name)
        numbers = ("—",) * 4 if run is None else _numbers(run)
        last = None if run is None else run.statistics.last
        event = "" if last is None else last.estimate.event or "driving"
        shown.add_row(name, *numbers, unready.get(name) or event)
    parts: list[Any] = [Text(head), shown]
    if len(names) > _MOST:
        parts.append(Text(f"and {len(names) - _MOST} more"))
    return Group(*parts)


def _numbers(run: VehicleRun) -> tuple[str, str, str, str]:
    s = run.statistics
    if s.last is None:
        return f"{s.row_rate:.0f}", "—", "—", "—"
    estimate = s.last.estimate
    slips = [abs(estimate[f"slip_{wheel}"]) for wheel in wheels_with("slip", estimate.places)]
    known = [slip for slip in slips if math.isfinite(slip)]
    slip = f"{100 * max(known):.0f}" if known else "—"
    return f"{s.row_rate:.0f}", f"{1e3 * s.delay:.1f}", f"{estimate.ground_speed:.2f}", slip
