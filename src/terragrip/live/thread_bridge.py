"""From the thread of a library into the service's: bounded, so that a backlog is dropped and counted, not piled up."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

from terragrip.live.feed import Receiver

_MOST = 4096  # calls on their way


class ThreadBridge:
    """`call` is used in another thread; what it is given runs in the loop's."""

    def __init__(self, feed: Receiver, most: int = _MOST) -> None:
        self._feed, self._most = feed, most
        self._loop = asyncio.get_running_loop()
        self._sent = self._done = self._dropped = 0  # each counted by one thread only
        self._reported = 0

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Have a function called in the loop's thread, or count it as dropped where too much is on its way."""
        if self._sent - self._done >= self._most:
            self._dropped += 1
            return
        self._sent += 1
        self._loop.call_soon_threadsafe(self._run, function, arguments)

    def _run(self, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self._done += 1
        dropped = self._dropped - self._reported
        if dropped:
            self._reported += dropped
            self._feed.dropped(dropped)
        function(*arguments)


async def repeated_in_thread(work: Callable[[], None]) -> None:
    """Call ``work`` again and again in a thread, until it raises or this is cancelled; the thread has ended when this does.

    So what it reads from can be closed behind it; a call may last as long as a cancelled source may.
    """
    done = threading.Event()

    def repeat() -> None:
        while not done.is_set():
            work()

    reader = asyncio.ensure_future(asyncio.to_thread(repeat))
    try:
        await asyncio.shield(reader)
    finally:
        done.set()
        await asyncio.wait([reader])
        if not reader.cancelled():
            reader.exception()  # of one that was lost while it was cancelled nobody asks, and asyncio would print it
