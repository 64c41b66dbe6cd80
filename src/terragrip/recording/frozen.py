"""Speeds and accelerations that keep one value while the vehicle's motion changes: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import known_part, quantum, usual_values
from terragrip.recording.ranks import median, quantile

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_LONG = 5.0  # s that a value may be repeated
_TIMES = 20.0  # ... and of its usual repetition
_CHANGED = 0.2  # of the others' speed that a twentieth of the drive exceeds: what they change meanwhile
_COARSE = 0.1  # of the size of a channel: larger steps hide the changes
_DRIVING = 0.3  # of the speed that a twentieth of the drive exceeds
_SEVERAL = 4  # channels
_CHANGES = 20  # of a channel's value: fewer show no resolution
_GAINED = 0.3  # m/s: a speed that changes by this has an acceleration
_GAP, _APART = 1.0, 3.0  # s, and times the usual distance of samples
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
    notes += _standing(recording, rims)
    torques = {n: v for n, v in recording.channels.items() if n.startswith("drive_torque_")}
    for name, values in torques.items():
        others = [other for one, other in torques.items() if one != name]
        notes += _repeats(name, recording.time, values, others, forces=True)
    if "drawbar_force" in recording.channels:
        pull = recording.channels["drawbar_force"]
        notes += _repeats("drawbar_force", recording.time, pull, list(torques.values()), forces=True)
    return notes + _off(recording.time, torques) + _hung(recording)


def _by_steps(what: Floats, step: float) -> bool:
    """Whether a channel (n,) changes from one of its ``step`` values to the next: no plateaus of a few speeds."""
    changes = np.abs(np.diff(what))
    changes = changes[changes > 0]
    return len(changes) > _CHANGES and float(np.mean(changes < 1.5 * step)) > 0.5


def _standing(recording: Recording, rims: list[str]) -> list[str]:
    """A sentence on each wheel that reads 0 for long while the ground speed, and other wheels, go on."""
    ground, notes = recording.channels.get("ground_speed"), []
    if ground is None or len(rims) < 2 or not np.isfinite(ground).any():
        return []
    if not any(_may_last(*known_part(recording.time, recording.channels[name])) for name in rims):
        return []
    zero = {name: recording.channels[name] == 0.0 for name in rims}
    driving = np.abs(ground) > _DRIVING * float(np.nanquantile(np.abs(ground), 0.95))
    for name in rims:
        if not zero[name].any() or _is_one_value(recording.channels[name]):
            continue
        alone = zero[name] & driving & ~np.logical_and.reduce(list(zero.values()))
        stretch = _longest(recording.time, alone, np.isfinite(recording.channels[name]) & np.isfinite(ground))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while the vehicle drives: the wheel is locked, or its sensor "
                "lost the signal. If it did, leave these cells empty."
            )
    return notes


def _off(time: Floats, torques: dict[str, Floats]) -> list[str]:
    """A sentence on each torque that alone is 0 for long: an axle that is switched off has two of them."""
    notes = []
    for name, values in torques.items():
        others = [other for one, other in torques.items() if one != name]
        if not others or not _may_last(*known_part(time, values)) or _is_one_value(values):
            continue
        alone = (values == 0.0) & np.logical_and.reduce([other != 0.0 for other in others])
        stretch = _longest(time, alone, np.isfinite(values))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while all other torques are not: its sensor lost the signal, "
                "or its motor is off. If the sensor did, leave these cells empty."
            )
    return notes


def _hung(recording: Recording) -> list[str]:
    """A sentence where all channels keep their values for long while the vehicle drives."""
    ground = recording.channels.get("ground_speed", np.full(len(recording), np.nan))
    if len(recording) < 3 or not np.isfinite(ground).all() or not _may_last(recording.time, ground):
        return []
    channels = [v for v in recording.channels.values() if not _is_one_value(v) and np.isfinite(v).all()]
    if len(channels) < _SEVERAL:
        return []
    time, same = recording.time[1:], np.abs(ground[1:]) > _DRIVING * quantile(np.abs(ground), 0.95)
    for values in channels:
        if not same.any():
            return []
        same &= values[1:] == values[:-1]
    stretch = _longest(time, same, np.ones(len(same), dtype=bool))
    changes = time[ground[1:] != ground[:-1]]
    if stretch is None or len(changes) < 3 or stretch[1] - stretch[0] < _TIMES * median(np.diff(changes)):
        return []
    return [
        f"All channels keep their values from {stretch[0]:.4g} to {stretch[1]:.4g} s: the logger hung, it seems. Leave these rows out."
    ]


def _longest(time: Floats, rows: Bools, known: Bools) -> tuple[float, float] | None:
    """First and last instant of the longest run of ``rows`` among those that are ``known`` (n,), if it lasts for `_LONG`."""
    if not rows.any():
        return None
    when, inside = time[known], rows[known]
    cut = np.flatnonzero(np.r_[True, (inside[1:] != inside[:-1]) | _gaps(when), True])
    runs = inside[cut[:-1]]
    starts, ends = cut[:-1][runs], cut[1:][runs] - 1
    if not len(starts):
        return None
    k = int(np.argmax(when[ends] - when[starts]))
    first, last = float(when[starts[k]]), float(when[ends[k]])
    return (first, last) if last - first >= _LONG else None


def _gaps(when: Floats) -> Bools:
    """Where samples at these instants (n,) are missing (n - 1,): no value is repeated across."""
    steps = np.diff(when)
    return steps > max(_GAP, _APART * median(steps)) if len(steps) else np.zeros(0, dtype=bool)


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
    when, what = known_part(time, values)
    if not others or not _may_last(when, what) or _is_one_value(what):
        return []
    first = np.flatnonzero(np.r_[True, (np.diff(what) != 0.0) | _gaps(when)])
    last = np.r_[first[1:], len(what)] - 1
    lasting = when[last] - when[first]
    usual = median(np.diff(when[first])) if len(first) > 2 else np.inf
    step, size = quantum(what), quantile(np.abs(what), 0.95)
    if step > _COARSE * size and _by_steps(what, step):
        return (
            []
            if forces
            else [
                f"{name} comes in steps of {step:.3g}, where {size:.3g} is fast: it and slip are off by half a step as long as it keeps "
                "one value. Log it in finer steps."
            ]
        )
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
    if len(when) < _LOOKS:
        return False
    every = max(1, len(when) // _FEW)
    step = quantile(np.diff(when[::every]), 0.95) / every
    alike = np.diff(what[:: max(1, int(_LONG / _LOOKS / max(step, 1e-9)))]) == 0.0
    least = _LOOKS // 2 - 1
    return len(alike) >= least and bool(sliding_window_view(alike, least).all(axis=1).any())


def _changes(other: Floats, rows: Bools) -> bool:
    """Whether another speed (n,) changes much within ``rows`` (n,)."""
    size = np.abs(other[np.isfinite(other)])
    return bool(len(size)) and _range(usual_values(other[rows])) > _CHANGED * quantile(size, 0.95) > 0.0
