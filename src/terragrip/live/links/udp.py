"""Datagrams. In: JSON (an object, a list, one a line), packed numbers by the profile's payload, as Simulink sends them, or NMEA 0183.

Out, to one address: JSON, or doubles in the order of the wanted columns, as Simulink receives them.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import struct
import sys

from terragrip.errors import InputError
from terragrip.live.feed import Feed, Lost
from terragrip.live.message import ESTIMATE, Message
from terragrip.live.nmea import Sentences, holds_sentences
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri, is_address, is_loopback

_BUFFER = 4 << 20  # bytes asked for, so that a burst finds room
_LONGEST = 1 << 16  # bytes of a datagram
_AT_ONCE = 256  # datagrams
_SO_MEMINFO, _DROPS = 55, 8  # of Linux (asm-generic/socket.h, linux/sock_diag.h); Python does not name them
_PASSING = {errno.EAGAIN, errno.ENOBUFS, errno.EMSGSIZE}
"""What concerns one message, not the way."""


class UdpSource:
    """``udp://127.0.0.1:PORT``; beyond this machine ``allow`` must name the senders."""

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.allowed = frozenset(filter(None, uri.options.get("allow", "").split(",")))
        if wrong := [one for one in self.allowed if not is_address(one)]:
            hint = "name each sender by its address: ?allow=192.168.1.7,192.168.1.8"
            raise InputError(f"allow has {wrong[0]!r}, which is no IP address", place=uri.text, hint=hint)
        if uri.port is None:
            raise InputError("names no port", place=uri.text, hint="write udp://127.0.0.1:9870")
        if not is_loopback(uri.host) and not self.allowed:
            raise InputError(
                "anyone could send samples here", place=uri.text,
                hint="listen on 127.0.0.1, or name the senders: ?allow=192.168.1.7",
            )  # fmt: skip

    async def run(self, feed: Feed) -> None:
        """Feed datagrams; raises Lost where the address cannot be had, InputError where a package is missing that they need."""
        loop = asyncio.get_running_loop()
        failed: asyncio.Future[None] = loop.create_future()
        try:
            link = self._socket()
        except OSError as error:
            raise Lost(f"cannot listen ({error.strerror or error})") from error
        loop.add_reader(link, _Receiver(link, feed, self.allowed, failed).read)
        feed.connected()
        try:
            await failed
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
    """Reads datagrams, many where many are there, so that what is too much is dropped, and counted, by the inbox rather
    than by the system; what the system drops is counted too.
    """

    def __init__(
        self, link: socket.socket, feed: Feed, allowed: frozenset[str], failed: asyncio.Future[None]
    ) -> None:
        self._link, self._feed, self._allowed, self._failed = link, feed, allowed, failed
        self._sentences = Sentences(feed)
        self._dropped = _dropped_by_system(link)

    def read(self) -> None:
        """The socket has datagrams."""
        try:
            for _ in range(_AT_ONCE):
                data, address = self._link.recvfrom(_LONGEST)
                if self._allowed and address[0] not in self._allowed:
                    self._feed.reject(f"from {address[0]}, which is not allowed")
                elif holds_sentences(data):
                    for line in data.splitlines():
                        self._sentences.line(line)
                else:
                    self._feed.message(data)
        except (BlockingIOError, InterruptedError):
            pass
        except (OSError, InputError) as error:
            if not self._failed.done():
                loss = Lost(error.strerror or str(error)) if isinstance(error, OSError) else error
                self._failed.set_exception(loss)
        # A full buffer is read afterwards: so nothing is dropped that is not counted here.
        dropped = _dropped_by_system(self._link)
        if dropped != self._dropped:
            self._feed.dropped((dropped - self._dropped) % (1 << 32))
            self._dropped = dropped


def _dropped_by_system(link: socket.socket) -> int:
    """Datagrams that found the socket's buffer full, modulo 2^32; 0 where the system does not tell (it does on Linux)."""
    if not sys.platform.startswith("linux"):
        return 0
    try:
        numbers = link.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * (_DROPS + 1))
    except OSError:
        return 0
    return struct.unpack(f"={len(numbers) // 4}I", numbers)[_DROPS]


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
