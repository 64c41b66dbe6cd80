"""Forces, accelerations and rates of turn that are cut at one value, by a sensor's range: sentences for the user, never errors.

A channel with noise hardly has one value twice as often as the next. Where its greatest or least value is its most frequent by far, what
was beyond is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import known_part, quantum
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import quantile
from terragrip.recording.stretches import DRIVING, is_one_value
from terragrip.recording.turns import filled

if TYPE_CHECKING:
    from terragrip.arrays import Floats
    from terragrip.recording.table import Recording

_PREFIXES = ("drive_torque_", "drawbar_force", "acceleration_", "angular_velocity_")
_SHARE, _LEAST = 0.01, 20  # of the driving, and rows
_OFTENER = 5.0  # than any other value
_TIMES = 10  # that it comes to this value: a channel held or switched off there comes seldom
_FINE, _NOISY = 0.02, 3e-4  # of a channel's size: its steps and its noise, without which it may keep a value


def cut_warnings(recording: Recording) -> list[str]:
    """A sentence on each channel whose greatest or least value while driving is a limit of what it can show."""
    ground = recording.channels.get("ground_speed")
    if ground is None or is_one_value(ground):
        return []
    speed = np.abs(filled(recording.time, ground))
    driving = speed > DRIVING * quantile(speed, 0.95)
    return [
        note
        for name, values in recording.channels.items()
        if name.startswith(_PREFIXES) and not is_one_value(values)
        for note in _cut(name, recording.time, np.where(driving, values, np.nan))
    ]


def _cut(name: str, time: Floats, values: Floats) -> list[str]:
    """On each end of a channel (n,), of rows of driving."""
    when, what = known_part(time, values)
    if len(what) < 2 * _LEAST:
        return []
    ends = []
    for value, beyond in ((what.min(), "less"), (what.max(), "more")):
        at = what == value
        times, comes = np.count_nonzero(at), np.count_nonzero(at[1:] & ~at[:-1])
        if times >= max(_LEAST, _SHARE * len(what)) and comes >= _TIMES:
            ends.append((float(value), beyond, times))
    if not ends:  # of most channels that is known already
        return []
    counts = np.unique(what, return_counts=True)[1]
    size = quantile(np.abs(what), 0.95)
    if (
        len(counts) < _LEAST
        or quantum(what) > _FINE * size
        or (white_noise(when, what) or 0.0) < _NOISY * size
    ):
        return []
    most = float(counts[1:-1].max())
    return [
        f"{name} is {value:.4g} in {times / len(what):.0%} of the driving and never {beyond}: the range of its sensor or "
        "column ends there, and what was beyond is lost. Take a wider range, or leave these cells empty; a motor's own limit may stay."
        for value, beyond, times in ends
        if times >= _OFTENER * most
    ]
