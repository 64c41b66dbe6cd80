"""A WebSocket server of our own, which the studio's pages and any script read.

First comes a JSON text: ``{"kind": "hello", "version", "vehicle", "columns", "wheels", "driven", "events"}``; of many vehicles the one
asked for by ``/?vehicle=NAME``, else the first, with its ``name`` and all ``vehicles``. Then JSON texts ``{"kind": "estimate", …}``,
``status``, ``soil``, ``ground``, ``setpoint``; the ``kind`` of an event is its own. A client that asks for binary gets estimates as
little-endian doubles: time [s], 1 if predicted, the place of the event in ``events``, then ``columns`` in order.
"""

from __future__ import annotations

import asyncio
import http
import json
import math
import struct
from contextlib import aclosing
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from terragrip import __version__
from terragrip.errors import InputError, suggestion
from terragrip.estimation.columns import wheels_with
from terragrip.estimation.engine import EVENTS
from terragrip.live.credentials import Credentials
from terragrip.live.feed import Lost
from terragrip.live.message import Columns, Message
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri, is_loopback
from terragrip.prometheus_text import CONTENT_TYPE

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Collection, Mapping, Sequence

    from terragrip.live.monitor import Answers
    from terragrip.vehicle import Vehicle

OPTIONS = ("rate", "columns", "format", "token", "vehicle")
_LOOK = 0.2  # s between two looks for a first vehicle


def hello(vehicle: str, every: Collection[str], free: Collection[str], sent: Sequence[str]) -> dict[str, Any]:
    """The first message: of a vehicle by name, ``every`` column of its estimates, its ``free`` wheels, and the columns ``sent``."""
    wheels = wheels_with("slip", every)
    return {
        "kind": "hello", "version": __version__, "vehicle": vehicle, "columns": list(sent), "wheels": list(wheels),
        "driven": [w for w in wheels if w not in free], "events": list(EVENTS),
    }  # fmt: skip


