"""A WebSocket server of our own, which the studio's pages and any script read (terragrip.live.broadcast)."""

from __future__ import annotations

import asyncio
import http
from contextlib import aclosing
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import parse_qs, urlsplit

from terragrip.errors import InputError
from terragrip.live.broadcast import Broadcast
from terragrip.live.credentials import Credentials
from terragrip.live.feed import Lost
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri, is_loopback
from terragrip.prometheus_text import CONTENT_TYPE

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Sequence

    from terragrip.live.message import Message
    from terragrip.vehicle import Vehicle


class Stream(Protocol):
    """What clients subscribe to (`Broadcast`)."""

    def put(self, message: Message) -> None: ...

    def subscribe(self, request: str) -> AsyncGenerator[str | bytes]: ...


class Answers(Protocol):
    """What reports the service's state (`terragrip.live.monitor.Monitor`)."""

    def answer(self, path: str) -> tuple[int, str] | None: ...


class StudioSink:
    """``studio://127.0.0.1:8766``. Beyond this machine clients must know the token.

    ``monitor``: what answers plain HTTP requests for the service's state; ``broadcast``: where clients subscribe, of one vehicle unless
    the service sets another. It sets the monitor too.
    """

    def __init__(self, uri: Uri, vehicle: Vehicle | None, columns: Sequence[str]) -> None:
        import websockets.asyncio.server  # noqa: F401  # so that a missing package is said at once

        self.uri = uri
        self.broadcast: Stream = Broadcast(vehicle.name if vehicle else "", columns)
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
