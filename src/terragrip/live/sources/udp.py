"""Datagrams: JSON (an object, a list of them, one a line) or packed numbers by the profile's payload, as Simulink sends them."""

from __future__ import annotations

import asyncio
import socket
from time import monotonic

from terragrip.errors import InputError
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Lost
from terragrip.live.uri import Uri

_BUFFER = 4 << 20  # bytes: a burst must not be lost in the system, where nobody counts
_LONGEST = 1 << 16  # bytes of a datagram
_PRESSED = 5e-4  # s since the last were done, within which the next mean that there are more
_TOGETHER = 256  # datagrams


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
        except OSError as error:
            raise Lost(f"cannot listen ({error.strerror or error})") from error
        loop.add_reader(link, _Receiver(link, feed, self.allowed, failed).read)
        feed.connected()
        try:
            raise Lost(await failed)
        finally:
            loop.remove_reader(link)
            link.close()

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


class _Receiver:
    """Takes datagrams as they come: one a turn of the loop; where the next are there already, many, so that what is too
    much is dropped, and counted, by the inbox, not by the system.
    """

    def __init__(
        self, link: socket.socket, feed: Feed, allowed: frozenset[str], failed: asyncio.Future[str]
    ) -> None:
        self._link, self._feed, self._allowed, self._failed = link, feed, allowed, failed
        self._done = 0.0

    def read(self) -> None:
        """The socket has datagrams."""
        pressed = monotonic() - self._done < _PRESSED
        found: list[bytes] = []
        try:
            self._take(found)
            while pressed and len(found) < _TOGETHER:
                self._take(found)
        except (BlockingIOError, InterruptedError):
            pass
        except OSError as error:
            if not self._failed.done():
                self._failed.set_result(str(error.strerror or error))
        self._feed.burst(found)
        self._done = monotonic()

    def _take(self, found: list[bytes]) -> None:
        if not self._allowed:
            found.append(self._link.recv(_LONGEST))
            return
        data, address = self._link.recvfrom(_LONGEST)
        if address[0] in self._allowed:
            found.append(data)
        else:
            self._feed.spoiled(f"from {address[0]}, which is not allowed")


def open_source(uri: Uri, decoder: Decoder) -> UdpSource:
    """See `terragrip.live.sources.open_source`."""
    return UdpSource(uri)
