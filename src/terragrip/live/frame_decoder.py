"""CAN frames into named fields, by the same table and DBC files as logs (terragrip.formats.can)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from terragrip.formats.can.bits import Field
from terragrip.formats.can.catalog import EXTENDED, Message, catalog, group_of, source_of
from terragrip.formats.can.frames import of_sender
from terragrip.formats.can.transport import CONNECTION, DATA, Transport, is_fast
from terragrip.live.payload import Fields

_FLOATS = {16: "<e", 32: "<f", 64: "<d"}


class FrameDecoder:
    """Fields of a frame as a log of it would name them; ``units`` by name; ``unknown`` counts frames that no table holds.

    ``wants`` tells whether a signal of one of several senders (``Name@F0``) is asked for. Raises InputError on a DBC that
    cannot be read.
    """

    def __init__(self, databases: Sequence[str], wants: Callable[[str], bool]) -> None:
        self._catalog = catalog(databases)
        self._wants = wants
        self._plans: dict[int, list[tuple[Field, tuple[str, ...]]] | None] = {}
        self._transport = Transport()
        self.unknown: dict[int, int] = {}
        self.units = {
            self._catalog.name(message, field): field.unit
            for message in self._catalog.messages
            for field in message.fields
            if field.unit
        }

    def fields(self, identifier: int, extended: bool, data: bytes) -> Fields:
        """The fields of a data frame, or of the message that it completes; empty where no table holds it.

        "Not available" and "error" are left out.
        """
        key = identifier | EXTENDED if extended else identifier
        if extended and (group := group_of(key)) in (CONNECTION, DATA):
            whole = self._transport.add(group, source_of(key), (identifier >> 8) & 0xFF, data)
            # By the identifier that it would have in one frame.
            return {} if whole is None else self._fields(EXTENDED | whole[0] << 8 | source_of(key), whole[1])
        message = self._catalog.message_of(key) if extended else None
        if message is not None and message.by_group and is_fast(message.key, message.length):
            whole = self._transport.add_fast(message.key, source_of(key), data)
            return {} if whole is None else self._fields(key, whole[1])
        return self._fields(key, data)

    def _fields(self, key: int, data: bytes) -> Fields:
        """The fields of a whole payload."""
        if key not in self._plans:
            self._plans[key] = self._plan(key)
        plan = self._plans[key]
        if plan is None:
            self.unknown[key] = self.unknown.get(key, 0) + 1
            return {}
        raws = {field.name: _raw(field, data) for field, _ in plan}
        result: Fields = {}
        for field, names in plan:
            raw = raws[field.name]
            if raw is None or raw in field.missing:
                continue
            if field.selector is not None and raws.get(field.selector) not in field.chosen:
                continue
            value = _physical(field, raw)
            if field.reverse is not None and raws.get(field.reverse) == 0:
                value = -value
            for name in names:
                result[name] = value
        return result

    def _plan(self, key: int) -> list[tuple[Field, tuple[str, ...]]] | None:
        """The message's fields and the names of each."""
        message = self._catalog.message_of(key)
        if message is None:
            return None
        return [(field, self._names(message, field, key)) for field in message.fields]

    def _names(self, message: Message, field: Field, key: int) -> tuple[str, ...]:
        name = self._catalog.name(message, field)
        sender = of_sender(name, source_of(key)) if message.by_group else name
        return (name, sender) if sender != name and self._wants(sender) else (name,)


def _raw(field: Field, data: bytes) -> int | None:
    """The raw value, unsigned; None where the payload does not reach to it."""
    if len(data) <= field.last_byte:
        return None
    if field.little_endian:
        raw = int.from_bytes(data, "little") >> field.start
    else:
        position = 8 * (field.start // 8) + 7 - field.start % 8  # from the first byte's highest bit
        raw = int.from_bytes(data, "big") >> (8 * len(data) - position - field.length)
    return raw & ((1 << field.length) - 1)


def _physical(field: Field, raw: int) -> float:
    if field.floating:
        number = struct.unpack(_FLOATS[field.length], raw.to_bytes(field.length // 8, "little"))[0]
    elif field.signed and raw >> (field.length - 1):
        number = raw - (1 << field.length)
    else:
        number = raw
    return float(field.scale * number + field.offset)
