"""Channels that a logger or a script drew on straight lines between fewer samples: sentences for the user, never errors.

A measured value has noise of its own, so three in a row hardly ever lie on a straight line to their last digit. Of an interpolated
channel all do, but for those at the samples, which are evenly spaced. What lies between is no measurement: its noise seems small.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.held import measurable, measured_part, quantum
from terragrip.recording.once import once
from terragrip.recording.ranks import median
from terragrip.recording.schema import speed_names

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_DIGITS = 2.1  # quanta that a change of two steps on a line may be rounded by
_RESOLVED = 5.0  # times what counts as straight, of the bends at the samples
_STRAIGHT = 0.6  # of the rows whose value changes
_FEWEST = 20  # samples
_STRETCH = 512  # rows
_EVEN = 0.6  # share of their distances that is the usual one, to a row
_STEADY = 10  # periods between two bends: in more, or in a hole of the log, they cannot be counted
_LONGEST = 1.0  # s, half of the usual gap behind which the motion starts anew: farther apart, several values of a line are used


@dataclass(frozen=True)
class Lines:
    """An interpolated channel: when its first sample was, the time between two, and between two rows [s]."""

    first: float
    period: float
    spacing: float


def interpolated_warnings(recording: Recording) -> list[str]:
    """A sentence on speeds and torques that lie on straight lines between evenly spaced samples."""
    known = lines_in(recording)
    if not known:
        return []
    each = ", ".join(f"{name} ({lines.period:.2g} s)" for name, lines in known.items())
    return [
        f"{each}: values lie on straight lines between samples that far apart, so they were interpolated: what lies between is no "
        "measurement, and 'estimate' leaves most of it out (a live service does not). Better give the log as it was measured, without "
        "interpolation (empty cells between the samples)."
    ]


@once  # of one log the estimate asks first, and then its note
def lines_in(recording: Recording) -> dict[str, Lines]:
    """The interpolated speeds and torques of a recording, by channel."""
    wanted = [n for n in recording.channels if n in speed_names(recording.channels) or "drive_torque_" in n]
    every = {name: lines_of(recording.time, recording.channels[name]) for name in wanted}
    return {name: lines for name, lines in every.items() if lines is not None}


def without_lines(recording: Recording, known: Mapping[str, Lines]) -> Recording:
    """The recording, or a part of it, with one value of an interpolated channel in each of its periods, or second if they are longer, the
    others missing."""
    channels = dict(recording.channels)
    for name, lines in known.items():
        since = recording.time - lines.first
        apart = lines.period / np.ceil(lines.period / _LONGEST - 0.01)
        before, after = (np.floor((since + part) / apart) for part in (-lines.spacing / 2, lines.spacing / 2))
        channels[name] = np.where(before < after, channels[name], np.nan)
    return replace(recording, channels=channels)


def lines_of(time: Floats, values: Floats) -> Lines | None:
    """The samples of an interpolated channel (n,); None of one that has noise of its own, or is too coarse to tell."""
    if _is_noisy(values):
        return None
    time, values = measured_part(time, measurable(values))
    if len(values) < 3 * _FEWEST:
        return None
    steps, usual = np.diff(values), median(np.diff(time))
    even = np.abs(np.diff(time) - usual) < 0.05 * usual
    seen = (steps[1:] != 0) & (steps[:-1] != 0) & even[1:] & even[:-1]
    bend = np.abs(np.diff(steps))
    rounding = _DIGITS * quantum(values) + 1e-9 * float(np.max(np.abs(values)))
    # Where stamps are rounded, too, steps of one line are as long as their times.
    straight = rounding + 2e-3 * np.abs(steps[1:])
    bent = seen & (bend > straight)
    rows = np.flatnonzero(bent)
    rows = rows[np.diff(rows, prepend=-2) > 1]  # a sample between two rows bends twice
    if len(rows) < _FEWEST or np.sum(seen & ~bent) < _STRAIGHT * seen.sum():
        return None
    apart = np.diff(rows)
    length = median(apart)
    if (
        length < 3
        or np.mean(np.abs(apart - length) <= 1) < _EVEN
        or median(bend[bent] / straight[bent]) < _RESOLVED
    ):
        return None
    # From bend to bend, since stamps in whole milliseconds make a row of 30 Hz a hundredth too short; 3 Hz at 20 Hz: 6 or 7 rows.
    between = np.diff(time[rows + 1])
    counted = np.round(between / (length * usual))
    near = (counted > 0) & (counted < _STEADY)
    return Lines(float(time[rows[0] + 1]), float(between[near].sum() / counted[near].sum()), float(usual))


def _is_noisy(values: Floats) -> bool:
    """Whether eight stretches of a long channel (n,) bend in most rows that change: a tenth of the work that the whole is."""
    parts = values[: len(values) // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    some = parts[:: max(1, len(parts) // 8)].ravel()
    some = some[np.isfinite(measurable(some))]
    steps = np.diff(some)
    moves = (steps[1:] != 0) & (steps[:-1] != 0)
    bent = np.abs(np.diff(steps)) > _DIGITS * quantum(some) + 2e-3 * np.abs(steps[1:])
    return bool(moves.sum() > _STRETCH and np.mean(bent[moves]) > 1 - _STRAIGHT / 2)
