"""Frames of a CAN log as they come, kept by message and sender in little memory."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from terragrip.formats.can.catalog import EXTENDED, Catalog, Message, group_of, source_of
from terragrip.formats.can.transport import CONNECTION, DATA, Transport, is_fast
from terragrip.formats.table import Wanted, every_of, skips

_CLASSIC = 8  # bytes
_BLOCK = 20_000  # frames that are read or left out together, where a log is looked at in parts
NO_SENDER = -1
"""The sender of a message that does not name one."""


@dataclass
class Payloads:
    """Payloads of one message from one sender: rows of ``width`` bytes, of which each holds its ``lengths``."""

    width: int = _CLASSIC
    time: array[float] = field(default_factory=lambda: array("d"))
    lengths: array[int] = field(default_factory=lambda: array("H"))
    data: bytearray = field(default_factory=bytearray)

    def add(self, time: float, payload: bytes) -> None:
        """Append a payload."""
        length = len(payload)
        if length > self.width:
            rows = np.frombuffer(bytes(self.data), np.uint8).reshape(-1, self.width)
            self.data = bytearray(np.pad(rows, ((0, 0), (0, length - self.width))).tobytes())
            self.width = length
        self.time.append(time)
        self.lengths.append(length)
        self.data += payload if length == self.width else payload.ljust(self.width, b"\0")

    def add_many(
        self, time: npt.NDArray[np.float64], lengths: npt.NDArray[np.int64], data: npt.NDArray[np.uint8]
    ) -> None:
        """Append payloads (n, bytes), of which each holds its ``lengths`` (n,)."""
        if bool((lengths == self.width).all()) and data.shape[1] >= self.width:
            self.time.frombytes(np.ascontiguousarray(time, np.float64).tobytes())
            self.lengths.frombytes(lengths.astype(np.uint16).tobytes())
            self.data += np.ascontiguousarray(data[:, : self.width]).tobytes()
            return
        for instant, length, row in zip(time.tolist(), lengths.tolist(), data, strict=True):
            self.add(instant, row[:length].tobytes())


def of_sender(name: str, sender: int) -> str:
    """The name of one sender's signal: ``Name@F0``."""
    return f"{name}@{sender:02X}"