class StudioSink:
    """``studio://127.0.0.1:8766``. Beyond this machine clients must know the token.

    ``monitor``, which the service sets: what answers plain HTTP requests for its state. ``vehicles``, which a service of many sets: as of
    `Broadcast`.
    """

    def __init__(self, uri: Uri, vehicle: Vehicle | None, columns: Sequence[str]) -> None:
        import websockets.asyncio.server  # noqa: F401  # so that a missing package is said at once

        self.uri = uri
        name, free = (vehicle.name, vehicle.free_wheels) if vehicle else ("", ())
        self.broadcast = Broadcast(lambda: {"": (name, columns, free)})
        self.monitor: Answers | None = None
        self._credentials = Credentials.find()
        if not is_loopback(uri.host) and not self._credentials.token:
            raise InputError(
                "anyone could listen here", place=uri.text, hint="serve on 127.0.0.1, or set TERRAGRIP_TOKEN"
            )

    async def run(self, outbox: Outbox) -> None:
        """Serve messages; raises Lost where the port is taken."""
        from websockets.asyncio.server import serve

        try:
            server = await serve(
                self._serve, self.uri.host, self.uri.port or 8766, process_request=self._admit
            )
        except OSError as error:
            raise Lost(f"the server: {error.strerror or error}") from error
        async with server:
            outbox.connected()
            while True:
                self.broadcast.put(await outbox.get())

    def _admit(self, connection: Any, request: Any) -> Any:
        """Refuse who may not listen; answer whoever asks for the service's state; let the others have their WebSocket."""
        refusal = self._refusal(request)
        if refusal is not None:
            return connection.respond(*refusal)
        asked = None if self.monitor is None else self.monitor.answer(urlsplit(request.path).path)
        if asked is None:
            return None
        answer = connection.respond(http.HTTPStatus(asked[0]), asked[1])
        del answer.headers["Content-Type"]
        answer.headers["Content-Type"] = CONTENT_TYPE
        return answer

    def _refusal(self, request: Any) -> tuple[http.HTTPStatus, str] | None:
        """The refusal of a client without the token, where one is set, or of a page of another site; else None.

        A site whose name leads to this machine (DNS rebinding) sends no Origin with a GET, but its name as Host.
        """
        origin = request.headers.get("Origin")
        claimed = [origin] if origin else []
        if self._credentials.token is None:
            claimed.append(f"//{request.headers.get('Host', '')}")
        if not all(map(_is_here, claimed)):
            return http.HTTPStatus.FORBIDDEN, "Pages of other sites are refused.\n"
        if self._credentials.token is None:
            return None
        given = request.headers.get("Authorization", "").removeprefix("Bearer ")
        given = given or parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if self._credentials.grants(given):
            return None
        return http.HTTPStatus.UNAUTHORIZED, "The token is wrong or missing.\n"

    async def _serve(self, connection: Any) -> None:
        """Send one client its frames until it disconnects, which is noticed while there are no frames, too."""
        sending = asyncio.create_task(self._send(connection))
        closed = asyncio.create_task(connection.wait_closed())
        try:
            await asyncio.wait((sending, closed), return_when=asyncio.FIRST_COMPLETED)
            if sending.done():
                sending.result()
        finally:
            sending.cancel()
            closed.cancel()
            await asyncio.gather(sending, closed, return_exceptions=True)

    async def _send(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            async with aclosing(self.broadcast.subscribe(connection.request.path)) as frames:
                async for frame in frames:
                    await connection.send(frame)
        except InputError as error:
            await connection.close(1008, str(error)[:120])
        except ConnectionClosed:
            return


def _is_here(url: str) -> bool:
    """Whether a URL leads to this machine, by its text alone."""
    try:
        return is_loopback(urlsplit(url).hostname or "")
    except ValueError:
        return False


class Broadcast:
    """Messages to any number of clients, each with a queue of its own.

    ``vehicles``: by the name in messages what each vehicle is called, its columns and its free wheels; of one alone its name is empty.
    ``put`` queues a message for the clients of its vehicle; ``subscribe`` gives one client's frames.
    """

    def __init__(
        self, vehicles: Callable[[], Mapping[str, tuple[str, Sequence[str], Sequence[str]]]]
    ) -> None:
        self.vehicles = vehicles
        self._clients: list[tuple[str, Outbox]] = []

    def __len__(self) -> int:
        return len(self._clients)

    def put(self, message: Message) -> None:
        """Queue a message for each client of its vehicle."""
        for vehicle, client in self._clients:
            if vehicle == message.vehicle:
                client.put(message)

    async def _hello(self, uri: Uri, columns: Columns | None) -> tuple[str, dict[str, Any]]:
        """Of the vehicle that was asked for, once there is one, its name and the first message; raises InputError where there is none."""
        while not (vehicles := self.vehicles()):
            await asyncio.sleep(_LOOK)
        name = uri.options.get("vehicle", next(iter(vehicles)))
        if name not in vehicles:
            hint = suggestion(name, vehicles, "look at /health/ready")
            raise InputError(f"no vehicle {name[:40]!r} sends", hint=hint)
        vehicle, every, free = vehicles[name]
        first = hello(vehicle, every, free, [n for n in every if columns is None or columns.wants(n)])
        return name, {**first, "name": name, "vehicles": sorted(vehicles)} if name else first

    async def subscribe(self, request: str = "/") -> AsyncGenerator[str | bytes]:
        """The frames for a client that asked for ``/?format=binary&rate=20&columns=slip_*``; raises InputError on any other."""
        uri = Uri.parse(f"studio://127.0.0.1{request}", {"studio": OPTIONS}, "sink")
        binary = uri.choice("format", ("json", "binary")) == "binary"
        client = Outbox(uri)
        name, first = await self._hello(uri, client.columns)
        columns = first["columns"]
        packer = struct.Struct(f"<{3 + len(columns)}d")
        self._clients.append((name, client))
        try:
            yield json.dumps(first)
            while True:
                message = await client.get()
                row = message.row
                if binary and row is not None:
                    values, places = row.estimate.values, row.estimate.places
                    event = EVENTS.index(row.estimate.event)
                    numbers = (values[places[n]] if n in places else math.nan for n in columns)
                    yield packer.pack(row.estimate.time, row.predicted, event, *numbers)
                else:
                    yield message.json(client.columns).decode()
        finally:
            self._clients.remove((name, client))
