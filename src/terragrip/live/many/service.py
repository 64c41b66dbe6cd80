"""The live service of many vehicles: one connection a source or sink, one loop, one thread besides those for the disk."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

from terragrip.errors import InputError
from terragrip.live.counts import FATES
from terragrip.live.decode import Decoder
from terragrip.live.inbox import newly_set
from terragrip.live.links import TopicSource, open_source
from terragrip.live.links.studio import StudioSink
from terragrip.live.many.links import Router, check_sources, open_sinks
from terragrip.live.many.monitor import ManyMonitor
from terragrip.live.many.roster import Roster
from terragrip.live.many.vehicles import MOST_VEHICLES, Journal, Vehicles
from terragrip.live.message import Message
from terragrip.live.options import Options
from terragrip.live.outbox import Outbox
from terragrip.live.record_folder import locked
from terragrip.live.service import HOUSEKEEPING
from terragrip.live.supervision import run_links
from terragrip.live.vehicle_run import VehicleRun

_SLICE = 8  # vehicles that are looked after at once
_TOGETHER = 0.002  # s: what comes so close together shares a turn, which costs a sixth less a sample
_QUEUE = 100  # messages of a vehicle before a sink


class ManyService:
    """Runs until `stop` is called.

    Parameters
    ----------
    roster: which vehicle file belongs to which name.
    sources: URIs of MQTT or Zenoh with ``{vehicle}`` as one level of the topic.
    sinks: likewise, or a `studio:`, where a client asks for one vehicle.
    record: folder that holds a record a vehicle, by its name; None: none is kept.
    options: as for one vehicle. ``listeners`` get what is published of every vehicle, and events of the service itself.
    most: how many vehicles there may be at once.

    Raises InputError on a URI or folder that cannot be used, or where vehicles are listed and none of them has a usable file.
    """

    def __init__(
        self,
        roster: Roster,
        sources: Sequence[str],
        sinks: Sequence[str] = (),
        *,
        record: Path | None = None,
        options: Options | None = None,
        most: int = MOST_VEHICLES,
    ) -> None:
        topics = check_sources(sources)
        self.sources = [cast(TopicSource, open_source(one.subscription, Decoder(None))[1]) for one in topics]
        opened = open_sinks(sinks, topics)
        self.sinks = [sink for _, sink in opened]
        self.listeners: list[Callable[[Message], None]] = []
        self.journal = Journal(self.listeners)
        self.outboxes = [Outbox(uri, self.journal, _QUEUE) for uri, _ in opened]
        self.vehicles = Vehicles(
            roster,
            options or Options(),
            topics,
            self.journal,
            self.outboxes,
            record=record,
            most=most,
        )
        self._unusable = _unusable(roster)
        self.routers = [Router(k, text, self.vehicles) for k, text in enumerate(sources)]
        self.monitor = ManyMonitor(self.vehicles, self.routers, self.outboxes)
        for sink in self.sinks:
            if isinstance(sink, StudioSink):
                sink.monitor, sink.broadcast.vehicles = self.monitor, partial(_shown, self.vehicles.runs)
        self._lock = None if record is None else locked(record)
        self._stopping = asyncio.Event()

    @property
    def source_names(self) -> list[str]:
        """Of the links, without their options."""
        return [router.name for router in self.routers]

    def stop(self) -> None:
        """Let `run` come to its end."""
        self._stopping.set()

    async def run(self) -> None:
        """Estimate until `stop` was called; then close all records whole.

        Raises InputError where a source or sink cannot be used at all, or a record could not be written to its end.
        """
        sources = [
            (partial(source.run, router), router.lost)
            for source, router in zip(self.sources, self.routers, strict=True)
        ]
        try:
            for name, why in self._unusable.items():
                self.vehicles.refuse(name, why)
            await run_links(
                sources, list(zip(self.sinks, self.outboxes, strict=True)),
                [self._stopping.wait(), self._estimate(), self._open(), self._housekeeping()],
                has_left=lambda: bool(self.vehicles.ready), finish=self.vehicles.finish,
            )  # fmt: skip
        finally:
            failed = self.vehicles.close()
            if self._lock is not None:
                os.close(self._lock)
        if failed:
            name, why = next(iter(failed.items()))
            others = f", and the records of {len(failed) - 1} other vehicles" if len(failed) > 1 else ""
            raise InputError(
                f"{name}: {why}{others}", place="--record", hint="free space or choose another folder"
            )

    async def _estimate(self) -> None:
        """Turn after turn: each vehicle's samples as they come in, and rows that have waited for long enough."""
        vehicles, clock = self.vehicles, self.vehicles.clock
        pending: dict[str, VehicleRun] = {}  # runs with a row that waits
        while True:
            await self._something(pending)
            ready, vehicles.ready = vehicles.ready, {}
            now = clock()
            ready |= {name: run for name, run in pending.items() if _due(run, now)}
            for name, run in ready.items():
                vehicles.guarded(run, run.turn)
                pending.pop(name, None)
                if vehicles.runs.get(name) is not run:
                    continue
                if run.inbox.samples:
                    vehicles.ready[name] = run
                elif run.pipeline.waiting_until is not None:
                    pending[name] = run

    async def _something(self, pending: dict[str, VehicleRun]) -> None:
        """Wait until a vehicle has something to do; lets others have their turn in any case."""
        vehicles = self.vehicles
        if vehicles.ready:
            await asyncio.sleep(0)
            return
        until = min((run.pipeline.waiting_until or 0.0 for run in pending.values()), default=None)
        await newly_set(vehicles.filled, None if until is None else until - vehicles.clock())
        await asyncio.sleep(_TOGETHER)

    async def _open(self) -> None:
        """Open vehicles one by one, with as much time for the others between two as one takes."""
        loop = asyncio.get_running_loop()
        while True:
            await self.vehicles.asked.wait()
            began = loop.time()
            if self.vehicles.open_next():
                await asyncio.sleep(loop.time() - began)

    async def _housekeeping(self) -> None:
        """Each vehicle ten times a second, a few at once."""
        vehicles = self.vehicles
        while True:
            runs = list(vehicles.runs.values())
            slices = [runs[k : k + _SLICE] for k in range(0, len(runs), _SLICE)] or [[]]
            for some in slices:
                await asyncio.sleep(HOUSEKEEPING / len(slices))
                for run in some:
                    if vehicles.runs.get(run.name) is run:
                        vehicles.guarded(run, run.housekeeping)
                        if not run.inbox.is_empty:
                            vehicles.ready[run.name] = run
                            vehicles.filled.set()

    def totals(self) -> dict[str, Any]:
        """What the log's last line says: vehicles, rows, and values by what became of them."""
        cores = [run.core for run in self.vehicles.runs.values()]
        values = {fate: sum(core.counts.total(fate) for core in cores) for fate in FATES}
        return {"vehicles": len(cores), "rows": sum(core.rows for core in cores), "values": values}

    def summary(self) -> str:
        """The run in a few lines of text."""
        vehicles = self.vehicles
        rows = sum(run.core.rows for run in vehicles.runs.values())
        lines = [f"{len(vehicles.runs)} vehicles, {rows} rows estimated"]
        lines += [
            f"{name}: not estimated: {refusal.why}" for name, refusal in list(vehicles.refusals.items())[:10]
        ]
        if len(vehicles.refusals) > 10:
            lines.append(f"and {len(vehicles.refusals) - 10} more that are not estimated")
        if vehicles.unnamed:
            lines.append(f"{vehicles.unnamed} messages whose topic names no vehicle")
        lossy = [f"{box.uri.name} {box.dropped}" for box in self.outboxes if box.dropped]
        if lossy:
            lines.append("messages dropped by slow sinks: " + ", ".join(lossy))
        return "\n".join(lines)


def _shown(runs: Mapping[str, VehicleRun]) -> dict[str, tuple[str, Sequence[str], Sequence[str]]]:
    """What clients get of each vehicle: what it is called, its columns and its free wheels."""
    return {
        name: (run.core.vehicle.name or name, run.core.columns, run.core.vehicle.free_wheels)
        for name, run in runs.items()
    }


def _due(run: VehicleRun, now: float) -> bool:
    until = run.pipeline.waiting_until
    return until is None or until <= now


def _unusable(roster: Roster) -> dict[str, str]:
    """The listed vehicles whose files cannot be used, and why; raises InputError where that is every one."""
    result, last = {}, None
    for name in roster.names:
        try:
            roster.of(name)
        except InputError as error:
            result[name], last = str(error), error
    if last is not None and len(result) == len(roster.names):
        raise last
    return result
