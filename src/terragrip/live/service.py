"""The live service: sources to core or record to sinks, in one thread, with what is lost said and counted."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.estimation.slip_estimator import SlipEstimator
from terragrip.live.core import WINDOW, Core, Ground, Output, Row, Settings
from terragrip.live.decode import Decoder, check_channels
from terragrip.live.engine import LiveEngine
from terragrip.live.event import Event
from terragrip.live.feed import Feed
from terragrip.live.inbox import CAPACITY, Inbox
from terragrip.live.message import ESTIMATE, GROUND, SOIL, STATUS, Message
from terragrip.live.outbox import Outbox
from terragrip.live.payload import unpacker
from terragrip.live.prediction import Prediction
from terragrip.live.record import Recorder
from terragrip.live.sinks import open_sink
from terragrip.live.sources import Source, open_source
from terragrip.live.statistics import Statistics
from terragrip.live.supervision import supervise_sink, supervise_source, unheard

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

_AT_ONCE = 64  # samples between two turns of sources and sinks
_HOUSEKEEPING = 0.09  # s: what came in is handed to the system at least ten times a second
_GRACE = (
    0.005  # s: so long the next sample may take to come, whose turn of the loop then does the housekeeping
)
_SILENCE = 0.1  # s: without samples it is done so often
_SYNC = 0.7  # s: with writing, under a second
_BREATH = 0.002  # s for sinks that have enough to do
_BEHIND = 1.0  # s
_LINGER = 2.0  # s for sinks to take the last messages

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
    ground: tell ground changes while driving; library: and which of these soils it is.
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
        ground: bool = False,
        library: SoilLibrary | None = None,
        capacity: int = CAPACITY,
    ) -> None:
        method_named(method)
        if not sources:
            raise InputError(
                "there is no source", place="--source", mend="name one, e.g. udp://127.0.0.1:9870"
            )
        decoders = [Decoder(profile) for _ in sources]
        opened = [open_source(text, decoder) for text, decoder in zip(sources, decoders, strict=True)]
        self.sources: list[Source] = [source for _, source in opened]
        if profile is not None:
            check_channels(profile, vehicle)
        channels = dict.fromkeys(
            name
            for decoder, source in zip(decoders, self.sources, strict=True)
            for name in (*decoder.channels, *getattr(source, "channels", ()))
        )
        names = tuple(uri.name for uri, _ in opened)
        settings = Settings(
            names, method, window, tuple(channels), dict(held or {}), ground or library is not None
        )
        core = Core(vehicle, settings, library)
        if settings.ground and isinstance(core.estimator, SlipEstimator):
            raise InputError(
                "the ground is told by adhesion and soil resistance, which need drive torques",
                place="--ground", mend="leave it out: the sources give speeds alone",
            )  # fmt: skip
        self.sinks = [open_sink(text, vehicle, core.columns) for text in sinks]
        self.outboxes = [Outbox(uri) for uri, _ in self.sinks]
        recorder = None if record is None else Recorder(record, core)
        core = core if recorder is None else recorder.core
        self.engine = LiveEngine(core, recorder)
        self._opening = [] if recorder is None else recorder.opening
        self.inbox = Inbox(capacity)
        self.inbox.busy = lambda: any(outbox.is_busy for outbox in self.outboxes)
        payload = None if profile is None else profile.payload
        self.feeds = [
            Feed(
                k, text, decoders[k], unpacker(payload), self.inbox, self.note,
                after=core.clocks[k].newest,
            )
            for k, text in enumerate(names)
        ]  # fmt: skip
        self.statistics = Statistics(self)
        self.prediction = Prediction(core)
        self.listeners: list[Callable[[Message], None]] = [outbox.put for outbox in self.outboxes]
        self._publishing: deque[Message] = deque()
        self.is_real_time = all(source.real_time for source in self.sources)
        self._stopped = False
        self._done: Any = None  # a future, once `run` runs
        self._waking: asyncio.TimerHandle | None = None
        self._house: asyncio.TimerHandle | None = None
        self._house_due = float("inf")  # on the inbox's clock

    @property
    def core(self) -> Core:
        """What is known of the run so far."""
        return self.engine.core

    def stop(self) -> None:
        """Let `run` come to its end."""
        self._stopped = True
        if self._done is not None and not self._done.done():
            self._done.set_result(None)

    def note(self, note: dict[str, Any]) -> None:
        """What a source or sink has to say: counts, an event."""
        self._dispatch(self.engine.note(note))

    async def run(self) -> None:
        """Estimate until the sources have ended or `stop` was called; then close the record whole.

        Raises InputError where a source or sink cannot be used at all, or the record could not be written.
        """
        watched = [
            asyncio.create_task(supervise_source(source, feed))
            for source, feed in zip(self.sources, self.feeds, strict=True)
        ]
        takers = [
            asyncio.create_task(supervise_sink(sink, outbox, self.note))
            for (_, sink), outbox in zip(self.sinks, self.outboxes, strict=True)
        ]
        gc.freeze()  # what is there now stays: the collector need not look at it again
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(unheard)
        self._done = self._loop.create_future()
        for task in watched:
            task.add_done_callback(lambda _: self._source_done(watched))
        for task in takers:
            task.add_done_callback(self._sink_done)
        self.inbox.filled = lambda: self._later(self._work)
        self.inbox.work = self._work_now
        self._dispatch(self._opening)
        self._later(self._work)
        self._later_house(_HOUSEKEEPING)
        try:
            if not self._stopped:
                await self._done
            self._dispatch(self.engine.flush())
            self.announce()
            for outbox in self.outboxes:
                await outbox.emptied(_LINGER)
        finally:
            self._stopped = True
            gc.unfreeze()
            for task in (*watched, *takers):
                task.cancel()
            await asyncio.gather(*watched, *takers, return_exceptions=True)
            self.engine.close()
        for task in (*watched, *takers):
            if not task.cancelled() and (failure := task.exception()) is not None:
                raise failure
        if self.engine.failure:
            raise InputError(
                self.engine.failure, place="--record", mend="free space or choose another folder"
            )

    def _source_done(self, watched: list[asyncio.Task[None]]) -> None:
        if any(not task.cancelled() and task.exception() for task in watched if task.done()):
            self.stop()
        self._end_with(watched)

    def _end_with(self, watched: list[asyncio.Task[None]]) -> None:
        """Stop once all sources have ended and all that they brought is estimated."""
        if all(task.done() for task in watched):
            if self.inbox.samples and not self._stopped:
                self._loop.call_soon(self._end_with, watched)
            else:
                self.stop()

    def _sink_done(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and task.exception():
            self.stop()

    def _later(self, act: Callable[[], None]) -> None:
        self._loop.call_soon(self._guarded, act)

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do it in a turn of the loop; what goes wrong ends the run."""
        if self._stopped:
            return
        try:
            act()
        except Exception as failure:  # noqa: BLE001 - raised by `run`
            self._fail(failure)

    def _fail(self, failure: Exception) -> None:
        if not self._done.done():
            self._done.set_exception(failure)

    def _work(self) -> None:
        """Estimate what is there; come again for more, or for a row that waits."""
        if not self.is_real_time and self.inbox.busy():
            self._loop.call_later(_BREATH, self._guarded, self._work)
            return
        self._drain()
        if self.inbox.samples:
            self._later(self._work)
            return
        until = self.engine.waiting_until
        if until is not None and self.is_real_time and self._waking is None:
            left = until - self.inbox.clock()
            self._waking = self._loop.call_later(max(left, 0.0) + 1e-4, self._guarded, self._tick)

    def _work_now(self) -> None:
        self._guarded(self._work)

    def _tick(self) -> None:
        self._waking = None
        now = self.inbox.clock()
        if not self.inbox.samples:
            self._dispatch(self.engine.tick(now))
        self._work()

    def _drain(self) -> None:
        samples = self.inbox.samples
        if not samples:
            return
        count = min(len(samples), _AT_ONCE)
        for _ in range(count):
            sample = samples.popleft()
            self._dispatch(self.engine.take(*sample))
        self.statistics.samples(count, sample[0])
        self.inbox.taken()
        if sample[0] >= self._house_due:  # here, since the processor is awake, and warm
            self._keep_house()

    def _dispatch(self, outputs: list[Output]) -> None:
        for output in outputs:
            if isinstance(output, Row):
                self.statistics.row(output, self.inbox.clock())
                self._publish(Message(ESTIMATE, output.estimate.time, output))
            elif isinstance(output, Ground):
                self.statistics.ground = output
                data = output.to_dict()
                change = data.pop("change")
                self._publish(Message(SOIL, output.time, data=data))
                if change is not None:
                    self._publish(Message(GROUND, change["time"], data=change))
            elif isinstance(output, Event):
                self.statistics.event(output)
                logger.info("%s: %s: %s", output.source, output.kind, output.text)
                self._publish(Message.of_event(output))

    def _later_house(self, seconds: float) -> None:
        if self._house is not None:
            self._house.cancel()
        self._house = self._loop.call_later(seconds, self._guarded, self._keep_house)

    def _keep_house(self) -> None:
        """What is done ten times a second."""
        now = self.inbox.clock()
        if self.is_real_time:
            self._house_due = now + _HOUSEKEEPING
        self._dispatch(self.engine.write())
        silent = now - self.statistics.last_arrival > _SILENCE
        self._later_house(_SILENCE if silent else _HOUSEKEEPING + _GRACE)
        dropped, self.inbox.dropped = self.inbox.dropped, type(self.inbox.dropped)()
        for channel, mine in dropped.by_channel.items():
            self.note({"fate": "dropped", "channels": [channel], "number": mine["dropped"]})
        if self.is_real_time:
            for feed in self.feeds:
                self.statistics.watch_silence(feed, now)
            lag = now - self.inbox.samples[0][0] if self.inbox.samples else 0.0
            if lag > _BEHIND or dropped.by_channel:
                self.statistics.say_behind(lag, dropped.total("dropped"), now)
            predicted = self.prediction.at(now, self.statistics.last_arrival, self.statistics.period)
            if predicted is not None:
                self._dispatch([predicted])
        if self.statistics.second(now):
            self.announce()
        if self.statistics.due_sync(now, _SYNC):
            self._dispatch(self.engine.sync())

    def announce(self) -> None:
        """Send the status to whom it concerns."""
        self._publish(Message(STATUS, self.core.time, data=self.statistics.to_dict()))

    def _publish(self, message: Message) -> None:
        """Give it to every listener; one that comes of a listener's doing waits until all have this one."""
        self._publishing.append(message)
        if len(self._publishing) > 1:
            return
        try:
            while self._publishing:
                for listen in self.listeners:
                    listen(self._publishing[0])
                self._publishing.popleft()
        finally:
            self._publishing.clear()
