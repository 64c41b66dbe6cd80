"""The vehicles that send: a run each, opened by its first message; what goes wrong with one stays with it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

from terragrip.errors import reason_of
from terragrip.live.decode import Decoder, check_channels
from terragrip.live.inbox import Inbox, steady_clock
from terragrip.live.many.roster import Roster
from terragrip.live.message import EVENT, Message
from terragrip.live.options import Options
from terragrip.live.outbox import Outbox
from terragrip.live.record import SECONDS, record_thread
from terragrip.live.topics import VehicleTopics, is_name
from terragrip.live.vehicle_run import VehicleRun
from terragrip.log_events import emit

MOST_BYTES = 64 * 1024  # of a message
MOST_VEHICLES = 256
CAPACITY = 1024  # samples of a vehicle that may wait for its estimator
PREDICT = 10.0  # s of silence: a parked vehicle costs nothing after that
RETRY = 30.0  # s after which a vehicle that was refused, or failed, may try again
_WAITING = 256  # messages of a vehicle that is being opened
_REMEMBERED = 1000  # vehicles that were refused
_REPORT_EVERY = 5.0  # s between two events about names that are none
_THREADS = 4  # for records
_LENGTHS = 61  # of segments, from half the usual one to one and a half

logger = logging.getLogger("terragrip.live")

Waiting = tuple[int, bytes, float, str]
"""Source, message, arrival, topic."""


@dataclass(slots=True)
class Refusal:
    """Why a vehicle is not estimated, and until when [s, monotonic]."""

    why: str
    until: float


class Journal:
    """Logs each event and gives it to every listener, none of which is a sink: a sink's topics belong to vehicles."""

    def __init__(self, listeners: list[Callable[[Message], None]]) -> None:
        self.listeners = listeners

    def event(self, kind: str, source: str, text: str, vehicle: str = "") -> None:
        """An event of ``source``: a link's URI, or ``service``."""
        emit(logger, kind, source=source, text=text, **({"vehicle": vehicle} if vehicle else {}))
        message = Message(
            EVENT, float("nan"), data={"kind": kind, "source": source, "text": text}, vehicle=vehicle
        )
        for listener in self.listeners:
            listener(message)


