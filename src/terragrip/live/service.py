"""The live service: sources to core or record to sinks, in one thread, with what is lost reported and counted."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.estimation.engine_estimator import EngineEstimator
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.live.core import WINDOW, Core, Ground, Output, Row, Settings
from terragrip.live.decode import Decoder, check_channels
from terragrip.live.event import Event
from terragrip.live.feed import Feed
from terragrip.live.inbox import CAPACITY, Inbox
from terragrip.live.message import ESTIMATE, GROUND, SETPOINT, SOIL, STATUS, Message
from terragrip.live.monitor import Monitor
from terragrip.live.outbox import Outbox
from terragrip.live.payload import unpacker
from terragrip.live.pipeline import Pipeline
from terragrip.live.prediction import Prediction
from terragrip.live.setpoint import LiveSetpoint
from terragrip.live.sinks import open_sink
from terragrip.live.sources import Source, open_source
from terragrip.live.statistics import Statistics
from terragrip.live.supervision import report_unhandled, supervise_sink, supervise_source
from terragrip.log_events import emit

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

_AT_ONCE = 64  # samples between two turns of sources and sinks
_HOUSEKEEPING = 0.09  # s: what came in is handed to the system at least ten times a second
_SYNC = 0.7  # s: with writing, under a second
_PAUSE = 0.002  # s for sinks that have enough to do
_LINGER = 2.0  # s for sinks to send the last messages

logger = logging.getLogger("terragrip.live")


class Service:
    """Runs until its sources end or `stop` is called.

    Parameters
    ----------
    vehicle: the machine. method: the estimator's.
    sources, sinks: URIs (docs/live.md). profile: what the sources' fields mean; None: the recording's own names.
    record: folder of the record, which is resumed where it holds one; None: none is kept.
    window: s that a row waits for what is due (`terragrip.live.reorder`).
    held: update periods [s] of channels that a source repeats between updates.
    noise: SDs [SI] by channel, as estimates of a log hold them; they win over the vehicle file's.
    learn: tell noise and held channels that are not given from the rows as they come.
    ground: report ground changes while driving; library: and which of these soils it is.
    driveline: what an earlier log told of a machine that tells engine torque (``about["driveline"]`` of its estimates).
    setpoint: slip and ground speed wanted [m/s] of the set-point to publish beside the estimates; None: none is.
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
        method: str = DEFAULT,
        window: float = WINDOW,
        held: Mapping[str, float] | None = None,
        noise: Mapping[str, float] | None = None,
        learn: bool = True,
        ground: bool = False,
        library: SoilLibrary | None = None,
        setpoint: tuple[float, float] | None = None,
        driveline: Mapping[str, Any] | None = None,
        capacity: int = CAPACITY,
    ) -> None:
        method_named(method)
        if not sources:
            raise InputError(
                "there is no source", place="--source", hint="name one, e.g. udp://127.0.0.1:9870"
            )
        decoders = [Decoder(profile) for _ in sources]
        opened = [open_source(text, decoder) for text, decoder in zip(sources, decoders, strict=True)]
        self.sources: list[Source] = [source for _, source in opened]
        if profile is not None:
            check_channels(profile, vehicle)
        channels = dict.fromkeys(
            name
            for decoder, source in zip(decoders, self.sources, strict=True)
            for name in (*_promised(decoder, vehicle, driveline), *getattr(source, "channels", ()))
        )
        names = tuple(uri.name for uri, _ in opened)
        settings = Settings(
            names,
            method,
            window,
            tuple(channels),
            dict(held or {}),
            ground or library is not None,
            dict(noise or {}),
            learn,
            driveline,
        )
        core = Core(vehicle, settings, library)
        if settings.ground and core.estimator is not None and core.estimator.rims:
            raise InputError(
                "ground changes show in adhesion and soil resistance, which need drive torques",
                place="--ground", hint="leave it out: the sources give speeds alone",
            )  # fmt: skip
        self.setpoint = None if setpoint is None else LiveSetpoint(vehicle, *setpoint)
        if self.setpoint is not None and core.estimator is not None and not _has_slips(core.estimator):
            raise InputError(
                "a set-point of slip needs the slip of each driven wheel",
                place="--setpoint", hint="leave it out: the sources give the drive train's speed alone",
            )  # fmt: skip
        self.sinks = [open_sink(text, vehicle, core.columns) for text in sinks]
        self.inbox = Inbox(capacity)
        self.outboxes = [Outbox(uri, self.inbox) for uri, _ in self.sinks]
        self.pipeline = Pipeline(core, record)
        payload = None if profile is None else profile.payload
        self.feeds = [
            Feed(
                k, text, decoders[k], unpacker(payload), self.inbox,
                after=self.core.clocks[k].newest,
            )
            for k, text in enumerate(names)
        ]  # fmt: skip
        self.listeners: list[Callable[[Message], None]] = [outbox.put for outbox in self.outboxes]
        self.is_real_time = all(source.real_time for source in self.sources)
        self._stopping = asyncio.Event()
        self.statistics = Statistics(self.core, self.inbox, self.feeds, self.outboxes, self.is_real_time)
        self.prediction = Prediction()
        for _, sink in self.sinks:
            if hasattr(sink, "monitor"):
                sink.monitor = Monitor(self.statistics, self.inbox, self.outboxes, self.pipeline)

    @property
    def core(self) -> Core:
        """What is known of the run so far."""
        return self.pipeline.core

    def stop(self) -> None:
        """Let `run` come to its end."""
        self._stopping.set()

    async def run(self) -> None:
        """Estimate until the sources have ended or `stop` was called; then close the record whole.

        Raises InputError where a source or sink cannot be used at all, or the record could not be written.
        """
        asyncio.get_running_loop().set_exception_handler(report_unhandled)
        gc.freeze()  # what is there now stays: the collector need not look at it again
        start = asyncio.create_task
        sources = [
            start(supervise_source(source, feed))
            for source, feed in zip(self.sources, self.feeds, strict=True)
        ]
        sinks = [
            start(supervise_sink(sink, outbox))
            for (_, sink), outbox in zip(self.sinks, self.outboxes, strict=True)
        ]
        until_end = [
            start(self._until_all_is_estimated(sources)), start(self._stopping.wait()),
            start(self._estimate()), start(self._keep_house()),
        ]  # fmt: skip
        try:
            self._publish(self.pipeline.opening)
            await asyncio.wait([*until_end, *sinks], return_when=asyncio.FIRST_COMPLETED)
            await _cancelled([*sources, *until_end])
            failures = [
                failure
                for task in (*sources, *sinks, *until_end)
                if task.done() and not task.cancelled() and (failure := task.exception()) is not None
            ]
            if failures:
                raise failures[0]
            while self.is_real_time and self.inbox.samples:
                self._turn()
            self._turn()
            self._publish(self.pipeline.flush())
            self.announce()
            for outbox in self.outboxes:
                await outbox.emptied(_LINGER)
        finally:
            await _cancelled([*sources, *until_end, *sinks])
            self.pipeline.close()
            gc.unfreeze()
        if self.pipeline.failure:
            raise InputError(
                self.pipeline.failure, place="--record", hint="free space or choose another folder"
            )

    async def _until_all_is_estimated(self, sources: Sequence[asyncio.Task[None]]) -> None:
        """Wait until the sources have ended, and what they brought is estimated; raises what one of them raises."""
        await asyncio.gather(*sources)
        while self.inbox.samples:
            await asyncio.sleep(_PAUSE)

    async def _estimate(self) -> None:
        """Turn after turn, as samples come in or a row has waited for long enough."""
        while True:
            await self.inbox.filled(self.pipeline.waiting_until if self.is_real_time else None)
            while not self.is_real_time and any(outbox.is_busy for outbox in self.outboxes):
                await asyncio.sleep(_PAUSE)
            self._turn()

    def _turn(self) -> None:
        """Estimate and publish what has come in, some of it where that is much."""
        for note in self.inbox.notes():  # first: they tell of samples lost before those that are here
            self._publish(self.pipeline.note(note))
        samples = self.inbox.pop(_AT_ONCE)
        for sample in samples:
            self._publish(self.pipeline.process(*sample))
        if samples:
            self.statistics.samples(len(samples), samples[-1][0])
        elif self.is_real_time:
            self._publish(self.pipeline.tick(self.inbox.clock()))

    def _publish(self, outputs: list[Output]) -> None:
        """Give what came out of the pipeline to every listener."""
        for output in outputs:
            if isinstance(output, Row):
                self.statistics.row(output, self.inbox.clock())
                self._send(Message(ESTIMATE, output.estimate.time, output))
                self._advise(output)
            elif isinstance(output, Ground):
                self.statistics.ground = output
                data = output.to_dict()
                change = data.pop("change")
                self._send(Message(SOIL, output.time, data=data))
                if change is not None:
                    self._send(Message(GROUND, change["time"], data=change))
            elif isinstance(output, Event):
                self.statistics.event(output)
                emit(logger, output.kind, **_logged(output))
                self._send(Message.of_event(output))

    def _advise(self, row: Row) -> None:
        """Publish the set-point, where one is wanted and the estimates hold the wheels' slips."""
        if self.setpoint is None or self.core.estimator is None:
            return
        if _has_slips(self.core.estimator):
            self._send(Message(SETPOINT, row.estimate.time, data=self.setpoint.message(row)))

    def _send(self, message: Message) -> None:
        for listener in self.listeners:
            listener(message)

    async def _keep_house(self) -> None:
        """What is done ten times a second: the record written, silences and backlogs noticed, the status sent."""
        while True:
            await asyncio.sleep(_HOUSEKEEPING)
            now = self.inbox.clock()
            self._publish(self.pipeline.write())
            if self.is_real_time:
                self.statistics.watch(now)
                predicted = self.prediction.at(
                    self.core, now, self.statistics.last_arrival, self.statistics.period
                )
                if predicted is not None:
                    self._publish([predicted])
            if self.statistics.second(now):
                self.announce()
            if self.statistics.due_sync(now, _SYNC):
                self._publish(self.pipeline.sync())

    def announce(self) -> None:
        """Send the status to whom it concerns."""
        self._send(Message(STATUS, self.core.time, data=self.statistics.to_dict()))


def _promised(decoder: Decoder, vehicle: Vehicle, driveline: Mapping[str, Any] | None) -> tuple[str, ...]:
    """The columns that a source's profile promises; of a vehicle with a driveline also what of its engine is optional, and what an
    earlier log of it had."""
    if vehicle.driveline is None or decoder.profile is None:
        return decoder.channels
    had = () if driveline is None else driveline["channels"]
    more = (name for name in decoder.profile.channels if name.startswith("engine_") or name in had)
    return tuple(dict.fromkeys((*decoder.channels, *more)))


def _has_slips(estimator: TractionEstimator) -> bool:
    """Whether its estimates hold the slip of each wheel, and what shows whether they can be trusted."""
    return not estimator.rims and not isinstance(estimator, EngineEstimator)


def _logged(event: Event) -> dict[str, Any]:
    fields = event.to_dict()
    del fields["kind"]
    return fields


async def _cancelled(tasks: Sequence[asyncio.Task[Any]]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