@dataclass
class Frames:
    """Takes the frames of a log one by one and keeps those of wanted signals.

    ``kept`` and ``seen``: by message name and sender. ``unknown``: frames by identifier that the catalog lacks.
    """

    catalog: Catalog
    wanted: Wanted | None = None
    count: int = 0
    first: float | None = None
    kept: dict[tuple[str, int], Payloads] = field(default_factory=dict)
    seen: dict[tuple[str, int], Message] = field(default_factory=dict)
    unknown: dict[int, int] = field(default_factory=dict)
    transport: Transport = field(default_factory=Transport)
    _routes: dict[int, Callable[[float, bytes], None] | None] = field(default_factory=dict)

    _number: int = 0  # frames so far, with those left out

    def __post_init__(self) -> None:
        self.every = every_of(self.wanted)

    def add(self, time: float, identifier: int, payload: bytes) -> None:
        """Add a data frame; ``identifier`` has `EXTENDED` set where it has 29 bits."""
        if self.every > 1:
            self._number += 1
            if skips(self._number - 1, _BLOCK, self.wanted):
                return
        self.count += 1
        if self.first is None:
            self.first = time
        try:
            route = self._routes[identifier]
        except KeyError:
            route = self._routes[identifier] = self._route(identifier)
        if route is not None:
            route(time, payload)
        elif identifier in self.unknown:
            self.unknown[identifier] += 1

    def add_many(
        self,
        time: npt.NDArray[np.float64],
        identifiers: npt.NDArray[np.int64],
        lengths: npt.NDArray[np.int64],
        data: npt.NDArray[np.uint8],
    ) -> None:
        """Add data frames (n,) with payloads (n, bytes), as `take` does one by one."""
        if self.every > 1:
            read = (self._number + np.arange(len(time))) // _BLOCK % self.every == 0
            self._number += len(time)
            time, identifiers, lengths, data = time[read], identifiers[read], lengths[read], data[read]
        self.count += len(time)
        if self.first is None and len(time):
            self.first = float(time[0])
        one_by_one = np.zeros(len(time), dtype=bool)
        for identifier in np.unique(identifiers).tolist():
            if identifier not in self._routes:
                self._routes[identifier] = self._route(identifier)
            route, rows = self._routes[identifier], identifiers == identifier
            place = getattr(route, "__self__", None)
            if isinstance(place, Payloads):
                place.add_many(time[rows], lengths[rows], data[rows])
            elif route is not None:
                one_by_one |= rows  # parts of longer messages, whose order counts
            elif identifier in self.unknown:
                self.unknown[identifier] += int(rows.sum())
        for k in np.flatnonzero(one_by_one).tolist():
            route = self._routes[int(identifiers[k])]
            if route is not None:
                route(float(time[k]), data[k, : lengths[k]].tobytes())

    def leaves_out_next(self) -> bool:
        """Whether the next frame is in a block that is not looked at; it then counts as the next but needs not be parsed."""
        if not skips(self._number, _BLOCK, self.wanted):
            return False
        self._number += 1
        return True

    def are_unwanted(self, identifier: int) -> bool:
        """Whether frames of an identifier are of no use, so that they need not be parsed: `pass_by` counts them."""
        if self.every > 1:
            return False  # all are counted, to leave out blocks of them
        if identifier not in self._routes:
            self._routes[identifier] = self._route(identifier)
        return self._routes[identifier] is None

    def pass_by(self, identifier: int) -> None:
        """Count a data frame of which nothing is wanted."""
        self.count += 1
        if identifier in self.unknown:
            self.unknown[identifier] += 1

    def senders(self, message: Message) -> int:
        """How many have sent a message."""
        return sum(name == message.name for name, _ in self.seen)

    def _route(self, identifier: int) -> Callable[[float, bytes], None] | None:
        """What is done with the frames of an identifier."""
        source = source_of(identifier)
        if identifier & EXTENDED and group_of(identifier) in (CONNECTION, DATA):
            return self._transported(group_of(identifier), source, (identifier >> 8) & 0xFF)
        message = self.catalog.message_of(identifier)
        if message is None:
            self.unknown[identifier] = 0
            return None
        if message.by_group and is_fast(message.key, message.length):
            return self._fast(message.key, source)
        place = self._place(message, source if message.by_group else NO_SENDER)
        return None if place is None else place.add

    def _transported(self, group: int, source: int, destination: int) -> Callable[[float, bytes], None]:
        def add(time: float, payload: bytes) -> None:
            self._long(time, source, self.transport.add(group, source, destination, payload))

        return add

    def _fast(self, group: int, source: int) -> Callable[[float, bytes], None]:
        def add(time: float, payload: bytes) -> None:
            self._long(time, source, self.transport.add_fast(group, source, payload))

        return add

    def _long(self, time: float, source: int, whole: tuple[int, bytes] | None) -> None:
        """Keep a message of several frames, once it is whole, at the time of its last frame."""
        message = None if whole is None else self.catalog.by_group.get(whole[0])
        if whole is None or message is None:
            return
        place = self._place(message, source)
        if place is not None:
            place.add(time, whole[1])

    def _place(self, message: Message, sender: int) -> Payloads | None:
        """Where payloads of a message from a sender are kept; None if no signal of it is wanted."""
        self.seen[message.name, sender] = message
        names = [self.catalog.name(message, f) for f in message.fields]
        own = names if sender == NO_SENDER else [of_sender(name, sender) for name in names]
        if self.wanted is not None and not any(map(self.wanted, (*names, *own))):
            return None
        return self.kept.setdefault((message.name, sender), Payloads())
