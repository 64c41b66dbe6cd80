"""Several sources of one drive on one time base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.formats.conversion import Part
from terragrip.formats.signals import Signal, SignalLog
from terragrip.recording import Recording
from terragrip.recording.lag import lag_between, speed_of, wheels_of
from terragrip.recording.schema import TIME, unit_of

_REACH = 60.0  # s that clocks which both count from 1970 may differ by: leap seconds are 18 s, time zones are distinguished


def merged(parts: Sequence[Part]) -> Recording:
    """One recording of several sources: each channel from the first that has it, on the first one's clock.

    Raises InputError where a source has no usable channel or time, and for whatever `Recording.from_frame` refuses.
    """
    frame, source, digests, notes, noise = joined(parts)
    return Recording.from_frame(frame, source, sha256=digests, notes=notes, noise=noise, start=parts[0].start)


def joined(
    parts: Sequence[Part],
) -> tuple[dict[str, Any], str, str | None, tuple[str, ...], dict[str, float]]:
    """Columns, source, digests, notes and noise of what `merged` makes a recording of; none is asked for but time."""
    reference = parts[0]
    signals: dict[str, Signal] = {}
    notes: list[str] = list(reference.notes)
    noise: dict[str, float] = {}
    for number, part in enumerate(parts):
        if not part.columns:
            raise InputError(
                "holds no channel", file=part.source, hint="leave it out, or name its columns in a profile"
            )
        shift = 0.0
        if part.columns.keys() <= signals.keys():
            # Taken as it is, its rows would vanish without a word: a drive cut into files is the usual cause.
            raise InputError(
                "has no channel that the logs before it lack, so nothing of it would be used",
                file=part.source,
                hint="logs that follow each other are estimated each by itself, or made one file first",
            )
        if number:
            notes += part.notes
            shift, remarks = _shift(reference, part)
            notes.append(remarks)
        for name, values in part.columns.items():
            if name in signals:
                continue
            known = _known(values)
            signals[name] = Signal(part.time[known] - shift, values[known], unit_of(name))
            noise |= {name: part.noise[name]} if name in part.noise else {}
    table = SignalLog(tuple(signals), signals, ", ".join(str(p.source) for p in parts)).table()
    # The union starts at its first instant: give it back the first source's clock.
    origin = min(float(s.time[0]) for s in signals.values() if len(s.time))
    frame: dict[str, Any] = {**table.columns, TIME: table.columns[TIME] + origin}
    digests = "+".join(part.sha256 or "" for part in parts) if any(p.sha256 for p in parts) else None
    return frame, str(table.source), digests, tuple(dict.fromkeys((*notes, *table.notes))), noise


def _known(values: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    if values.dtype.kind in "fiub":
        return np.isfinite(values)
    return np.asarray(values != "", dtype=bool)


def _shift(reference: Part, part: Part) -> tuple[float, str]:
    """What to take off a source's time, and the sentence that says so."""
    stated, reach = 0.0, None
    if reference.start is not None and part.start is not None:
        stated, reach = reference.start - part.start, _REACH
    elif (reference.start is None) != (part.start is None) and len(reference.time) and len(part.time):
        stated = float(part.time[0] - reference.time[0])  # only one counts from 1970: they start together
    name = Path(str(part.source)).name
    mine, theirs = speed_of(reference.time, reference.columns), speed_of(part.time, part.columns)
    if mine is not None and theirs is not None and (mine.pace is None) != (theirs.pace is None):
        # Like with like, where both have wheels: a ground speed lags behind them, and is slower to come.
        alike = wheels_of(reference.time, reference.columns), wheels_of(part.time, part.columns)
        mine, theirs = alike if None not in alike else (mine, theirs)
    result = None
    if mine is not None and theirs is not None:
        result = lag_between(mine, replace(theirs, time=theirs.time - stated), reach=reach)
    if result is None:
        how = "counts from 1970 as the first does" if reach is not None else "starts with the first one"
        return stated, f"The clock of {name} is used as it is (it {how}): the speeds show no offset."
    side = "ahead of" if result.seconds >= 0 else "behind"
    beyond = "its stamps" if reach is not None else "its start"
    sentence = (
        f"The clock of {name} is {abs(result.seconds):.3f} ± {result.std:.3f} s {side} the first one beyond {beyond}, by the "
        f"correlation of the speeds ({result.correlation:.3f})"
    )
    if not result.is_of_the_clock:
        return stated, f"{sentence}; {result.why_not}, so it is used as it is."
    return stated + result.seconds, f"{sentence}, and was shifted by that."
