"""Notices that every open page receives: changes of the folder, progress of jobs, new calibrations."""

from __future__ import annotations

import asyncio
from typing import Any

from terragrip.studio.folder import Folder, Item

PERIOD = 1.0
"""Seconds between looks at the folder while a page is open."""
BACKLOG = 256
"""Notices that may wait for a slow page before the oldest is dropped."""


class Notices:
    """Fan-out of small JSON messages to any number of pages. Used from one event loop."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._pages: set[asyncio.Queue[dict[str, Any]]] = set()
        self._watch: asyncio.Task[None] | None = None
        self._looked = asyncio.Event()

    async def join(self) -> asyncio.Queue[dict[str, Any]]:
        """A queue that receives every notice from now on; the folder is listed first, so that any later change is noticed."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue(BACKLOG)
        self._pages.add(queue)
        if self._watch is None:
            self._looked.clear()
            self._watch = asyncio.create_task(self._watch_folder())
        try:
            await self._looked.wait()
        except asyncio.CancelledError:
            self.leave(queue)
            raise
        return queue

    def leave(self, queue: asyncio.Queue[dict[str, Any]]) -> None:
        """Send no more to `queue`; without pages the folder is no longer watched."""
        self._pages.discard(queue)
        if not self._pages and self._watch is not None:
            self._watch.cancel()
            self._watch = None

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    def publish(self, kind: str, **content: Any) -> None:
        """Send {"kind": kind, ...} to every page."""
        for queue in self._pages:
            if queue.full():
                queue.get_nowait()
            queue.put_nowait({"kind": kind, **content})

    async def _watch_folder(self) -> None:
        seen: list[Item] | None = None
        while True:
            items = await asyncio.to_thread(self._folder.items)
            if seen is not None and items != seen:
                self.publish("folder")
            seen = items
            self._looked.set()
            await asyncio.sleep(PERIOD)
