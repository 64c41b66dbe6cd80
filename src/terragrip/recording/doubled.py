"""Wheels whose pulses are counted twice, or every other one lost, in a part of the drive: sentences for the user, never errors.

Their speed is then twice (half) what it was, from one sample to the next and back. A wheel that spins or locks takes time for it by its
inertia, comes to any factor, and does not keep that: here both steps and what lies between are a factor of 2 beside the other speeds, and
the steps are its own. Several wheels at once are a turn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import known_part
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import rim_names
from terragrip.recording.stretches import DRIVING
from terragrip.written_times import span

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_TWICE = float(np.log(2))
_EXACTLY = 0.04  # logarithm, of means over `_BESIDE` samples
_ROUGHLY = 0.15  # the same, of one sample
_BESIDE = 5
_CLOSE = 0.25  # s between samples: further apart a wheel may spin and grip again


def doubled_warnings(recording: Recording) -> list[str]:
    """A sentence on each wheel that goes at twice or half its speed for a while, from one sample to the next."""
    names = rim_names(recording.channels)
    stretches = {name: stretch for name in names if (stretch := _stretch(recording, name, names)) is not None}
    return [
        f"{name} is {'twice' if twice else 'half'} as fast {span(first, last)} as before and after, from one sample to the next, and other "
        f"wheels are not: {'a pulse counts as two' if twice else 'every other pulse is lost'}, it seems, and slip is wrong there. Leave "
        "these cells empty, or correct them."
        for name, (first, last, twice) in stretches.items()
        if sum(begin <= last and first <= end for begin, end, _ in stretches.values()) == 1
    ]


def _stretch(recording: Recording, name: str, rims: list[str]) -> tuple[float, float, bool] | None:
    """First and last instant [s] of the longest such stretch, and whether the speed is doubled in it."""
    time, speed = known_part(recording.time, np.abs(recording.channels[name]))
    others = [rim for rim in rims if rim != name]
    if len(others) == 1 and "ground_speed" in recording.channels:
        others.append(
            "ground_speed"
        )  # of two wheels alone, the ratio does not show which one changes, nor a turn
    beside = [known_part(recording.time, np.abs(recording.channels[other])) for other in others]
    if len(time) < 4 * _BESIDE or len(beside) < 2 or min(len(when) for when, _ in beside) < 2:
        return None
    usual = np.median([np.interp(time, *one) / max(quantile(one[1], 0.95), 1e-9) for one in beside], axis=0)
    moving = (speed > DRIVING / 2 * quantile(speed, 0.95)) & (usual > DRIVING / 2)
    ratio = np.log(np.where(moving, speed / np.where(moving, usual, 1.0), np.nan))
    steps, own = (
        np.where(np.diff(time) <= _CLOSE, np.diff(x), np.nan)
        for x in (ratio, np.log(np.where(moving, speed, np.nan)))
    )
    edges = np.flatnonzero((np.abs(np.abs(steps) - _TWICE) < _ROUGHLY) & (np.abs(own - steps) < _ROUGHLY))
    result: tuple[float, float, bool] | None = None
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if last - first < _BESIDE or first < _BESIDE or steps[first] * steps[last] > 0:
            continue
        inside, before, after = (
            ratio[first + 1 : last + 1],
            ratio[first + 1 - _BESIDE : first + 1],
            ratio[last + 1 : last + 1 + _BESIDE],
        )
        levels = [before, inside[:_BESIDE], inside, inside[-_BESIDE:], after]
        if not all(np.isfinite(part).all() for part in levels):
            continue
        out, begin, whole, end, back = (median(part) for part in levels)
        size = np.sign(steps[first]) * np.array([begin - out, end - back, whole - (out + back) / 2])
        if np.abs(size - _TWICE).max() < _EXACTLY and (
            result is None or time[last] - time[first] > result[1] - result[0]
        ):
            result = float(time[first + 1]), float(time[last]), bool(steps[first] > 0)
    return result
