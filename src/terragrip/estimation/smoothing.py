"""A backward pass over a whole recording: every row then knows the rows after it (Rauch, Tung and Striebel 1965).

Memory stays bounded: the forward pass keeps a snapshot a block; then, from the last block to the first, a
restored estimator writes records of one block and they are smoothed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.estimation.batch import finished, flag_before_gaps, prepared, table_of
from terragrip.estimation.estimates import Estimates

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.recording import Recording

Floats = npt.NDArray[np.float64]

_BLOCK = 8192  # rows: some 25 MB of records for four wheels


def run_smoothed(
    estimator: TractionEstimator,
    recording: Recording,
    progress: Callable[[int, int], None] | None = None,
    block: int = _BLOCK,
) -> Estimates:
    """Filter all rows of the recording forwards, then smooth them backwards.

    ``estimator`` must not be `algebraic`; it stands after the last row when this returns. ``nis``,
    ``supervisor``, ``adaptation_<state>``, ``distance``, loads and events are those of the forward pass.
    ``block`` rows are held in memory at a time; it does not change the result. ``progress`` counts every row
    twice: there and back.
    """
    engine = estimator.engine
    time, columns = prepared(estimator, recording)
    rows = len(time)
    out = table_of(estimator.columns, rows)
    event = np.empty(rows, dtype=np.uint8)
    starts = range(0, rows, block)
    snapshots = []
    for first in starts:
        part = slice(first, first + block)
        snapshots.append(engine.snapshot())
        engine.run(time[part], _cut(columns, part), _cut(out, part), event[part])
        _tell(progress, min(first + block, rows), 2 * rows)
    end = engine.snapshot()
    carry, following = engine.smooth_carry(), None
    for first in reversed(starts):
        part = slice(first, first + block)
        engine.restore(snapshots.pop())
        records = engine.record(time[part], _cut(columns, part))
        engine.smooth(records, following, carry, _cut(out, part))
        following = records[0].copy()
        _tell(progress, 2 * rows - first, 2 * rows)
    engine.restore(end)
    flag_before_gaps(event)
    return finished(estimator, recording, out, event, smooth=True)


def _cut(columns: dict[str, Floats], part: slice) -> dict[str, Floats]:
    return {name: values[part] for name, values in columns.items()}


def _tell(progress: Callable[[int, int], None] | None, done: int, of: int) -> None:
    if progress is not None:
        progress(done, of)
