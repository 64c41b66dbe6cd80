"""Datagrams to one address: JSON, or doubles in the order of the wanted columns, as Simulink receives them."""

from __future__ import annotations

import asyncio
import struct
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.live.feed import Lost
from terragrip.live.message import ESTIMATE, Message
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle


class UdpSink:
    """``udp://HOST:PORT?format=json|doubles``. Doubles are little-endian: time, then the columns; events are left out."""

    def __init__(self, uri: Uri) -> None:
        self.uri = uri
        self.packed = uri.options.get("format", "json") == "doubles"
        self.port = uri.port or 0
        if not self.port or not uri.host:
            raise InputError("names no host and port", place=uri.text, mend="write udp://127.0.0.1:9871")
        if uri.options.get("format", "json") not in ("json", "doubles"):
            raise InputError(
                f"has no format {uri.options['format']!r}", place=uri.text, mend="json or doubles"
            )

    async def run(self, outbox: Outbox) -> None:
        """Send messages; raises Lost where the system does not let us."""
        loop = asyncio.get_running_loop()
        try:
            transport, _ = await loop.create_datagram_endpoint(
                asyncio.DatagramProtocol, remote_addr=(self.uri.host, self.port)
            )
        except OSError as error:
            raise Lost(f"cannot send to {self.uri.host} ({error.strerror or error})") from error
        outbox.connected()

        def send(message: Message) -> None:
            data = self._encoded(message, outbox)
            if data:
                transport.sendto(data)

        try:
            await outbox.deliver(send)
        finally:
            transport.close()

    def _encoded(self, message: Message, outbox: Outbox) -> bytes:
        if not self.packed:
            return message.json(outbox.columns)
        row = message.row
        if message.kind != ESTIMATE or row is None:
            return b""
        places = row.estimate.places if outbox.columns is None else outbox.columns.places(row)
        values = row.estimate.values
        numbers = [values[place] for place in places.values()]
        return struct.pack(f"<{1 + len(numbers)}d", row.estimate.time, *numbers)


def open_sink(uri: Uri, vehicle: Vehicle) -> UdpSink:
    """See `terragrip.live.sinks.open_sink`."""
    return UdpSink(uri)
