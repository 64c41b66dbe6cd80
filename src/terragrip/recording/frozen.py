"""Speeds and accelerations that keep one value while the vehicle's motion changes: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from terragrip.arrays import Bools, Floats

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_LONG = 5.0  # s that a value may be repeated
_TIMES = 20.0  # ... and of its usual repetition
_CHANGED = 0.2  # of the others' speed that a twentieth of the drive exceeds: what they change meanwhile
_GAINED = 0.3  # m/s: a speed that changes by this has an acceleration
_LOOKS = 8  # within `_LONG`: a value that is repeated for so long stands at half of them in succession
_FEW = 4000  # rows that show how far rows are apart


def frozen_warnings(recording: Recording) -> list[str]:
    """Sentences on a ground speed or an acceleration that never changes while the wheels do, and on speeds, torques and a drawbar force
    that repeat a value for long, as a receiver does that lost its fix, or a logger whose bus went silent."""
    speeds = _speeds(recording)
    ground = recording.channels.get("ground_speed")
    rims = [name for name in speeds if name != "ground_speed"]
    notes = []
    if ground is not None and _is_one_value(ground) and any(not _is_one_value(speeds[name]) for name in rims):
        value = ground[np.isfinite(ground)][0]
        notes.append(
            f"ground_speed ({value:.3g}) never changes while the wheels turn: a sensor that is dead, or a wrong column."
        )
    acceleration = recording.channels.get("acceleration_x")
    if (
        acceleration is not None
        and _is_one_value(acceleration)
        and any(_range(v) > _GAINED for v in _metric(speeds))
    ):
        value = acceleration[np.isfinite(acceleration)][0]
        notes.append(
            f"acceleration_x ({value:.3g}) never changes while the speed does: a sensor that is dead, or a wrong column."
        )
    for name in speeds:
        others = [
            speeds[one] for one in (["ground_speed"] if name != "ground_speed" else rims) if one in speeds
        ]
        notes += _repeats(name, recording.time, speeds[name], others)
    torques = {n: v for n, v in recording.channels.items() if n.startswith("drive_torque_")}
    for name, values in torques.items():
        others = [other for one, other in torques.items() if one != name]
        notes += _repeats(name, recording.time, values, others, forces=True)
    if "drawbar_force" in recording.channels:
        pull = recording.channels["drawbar_force"]
        notes += _repeats("drawbar_force", recording.time, pull, list(torques.values()), forces=True)
    return notes


def _speeds(recording: Recording) -> dict[str, Floats]:
    names = ("ground_speed", "wheel_based_speed")
    return {n: v for n, v in recording.channels.items() if n in names or n.startswith("wheel_speed_")}


def _metric(speeds: dict[str, Floats]) -> list[Floats]:
    return [v for n, v in speeds.items() if n in ("ground_speed", "wheel_based_speed")]


def _is_one_value(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 2 and bool(np.ptp(known) == 0.0)


def _range(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


def _repeats(
    name: str, time: Floats, values: Floats, others: list[Floats], *, forces: bool = False
) -> list[str]:
    """A sentence on the longest run of one value while others change much. Speeds that are 0 may stand; ``forces`` that are 0 may be
    switched off, and at their limits be as great as they can."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 3 or not others:
        return []
    when, what = time[known], values[known]
    if not _may_last(when, what) or _is_one_value(what):
        return []
    first = np.flatnonzero(np.r_[True, np.diff(what) != 0.0])
    last = np.r_[first[1:], len(what)] - 1
    lasting = when[last] - when[first]
    usual = float(np.median(np.diff(when[first]))) if len(first) > 2 else np.inf
    usable = what[first] != 0.0
    if forces:
        usable &= (what[first] > what.min()) & (what[first] < what.max())
    long = (lasting >= max(_LONG, _TIMES * usual)) & usable
    found = [
        (float(lasting[k]), float(when[first[k]]), float(what[first[k]]))
        for k in np.flatnonzero(long)
        if any(_changes(other, (time >= when[first[k]]) & (time <= when[last[k]])) for other in others)
    ]
    if not found:
        return []
    seconds, start, value = max(found)
    return [
        f"{name} repeats {value:.4g} from {start:.4g} to {start + seconds:.4g} s"
        + (f", and {len(found) - 1} times more," if len(found) > 1 else "")
        + f" while other {'torques' if forces else 'speeds'} change: no measurement, it seems. Leave these cells empty: the intervals "
        "then show how little is known."
    ]


def _may_last(when: Floats, what: Floats) -> bool:
    """Whether a value may be repeated for `_LONG`: a quick look at some of the samples (n,)."""
    every = max(1, len(when) // _FEW)
    step = float(np.quantile(np.diff(when[::every]), 0.95)) / every
    alike = np.diff(what[:: max(1, int(_LONG / _LOOKS / max(step, 1e-9)))]) == 0.0
    least = _LOOKS // 2 - 1
    return len(alike) >= least and bool(sliding_window_view(alike, least).all(axis=1).any())


def _changes(other: Floats, rows: Bools) -> bool:
    """Whether another speed (n,) changes much within ``rows`` (n,)."""
    size = np.abs(other[np.isfinite(other)])
    return bool(len(size)) and _range(other[rows]) > _CHANGED * float(np.quantile(size, 0.95)) > 0.0
