"""What goes to sinks: an estimate, an event, a status; written as JSON once, however many sinks there are."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from terragrip.live.outputs import Row

ESTIMATE, EVENT, STATUS, SOIL, GROUND, SETPOINT = "estimate", "event", "status", "soil", "ground", "setpoint"


_ESTIMATORS = 1024  # whose columns are kept
_NOT_FINITE = re.compile(":(nan|-?inf)")


@dataclass(slots=True, eq=False)
class Message:
    """``kind`` is `ESTIMATE`, `EVENT`, `STATUS`, `SOIL`, `GROUND` or `SETPOINT`; ``row`` is there for an estimate, ``data`` for others.

    ``vehicle``: its name where many are served, else empty.
    """

    kind: str
    time: float
    row: Row | None = None
    data: dict[str, Any] | None = None
    vehicle: str = ""
    _json: dict[Columns | None, bytes] = field(default_factory=dict)

    def json(self, columns: Columns | None = None) -> bytes:
        """The message as a JSON object with its ``kind``; of an estimate, ``columns`` or all of them. Missing numbers are null."""
        row = self.row
        columns = None if row is None else columns
        result = self._json.get(columns)
        if result is None:
            result = self._json[columns] = (
                json.dumps({"kind": self.kind} | (self.data or {})).encode()
                if row is None
                else (columns or _EVERY).json(row)
            )
        return result


class Columns:
    """Which columns of an estimate a sink wants, by patterns as a shell has them: ``slip_*,adhesion_*``; empty: all."""

    def __init__(self, text: str = "") -> None:
        self._patterns = [part.strip() for part in text.split(",") if part.strip()]
        self._known: dict[int, tuple[dict[str, int], dict[str, int], str]] = {}

    def wants(self, name: str) -> bool:
        """Whether a column is wanted."""
        return not self._patterns or any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def places(self, row: Row) -> dict[str, int]:
        """Name and place of each wanted column."""
        return self._of(row.estimate.places)[1]

    def _of(self, every: dict[str, int]) -> tuple[dict[str, int], dict[str, int], str]:
        """All columns, those wanted, and the JSON of these; kept by estimator, whose dictionary of places is always the same."""
        known = self._known.get(id(every))
        if known is None or known[0] is not every:
            wanted = {name: place for name, place in every.items() if self.wants(name)}
            template = "".join(f',"{name}":%.9g' for name in wanted) + "}"
            if len(self._known) >= _ESTIMATORS:
                self._known.clear()
            known = self._known[id(every)] = (every, wanted, template)
        return known

    def json(self, row: Row) -> bytes:
        """The row as a JSON object, numbers to nine digits; a missing one is null."""
        estimate = row.estimate
        _, places, template = self._of(estimate.places)
        numbers = template % tuple(map(estimate.values.__getitem__, places.values()))
        if ":n" in numbers or "inf" in numbers:
            numbers = _NOT_FINITE.sub(":null", numbers)
        head = f'{{"kind":"{ESTIMATE}","time":{estimate.time!r},"arrival":{row.arrival!r},"event":"{estimate.event}"'
        return f'{head},"predicted":{"true" if row.predicted else "false"}{numbers}'.encode()


_EVERY = Columns()
