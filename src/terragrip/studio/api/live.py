"""The live page's stream."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect

from terragrip.errors import InputError
from terragrip.studio.replay import relayed, replayed
from terragrip.studio.state import Here, Studio

router = APIRouter(tags=["live"])

LIVE_TOKEN = "TERRAGRIP_LIVE_TOKEN"
"""Environment variable with the token of the live service, where it needs one."""


@router.get("/live/sources")
def sources(studio: Here) -> dict[str, bool]:
    """Whether a live service was named when the studio was started."""
    return {"service": studio.live is not None}


@router.websocket("/live")
async def live(
    socket: WebSocket,
    studio: Here,
    replay: str = "",
    vehicle: str = "",
    speed: Annotated[float, Query(gt=0, le=1000)] = 1.0,
    start: float = 0.0,
) -> None:
    """Rows of the live service, of its ``vehicle`` where it has many, or of estimates of the folder played again (`replay`)."""
    await socket.accept()
    try:
        frames = await _frames(studio, replay, vehicle, speed, start)
        await _send_all(socket, frames)
        await socket.send_json({"kind": "end"})
        await socket.close()
    except InputError as error:
        text = str(error).replace(f"{studio.folder.root}/", "")
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await socket.send_json({"kind": "problem", "text": text})
            await socket.close(1011)
    except WebSocketDisconnect:
        return


async def _frames(
    studio: Studio, replay: str, vehicle: str, speed: float, start: float
) -> AsyncIterator[str | bytes]:
    if replay:
        table = await asyncio.to_thread(studio.estimates.get, studio.folder.file(replay))
        if not len(table):
            raise InputError("holds no rows", file=replay)
        return replayed(table, speed, start)
    if studio.live is None:
        raise InputError(
            "no live service was named", hint="start the studio with --live ws://HOST:PORT, or replay a run"
        )
    return relayed(studio.live, os.environ.get(LIVE_TOKEN), vehicle)


async def _send_all(socket: WebSocket, frames: AsyncIterator[str | bytes]) -> None:
    """Send frames until they end or the page closes."""

    async def pump() -> None:
        async for frame in frames:
            if isinstance(frame, str):
                await socket.send_text(frame)
            else:
                await socket.send_bytes(frame)

    async def receive() -> None:
        while True:
            await socket.receive_text()

    tasks = {asyncio.create_task(pump()), asyncio.create_task(receive())}
    done, pending = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in pending:
        task.cancel()
    await asyncio.gather(*pending, return_exceptions=True)
    failures = [
        task.exception() for task in done
    ]  # of both, where both ended: what is not looked at is logged
    for failure in failures:
        if failure is not None:
            raise failure
