"""Sources and sinks run again after a loss, waiting longer each time; what is lost and back is noted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from terragrip.live.feed import Lost
from terragrip.live.outbox import Outbox
from terragrip.live.sinks import Sink

_BACKOFF = (0.5, 30.0)  # s, doubled from the first to the last
_PATIENCE = 1.0  # s until a task is cancelled again
_SETTLED = 10.0  # s connected, after which the back-off begins anew

Task = asyncio.Task[Any]
Run = Callable[[], Awaitable[None]]


async def supervise_source(run: Run, lost: Callable[[str], None]) -> None:
    """Run a source until it ends; raises InputError where it cannot be used at all."""
    await _again_and_again(run, lost)


async def supervise_sink(sink: Sink, outbox: Outbox) -> None:
    """Run a sink until cancelled; raises InputError where it cannot be used at all."""
    await _again_and_again(lambda: sink.run(outbox), outbox.lost)


async def _again_and_again(run: Run, lost: Callable[[str], None]) -> None:
    loop = asyncio.get_running_loop()
    pause = _BACKOFF[0]
    while True:
        began = loop.time()
        try:
            await run()
            return
        except Lost as loss:
            lost(str(loss))
        if loop.time() - began > _SETTLED:
            pause = _BACKOFF[0]
        await asyncio.sleep(pause)
        pause = min(2 * pause, _BACKOFF[1])


async def ended(sources: Sequence[Task], sinks: Sequence[Task], until_end: Sequence[Task]) -> None:
    """Wait until one of ``until_end`` is done, or a sink fails; then end all but the sinks. Raises what one of them raised."""
    await asyncio.wait([*until_end, *sinks], return_when=asyncio.FIRST_COMPLETED)
    await cancelled([*sources, *until_end])
    for task in (*sources, *sinks, *until_end):
        if task.done() and not task.cancelled() and (failure := task.exception()) is not None:
            raise failure


async def cancelled(tasks: Sequence[Task]) -> None:
    """Cancel tasks and wait for their end; again, where one goes on: it may wait for another side that no longer answers, or a library may
    have lost the cancellation.
    """
    while going_on := [task for task in tasks if not task.done()]:
        for task in going_on:
            task.cancel()
        await asyncio.wait(going_on, timeout=_PATIENCE)
    await asyncio.gather(*tasks, return_exceptions=True)
