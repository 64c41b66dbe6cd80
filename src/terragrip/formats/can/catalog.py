"""Which frame holds which signals: the built-in table of J1939 and ISO 11783, and DBC files."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Ints
from terragrip.document import read_yaml
from terragrip.errors import InputError
from terragrip.files import refuse_missing
from terragrip.formats.boundary import needed, reading
from terragrip.formats.can.bits import Field

EXTENDED = 1 << 31
"""Set in an identifier of 29 bits, as in a DBC."""
_BUS, _MOST_BUSES = 32, 1 << 16  # bits of an identifier, above which its frame's bus stands
NO_SENDER = -1
"""The sender of a message that names none in a log that names no bus."""


@dataclass(frozen=True)
class Message:
    """A frame's signals. ``key`` is its identifier (`EXTENDED` where it has 29 bits), or its PGN if ``by_group``."""

    name: str
    key: int
    fields: tuple[Field, ...]
    length: int
    by_group: bool


def group_of(identifier: int) -> int:
    """The parameter group number of a 29-bit identifier; a destination address is no part of it (J1939-21)."""
    group = (identifier >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= 240 else group & 0x3FF00


def source_of(identifier: int) -> int:
    """The address of the sender of a 29-bit identifier (J1939-21)."""
    return identifier & 0xFF


def on_bus(identifier: int, bus: object) -> int:
    """An identifier with its frame's bus, as the log numbers it; as it is where there is no number."""
    return identifier | (bus + 1) << _BUS if isinstance(bus, int) and 0 <= bus < _MOST_BUSES else identifier


def bus_of(name: str, known: dict[str, int]) -> int | None:
    """The number of a bus by its name in a log, None where it has none: the one at its end, else, or where another bus of the log has
    that, the next free one. ``known``: those met so far, to which it is added."""
    if name and name not in known:
        number = re.search(r"\d{1,4}$", name)
        own = int(number[0]) if number else None
        free = next(k for k in range(len(known) + 1) if k not in known.values())
        known[name] = free if own is None or own in known.values() else own
    return known.get(name)


def number_buses(names: Iterable[str], known: dict[str, int]) -> None:
    """Number the buses of a log's head by `bus_of`, those with a number of their own first, else by name: which one speaks first differs
    from log to log of one machine, and a profile goes by the number."""
    for name in sorted(names, key=lambda name: (not name[-1:].isdecimal(), name)):
        bus_of(name, known)


def with_buses(identifiers: Ints, buses: npt.NDArray[Any]) -> Ints:
    """Identifiers (n,), each with the number of its frame's bus."""
    return identifiers | (buses.astype(np.int64) + 1) << _BUS


def sender_of(identifier: int, message: Message) -> int:
    """Who sent a message: an address, or below `NO_SENDER` a bus where the message names no sender."""
    return source_of(identifier) if message.by_group else NO_SENDER - (identifier >> _BUS)


def without_bus(identifier: int) -> int:
    """An identifier as it was on its bus."""
    return identifier & ((1 << _BUS) - 1)


def of_sender(name: str, sender: int) -> str:
    """The name of one sender's signal: ``Name@F0``, or ``Name@bus1``."""
    return f"{name}@{sender:02X}" if sender >= 0 else f"{name}@bus{NO_SENDER - 1 - sender}"


def place_of(sender: int) -> str:
    """A sender in words: ``address 80 hex``, ``bus 1``."""
    return f"address {sender:02X} hex" if sender >= 0 else f"bus {NO_SENDER - 1 - sender}"


class Catalog:
    """Messages by identifier and by parameter group; the first of equals counts.

    `name` gives each signal its name: its own, or ``Message.Signal`` where several messages have one of that name, or
    ``Message(1F0).Signal`` by the identifier where these have one name, too. ``differing``: whether by group, and key, of messages of
    which there are several unlike ones. ``given``: names of the messages that came from DBC files.
    """

    def __init__(self, messages: Iterable[Message], given: Iterable[Message] = ()) -> None:
        self._table: dict[tuple[bool, int], Message] = {}
        self.differing: set[tuple[bool, int]] = set()
        for message in messages:
            place = message.by_group, message.key
            if self._table.setdefault(place, message).fields != message.fields:
                self.differing.add(place)
        names = Counter(message.name for message in self.messages)
        for place, message in self._table.items():
            if names[message.name] > 1:
                self._table[place] = replace(message, name=f"{message.name}({message.key & ~EXTENDED:X})")
        self.given = frozenset(self._table[message.by_group, message.key].name for message in given)
        self._seen = Counter(field.name for message in self.messages for field in message.fields)

    @property
    def messages(self) -> tuple[Message, ...]:
        """All messages."""
        return tuple(self._table.values())

    def message_of(self, identifier: int) -> Message | None:
        """The message of a frame's identifier (`EXTENDED` set where it has 29 bits); None if it is unknown."""
        identifier = without_bus(identifier)
        result = self._table.get((False, identifier))
        if result is None and identifier & EXTENDED:
            result = self._table.get((True, group_of(identifier)))
        return result

    def name(self, message: Message, field: Field) -> str:
        """The name of a signal in a log."""
        return field.name if self._seen[field.name] == 1 else f"{message.name}.{field.name}"

    def names(self, message: Message, sender: int) -> dict[str, tuple[str, ...]]:
        """By a message's fields the names of their signals: the plain one, and that of its sender or bus, where it has one."""
        plain = {field.name: self.name(message, field) for field in message.fields}
        return {f: (n,) if sender == NO_SENDER else (n, of_sender(n, sender)) for f, n in plain.items()}


def catalog(databases: Sequence[str | os.PathLike[str]] = ()) -> Catalog:
    """The built-in table, after the messages of DBC files; raises InputError if one of these cannot be read."""
    own = [message for path in databases for message in _read_dbc(path)]
    taken = {message.key if message.by_group else group_of(message.key) for message in own}
    return Catalog([*own, *(message for message in built_in() if message.key not in taken)], own)


@cache
def built_in() -> tuple[Message, ...]:
    """The parameter groups of ``j1939.yaml``."""
    table = read_yaml(Path(__file__).with_name("j1939.yaml")).data
    return tuple(_group(int(number), entry) for number, entry in table.items())


def _group(number: int, entry: dict[str, Any]) -> Message:
    fields = []
    for name, place in entry["fields"].items():
        byte, _, bit = str(place["at"]).partition(".")
        start = 8 * (int(byte) - 1) + int(bit or 1) - 1
        about = {key: value for key, value in place.items() if key != "at"}
        fields.append(Field(name, start, codes=True, **about))
    length = max(8, max(field.last_byte for field in fields) + 1)
    return Message(entry["name"], number, tuple(fields), length, by_group=True)


def _read_dbc(path: str | os.PathLike[str]) -> list[Message]:
    """The messages of a DBC (or what else cantools reads: KCD, SYM, ARXML)."""
    file = os.fspath(path)
    refuse_missing(file, suffixes=(".dbc", ".kcd", ".sym", ".arxml"))
    cantools = needed("cantools", "a DBC")
    errors = cantools.Error, needed("textparser", "a DBC").Error
    with reading(file, "DBC", *errors, hint="export it again"):
        database = cantools.database.load_file(file, strict=False, cache_dir=None)
        result = [message_of(database, message) for message in database.messages]
    if not result:
        raise InputError("describes no message", file=file, hint="give the DBC of the machine's bus")
    return result


def message_of(database: Any, message: Any) -> Message:
    """A message of a cantools database."""
    by_group = message.is_extended_frame and _is_j1939(database, message)
    extended = EXTENDED if message.is_extended_frame else 0
    key = group_of(message.frame_id) if by_group else message.frame_id | extended
    fields = [_field(signal, codes=by_group) for signal in message.signals]
    return Message(message.name, key, _distinct(fields), message.length, by_group)


def _distinct(fields: Sequence[Field]) -> tuple[Field, ...]:
    """Fields that share a name, as a multiplexer's pages do, get that of the page (``Speed.m1``), or of their place (``Speed.bit16``)."""
    names = Counter(field.name for field in fields)
    pages = Counter((field.name, page) for field in fields for page in field.chosen)

    def name(field: Field) -> str:
        if names[field.name] == 1:
            return field.name
        alone = field.chosen and all(pages[field.name, page] == 1 for page in field.chosen)
        return f"{field.name}.{f'm{min(field.chosen)}' if alone else f'bit{field.start}'}"

    return tuple(replace(field, name=name(field)) for field in fields)


def _is_j1939(database: Any, message: Any) -> bool:
    """By the message's frame format, the database's protocol, or DBC's usual source address for "any", 0xFE."""
    if message.protocol == "j1939" or message.frame_id & 0xFF == 0xFE:
        return True
    attributes = getattr(database.dbc, "attributes", None) or {}
    protocol = attributes.get("ProtocolType") or attributes.get("BusType")
    return protocol is not None and str(protocol.value).upper() == "J1939"


def _field(signal: Any, *, codes: bool) -> Field:
    return Field(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        little_endian=signal.byte_order == "little_endian",
        signed=signal.is_signed,
        floating=signal.is_float,
        scale=float(signal.scale),
        offset=float(signal.offset),
        unit=signal.unit or None,
        codes=codes and not signal.is_float,
        selector=signal.multiplexer_signal,
        chosen=tuple(signal.multiplexer_ids or ()),
    )
