"""Wheel speeds that are the pulses counted in each row: where the teeth are few, a row has one or none, and does not show the speed; or of
the time between pulses, which keep their last value where none comes."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from terragrip.errors import InputError
from terragrip.recording.held import known_part, measured_part, quantum
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import rim_names
from terragrip.recording.stretches import DRIVING

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_ZEROS = 0.1  # of the rows at speed: with fewer, a row is off by a part of the speed alone
_FEWEST = 20  # pulses
_WAITS = 4.0  # times the usual wait for a pulse: longer ones are rare
_RARE = 0.1  # share of the pulses
_STANDS, _KEPT = 0.1, 2.0  # of the usual speed, and s
_UNLIKE, _FINE = 3, 30.0  # values, of all wheels and stops, and their least size in steps of the channel
_PULSES, _SHORTEST = 5, 0.5  # in a window, and its least length [s]


def counted_warnings(recording: Recording) -> list[str]:
    """A sentence on each wheel speed that is counted in pulses, of which a row has one or none."""
    found = _counted(recording)
    return [f"column {name}: {_problem(step)}; {_fix(name, window)}." for name, step, window in found]


def waiting_warnings(recording: Recording) -> list[str]:
    """A sentence on wheel speeds that keep the value of their last pulse while the vehicle stands, another one each time."""
    ground = recording.channels.get("ground_speed")
    if ground is None or np.isfinite(ground).sum() < 2:
        return []
    at, speed = known_part(recording.time, np.abs(ground))
    values: dict[str, set[float]] = {}
    for name in rim_names(recording.channels):
        when, what = measured_part(recording.time, np.abs(recording.channels[name]))
        starts = np.flatnonzero(np.diff(what, prepend=np.nan))
        counts = np.diff(starts, append=len(what))
        lasts = when[starts + counts - 1] - when[starts]
        long = (lasts > _KEPT) & (counts > _PULSES) & (what[starts] > 0.0)
        if not long.any():
            continue
        meanwhile = np.interp(when, at, speed)
        slow = np.add.reduceat(meanwhile, starts) / counts < _STANDS * quantile(speed, 0.95)
        low, high = (pick.reduceat(meanwhile, starts) for pick in (np.minimum, np.maximum))
        slow &= (low < high) | (high == 0.0)  # else the logger hung
        kept = what[starts][long & slow]
        kept = kept[kept > _FINE * quantum(what)]  # a wheel that spins evenly keeps a coarse value, too
        if len(kept) > np.sum(long & ~slow):  # else the logger repeats values, driving or not
            values[name] = set(kept.tolist())
    if len(set().union(*values.values())) < _UNLIKE:
        return []
    return [
        f"{', '.join(values)}: while the vehicle stands each keeps one value for seconds, not 0, and another one each time: they wait for "
        "the next pulse, it seems, and a stop may be called stuck. Let them read 0 where none comes, or leave these cells empty."
    ]


def refuse_counted(recording: Recording) -> None:
    """Raise InputError where a wheel speed is counted in pulses, of which a row has one or none: slip would be noise, about -1 or 1."""
    for name, step, window in _counted(recording):
        raise InputError(
            _problem(step), file=recording.source, place=f"column {name}", hint=_fix(name, window)
        )


def _problem(step: float) -> str:
    return f"is 0 or steps of {step:.3g} rad/s while the vehicle drives, as pulses counted in each row: no row shows the wheel's speed"


def _fix(name: str, window: float) -> str:
    line = f"{name}: {{from: COLUMN, window: {window:.1f} s}}"
    return f"take its mean over some pulses in a profile, '{line}', or log the time between pulses"


def _counted(recording: Recording) -> list[tuple[str, float, float]]:
    """Such channels, each with the speed that one pulse in a row is, and with the seconds that enough pulses take."""
    ground = recording.channels.get("ground_speed")
    if ground is None or not np.isfinite(ground).any():
        return []
    at, speed = known_part(recording.time, np.abs(ground))
    result = []
    for name in rim_names(recording.channels):
        when, what = measured_part(recording.time, recording.channels[name])
        if len(what) < _FEWEST or np.count_nonzero(what) > (1 - _ZEROS) * len(what):
            continue
        drives = np.interp(when, at, speed) > DRIVING * quantile(speed, 0.95)
        pulse = what != 0.0
        begins = np.flatnonzero(pulse[1:] & ~pulse[:-1] & drives[1:]) + 1
        if len(begins) < _FEWEST or np.mean(pulse[drives]) > 1 - _ZEROS:
            continue
        step, waits = quantum(what), np.diff(when[begins])
        if np.mean(np.abs(what[pulse]) > 2.5 * step) > _RARE:
            continue
        if np.mean(np.diff(np.sign(what[begins])) != 0) > _RARE:  # noise of a wheel that stands
            continue
        wait = median(waits)
        if np.mean(waits > _WAITS * wait) <= _RARE:
            result.append((name, step, max(_SHORTEST, ceil(10 * _PULSES * wait) / 10)))
    return result
