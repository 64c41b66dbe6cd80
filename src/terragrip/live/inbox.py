"""What sources bring, until the service takes it: samples, counts and events.

Room for samples is bounded, so that a backlog is dropped and counted, not hidden.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from terragrip.live.outputs import Values

CAPACITY = 8192  # samples
Arrived = tuple[float, int, float, Values]
"""Arrival [s], source, stamp [s], values."""


def steady_clock() -> Callable[[], float]:
    """A clock that gives s since 1970 and never steps."""
    ahead, now = time.time() - time.monotonic(), time.monotonic
    return lambda: now() + ahead


async def newly_set(event: asyncio.Event, seconds: float | None) -> None:
    """Clear an event and wait until it is set again, at most so long; None: for ever."""
    event.clear()
    with suppress(TimeoutError):
        async with asyncio.timeout(None if seconds is None else max(seconds, 0.0) + 1e-4):
            await event.wait()


class Inbox:
    """A queue with one reader. ``clock``: arrivals' (`steady_clock`)."""

    def __init__(self, capacity: int = CAPACITY, clock: Callable[[], float] | None = None) -> None:
        self.capacity = capacity
        self.clock = clock or steady_clock()
        self.samples: deque[Arrived] = deque()
        self.values_dropped = 0
        self._counts: dict[tuple[str, int | None, tuple[str, ...]], int] = {}
        self._events: list[dict[str, Any]] = []
        self._filled, self._room = asyncio.Event(), asyncio.Event()

    def put(self, source: int, stamp: float | None, values: Values, arrival: float | None = None) -> None:
        """Add a sample, stamped by its arrival where it has no stamp; drop it, counted, where there is no room."""
        if len(self.samples) >= self.capacity:
            self.values_dropped += len(values)
            self.count("dropped", values, source=source)
            return
        now = self.clock() if arrival is None else arrival
        self.samples.append((now, source, now if stamp is None else stamp, values))
        self._filled.set()

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a sample nor a count nor an event."""
        return not (self.samples or self._counts or self._events)

    def count(self, fate: str, channels: Iterable[str], number: int = 1, source: int | None = None) -> None:
        """Count what happened beside the samples (`terragrip.live.counts.FATES`)."""
        key = (fate, source, tuple(channels))
        self._counts[key] = self._counts.get(key, 0) + number
        self._filled.set()

    def event(self, kind: str, source: str, text: str) -> None:
        """Add an event (`terragrip.log_events.LIVE`) of a source or sink."""
        sound = text.encode("utf-8", "backslashreplace").decode()  # half a surrogate pair is no text to most
        self._events.append({"event": {"time": None, "kind": kind, "source": source, "text": sound}})
        self._filled.set()

    def notes(self) -> list[dict[str, Any]]:
        """The counts and events since the last call, for `Core.note`."""
        if not self._counts and not self._events:
            return []
        counts, self._counts = self._counts, {}
        events, self._events = self._events, []
        now = self.clock()
        return [
            {"fate": fate, "channels": list(channels), "number": number, "source": source, "arrival": now}
            for (fate, source, channels), number in counts.items()
        ] + events

    def pop(self, most: int) -> list[Arrived]:
        """The oldest samples, at most so many."""
        samples = [self.samples.popleft() for _ in range(min(most, len(self.samples)))]
        self._room.set()
        return samples

    async def filled(self, until: float | None = None) -> None:
        """Wait until something is there, at most up to ``until`` on the clock [s]; lets others have their turn in any case."""
        if not self.is_empty:
            await asyncio.sleep(0)
            return
        await newly_set(self._filled, None if until is None else until - self.clock())

    async def room(self) -> None:
        """Wait until at least half of the place is free: for sources that can wait."""
        await asyncio.sleep(0)
        while len(self.samples) > self.capacity // 2:
            self._room.clear()
            await self._room.wait()
