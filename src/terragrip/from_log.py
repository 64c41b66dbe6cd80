"""From a log to a file of estimates: the one way for command line, studio, campaign and fleet."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.estimation import DEFAULT, Estimates, RunOptions, estimated
from terragrip.estimation.export import require_room, require_suffix
from terragrip.estimation.summary import Tally
from terragrip.estimation.writing import write_parts
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.survey import ROWS

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.vehicle import Vehicle

PathLike = str | os.PathLike[str]

_CUT = 2.0  # s, or three rows, between the files of one drive: what a logger loses when it begins another
_FEW = 3  # rows


def estimate_file(
    log: PathLike | Sequence[PathLike] | Recording,
    vehicle: Vehicle,
    output: PathLike,
    method: str = DEFAULT,
    *,
    profile: Profile | PathLike | Sequence[Profile | PathLike | None] | None = None,
    dbc: Sequence[PathLike] = (),
    smooth: bool = False,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
    gap: float | None = None,
    standstill_speed: float | None = None,
    labels: Mapping[str, str] | None = None,
    observe: Callable[[Estimates], None] | None = None,
    summary: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> str:
    """Estimate a log into a file, Parquet or another by its suffix (docs/export.md); returns the summary as text.

    The rows are those of :func:`terragrip.estimate`, to the last digit, at any length of the log. A first pass finds the
    noise and the held channels, which are in the file's metadata with all other settings. The second pass estimates in blocks,
    so memory stays small. The file appears whole or not at all.

    Parameters
    ----------
    log: the path of a log, those of several sources of one drive, or a Recording.
    vehicle, method, smooth, sensors, held, gap, standstill_speed: as for :func:`terragrip.estimate`.
    profile, dbc: as for :func:`terragrip.read`.
    labels: text columns with one value in every row, such as ``log``.
    observe: called with each block of estimates, in the order of time, before it is written.
    summary: False: no text (""), which saves a tenth of the time for a log of a minute.
    progress: called with the rows done and the total; each pass over the log counts all its rows.

    Raises
    ------
    InputError: the log, the vehicle or the call is unusable, or the file cannot be written.
    """
    options = RunOptions(method, smooth, sensors, held, gap, standstill_speed)
    require_suffix(output)
    if isinstance(log, Recording):
        blocks = LogBlocks.of(log, ROWS)
    else:
        from terragrip.formats.log_blocks import log_in_blocks

        blocks = log_in_blocks(log, profile, dbc=dbc)
    parts = estimated(
        blocks,
        vehicle,
        options,
        beside=Path(output).parent,
        planned=lambda rows, names: require_room(output, rows, names),
        progress=progress,
    )
    tally, notes = Tally(), dict[str, None]()

    def followed() -> Iterator[Estimates]:
        for part in parts:
            same = {name: np.full(len(part), text, dtype=object) for name, text in (labels or {}).items()}
            part = replace(part, labels={**part.labels, **same})
            if observe is not None:
                observe(part)
            if summary:
                tally.add(part)
                notes.update(dict.fromkeys(part.notes))
            yield part

    write_parts(followed(), output)
    return tally.text(notes, os.fspath(output)) if summary else ""


def follows(second: PathLike, first: PathLike) -> bool:
    """Whether the rows of one Parquet file of estimates begin where those of another end: by clock time, or by times that run on."""
    (clock, before), (other, time) = (_times(file) for file in (first, second))
    if min(len(before), len(time)) < _FEW:
        return False
    between = other - clock + float(time[0] - before[-1])
    return 0.0 < between <= max(_CUT, 3 * float(np.median(np.diff(before))))


def _times(file: PathLike) -> tuple[float, Floats]:
    """Clock time of time 0 [s since 1970] of a file of estimates, 0 if it has none, and its time [s]."""
    import pyarrow.parquet as pq

    zero = (Estimates.read_about(file).get("recording") or {}).get("time_zero")
    time = pq.read_table(os.fspath(file), columns=["time"]).column("time").to_numpy()
    return 0.0 if zero is None else datetime.fromisoformat(zero).timestamp(), time
