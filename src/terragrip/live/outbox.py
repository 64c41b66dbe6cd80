"""The queue in front of a sink: bounded; where a sink is too slow the oldest go, and are counted."""

from __future__ import annotations

import asyncio
from collections import deque

from terragrip.live.inbox import Inbox
from terragrip.live.message import ESTIMATE, SETPOINT, Columns, Message
from terragrip.live.uri import Uri

CAPACITY = 1000  # messages


class Outbox:
    """``rate`` [Hz] and ``columns`` of the sink's URI thin out estimates, and with them the set-points that go by them; events and
    predictions always pass.

    ``inbox``: where it is reported that the sink is lost, or back.
    """

    def __init__(self, uri: Uri, inbox: Inbox | None = None, capacity: int = CAPACITY) -> None:
        self.uri, self.capacity = uri, capacity
        self.step = 0.0 if "rate" not in uri.options else 1.0 / uri.number("rate", 1.0)
        self.columns = Columns(uri.options["columns"]) if "columns" in uri.options else None
        self.dropped = self.sent = 0
        self.is_lost = False
        self._inbox = inbox
        self._queue: deque[Message] = deque()
        self._filled = asyncio.Event()
        self._next = float("-inf")
        self._passed = True  # the last estimate

    def put(self, message: Message) -> None:
        """Add a message, or leave it out where the sink wants fewer."""
        if self.step and message.kind == ESTIMATE and message.row is not None and not message.row.predicted:
            self._passed = not self._next - self.step < message.time < self._next
            if not self._passed:
                return
            # On a grid, so that 10 Hz out of 100 Hz is every tenth; anew after a pause.
            late = message.time - self._next > self.step
            self._next = (
                message.time + self.step * (1 - 1e-6) if late or self._next < 0 else self._next + self.step
            )
        if self.step and message.kind == SETPOINT and not self._passed:
            return
        if len(self._queue) >= self.capacity:
            self._queue.popleft()
            self.dropped += 1
        self._queue.append(message)
        self._filled.set()

    async def get(self) -> Message:
        """The next message."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        self.sent += 1
        return self._queue.popleft()

    def connected(self) -> None:
        """The sink has its other side (again)."""
        if self.is_lost and self._inbox is not None:
            self._inbox.event("sink_back", self.uri.name, "connected again")
        self.is_lost = False

    def lost(self, why: str) -> None:
        """The sink lost its other side."""
        if not self.is_lost and self._inbox is not None:
            self._inbox.event("sink_lost", self.uri.name, why)
        self.is_lost = True

    @property
    def is_busy(self) -> bool:
        """Whether a sink that is not lost has half of the queue before it."""
        return not self.is_lost and len(self._queue) > self.capacity // 2

    def __len__(self) -> int:
        return len(self._queue)

    async def emptied(self, timeout: float) -> None:
        """Wait until the sink has sent all, at most ``timeout`` s."""
        try:
            async with asyncio.timeout(timeout):
                while self._queue:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            self.dropped += len(self._queue)
