"""Datagrams: JSON (an object, a list of them, one a line) or packed numbers by the profile's payload, as Simulink sends them."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

from terragrip.errors import InputError
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Lost
from terragrip.live.uri import Uri

_BUFFER = 4 << 20  # bytes: a burst must not be lost in the system, where nobody counts


class UdpSource:
    """``udp://127.0.0.1:PORT``; beyond this machine ``allow`` must name the senders."""

    real_time = True

    def __init__(self, uri: Uri) -> None:
        self.uri = uri
        self.allowed = frozenset(filter(None, uri.options.get("allow", "").split(",")))
        if uri.port is None:
            raise InputError("names no port", place=uri.text, mend="write udp://127.0.0.1:9870")
        if not uri.is_loopback() and not self.allowed:
            raise InputError(
                "anyone could send samples here", place=uri.text,
                mend="listen on 127.0.0.1, or name the senders: ?allow=192.168.1.7",
            )  # fmt: skip

    async def run(self, feed: Feed) -> None:
        """Feed datagrams; raises Lost where the address cannot be had."""
        loop = asyncio.get_running_loop()
        failed: asyncio.Future[str] = loop.create_future()
        try:
            link = self._socket()
            transport, _ = await loop.create_datagram_endpoint(
                lambda: _Receiver(feed, self.allowed, failed), sock=link
            )
        except OSError as error:
            raise Lost(f"cannot listen ({error.strerror or error})") from error
        feed.connected()
        try:
            raise Lost(await failed)
        finally:
            transport.close()

    def _socket(self) -> socket.socket:
        family = socket.AF_INET6 if ":" in self.uri.host else socket.AF_INET
        link = socket.socket(family, socket.SOCK_DGRAM)
        try:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            link.setblocking(False)
            link.bind((self.uri.host, self.uri.port))
        except OSError:
            link.close()
            raise
        return link


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, feed: Feed, allowed: frozenset[str], failed: asyncio.Future[str]) -> None:
        self._feed, self._allowed, self._failed = feed, allowed, failed

    def datagram_received(self, data: bytes, address: tuple[Any, ...]) -> None:
        if self._allowed and address[0] not in self._allowed:
            self._feed.spoiled(f"from {address[0]}, which is not allowed")
            return
        self._feed.message(data)

    def connection_lost(self, error: Exception | None) -> None:
        if not self._failed.done():
            self._failed.set_result(str(error or "closed"))


def open_source(uri: Uri, decoder: Decoder) -> UdpSource:
    """See `terragrip.live.sources.open_source`."""
    return UdpSource(uri)
