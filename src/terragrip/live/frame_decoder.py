"""CAN frames into named fields, by the same table and DBC files as logs (terragrip.formats.can)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from terragrip.formats.can.bits import decode
from terragrip.formats.can.catalog import EXTENDED, Message, catalog, sender_of
from terragrip.formats.can.transport import Transport, is_part
from terragrip.live.payload import Fields


class FrameDecoder:
    """Fields of a frame as a log of it would name them; ``units`` by name; ``unknown`` counts frames that no table holds.

    ``wants`` tells whether a signal is asked for, also that of one of several senders (``Name@F0``). Raises InputError on a DBC that
    cannot be read.
    """

    def __init__(self, databases: Sequence[str], wants: Callable[[str], bool]) -> None:
        self._catalog = catalog(databases)
        self._wants = wants
        self._plans: dict[int, tuple[Message, dict[str, list[str]]] | None] = {}
        self._transport = Transport()
        self.unknown: dict[int, int] = {}
        self.units = {
            self._catalog.name(message, field): field.unit
            for message in self._catalog.messages
            for field in message.fields
            if field.unit
        }

    def fields(self, identifier: int, extended: bool, data: bytes) -> Fields:
        """The wanted fields of a data frame, or of the message that it completes; empty where no table holds it.

        "Not available" and "error" are left out.
        """
        key = identifier | EXTENDED if extended else identifier
        if not is_part(key, self._catalog.message_of(key)):
            return self._fields(key, data)
        whole = self._transport.add(key, data)
        return {} if whole is None else self._fields(*whole)

    def _fields(self, key: int, data: bytes) -> Fields:
        """The wanted fields of a whole payload."""
        if key not in self._plans:
            self._plans[key] = self._plan(key)
        plan = self._plans[key]
        if plan is None:
            self.unknown[key] = self.unknown.get(key, 0) + 1
            return {}
        message, names = plan
        if not names or not data:
            return {}
        payload, length = np.frombuffer(data, np.uint8)[None], np.array([len(data)], np.uint16)
        values = {
            field: float(value[0])
            for field, value in decode(message.fields, set(names), payload, length).items()
        }
        return {name: value for field, value in values.items() if value == value for name in names[field]}

    def _plan(self, key: int) -> tuple[Message, dict[str, list[str]]] | None:
        """The message, and by its fields the names that are wanted."""
        message = self._catalog.message_of(key)
        if message is None:
            return None
        names = self._catalog.names(message, sender_of(key, message))
        wanted = {field: [name for name in every if self._wants(name)] for field, every in names.items()}
        return message, {field: own for field, own in wanted.items() if own}
