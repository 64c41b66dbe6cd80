"""The tasks of a service: its sources and sinks, which run again after a loss, waiting longer each time; and its work."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from functools import partial
from typing import Any

from terragrip.live.feed import Lost
from terragrip.live.links import Sink
from terragrip.live.outbox import Outbox

_BACKOFF = (0.5, 30.0)  # s, doubled from the first to the last
_PATIENCE = 1.0  # s until a task is cancelled again
_LINGER = 2.0  # s for sinks to send the last messages
PAUSE = 0.002  # s between two looks at whether others have done enough
_SETTLED = 10.0  # s connected, after which the back-off begins anew

Task = asyncio.Task[Any]
Run = Callable[[], Awaitable[None]]


async def run_links(
    sources: Sequence[tuple[Run, Callable[[str], None]]],
    sinks: Sequence[tuple[Sink, Outbox]],
    work: Sequence[Coroutine[Any, Any, Any]],
    *,
    has_left: Callable[[], bool],
    finish: Callable[[], None],
) -> None:
    """Run sources, sinks and ``work`` together; at the end ``finish``, and give the sinks some time for the last messages.

    The end is where a part of the work ends, or where all sources have ended and nothing that they brought is left. Of a source there is
    what runs it, and whom to tell that it is lost. Raises what one of them raised: InputError where a source or sink cannot be used at all.
    """
    gc.freeze()  # what is there now stays: the collector need not look at it again
    start = asyncio.create_task
    feeding = [start(_restarted_when_lost(run, lost)) for run, lost in sources]
    sending = [start(_restarted_when_lost(partial(sink.run, outbox), outbox.lost)) for sink, outbox in sinks]
    until_end = [start(_all_done(feeding, has_left)), *map(start, work)]
    try:
        await asyncio.wait([*until_end, *sending], return_when=asyncio.FIRST_COMPLETED)
        await cancelled([*feeding, *until_end])
        for task in (*feeding, *sending, *until_end):
            if task.done() and not task.cancelled() and (failure := task.exception()) is not None:
                raise failure
        finish()
        for _, outbox in sinks:
            await outbox.drained(_LINGER)
    finally:
        await cancelled([*feeding, *until_end, *sending])
        gc.unfreeze()


async def _all_done(sources: Sequence[Task], has_left: Callable[[], bool]) -> None:
    """Wait until the sources have ended, and what they brought is taken; raises what one of them raises."""
    await asyncio.gather(*sources)
    while has_left():
        await asyncio.sleep(PAUSE)


async def _restarted_when_lost(run: Run, lost: Callable[[str], None]) -> None:
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


async def cancelled(tasks: Sequence[Task]) -> None:
    """Cancel tasks and wait for their end; again, where one goes on: it may wait for another side that no longer answers, or a library may
    have lost the cancellation.
    """
    while going_on := [task for task in tasks if not task.done()]:
        for task in going_on:
            task.cancel()
        await asyncio.wait(going_on, timeout=_PATIENCE)
    await asyncio.gather(*tasks, return_exceptions=True)
