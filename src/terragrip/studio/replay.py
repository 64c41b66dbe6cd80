"""Frames for the live page: a table of estimates played again, or those of a live service passed on.

Both speak as `terragrip.live.links.studio` does: a hello as JSON, then rows of little-endian doubles (time, predicted, event, columns in
order), here several rows to a message, and JSON texts for everything else.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.ground.events import events
from terragrip.live.links.studio import hello

if TYPE_CHECKING:
    from terragrip.estimation import Estimates

_REFUSED = 1008  # how a live service refuses a request for what it does not have
PERIOD = 1 / 60
"""Seconds between messages: as often as a screen draws."""
PATTERNS = (
    "slip_*",
    "adhesion_*",
    "ground_speed*",
    "wheel_speed_*",
    "soil_resistance*",
    "efficiency_*",
    "curve_a",
    "curve_a_std",
)
"""Columns that the page shows."""


async def replayed(table: Estimates, speed: float, start: float) -> AsyncIterator[str | bytes]:
    """Play a table from `start` [s] at `speed` times its own pace; ends with the table."""
    names = [n for n in table.columns if _wanted(n)]
    first = hello(table.vehicle.name, table.columns, table.vehicle.free_wheels, names)
    yield json.dumps({**first, "replay": {"start": float(table.time[0]), "end": float(table.time[-1])}})
    messages = [
        {"kind": e.kind, "source": "estimator", "time": e.start, "text": e.why} for e in events(table)
    ]
    soils = _soils(table)
    row = int(np.searchsorted(table.time, start))
    loop = asyncio.get_running_loop()
    began = loop.time()
    due = began
    origin = float(table.time[min(row, len(table) - 1)])
    while row < len(table):
        now = origin + (loop.time() - began) * speed
        last = min(int(np.searchsorted(table.time, now, "right")), len(table))
        if last > row:
            yield _rows(table, names, row, last)
            for message in _until(messages, now):
                yield json.dumps(message)
            for message in _until(soils, now):
                yield json.dumps(message)
            row = last
        due += PERIOD
        await asyncio.sleep(max(due - loop.time(), 0.0))


def _wanted(name: str) -> bool:
    from fnmatch import fnmatchcase

    return any(fnmatchcase(name, pattern) for pattern in PATTERNS)


def _rows(table: Estimates, names: list[str], first: int, last: int) -> bytes:
    block = np.empty((last - first, 3 + len(names)))
    block[:, 0] = table.time[first:last]
    block[:, 1] = 0.0
    block[:, 2] = table.event_codes[first:last]
    for place, name in enumerate(names, 3):
        block[:, place] = table.columns[name][first:last]
    return block.tobytes()


def _until(messages: list[dict[str, Any]], now: float) -> list[dict[str, Any]]:
    due = [m for m in messages if m["time"] <= now]
    del messages[: len(due)]
    return due


def _soils(table: Estimates) -> list[dict[str, Any]]:
    """When the soil changes along the drive: recognised where the table holds that, else as labelled."""
    name = next((n for n in ("soil_estimate", "soil") if n in table.labels), None)
    if name is None:
        return []
    labels = table.labels[name]
    edges = np.r_[0, np.flatnonzero(labels[1:] != labels[:-1]) + 1]
    certain = table.columns.get("soil_probability")
    return [
        {
            "kind": "soil",
            "time": float(table.time[k]),
            "soil": str(labels[k]),
            "probability": None if certain is None or not math.isfinite(certain[k]) else float(certain[k]),
            "labelled": name == "soil",
        }
        for k in edges
    ]


async def relayed(address: str, token: str | None, vehicle: str = "") -> AsyncIterator[str | bytes]:
    """Pass on a live service's messages, of one ``vehicle`` of many; ends when the service does.

    Raises InputError where it cannot be reached, or has no such vehicle.
    """
    from urllib.parse import urlencode

    from websockets.asyncio.client import connect
    from websockets.exceptions import ConnectionClosed, WebSocketException

    asked = {"format": "binary", "columns": ",".join(PATTERNS), "vehicle": vehicle}
    query = urlencode({name: value for name, value in asked.items() if value})
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        async with connect(
            f"{address.rstrip('/')}/?{query}",
            additional_headers=headers,
            max_size=1 << 20,
            close_timeout=0.5,  # the answer stands behind the rows that a page left unread, and does not come
        ) as socket:
            async for message in _together(socket):
                yield message
    except ConnectionClosed as closed:
        if closed.rcvd is not None and closed.rcvd.code == _REFUSED:
            raise InputError(closed.rcvd.reason, place=address) from closed
    except (OSError, WebSocketException, TimeoutError) as error:
        raise InputError(
            f"does not answer ({error})",
            place=address,
            hint=f"start 'terragrip live' with --sink studio://{address.partition('://')[2].rstrip('/')}",
        ) from error


async def _together(socket: Any) -> AsyncIterator[str | bytes]:
    """Messages in their order, rows that come within `PERIOD` of each other in one. Raises ConnectionClosed at the end."""
    from websockets.exceptions import ConnectionClosed

    loop = asyncio.get_running_loop()
    while True:
        message = await socket.recv()
        if isinstance(message, str):
            yield message
            continue
        rows, due, text, gone = [message], loop.time() + PERIOD, None, None
        while text is None and gone is None:
            try:
                async with asyncio.timeout_at(due):
                    message = await socket.recv()
            except TimeoutError:
                break
            except ConnectionClosed as closed:
                gone = closed
                break
            if isinstance(message, str):
                text = message
            else:
                rows.append(message)
        yield b"".join(rows)
        if text is not None:
            yield text
        if gone is not None:
            raise gone
