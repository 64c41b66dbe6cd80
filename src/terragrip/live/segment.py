"""A closed segment of the record: Parquet files that appear whole, synced, or not at all."""

from __future__ import annotations

import json
import os
import struct
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.estimation.arrow import floats
from terragrip.estimation.engine import EVENTS
from terragrip.live.core import Ground, Output, Refusal, Row
from terragrip.live.event import Event

if TYPE_CHECKING:
    import pyarrow as pa

    from terragrip.estimation.estimates import Estimates
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.estimation.slip_estimator import SlipEstimator

_TOGETHER = 64  # rows

RECORDING, ESTIMATES, REFUSED, EVENT_LINES, GROUND = "recording", "estimates", "refused", "events", "ground"


@dataclass(slots=True)
class Segment:
    """What came out of the core since the last segment was closed. Rows lie flat, 8 bytes a number."""

    number: int
    time: array[float] = field(default_factory=lambda: array("d"))
    arrival: array[float] = field(default_factory=lambda: array("d"))
    estimates: bytearray = field(default_factory=bytearray)  # packed: many times quicker than array.extend
    codes: array[int] = field(default_factory=lambda: array("B"))
    channels: dict[str, array[float]] = field(default_factory=dict)
    refusals: list[Refusal] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    ground: list[Ground] = field(default_factory=list)
    _waiting: list[Row] = field(default_factory=list)  # laid flat together: quicker than one by one

    def __len__(self) -> int:
        return len(self.time) + len(self._waiting)

    @property
    def size(self) -> int:
        """Outputs in it: rows, events, refusals and states of the ground."""
        return len(self) + len(self.events) + len(self.refusals) + len(self.ground)

    def add(self, output: Output) -> None:
        """Take one output of the core."""
        if isinstance(output, Row):
            self._waiting.append(output)
            if len(self._waiting) >= _TOGETHER:
                self.settle()
        elif isinstance(output, Event):
            self.events.append(output)
        elif isinstance(output, Ground):
            self.ground.append(output)
        else:
            self.refusals.append(output)

    def settle(self) -> None:
        """Lay the rows flat that have come since the last call."""
        rows, self._waiting = self._waiting, []
        for row in rows:
            self._add_row(row)

    def _add_row(self, row: Row) -> None:
        rows = len(self.time)
        self.time.append(row.estimate.time)
        self.arrival.append(row.arrival)
        values = row.estimate.values
        self.estimates += _packer(len(values)).pack(*values)
        self.codes.append(EVENTS.index(row.estimate.event))
        for name, column in self.channels.items():
            column.append(row.values.get(name, float("nan")))
        if not row.values.keys() <= self.channels.keys():
            for name, value in row.values.items():
                if name not in self.channels:
                    self.channels[name] = array("d", [float("nan")]) * rows
                    self.channels[name].append(value)

    def write(self, folder: Path, estimator: TractionEstimator | SlipEstimator | None) -> None:
        """Write the segment's files; raises OSError."""
        self.settle()
        if len(self) and estimator is not None:
            import pyarrow.parquet as pq

            from terragrip.estimation.estimates import parquet_options

            for name, table in (
                (RECORDING, self.to_recording()),
                (ESTIMATES, self.to_estimates(estimator).to_arrow()),
            ):
                with durable(folder / f"{name}-{self.number:06d}.parquet") as path:
                    pq.write_table(table, path, **parquet_options(table.schema))
        if self.refusals:
            lines = [json.dumps({n: getattr(r, n) for n in Refusal.__slots__}) for r in self.refusals]
            self._write_lines(folder, REFUSED, lines)
        if self.ground:
            self._write_lines(folder, GROUND, [json.dumps(ground.to_dict()) for ground in self.ground])
        if self.events:
            self._write_lines(folder, EVENT_LINES, [json.dumps(event.to_dict()) for event in self.events])

    def _write_lines(self, folder: Path, name: str, lines: list[str]) -> None:
        with durable(folder / f"{name}-{self.number:06d}.jsonl") as path:
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def to_recording(self) -> pa.Table:
        """The rows as they were measured, with the arrival of each [s since 1970]."""
        import numpy as np
        import pyarrow as pa

        self.settle()
        columns = {"time": self.time, "arrival": self.arrival, **self.channels}
        return pa.table({name: floats(np.frombuffer(c)) for name, c in columns.items()})

    def to_estimates(self, estimator: TractionEstimator | SlipEstimator) -> Estimates:
        """The rows' estimates as a table."""
        import numpy as np

        from terragrip.estimation.batch import about_run
        from terragrip.estimation.estimates import Estimates

        self.settle()
        table = np.frombuffer(self.estimates).reshape(len(self), -1)
        columns = {name: np.ascontiguousarray(table[:, place]) for name, place in estimator.places.items()}
        for name in ("latitude", "longitude", "altitude"):
            if name in self.channels:
                columns[name] = np.frombuffer(self.channels[name])
        about = about_run(estimator, None, None, smooth=False)
        codes = np.frombuffer(self.codes, dtype=np.uint8)
        return Estimates(np.frombuffer(self.time), columns, codes, {}, about)


@cache
def _packer(count: int) -> struct.Struct:
    return struct.Struct(f"={count}d")


@contextmanager
def durable(path: Path) -> Iterator[Path]:
    """A temporary path, synced and renamed to ``path`` at the end; raises OSError."""
    temporary = path.with_name(f".{path.name}.part")
    try:
        yield temporary
        file = os.open(temporary, os.O_RDONLY)
        try:
            os.fsync(file)
        finally:
            os.close(file)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Have renames in a folder survive a power cut; raises OSError."""
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
