"""A closed segment of the record: Parquet files that appear whole, synced, or not at all."""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.estimation.arrow import floats
from terragrip.estimation.engine import EVENTS
from terragrip.files import sync
from terragrip.live.outputs import Event, Output, Refusal, Row
from terragrip.recording.schema import CARRIED

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pyarrow as pa

    from terragrip.estimation.estimates import Estimates
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.ground.live import GroundState

_CODES = {event: code for code, event in enumerate(EVENTS)}
RECORDING, ESTIMATES, REFUSED, EVENT_LINES, GROUND = "recording", "estimates", "refused", "events", "ground"


@dataclass(slots=True)
class Segment:
    """What came out of the core since the last segment was closed. Rows lie flat: made to columns of a table in a moment."""

    number: int
    size: int = 0  # outputs in it: rows, events, refusals and states of the ground
    time: array[float] = field(default_factory=lambda: array("d"))
    arrival: array[float] = field(default_factory=lambda: array("d"))
    codes: bytearray = field(default_factory=bytearray)  # of the rows' events
    estimates: array[float] = field(default_factory=lambda: array("d"))
    measured: dict[tuple[str, ...], tuple[array[int], array[float]]] = field(default_factory=dict)
    """Of the channels that came together, the places of their rows, and their values one behind the other."""
    refusals: list[Refusal] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    ground: list[GroundState] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.time)

    def add(self, output: Output) -> None:
        """Take one output of the core."""
        self.size += 1
        if isinstance(output, Row):
            estimate, names = output.estimate, tuple(output.values)
            if names not in self.measured:
                self.measured[names] = array("q"), array("d")
            places, values = self.measured[names]
            places.append(len(self))
            values.extend(output.values.values())
            self.time.append(estimate.time)
            self.arrival.append(output.arrival)
            self.codes.append(_CODES[estimate.event])
            self.estimates.extend(estimate.values)
        elif isinstance(output, Event):
            self.events.append(output)
        elif isinstance(output, Refusal):
            self.refusals.append(output)
        else:
            self.ground.append(output)

    def channels(self) -> dict[str, npt.NDArray[np.float64]]:
        """What was measured, a column (n,) each; NaN where a row has none."""
        import numpy as np

        result = {name: np.full(len(self), np.nan) for names in self.measured for name in names}
        for names, (places, values) in self.measured.items():
            table = np.frombuffer(values).reshape(-1, len(names))
            for name, column in zip(names, table.T, strict=True):
                result[name][np.frombuffer(places, dtype=np.int64)] = column
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
        import numpy as np
        import pyarrow as pa

        stamps = {"time": np.frombuffer(self.time), "arrival": np.frombuffer(self.arrival)}
        columns = {**stamps, **self.channels()}
        return pa.table({name: floats(column) for name, column in columns.items()})

    def to_estimates(self, estimator: TractionEstimator) -> Estimates:
        """The rows' estimates as a table."""
        import numpy as np

        from terragrip.estimation.engine_estimator import EngineEstimator
        from terragrip.estimation.estimates import Estimates
        from terragrip.estimation.provenance import about_run

        table = np.frombuffer(self.estimates).reshape(len(self), -1)
        columns = {name: np.ascontiguousarray(table[:, place]) for name, place in estimator.places.items()}
        measured = self.channels()
        columns |= {name: measured[name] for name in CARRIED if name in measured}
        about = about_run(estimator, {"source": None, "sha256": None}, smooth=False)
        if isinstance(estimator, EngineEstimator):
            about["driveline"] = estimator.machine.to_dict()
        return Estimates(np.array(self.time), columns, np.array(self.codes, dtype=np.uint8), {}, about)


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
