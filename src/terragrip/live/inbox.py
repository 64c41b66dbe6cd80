"""Where sources put samples and the service takes them: bounded, so that a backlog is dropped and counted, not hidden."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable

from terragrip.live.counts import Counts

CAPACITY = 8192  # samples
_BREATH = 0.002  # s
Values = dict[str, float]
Arrived = tuple[float, int, float, Values]


class Inbox:
    """``clock`` gives s since 1970; it never steps within one run.

    ``filled`` is called when a sample comes into an empty box, ``work`` where a burst of them did.
    """

    def __init__(self, capacity: int = CAPACITY, clock: Callable[[], float] | None = None) -> None:
        self.capacity = capacity
        ahead, now = time.time() - time.monotonic(), time.monotonic
        self.clock = clock or (lambda: now() + ahead)
        self.samples: deque[Arrived] = deque()
        self.dropped = Counts()
        self.filled: Callable[[], None] = lambda: None
        self.work: Callable[[], None] = lambda: None
        self.busy: Callable[[], bool] = lambda: False  # whether sinks have enough to do
        self._room, self._wanted = asyncio.Event(), False
        self._together = False

    def put(self, source: int, stamp: float | None, values: Values, arrival: float | None = None) -> None:
        """Add a sample, stamped by its arrival where it bears no stamp; drop it, counted, where there is no room."""
        waiting = len(self.samples)
        if waiting >= self.capacity:
            self.dropped.add("dropped", values)
            return
        now = self.clock() if arrival is None else arrival
        self.samples.append((now, source, now if stamp is None else stamp, values))
        if not waiting and not self._together:
            self.filled()

    def begin(self) -> None:
        """A burst of samples begins, which whoever puts it ends by `end`."""
        self._together = not self.samples

    def end(self) -> None:
        """Have a burst worked on now, not a turn of the loop later."""
        if self._together:
            self._together = False
            if self.samples:
                self.work()

    async def room(self) -> None:
        """Wait until at least half of the place is free, and sinks keep up: for sources that can wait."""
        await asyncio.sleep(_BREATH if self.busy() else 0.0)
        while len(self.samples) > self.capacity // 2:
            self._wanted = True
            self._room.clear()
            await self._room.wait()

    def taken(self) -> None:
        """Tell waiting sources that there is room."""
        if self._wanted:
            self._wanted = False
            self._room.set()
