"""The rows of a recording through an estimator in its present state, and the table that they make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.methods import SLIP_ONLY
from terragrip.estimation.provenance import about_recording, about_run, notes_of
from terragrip.recording.schema import CARRIED

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.recording import Recording

Codes = npt.NDArray[np.uint8]

GAP = EVENTS.index("gap")


def run(
    estimator: TractionEstimator,
    recording: Recording,
    notes: Callable[[], Sequence[str]] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Estimates:
    """All rows of the recording through the estimator in its present state; ``notes``: None: those that it gives itself.

    A row before a gap is not flagged (`flag_before_gaps`), as none is where samples come one by one.
    """
    time, columns = prepared(estimator, recording)
    out = table_of(estimator.columns, len(time))
    event = np.empty(len(time), dtype=np.uint8)
    estimator.engine.run(time, columns, out, event, progress)
    texts = notes_of(estimator, recording) if notes is None else notes()
    return finished(estimator, recording, out, event, texts, smooth=False)


def prepared(estimator: TractionEstimator, recording: Recording) -> tuple[Floats, dict[str, Floats]]:
    """Time and those channels that the estimator uses, each contiguous."""
    wanted, channels = estimator.engine.slots_in, recording.channels
    if estimator.turn is not None:
        channels = {**channels, "angular_velocity_z": estimator.turn.over(recording)}
    columns = {name: np.ascontiguousarray(values) for name, values in channels.items() if name in wanted}
    return np.ascontiguousarray(recording.time), columns


def table_of(names: Sequence[str], rows: int) -> dict[str, Floats]:
    """Empty columns (rows,) in one block.

    An odd number of cache lines a column keeps columns that are written side by side out of the same cache set.
    """
    lines = (rows + 7) // 8 | 1
    block = np.empty((len(names), 8 * lines))
    return {name: block[k, :rows] for k, name in enumerate(names)}


def finished(
    estimator: TractionEstimator,
    recording: Recording,
    out: dict[str, Floats],
    event: Codes,
    notes: Sequence[str],
    *,
    smooth: bool,
) -> Estimates:
    """Estimates from the kernel's columns, with what is passed on and notes."""
    out |= {name: recording.channels[name] for name in carried_channels(recording, estimator)}
    about = about_run(estimator, about_recording(recording), smooth=smooth)
    return Estimates(recording.time, out, event, dict(recording.labels), about, tuple(notes))


def carried_channels(recording: Recording, estimator: TractionEstimator) -> tuple[str, ...]:
    """The channels that are copied to the estimates as they were measured."""
    own = ("drawbar_force",) if estimator.method == SLIP_ONLY.name else ()
    return tuple(n for n in (*own, *CARRIED, *recording.references) if n in recording.channels)


def flag_before_gaps(event: Codes, before: Codes | None = None) -> None:
    """Flag the row before each gap too: it is the last one before the unknown. ``before``: the codes of the rows before these."""
    if before is not None and event[0] == GAP:
        before[-1] = GAP
    event[np.flatnonzero((event[1:] == GAP) & (event[:-1] != GAP))] = GAP
