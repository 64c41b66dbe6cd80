"""Frames of a CAN log as they come, kept by message and sender in little memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats, Ints
from terragrip.formats.can.catalog import Catalog, Message, sender_of, without_bus
from terragrip.formats.can.transport import Transport, is_part
from terragrip.formats.table import EVERY, Wanted, every_of, skips

_BLOCK = 20_000  # frames that are sorted, read or left out together

Frame = tuple[float, int, bytes]
"""Stamp [s], identifier with `EXTENDED` set where it has 29 bits and its bus (`on_bus`), payload."""
Bytes = npt.NDArray[np.uint8]
Block = tuple[Floats, npt.NDArray[np.uint16], Bytes]
"""Stamps (n,) [s], lengths (n,) and payloads (n, bytes) of frames."""
Route = list[Block] | Transport | None
"""Where frames are kept, or what puts them together as parts of longer messages; None where no signal of them is wanted."""


@dataclass
class Frames:
    """Takes the frames of a log and keeps those of wanted signals.

    ``kept`` (blocks of payloads) and ``seen``: by message name and sender. ``unknown``: frames by identifier that the catalog lacks.
    All speak of the frames up to the last `flush`. ``tick``: seconds that the stamps count. ``leaping``: signals left out, since a DBC
    seems to have the wrong byte order for them.
    """

    catalog: Catalog
    wanted: Wanted = EVERY
    count: int = 0
    first: float | None = None
    tick: float = 1.0
    kept: dict[tuple[str, int], list[Block]] = field(default_factory=dict)
    seen: dict[tuple[str, int], Message] = field(default_factory=dict)
    unknown: dict[int, int] = field(default_factory=dict)
    leaping: list[str] = field(default_factory=list)
    transport: Transport = field(default_factory=Transport)
    _routes: dict[tuple[int, bool], Route] = field(default_factory=dict)
    _waiting: list[Frame] = field(default_factory=list)
    _number: int = 0  # frames so far, with those left out

    def __post_init__(self) -> None:
        self._every = every_of(self.wanted)

    def add(self, time: float, identifier: int, payload: bytes) -> None:
        """Add a data frame."""
        if self._every > 1 and self.leaves_out_next():
            return
        self._number += 1
        self._waiting.append((time, identifier, payload))
        if len(self._waiting) >= _BLOCK:
            self.flush()

    def flush(self) -> None:
        """Sort the frames that were added one by one."""
        waiting, self._waiting = self._waiting, []
        self._sort(*_block(waiting))

    def add_many(self, time: Floats, identifiers: Ints, lengths: Ints, data: Bytes) -> None:
        """Add data frames (n,) with payloads (n, bytes), as `add` does one by one."""
        read = (self._number + np.arange(len(time))) // _BLOCK % self._every == 0
        self._number += len(time)
        self._sort(time[read], identifiers[read], lengths[read], data[read])

    def _sort(
        self, time: Floats, identifiers: Ints, lengths: Ints, data: Bytes, *, whole: bool = False
    ) -> None:
        """Keep frames where they belong; ``whole``: they are messages of several frames put together."""
        if not whole:
            self.count += len(time)
            self.first = float(time[0]) if self.first is None and len(time) else self.first
        parts: Bools = np.zeros(len(time), dtype=bool)
        order = np.argsort(identifiers, kind="stable")
        each, begins = np.unique(identifiers[order], return_index=True)
        for identifier, rows in zip(each.tolist(), np.split(order, begins)[1:], strict=True):
            route = self._route_of(identifier, whole=whole)
            if isinstance(route, list):
                held = lengths[rows].astype(np.uint16)
                route.append((time[rows], held, data[rows, : held.max()]))
            elif route is not None:
                parts[rows] = True  # whose order counts
            elif (bare := without_bus(identifier)) in self.unknown:
                self.unknown[bare] += len(rows)
        put_together: list[Frame] = []
        for k in np.flatnonzero(parts).tolist():
            message = self.transport.add(int(identifiers[k]), data[k, : lengths[k]].tobytes())
            if message is not None and self.catalog.message_of(message[0]) is not None:
                put_together.append((float(time[k]), *message))
        if put_together:
            self._sort(*_block(put_together), whole=True)

    def leaves_out_next(self) -> bool:
        """Whether the next frame is in a block that is not looked at; it then counts as the next but needs not be parsed."""
        if not skips(self._number, _BLOCK, self.wanted):
            return False
        self._number += 1
        return True

    def are_unwanted(self, identifier: int) -> bool:
        """Whether frames of an identifier are of no use, so that they need not be parsed: `pass_by` counts them."""
        # Of a log that is looked at in parts all are counted, to leave out blocks of them.
        return self._every == 1 and self._route_of(identifier) is None

    def pass_by(self, identifier: int) -> None:
        """Count a data frame of which nothing is wanted."""
        self.count += 1
        if (bare := without_bus(identifier)) in self.unknown:
            self.unknown[bare] += 1

    def senders(self, message: Message) -> int:
        """How many have sent a message."""
        return sum(name == message.name for name, _ in self.seen)

    def _route_of(self, identifier: int, *, whole: bool = False) -> Route:
        key = identifier, whole
        if key not in self._routes:
            self._routes[key] = self._route(identifier, whole=whole)
        return self._routes[key]

    def _route(self, identifier: int, *, whole: bool) -> Route:
        message = self.catalog.message_of(identifier)
        if not whole and is_part(identifier, message):
            return self.transport
        if message is None:
            self.unknown.setdefault(without_bus(identifier), 0)
            return None
        sender = sender_of(identifier, message)
        self.seen[message.name, sender] = message
        names = self.catalog.names(message, sender).values()
        if not any(self.wanted(name) for every in names for name in every):
            return None
        return self.kept.setdefault((message.name, sender), [])


def _block(frames: list[Frame]) -> tuple[Floats, Ints, Ints, Bytes]:
    """Stamps, identifiers, lengths (n,) and payloads (n, bytes) of frames."""
    time, identifiers, payloads = zip(*frames, strict=True) if frames else ((), (), ())
    lengths = np.fromiter(map(len, payloads), np.intp, len(payloads))
    width = int(lengths.max(initial=1))
    if lengths.min(initial=width) < width:
        payloads = tuple(payload.ljust(width, b"\0") for payload in payloads)
    data = np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, width)
    return np.array(time), np.array(identifiers, dtype=np.intp), lengths, data
