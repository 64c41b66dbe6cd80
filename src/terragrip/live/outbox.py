"""The queue in front of a sink: bounded; where a sink is too slow the oldest messages are dropped, and counted."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Protocol

from terragrip.live.message import ESTIMATE, SETPOINT, Columns, Message
from terragrip.live.uri import Uri

CAPACITY = 1000  # messages of one vehicle


class Events(Protocol):
    """Where a sink that is lost, or back, is reported: an inbox, or a service of many vehicles."""

    def event(self, kind: str, source: str, text: str) -> None: ...


class _Lane:
    """One vehicle's messages. ``step`` [s]: estimates, and the set-points that go by them, are thinned out to one in so long."""

    __slots__ = ("_next", "_passed", "_step", "queue")

    def __init__(self, step: float) -> None:
        self.queue: deque[Message] = deque()
        self._step = step
        self._next = float("-inf")
        self._passed = True  # the last estimate

    def wants(self, message: Message) -> bool:
        """Whether a message goes to the sink; events and predictions always do."""
        if not self._step:
            return True
        if message.kind == SETPOINT:
            return self._passed
        if message.kind != ESTIMATE or message.row is None or message.row.predicted:
            return True
        self._passed = not self._next - self._step < message.time < self._next
        if self._passed:
            # On a grid, so that 10 Hz out of 100 Hz is every tenth; anew after a pause.
            late = message.time - self._next > self._step
            anew = late or self._next < 0
            self._next = message.time + self._step * (1 - 1e-6) if anew else self._next + self._step
        return self._passed


class Outbox:
    """``rate`` [Hz] and ``columns`` of the sink's URI thin out the estimates of each vehicle.

    Each vehicle has a queue of its own, for ``capacity`` messages, and they have their turns: one that sends too much pushes out its
    own messages alone. ``events``: where it is reported that the sink is lost, or back.
    """

    def __init__(self, uri: Uri, events: Events | None = None, capacity: int = CAPACITY) -> None:
        self.uri, self.capacity = uri, capacity
        self.step = 0.0 if "rate" not in uri.options else 1.0 / uri.number("rate", 1.0)
        self.columns = Columns(uri.options["columns"]) if "columns" in uri.options else None
        self.dropped = self.sent = 0
        self.is_lost = False
        self._events = events
        self._lanes: dict[str, _Lane] = {}
        self._turns: deque[_Lane] = deque()  # lanes that hold messages
        self._size = 0
        self._filled = asyncio.Event()

    def put(self, message: Message) -> None:
        """Add a message, or leave it out where the sink wants fewer."""
        lane = self._lanes.get(message.vehicle)
        if lane is None:
            lane = self._lanes[message.vehicle] = _Lane(self.step)
        if not lane.wants(message):
            return
        queue = lane.queue
        if not queue:
            self._turns.append(lane)
        if len(queue) >= self.capacity:
            queue.popleft()
            self.dropped += 1
        else:
            self._size += 1
        queue.append(message)
        self._filled.set()

    async def get(self) -> Message:
        """The next message."""
        while not self._turns:
            self._filled.clear()
            await self._filled.wait()
        self.sent += 1
        self._size -= 1
        lane = self._turns.popleft()
        message = lane.queue.popleft()
        if lane.queue:
            self._turns.append(lane)
        return message

    def connected(self) -> None:
        """The sink has its other side (again)."""
        if self.is_lost and self._events is not None:
            self._events.event("sink_back", self.uri.name, "connected again")
        self.is_lost = False

    def lost(self, why: str) -> None:
        """The sink lost its other side."""
        if not self.is_lost and self._events is not None:
            self._events.event("sink_lost", self.uri.name, why)
        self.is_lost = True

    @property
    def is_busy(self) -> bool:
        """Whether a sink that is not lost has half of one vehicle's queue before it."""
        return not self.is_lost and self._size > self.capacity // 2

    def __len__(self) -> int:
        return self._size

    async def drained(self, timeout: float) -> None:
        """Wait until the sink has sent all, at most ``timeout`` s."""
        try:
            async with asyncio.timeout(timeout):
                while self._size:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            self.dropped += self._size
