"""The queue in front of a sink: bounded; where a sink is too slow the oldest go, and are counted."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

from terragrip.live.message import ESTIMATE, Columns, Message
from terragrip.live.uri import Uri

CAPACITY = 1000  # messages


class Outbox:
    """``rate`` [Hz] and ``columns`` of the sink's URI thin out estimates; events and predictions always pass."""

    def __init__(self, uri: Uri, capacity: int = CAPACITY) -> None:
        self.uri, self.capacity = uri, capacity
        self.step = 0.0 if "rate" not in uri.options else 1.0 / uri.number("rate", 1.0)
        self.columns = Columns(uri.options["columns"]) if "columns" in uri.options else None
        self.dropped = self.sent = 0
        self.is_lost = False
        self.direct: Callable[[Message], None] | None = None  # a sink that never waits takes messages at once
        self.connected: Callable[[], None] = lambda: None  # a sink calls it once it has its other side
        self._queue: deque[Message] = deque()
        self._filled = asyncio.Event()
        self._next = float("-inf")

    def put(self, message: Message) -> None:
        """Add a message, or leave it out where the sink wants fewer."""
        if self.step and message.kind == ESTIMATE and message.row is not None and not message.row.predicted:
            if self._next - self.step < message.time < self._next:
                return
            # On a grid, so that 10 Hz out of 100 Hz is every tenth; anew after a pause.
            late = message.time - self._next > self.step
            self._next = (
                message.time + self.step * (1 - 1e-6) if late or self._next < 0 else self._next + self.step
            )
        if self.direct is not None:
            self.sent += 1
            self.direct(message)
            return
        if len(self._queue) >= self.capacity:
            self._queue.popleft()
            self.dropped += 1
        self._queue.append(message)
        self._filled.set()

    async def deliver(self, take: Callable[[Message], None]) -> None:
        """Give every message to ``take`` as it comes, until cancelled or ``take`` raises; what has waited comes first."""
        loop = asyncio.get_running_loop()
        failed: asyncio.Future[None] = loop.create_future()

        def safely(message: Message) -> None:
            try:
                take(message)
            except Exception as error:  # noqa: BLE001 - handed to who awaits this
                self.direct = None
                if not failed.done():
                    failed.set_exception(error)

        while self._queue and not failed.done():
            safely(self._queue.popleft())
        self.direct = safely
        try:
            await failed
        finally:
            self.direct = None

    async def get(self) -> Message:
        """The next message."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        self.sent += 1
        return self._queue.popleft()

    @property
    def is_busy(self) -> bool:
        """Whether a sink that is not lost has half of the queue before it."""
        return not self.is_lost and len(self._queue) > self.capacity // 2

    def __len__(self) -> int:
        return len(self._queue)

    async def emptied(self, timeout: float) -> None:
        """Wait until the sink has taken all, at most ``timeout`` s."""
        try:
            async with asyncio.timeout(timeout):
                while self._queue:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            self.dropped += len(self._queue)
