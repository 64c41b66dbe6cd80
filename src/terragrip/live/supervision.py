"""Sources and sinks run again after a loss, waiting longer each time; what is lost and back is noted."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from terragrip.live.feed import Feed, Lost
from terragrip.live.outbox import Outbox
from terragrip.live.sinks import Sink
from terragrip.live.sources import Source

_BACKOFF = (0.5, 30.0)  # s, doubled from the first to the last
_SETTLED = 10.0  # s connected, after which the back-off begins anew

logger = logging.getLogger("terragrip.live")


async def supervise_source(source: Source, feed: Feed) -> None:
    """Run a source until it ends; raises InputError where it cannot be used at all."""
    await _again_and_again(lambda: source.run(feed), feed.lost)


async def supervise_sink(sink: Sink, outbox: Outbox) -> None:
    """Run a sink until cancelled; raises InputError where it cannot be used at all."""
    await _again_and_again(lambda: sink.run(outbox), outbox.lost)


async def _again_and_again(run: Callable[[], Awaitable[None]], lost: Callable[[str], None]) -> None:
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


def report_unhandled(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """A future whose failure nobody awaits: aiomqtt leaves some when a broker goes, of which the service knows."""
    if type(context.get("exception")).__module__.startswith("aiomqtt"):
        logger.info("%s: %s", context["message"], context["exception"])
    else:
        loop.default_exception_handler(context)
