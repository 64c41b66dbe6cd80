"""A closed segment of the record: Parquet files that appear whole, synced, or not at all."""

from __future__ import annotations

import json
import struct
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.estimation.arrow import floats
from terragrip.estimation.engine import EVENTS
from terragrip.files import sync
from terragrip.live.core import Ground, Output, Refusal, Row
from terragrip.live.event import Event

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pyarrow as pa

    from terragrip.estimation.estimates import Estimates
    from terragrip.estimation.estimator import TractionEstimator

_STAMP = struct.Struct("=ddB")  # time, arrival, code of the event
_CODES = {event: code for code, event in enumerate(EVENTS)}

RECORDING, ESTIMATES, REFUSED, EVENT_LINES, GROUND = "recording", "estimates", "refused", "events", "ground"


@dataclass(slots=True)
class _Rows:
    """Rows that hold the same channels: their places in the segment, and their values one behind the other."""

    pack: Callable[..., bytes]
    places: array[int] = field(default_factory=lambda: array("q"))
    values: bytearray = field(default_factory=bytearray)


@dataclass(slots=True)
class Segment:
    """What came out of the core since the last segment was closed. Rows lie flat, 8 bytes a number."""

    number: int
    size: int = 0  # outputs in it: rows, events, refusals and states of the ground
    stamps: bytearray = field(default_factory=bytearray)  # _STAMP of each row
    estimates: bytearray = field(default_factory=bytearray)
    measured: dict[tuple[str, ...], _Rows] = field(default_factory=dict)
    refusals: list[Refusal] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    ground: list[Ground] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.stamps) // _STAMP.size

    def add(self, output: Output) -> None:
        """Take one output of the core."""
        self.size += 1
        if isinstance(output, Row):
            self._add_row(output)
        elif isinstance(output, Event):
            self.events.append(output)
        elif isinstance(output, Ground):
            self.ground.append(output)
        else:
            self.refusals.append(output)

    def _alike(self, names: tuple[str, ...]) -> _Rows:
        result = self.measured.get(names)
        if result is None:
            result = self.measured[names] = _Rows(struct.Struct(f"={len(names)}d").pack)
        return result

    def _add_row(self, row: Row) -> None:
        alike, estimate = self._alike(tuple(row.values)), row.estimate
        alike.places.append(len(self))
        alike.values += alike.pack(*row.values.values())
        self.stamps += _STAMP.pack(estimate.time, row.arrival, _CODES[estimate.event])
        self.estimates += estimate.packed

    def _stamps(self) -> npt.NDArray[np.void]:
        import numpy as np

        return np.frombuffer(self.stamps, dtype=[("time", "=f8"), ("arrival", "=f8"), ("code", "u1")])

    def channels(self) -> dict[str, npt.NDArray[np.float64]]:
        """What was measured, a column (n,) each; NaN where a row has none."""
        import numpy as np

        result = {name: np.full(len(self), np.nan) for names in self.measured for name in names}
        for names, rows in self.measured.items():
            table = np.frombuffer(rows.values).reshape(-1, len(names))
            for name, column in zip(names, table.T, strict=True):
                result[name][np.frombuffer(rows.places, dtype=np.int64)] = column
        return result

    def write(self, folder: Path, estimator: TractionEstimator | None) -> None:
        """Write the segment's files; raises OSError."""
        if len(self) and estimator is not None:
            import pyarrow.parquet as pq

            from terragrip.estimation.export.arrow_files import parquet_options

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
        import pyarrow as pa

        stamps = self._stamps()
        columns = {"time": stamps["time"], "arrival": stamps["arrival"], **self.channels()}
        return pa.table({name: floats(column) for name, column in columns.items()})

    def to_estimates(self, estimator: TractionEstimator) -> Estimates:
        """The rows' estimates as a table."""
        import numpy as np

        from terragrip.estimation.engine_estimator import EngineEstimator
        from terragrip.estimation.estimates import Estimates
        from terragrip.estimation.forward import CARRIED
        from terragrip.estimation.provenance import about_run

        table = np.frombuffer(self.estimates).reshape(len(self), -1)
        columns = {name: np.ascontiguousarray(table[:, place]) for name, place in estimator.places.items()}
        measured = self.channels()
        columns |= {name: measured[name] for name in CARRIED if name in measured}
        about = about_run(estimator, {"source": None, "sha256": None}, smooth=False)
        if isinstance(estimator, EngineEstimator):
            about["driveline"] = estimator.machine.to_dict()
        stamps = self._stamps()
        time, codes = (np.ascontiguousarray(stamps[name]) for name in ("time", "code"))
        return Estimates(time, columns, codes, {}, about)


@contextmanager
def durable(path: Path) -> Iterator[Path]:
    """A temporary path, synced and renamed to ``path`` at the end; raises OSError."""
    temporary = path.with_name(f".{path.name}.part")
    try:
        yield temporary
        sync(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
