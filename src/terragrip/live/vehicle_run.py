"""One vehicle's way from samples to messages: inbox, pipeline, and the numbers that it shows of itself. No tasks, no links."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.estimation.engine_estimator import restored
from terragrip.live.core import Core
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed
from terragrip.live.inbox import Inbox
from terragrip.live.message import ESTIMATE, EVENT, GROUND, SETPOINT, SOIL, STATUS, Message
from terragrip.live.options import has_slips
from terragrip.live.outbox import Outbox
from terragrip.live.outputs import Event, Output, Refusal, Row
from terragrip.live.payload import unpacker
from terragrip.live.pipeline import Pipeline
from terragrip.live.record import SECONDS
from terragrip.live.statistics import Statistics
from terragrip.log_events import emit

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.formats import Profile
    from terragrip.live.setpoint import LiveSetpoint

AT_ONCE = 64  # samples between two turns of sources and sinks
_SYNC = 0.7  # s: with writing, under a second
_PATIENCE = 0.3  # s of silence before rows are predicted, or
_PERIODS = 5.0  # rows' periods

logger = logging.getLogger("terragrip.live")


class VehicleRun:
    """Whoever runs it fills the inbox by ``feeds``, and calls `open`, then `turn` and `housekeeping`, then `finish`.

    Parameters
    ----------
    inbox: where the feeds put samples. decoders: of each of the core's sources; profile: theirs.
    outboxes: of the sinks that everything published goes to, besides ``listeners``.
    setpoint: that is published beside the estimates; None: none is.
    is_real_time: samples come when they come, and silence means something.
    name: of the vehicle, where many are served. predict: s of silence that predictions go on for.
    core, record, thread, segment: a `Recorder`'s core, folder (None: no record is kept), thread and seconds.

    Raises InputError where the record cannot be used.
    """

    def __init__(
        self,
        core: Core,
        inbox: Inbox,
        decoders: Sequence[Decoder],
        outboxes: Sequence[Outbox],
        *,
        profile: Profile | None = None,
        record: Path | None = None,
        setpoint: LiveSetpoint | None = None,
        is_real_time: bool = True,
        name: str = "",
        thread: Executor | None = None,
        segment: float = SECONDS,
        predict: float = float("inf"),
    ) -> None:
        self.name = name
        self.inbox, self.setpoint, self.is_real_time = inbox, setpoint, is_real_time
        self.pipeline = Pipeline(core, record, seconds=segment, thread=thread)
        unpack = unpacker(None if profile is None else profile.payload)
        self.feeds = [
            Feed(k, name, decoders[k], unpack, inbox, after=self.core.clocks[k].newest)
            for k, name in enumerate(core.settings.sources)
        ]
        self.listeners: list[Callable[[Message], None]] = [outbox.put for outbox in outboxes]
        self.statistics = Statistics(self.core, inbox, self.feeds, outboxes, is_real_time)
        self._prediction = Prediction(predict)
        self._synced = float("-inf")  # when the record was

    @property
    def core(self) -> Core:
        """What is known of the run so far."""
        return self.pipeline.core

    def open(self) -> None:
        """Publish what opening the record brought: that the run goes on."""
        self._publish(self.pipeline.opening)

    def turn(self) -> None:
        """Estimate and publish what has come in, some of it where that is much."""
        for note in self.inbox.notes():  # first: they tell of samples lost before those that are here
            self._publish(self.pipeline.note(note))
        samples = self.inbox.pop(AT_ONCE)
        for sample in samples:
            self._publish(self.pipeline.process(*sample))
        if samples:
            self.statistics.samples(len(samples), samples[-1][0])
        elif self.is_real_time:
            self._publish(self.pipeline.tick(self.inbox.clock()))

    def housekeeping(self) -> None:
        """Ten times a second: write the record, notice silences and backlogs, send the status."""
        now = self.inbox.clock()
        self._publish(self.pipeline.write())
        if self.is_real_time:
            self.statistics.watch(now)
            predicted = self._prediction.at(
                self.core, now, self.statistics.last_arrival, self.statistics.period
            )
            if predicted is not None:
                self._publish([predicted])
        if self.statistics.second(now):
            self.announce()
        if now - self._synced >= _SYNC:
            self._synced = now
            self._publish(self.pipeline.sync())

    def finish(self) -> None:
        """The sources have ended: estimate and publish what is left of what they brought."""
        while self.is_real_time and self.inbox.samples:
            self.turn()
        self.turn()
        self._publish(self.pipeline.flush())
        self.announce()

    def announce(self) -> None:
        """Send the status to all listeners."""
        self._send(STATUS, self.core.time, data=self.statistics.to_dict())

    def _publish(self, outputs: list[Output]) -> None:
        """Give what came out of the pipeline to every listener."""
        for output in outputs:
            if isinstance(output, Row):
                self.statistics.row(output, self.inbox.clock())
                self._send(ESTIMATE, output.estimate.time, output)
                self._advise(output)
            elif isinstance(output, Event):
                self.statistics.event(output)
                data = output.to_dict()
                named = {"vehicle": self.name} if self.name else {}
                emit(logger, output.kind, **named, **{name: data[name] for name in data if name != "kind"})
                self._send(EVENT, output.time, data=data)
            elif not isinstance(output, Refusal):
                self.statistics.ground = output
                data = output.to_dict()
                change = data.pop("change")
                self._send(SOIL, output.time, data=data)
                if change is not None:
                    self._send(GROUND, change["time"], data=change)

    def _advise(self, row: Row) -> None:
        """Publish the set-point, where one is wanted and the estimates hold the wheels' slips."""
        estimator = self.core.estimator
        if self.setpoint is not None and estimator is not None and has_slips(estimator):
            self._send(SETPOINT, row.estimate.time, data=self.setpoint.message(row))

    def _send(
        self, kind: str, time: float, row: Row | None = None, *, data: dict[str, Any] | None = None
    ) -> None:
        message = Message(kind, time, row, data, self.name)
        for listener in self.listeners:
            listener(message)


class Prediction:
    """Rows while nothing comes in, with growing intervals: at most one a call, and none after ``longest`` s of silence.

    They are made on a copy: the filter itself does not move, and samples that were only delayed find it as if nothing had happened.
    """

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
