"""The live service: sources to core or record to sinks, in one thread, with what is lost reported and counted."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.live.counts import FATES
from terragrip.live.decode import Decoder, check_channels
from terragrip.live.inbox import CAPACITY, Inbox
from terragrip.live.links import Source, open_sink, open_source
from terragrip.live.monitor import Monitor
from terragrip.live.options import Options
from terragrip.live.outbox import Outbox
from terragrip.live.supervision import PAUSE, run_links
from terragrip.live.topics import refuse_echo
from terragrip.live.vehicle_run import VehicleRun

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.vehicle import Vehicle

HOUSEKEEPING = 0.09  # s: what came in is handed to the system at least ten times a second


class Service(VehicleRun):
    """One vehicle's run with its links. Runs until its sources end or `stop` is called.

    Parameters
    ----------
    vehicle: the machine.
    sources, sinks: URIs (docs/live.md). profile: what the sources' fields mean; None: the recording's own names.
    record: folder of the record, which is resumed where it holds one; None: none is kept.
    options: what else the command line says.
    capacity: samples that may wait for the estimator before they are dropped.

    Raises InputError on a URI, profile, vehicle or folder that cannot be used.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        sources: Sequence[str],
        sinks: Sequence[str] = (),
        *,
        profile: Profile | None = None,
        record: Path | None = None,
        options: Options | None = None,
        capacity: int = CAPACITY,
    ) -> None:
        if not sources:
            raise InputError(
                "there is no source", place="--source", hint="name one, e.g. udp://127.0.0.1:9870"
            )
        options = options or Options()
        decoders = [Decoder(profile) for _ in sources]
        opened = [open_source(text, decoder) for text, decoder in zip(sources, decoders, strict=True)]
        self.source_names = [uri.name for uri, _ in opened]
        self.sources: list[Source] = [source for _, source in opened]
        if profile is not None:
            check_channels(profile, vehicle, options.window)
        channels = [
            name
            for decoder, source in zip(decoders, self.sources, strict=True)
            for name in (*options.promised(decoder, vehicle), *getattr(source, "channels", ()))
        ]
        core, setpoint = options.core(vehicle, self.source_names, channels)
        self.sinks = [open_sink(text, vehicle, core.columns) for text in sinks]
        for text in sinks:
            refuse_echo(text, sources)
        inbox = Inbox(capacity)
        self.outboxes = [Outbox(uri, inbox) for uri, _ in self.sinks]
        super().__init__(
            core, inbox, decoders, self.outboxes, profile=profile, record=record, setpoint=setpoint,
            is_real_time=all(source.real_time for source in self.sources),
        )  # fmt: skip
        self._stopping = asyncio.Event()
        for _, sink in self.sinks:
            if hasattr(sink, "monitor"):
                sink.monitor = Monitor(self.statistics, self.inbox, self.outboxes, self.pipeline)

    def totals(self) -> dict[str, Any]:
        """What the log's last line says: rows, and values by what became of them."""
        return {"rows": self.core.rows, "values": {fate: self.core.counts.total(fate) for fate in FATES}}

    def summary(self) -> str:
        """The run in a few lines of text."""
        return self.statistics.summary()

    def stop(self) -> None:
        """Let `run` come to its end."""
        self._stopping.set()

    async def run(self) -> None:
        """Estimate until the sources have ended or `stop` was called; then close the record whole.

        Raises InputError where a source or sink cannot be used at all, or the record could not be written.
        """
        sources = [
            (partial(source.run, feed), feed.lost)
            for source, feed in zip(self.sources, self.feeds, strict=True)
        ]
        sinks = [(sink, outbox) for (_, sink), outbox in zip(self.sinks, self.outboxes, strict=True)]
        try:
            self.open()
            await run_links(
                sources, sinks, [self._stopping.wait(), self._estimate(), self._look_after()],
                has_left=lambda: bool(self.inbox.samples), finish=self.finish,
            )  # fmt: skip
            self.turn()  # what sinks reported as they ended
        finally:
            self.pipeline.close()
        if self.pipeline.failure:
            raise InputError(
                self.pipeline.failure, place="--record", hint="free space or choose another folder"
            )

    async def _estimate(self) -> None:
        """Turn after turn, as samples come in or a row has waited for long enough."""
        while True:
            await self.inbox.filled(self.pipeline.waiting_until if self.is_real_time else None)
            while not self.is_real_time and any(outbox.is_busy for outbox in self.outboxes):
                await asyncio.sleep(PAUSE)
            self.turn()

    async def _look_after(self) -> None:
        while True:
            await asyncio.sleep(HOUSEKEEPING)
            self.housekeeping()
