"""From the thread of a library into the service's: bounded, so that a backlog is dropped and counted, not piled up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from terragrip.live.feed import Feed

_MOST = 4096  # messages on their way


class Door:
    """``hand`` is called in another thread; the act it is given runs in the loop's."""

    def __init__(self, feed: Feed, most: int = _MOST) -> None:
        self._feed, self._most = feed, most
        self._loop = asyncio.get_running_loop()
        self._handed = self._done = self._lost = 0  # each counted by one thread only
        self._told = 0

    def hand(self, act: Callable[..., None], *arguments: Any) -> None:
        """Have ``act`` done in the loop's thread, or count it as dropped where too much is on its way."""
        if self._handed - self._done >= self._most:
            self._lost += 1
            return
        self._handed += 1
        self._loop.call_soon_threadsafe(self._do, act, arguments)

    def _do(self, act: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self._done += 1
        lost = self._lost - self._told
        if lost:
            self._told += lost
            self._feed.dropped(lost)
        act(*arguments)
