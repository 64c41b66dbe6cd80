"""The running status on a terminal, of one vehicle or of many."""

from __future__ import annotations

import asyncio
import logging
import math
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from terragrip.estimation.columns import wheels_with
from terragrip.live.message import EVENT, Message
from terragrip.live.outputs import Row
from terragrip.recording.columns import SINCE_1970

if TYPE_CHECKING:
    from terragrip.live.many.service import ManyService
    from terragrip.live.service import Service
    from terragrip.live.vehicle_run import VehicleRun

_STEP = 0.25  # s
_MOST = 20  # lines of vehicles
_TROUBLE = ("late", "doubled", "missing", "dropped", "unreadable", "clock")


@asynccontextmanager
async def shown(
    screen: Callable[[], Any], listeners: list[Callable[[Message], None]], quiet: bool
) -> AsyncIterator[None]:
    """Show the status on standard error while the block runs: on a terminal ``screen`` as rich shows it, elsewhere one line an event."""
    if not quiet and sys.stderr.isatty():
        task = asyncio.create_task(_refresh(screen))
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        return
    if not quiet and not logging.getLogger("terragrip").isEnabledFor(logging.INFO):  # else the log says it
        listeners.append(_print_event)
    yield


async def _refresh(screen: Callable[[], Any]) -> None:
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:
        while True:
            live.update(screen(), refresh=True)
            await asyncio.sleep(_STEP)


def _print_event(message: Message) -> None:
    if message.kind == EVENT and message.data is not None:
        event, whose = message.data, f"{message.vehicle}: " if message.vehicle else ""
        print(f"{whose}{event['kind']}: {event['source']}: {event['text']}", file=sys.stderr)


def table(service: Service) -> Any:
    """Rates, drops, slip, adhesion, the ground and the last events, as rich shows them."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    parts: list[Any] = [Text(line) for line in head(service)]
    row = service.statistics.last
    if row is not None:
        parts.append(_wheels(row, Table))
    trouble = counts_table(service, Table)
    if trouble is not None:
        parts.append(trouble)
    parts += [
        Text(f"{_seconds(e.time)}  {e.kind}: {e.source}: {e.text}")
        for e in list(service.statistics.events)[-4:]
    ]
    return Group(*parts)


def _seconds(time: float) -> str:
    """An event's time, of day where it counts from 1970; before the first sample there is none."""
    if SINCE_1970 < time < 1e11:
        return f"{datetime.fromtimestamp(time, UTC):%H:%M:%S UTC}"
    return f"{time:9.1f} s" if math.isfinite(time) else f"{'—':>9}  "


def head(service: Service) -> list[str]:
    """The lines above the tables."""
    s, core = service.statistics, service.core
    delay = f"delay {1e3 * s.delay:.1f} ms   " if service.is_real_time else ""
    lines = [
        f"{core.when}   {s.row_rate:.0f} rows/s   {s.sample_rate:.0f} samples/s   "
        f"{delay}{len(service.inbox.samples)} waiting   {core.rows} rows"
        if core.rows else "waiting for the first sample"
    ]  # fmt: skip
    if s.last is not None:
        e = s.last.estimate
        state = "predicted, nothing received" if s.last.predicted else e.event or "driving"
        lines.append(
            f"{state}   v {e.ground_speed:.2f} ± {e.ground_speed_std:.2f} m/s"
            + (
                f"   soil resistance {e.soil_resistance:.3f} ± {e.soil_resistance_std:.3f}"
                if "soil_resistance" in e.places
                else "   slip alone: there is no torque"
            )
        )
    lossy = [f"{box.uri.name} {box.dropped}" for box in service.outboxes if box.dropped]
    if lossy:
        lines.append("sinks too slow, messages dropped: " + ", ".join(lossy))
    if s.ground is not None:
        likely = sorted(s.ground.probabilities.items(), key=lambda one: -one[1])[:3]
        lines.append("ground: " + ", ".join(f"{name} {probability:.0%}" for name, probability in likely))
    if service.setpoint is not None and service.setpoint.last is not None:
        advised = service.setpoint.last
        speeds = ", ".join(f"{wheel} {speed:.2f}" for wheel, speed in advised["wheel_speed"].items())
        why = f" ({advised['why']})" if advised["why"] else ""
        lines.append(f"set-point, advice only: {advised['state']}{why}   {speeds} rad/s")
    return lines


def _wheels(row: Row, table: Any) -> Any:
    estimate = row.estimate
    wheels = wheels_with("adhesion", estimate.places)
    if not wheels:
        shown = table("wheel", "slip %", "zero-slip radius m")
        for wheel in wheels_with("slip", estimate.places):
            radius = _with_std(estimate, f"zero_slip_radius_{wheel}", 1.0, 3)
            shown.add_row(wheel, _with_std(estimate, f"slip_{wheel}", 100.0, 1), radius)
        return shown
    shown = table("wheel", "slip %", "adhesion", "net traction", "efficiency %")
    for wheel in wheels:
        shown.add_row(
            wheel,
            _with_std(estimate, f"slip_{wheel}", 100.0, 1),
            _with_std(estimate, f"adhesion_{wheel}", 1.0, 2),
            _with_std(estimate, f"net_traction_{wheel}", 1.0, 2),
            _with_std(estimate, f"efficiency_{wheel}", 100.0, 0),
        )
    return shown


def _with_std(estimate: Any, name: str, scale: float, digits: int) -> str:
    if name not in estimate.places:
        return "—"
    value, std = scale * estimate[name], scale * estimate[f"{name}_std"]
    return "—" if value != value else f"{value:.{digits}f} ± {std:.{digits}f}"


def counts_table(service: Service, table: Any) -> Any:
    """What went wrong, by channel; None where nothing did. Channels that fared alike share a line."""
    alike: dict[tuple[int, ...], list[str]] = {}
    for name, mine in service.core.counts.by_channel.items():
        if any(mine[fate] for fate in _TROUBLE):
            alike.setdefault(tuple(mine[fate] for fate in ("received", *_TROUBLE)), []).append(name)
    if not alike:
        return None
    shown = table("channel", "received", *_TROUBLE)
    for counts, names in alike.items():
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        shown.add_row(names[0] + more, *map(str, counts))
    return shown


def table_of_many(service: ManyService) -> Any:
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
