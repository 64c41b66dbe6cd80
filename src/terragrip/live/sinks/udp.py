"""Datagrams to one address: JSON, or doubles in the order of the wanted columns, as Simulink receives them."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct

from terragrip.errors import InputError
from terragrip.live.feed import Lost
from terragrip.live.message import ESTIMATE, Message
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri

_PASSING = {errno.EAGAIN, errno.ENOBUFS, errno.EMSGSIZE}
"""What concerns one message, not the way."""


class UdpSink:
    """``udp://HOST:PORT?format=json|doubles``. Doubles are little-endian: time, then the columns; events are left out."""

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.packed = uri.choice("format", ("json", "doubles")) == "doubles"
        self.port = uri.port or 0
        if not self.port or not uri.host:
            raise InputError("has no host or no port", place=uri.text, hint="write udp://127.0.0.1:9871")

    async def run(self, outbox: Outbox) -> None:
        """Send messages; raises Lost where the system does not let us."""
        try:
            link = await self._socket()
        except OSError as error:
            raise Lost(f"cannot send to {self.uri.host} ({error.strerror or error})") from error
        outbox.connected()
        with link:
            while True:
                message = await outbox.get()
                data = self._packed(message, outbox) if self.packed else message.json(outbox.columns)
                try:
                    if data:
                        link.send(data)
                except ConnectionRefusedError:
                    pass  # nobody listens yet; the next may find someone
                except OSError as error:
                    if error.errno not in _PASSING:
                        raise Lost(f"cannot send to {self.uri.host} ({error.strerror or error})") from error
                    outbox.dropped += 1

    async def _socket(self) -> socket.socket:
        loop = asyncio.get_running_loop()
        (family, kind, protocol, _, address), *_ = await loop.getaddrinfo(
            self.uri.host, self.port, type=socket.SOCK_DGRAM
        )
        link = socket.socket(family, kind, protocol)
        try:
            link.setblocking(False)
            link.connect(address)
        except OSError:
            link.close()
            raise
        return link

    def _packed(self, message: Message, outbox: Outbox) -> bytes:
        row = message.row
        if message.kind != ESTIMATE or row is None:
            return b""
        places = row.estimate.places if outbox.columns is None else outbox.columns.places(row)
        values = row.estimate.values
        numbers = [values[place] for place in places.values()]
        return struct.pack(f"<{1 + len(numbers)}d", row.estimate.time, *numbers)