class Vehicles:
    """Takes messages by topic, opens runs, and keeps the failure of one from the others.

    ``ready``: runs with something to do since they were taken out; ``filled`` and ``asked``: set where there is one, and where a vehicle
    waits to be opened. What is published goes to ``outboxes`` and to the journal's listeners. ``most``: vehicles at once, others are
    refused.
    """

    def __init__(
        self,
        roster: Roster,
        options: Options,
        topics: Sequence[VehicleTopics],
        journal: Journal,
        outboxes: Sequence[Outbox],
        *,
        record: Path | None = None,
        most: int,
    ) -> None:
        self.roster, self.most = roster, most
        self._options, self._topics, self._record = options, topics, record
        self.journal, self._outboxes = journal, outboxes
        self.runs: dict[str, VehicleRun] = {}
        self.ready: dict[str, VehicleRun] = {}
        self.refusals: dict[str, Refusal] = {}
        self.unnamed = 0  # messages whose topic names no vehicle
        self.failures = 0
        self.filled, self.asked = asyncio.Event(), asyncio.Event()
        self._waiting: dict[str, deque[Waiting]] = {}
        self._reported = float("-inf")
        self.clock = steady_clock()
        self._closing = ExitStack()
        threads = [self._closing.enter_context(record_thread()) for _ in range(_THREADS if record else 0)]
        self._threads = cycle(threads or [None])
        # Vehicles that begin together do not close their segments together.
        self._segments = cycle(SECONDS * (0.5 + k / _LENGTHS) for k in range(_LENGTHS))

    def message(self, source: int, data: bytes, topic: str) -> None:
        """A message of source number ``source``."""
        name, general = self._topics[source].split(topic)
        run = self.runs.get(name)
        if run is None:
            self._wait(name, (source, data, self.clock(), general))
            return
        self.guarded(run, lambda: _feed(run, source, data, None, general))
        self.ready[name] = run
        self.filled.set()

    def guarded(self, run: VehicleRun, work: Callable[[], object]) -> None:
        """Do a vehicle's work; where that fails the vehicle is closed, and opened anew after a while."""
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever it is, it is this vehicle's and no other's
            self._fail(run, error)

    def _fail(self, run: VehicleRun, error: Exception) -> None:
        if self.runs.get(run.name) is not run:
            return
        del self.runs[run.name]
        self.ready.pop(run.name, None)
        self.failures += 1
        run.pipeline.abandon()
        self.refuse(run.name, reason_of(error), "vehicle_failed")

    def refuse(self, name: str, why: str, kind: str = "vehicle_refused") -> None:
        if len(self.refusals) >= _REMEMBERED:
            del self.refusals[next(iter(self.refusals))]
        self.refusals[name] = Refusal(why, time.monotonic() + RETRY)
        self.journal.event(kind, "service", why, name)

    def _wait(self, name: str, message: Waiting) -> None:
        """Keep a message until its vehicle is open, where it may be opened."""
        waiting = self._waiting.get(name)
        if waiting is None:
            refusal = self.refusals.get(name)
            if refusal is not None:
                if time.monotonic() < refusal.until:
                    return
            elif not is_name(name):
                self._report_unnamed(name)
                return
            count = len(self.runs) + len(self._waiting)
            if count >= self.most:
                self.refuse(name, f"there are already {count} vehicles; raise --max-vehicles")
                return
            waiting = self._waiting[name] = deque(maxlen=_WAITING)
            self.asked.set()
        if len(message[1]) <= MOST_BYTES:
            waiting.append(message)

    def _report_unnamed(self, name: str) -> None:
        self.unnamed += 1
        now = time.monotonic()
        if now - self._reported >= _REPORT_EVERY:
            self._reported = now
            text = f"{name[:40]!r} in a topic is not a vehicle's name: letters, digits and _ - . alone"
            self.journal.event("vehicle_refused", "service", text)

    def open_next(self) -> bool:
        """Open the vehicle that has waited longest and give it its messages; whether there was one."""
        if not self._waiting:
            self.asked.clear()
            return False
        name = next(iter(self._waiting))
        try:
            run = self._opened(name)
        except Exception as error:  # noqa: BLE001 - as in `guarded`
            del self._waiting[name]
            self.refuse(name, reason_of(error))
            return True
        self.refusals.pop(name, None)
        self.runs[name] = self.ready[name] = run
        self.journal.event(
            "vehicle_started",
            "service",
            f"{run.core.vehicle.name or 'vehicle'}, {len(self.runs)} in all",
            name,
        )
        self.guarded(run, run.open)
        for source, data, arrival, topic in self._waiting.pop(name):
            self.guarded(run, lambda s=source, d=data, a=arrival, t=topic: _feed(run, s, d, a, t))  # type: ignore[misc]
        self.filled.set()
        return True

    def _opened(self, name: str) -> VehicleRun:
        self.roster.refresh()
        vehicle, profile = self.roster.of(name)
        if profile is not None:
            check_channels(profile, vehicle, self._options.window)
        decoders = [Decoder(profile) for _ in self._topics]
        channels = [channel for decoder in decoders for channel in self._options.promised(decoder, vehicle)]
        core, setpoint = self._options.core(vehicle, [one.named(name) for one in self._topics], channels)
        run = VehicleRun(
            core, Inbox(CAPACITY, self.clock), decoders, (), profile=profile, name=name, setpoint=setpoint,
            record=None if self._record is None else self._record / name, thread=next(self._threads), segment=next(self._segments),
            predict=PREDICT,
        )  # fmt: skip
        run.listeners += [*(outbox.put for outbox in self._outboxes), *self.journal.listeners]
        return run

    def finish(self) -> None:
        """The sources have ended: estimate and publish what is left."""
        for run in list(self.runs.values()):
            self.guarded(run, run.finish)

    def close(self) -> dict[str, str]:
        """Close the records whole; by vehicle, why one was not written to its end."""
        failed = {}
        for run in self.runs.values():
            run.pipeline.close()
            if run.pipeline.failure:
                failed[run.name] = run.pipeline.failure
        self._closing.close()
        return failed


def _feed(run: VehicleRun, source: int, data: bytes, arrival: float | None, topic: str) -> None:
    feed = run.feeds[source]
    if len(data) > MOST_BYTES:
        feed.reject(f"of {len(data)} bytes, more than {MOST_BYTES}")
    elif len(run.inbox.samples) >= run.inbox.capacity:
        feed.dropped(1)  # before it is decoded: a vehicle that sends too much costs no other more than that
    else:
        feed.message(data, arrival, topic=topic)
