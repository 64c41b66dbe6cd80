"""What goes to sinks: an estimate, an event, a status; written as JSON once, however many sinks there are."""

from __future__ import annotations

import json
import re
from fnmatch import fnmatchcase
from typing import Any

from terragrip.live.core import Row
from terragrip.live.event import Event

ESTIMATE, EVENT, STATUS, SOIL, GROUND, SETPOINT = "estimate", "event", "status", "soil", "ground", "setpoint"


_NOT_FINITE = re.compile(":(nan|-?inf)")


class Message:
    """``kind`` is `ESTIMATE`, `EVENT`, `STATUS`, `SOIL`, `GROUND` or `SETPOINT`; ``row`` is there for an estimate, ``data`` for others."""

    __slots__ = ("_json", "data", "kind", "row", "time")

    def __init__(
        self, kind: str, time: float, row: Row | None = None, data: dict[str, Any] | None = None
    ) -> None:
        self.kind, self.time, self.row, self.data = kind, time, row, data
        self._json: dict[Columns | None, bytes] = {}

    @classmethod
    def of_event(cls, event: Event) -> Message:
        """An event's message."""
        return cls(EVENT, event.time, data=event.to_dict())

    def json(self, columns: Columns | None = None) -> bytes:
        """The message as a JSON object; of an estimate, ``columns`` or all of them. Missing numbers are null."""
        result = self._json.get(columns)
        if result is None:
            row = self.row
            result = self._json[columns] = (
                json.dumps(self.data).encode() if row is None else (columns or _EVERY).json(row)
            )
        return result


class Columns:
    """Which columns of an estimate a sink wants, by patterns as a shell has them: ``slip_*,adhesion_*``; empty: all."""

    def __init__(self, text: str = "") -> None:
        self._patterns = [part.strip() for part in text.split(",") if part.strip()]
        self._of: object = None
        self._places: dict[str, int] = {}
        self._template = ""

    def wants(self, name: str) -> bool:
        """Whether a column is wanted."""
        return not self._patterns or any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def places(self, row: Row) -> dict[str, int]:
        """Name and place of each wanted column."""
        every = row.estimate.places
        if self._of is not every:
            self._of = every
            self._places = {name: place for name, place in every.items() if self.wants(name)}
            self._template = "".join(f',"{name}":%.9g' for name in self._places) + "}"
        return self._places

    def json(self, row: Row) -> bytes:
        """The row as a JSON object, numbers to nine digits; a missing one is null."""
        estimate, places = row.estimate, self.places(row)
        numbers = self._template % tuple(map(estimate.values.__getitem__, places.values()))
        if ":n" in numbers or "inf" in numbers:
            numbers = _NOT_FINITE.sub(":null", numbers)
        head = f'{{"time":{estimate.time!r},"arrival":{row.arrival!r},"event":"{estimate.event}"'
        return f'{head},"predicted":{"true" if row.predicted else "false"}{numbers}'.encode()


_EVERY = Columns()
