"""Recordings larger than memory: blocks in, a Parquet file of estimates out."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.estimation.batch import GAP, check, flag_before_gaps, run
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.methods import DEFAULT
from terragrip.estimation.summary import Tally
from terragrip.files import replacing

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording
    from terragrip.vehicle import Vehicle


def estimate_blocks(
    blocks: Iterable[Recording],
    vehicle: Vehicle,
    output: str | os.PathLike[str],
    method: str = DEFAULT,
    *,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
    gap: float | None = None,
    standstill_speed: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> str:
    """Estimate consecutive blocks of one recording into a Parquet file; return its summary.

    The rows are those that :func:`estimate` gives for the whole recording, given the same noise and held
    channels; where these are found in the log, the first block stands for it. The file appears whole or not at
    all. A block is written while the next one is estimated. ``progress`` is called with the rows done so far.

    Raises InputError as :func:`estimate` does, on no block at all, and where the file cannot be written.
    """
    parts = _estimated(blocks, vehicle, method, sensors, held, gap, standstill_speed)
    return _written(_flagged(parts), output, progress)


def estimate_in_parts(
    recording: Recording,
    vehicle: Vehicle,
    output: str | os.PathLike[str],
    method: str = DEFAULT,
    *,
    rows: int = 200_000,
    progress: Callable[[int], None] | None = None,
) -> str:
    """Estimate a recording that fits memory, of which the estimates do not, into a Parquet file; return its summary.

    Noise and held channels are found in the whole recording, so that the rows are those of :func:`estimate`. Raises
    InputError as `estimate_blocks` does.
    """
    check(recording, vehicle)
    estimator = TractionEstimator.for_recording(recording, vehicle, method)
    parts = (recording.select(slice(k, k + rows)) for k in range(0, len(recording), rows))
    return _written(_flagged(run(estimator, part, flag=False) for part in parts), output, progress)


def _written(
    parts: Iterator[Estimates], output: str | os.PathLike[str], progress: Callable[[int], None] | None
) -> str:
    """Write parts of estimates to a Parquet file, which appears whole or not at all; returns their summary."""
    tally, notes = Tally(), dict[str, None]()
    with replacing(output) as temporary, _Writer(temporary) as writer:
        for part in parts:
            writer.write(part)
            tally.add(part)
            notes.update(dict.fromkeys(part.notes))
            if progress is not None:
                progress(tally.rows)
        if tally.rows == 0:
            raise InputError("there is no row to estimate", mend="give a log with at least one row")
    return tally.text(notes)


def _estimated(
    blocks: Iterable[Recording],
    vehicle: Vehicle,
    method: str,
    sensors: Mapping[str, float] | None,
    held: Mapping[str, float] | None,
    gap: float | None,
    standstill_speed: float | None,
) -> Iterator[Estimates]:
    estimator = None
    for block in blocks:
        if estimator is None:
            check(block, vehicle)
            estimator = TractionEstimator.for_recording(
                block, vehicle, method, sensors=sensors, held=held, gap=gap, standstill_speed=standstill_speed
            )
        yield run(estimator, block, flag=False)


def _flagged(parts: Iterator[Estimates]) -> Iterator[Estimates]:
    """Hold each part back until the next shows whether a gap follows its last row."""
    last: Estimates | None = None
    for part in parts:
        if last is not None:
            if part.event_codes[0] == GAP:
                last.event_codes[-1] = GAP
            yield last
        flag_before_gaps(part.event_codes)
        last = part
    if last is not None:
        yield last


class _Writer:
    """Writes one part in a thread of its own while the caller works on the next."""

    def __init__(self, path: os.PathLike[str]) -> None:
        self._path = path
        self._pool = ThreadPoolExecutor(1)
        self._writer: pq.ParquetWriter | None = None
        self._schema: pa.Schema | None = None
        self._pending: Future[None] | None = None

    def __enter__(self) -> _Writer:
        return self

    def write(self, part: Estimates) -> None:
        """Hand over a part; waits for the one before it and raises what went wrong with that."""
        table = part.to_arrow()
        self._wait()
        self._pending = self._pool.submit(self._write, table)

    def _write(self, table: pa.Table) -> None:
        import pyarrow.parquet as pq

        from terragrip.estimation.estimates import parquet_options

        if self._writer is None:
            self._schema = table.schema
            self._writer = pq.ParquetWriter(self._path, table.schema, **parquet_options(table.schema))
        self._writer.write_table(table.cast(self._schema))

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __exit__(self, *failure: object) -> None:
        try:
            if failure[0] is None:
                self._wait()
        finally:
            self._pool.shutdown(wait=True, cancel_futures=True)
            if self._writer is not None:
                self._writer.close()
