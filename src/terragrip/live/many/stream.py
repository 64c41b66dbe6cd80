"""Clients of a studio sink, each with the vehicle that it asked for: ``/?vehicle=NAME``, else the first that sends."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator, Mapping
from contextlib import aclosing
from urllib.parse import parse_qs, urlsplit

from terragrip.errors import InputError, suggestion
from terragrip.live.broadcast import Broadcast
from terragrip.live.message import Message
from terragrip.live.vehicle_run import VehicleRun

_LOOK = 0.2  # s


class ManyStreams:
    """A `Broadcast` a vehicle that somebody listens to. Its first message names all ``vehicles`` too."""

    def __init__(self, runs: Mapping[str, VehicleRun]) -> None:
        self._runs = runs
        self._broadcasts: dict[str, Broadcast] = {}

    def put(self, message: Message) -> None:
        """Queue a message for the clients of its vehicle."""
        broadcast = self._broadcasts.get(message.vehicle)
        if broadcast is not None:
            broadcast.put(message)

    async def subscribe(self, request: str) -> AsyncGenerator[str | bytes]:
        """The frames for a client; raises InputError where no vehicle is called so."""
        parts = urlsplit(request)
        asked = parse_qs(parts.query)
        while not self._runs:
            await asyncio.sleep(_LOOK)
        name = asked.pop("vehicle", [next(iter(self._runs))])[0]
        run = self._runs.get(name)
        if run is None:
            hint = suggestion(name, self._runs, "look at /health/ready")
            raise InputError(f"no vehicle {name[:40]!r} sends", hint=hint)
        broadcast = self._broadcasts.get(name)
        if broadcast is None or broadcast.columns != run.core.columns:
            broadcast = self._broadcasts[name] = Broadcast(run.core.vehicle.name or name, run.core.columns)
        rest = "&".join(f"{key}={values[0]}" for key, values in asked.items())
        async with aclosing(broadcast.subscribe(f"/?{rest}" if rest else "/")) as frames:
            hello = json.loads(str(await anext(frames)))
            yield json.dumps({**hello, "name": name, "vehicles": sorted(self._runs)})
            async for frame in frames:
                yield frame
