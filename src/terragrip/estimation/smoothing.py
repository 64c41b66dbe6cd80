"""A backward pass over a whole recording: every row then also uses the rows after it (Rauch, Tung and Striebel 1965).

Memory stays bounded. The forward pass keeps a snapshot every few thousand rows and puts each block on disk; then, from the last block
to the first, a restored estimator writes the records of some rows and they are smoothed. All blocks but the newest wait on disk.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.forward import finished, flag_before_gaps, prepared, table_of
from terragrip.estimation.stack_on_disk import StackOnDisk

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.recording import Recording

Done = Callable[[int], None]

STEP = 8192
"""Rows between snapshots: some 25 MB of records for four wheels."""


@dataclass(frozen=True)
class _Forward:
    """A block after the forward pass: what smoothing leaves as it is (``out``, ``event``), and snapshots every ``STEP`` rows."""

    block: Recording
    out: dict[str, Floats]
    event: npt.NDArray[np.uint8]
    snapshots: list[bytes]


def smoothed(
    estimator: TractionEstimator,
    blocks: Iterator[Recording],
    notes: Callable[[], Sequence[str]],
    beside: str | os.PathLike[str] | None = None,
    forward: Done = lambda rows: None,
    backward: Done = lambda rows: None,
    step: int = STEP,
) -> Iterator[Estimates]:
    """Filter all blocks of a recording forwards, then smooth them backwards; gives the blocks in the order of time.

    ``estimator`` must not be `algebraic`; it stands after the last row when this ends. ``nis``, ``supervisor``,
    ``adaptation_<state>``, ``distance``, loads and events are those of the forward pass. Neither the blocks nor ``step`` change the
    result. ``beside``: see `terragrip.estimation.stack_on_disk`. ``forward`` and ``backward`` are called with the rows done.
    """
    engine = estimator.engine
    with StackOnDisk(beside) as filtered, StackOnDisk(beside) as finals:
        last, rows = None, 0
        for block in blocks:
            done = _filter(estimator, block, step, lambda k, before=rows: forward(before + k))  # type: ignore[misc]
            flag_before_gaps(done.event, None if last is None else last.event)
            if last is not None:
                filtered.push(last)
            last, rows = done, rows + len(block)
        if last is None:
            return
        end = engine.snapshot()
        carry, following, count = engine.smooth_carry(), None, rows
        while True:
            result, following = _smooth(estimator, last, carry, following, notes, step)
            count -= len(result)
            backward(rows - count)
            if not len(filtered):
                break
            finals.push(result)
            last = filtered.pop()
        engine.restore(end)
        yield result
        while len(finals):
            yield finals.pop()


def _filter(estimator: TractionEstimator, block: Recording, step: int, forward: Done) -> _Forward:
    engine = estimator.engine
    time, columns = prepared(estimator, block)
    out = table_of(engine.filtered_only, len(time))
    event = np.empty(len(time), dtype=np.uint8)
    snapshots = []
    for first in range(0, len(time), step):
        part = slice(first, first + step)
        snapshots.append(engine.snapshot())
        engine.run(time[part], _cut(columns, part), _cut(out, part), event[part])
        forward(min(first + step, len(time)))
    return _Forward(block, out, event, snapshots)


def _smooth(
    estimator: TractionEstimator,
    one: _Forward,
    carry: Floats,
    following: Floats | None,
    notes: Callable[[], Sequence[str]],
    step: int,
) -> tuple[Estimates, Floats | None]:
    """The estimates of a block, and the record of its first row; ``following`` is the record behind its last."""
    engine = estimator.engine
    time, columns = prepared(estimator, one.block)
    out = table_of(estimator.columns, len(time))
    for name, values in one.out.items():
        out[name][:] = values
    for number in reversed(range(len(one.snapshots))):
        part = slice(number * step, (number + 1) * step)
        engine.restore(one.snapshots[number])
        records = engine.record(time[part], _cut(columns, part))
        engine.smooth(records, following, carry, _cut(out, part))
        following = records[0].copy()
    return finished(estimator, one.block, out, one.event, notes(), smooth=True), following


def _cut(columns: dict[str, Floats], part: slice) -> dict[str, Floats]:
    return {name: values[part] for name, values in columns.items()}
