"""A wheel's speed, or one wheel's torque, that drops to 0 while the others go on: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import known_part
from terragrip.recording.lag import measured
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import median, quantile
from terragrip.recording.stretches import DRIVING, is_one_value, longest, may_last

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


_BLINK = 1.0  # s, or three samples: a speed that is 0 no longer
_GOES_ON = 0.5  # of another speed around
_SURE = 5.0  # standard deviations of the noise: less is rounded to 0 by chance
_FEWEST = 5  # such samples


def dropout_warnings(recording: Recording) -> list[str]:
    """A sentence on each wheel that reads 0 for long while ground speed and other wheels go on, and on each torque that alone does."""
    return _wheels(recording) + _torques(recording) + _blinks(recording)


def _wheels(recording: Recording) -> list[str]:
    """A sentence on each wheel that reads 0 for long while the ground speed, and other wheels, go on."""
    rims = [n for n in recording.channels if n == "wheel_based_speed" or n.startswith("wheel_speed_")]
    ground, notes = recording.channels.get("ground_speed"), []
    if ground is None or len(rims) < 2 or not np.isfinite(ground).any():
        return []
    if not any(may_last(*known_part(recording.time, recording.channels[name])) for name in rims):
        return []
    zero = {name: recording.channels[name] == 0.0 for name in rims}
    driving = np.abs(ground) > DRIVING * float(np.nanquantile(np.abs(ground), 0.95))
    for name in rims:
        if not zero[name].any() or is_one_value(recording.channels[name]):
            continue
        alone = zero[name] & driving & ~np.logical_and.reduce(list(zero.values()))
        stretch = longest(recording.time, alone, np.isfinite(recording.channels[name]) & np.isfinite(ground))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while the vehicle drives: the wheel is locked, or its sensor "
                "lost the signal. If it did, leave these cells empty."
            )
    return notes


def _torques(recording: Recording) -> list[str]:
    """A sentence on each torque that alone is 0 for long: an axle that is switched off has two of them."""
    time, notes = recording.time, []
    torques = {n: v for n, v in recording.channels.items() if n.startswith("drive_torque_")}
    for name, values in torques.items():
        others = [other for one, other in torques.items() if one != name]
        if not others or not may_last(*known_part(time, values)) or is_one_value(values):
            continue
        alone = (values == 0.0) & np.logical_and.reduce([other != 0.0 for other in others])
        stretch = longest(time, alone, np.isfinite(values))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while all other torques are not: its sensor lost the signal, "
                "or its motor is off. If the sensor did, leave these cells empty."
            )
    return notes


def _blinks(recording: Recording) -> list[str]:
    """A sentence on each speed that is 0 for single samples while another speed continues: zeros in place of missing values."""
    speeds = {n: v for n, v in recording.channels.items() if n == "ground_speed" or n.startswith("wheel_")}
    ground, notes = speeds.get("ground_speed"), []
    rims = [v for n, v in speeds.items() if n != "ground_speed" and np.isfinite(v).any()]
    if ground is None or not rims or not np.isfinite(ground).any():
        return []
    for name, values in speeds.items():
        if np.count_nonzero(values == 0.0) < _FEWEST:
            continue
        when, what = measured(recording.time, values) or (np.empty(0), np.empty(0))
        zero = what == 0.0
        if zero.sum() < _FEWEST or zero.all():
            continue
        edges = np.flatnonzero(np.diff(zero)) + 1
        edges = edges[1:] if zero[0] else edges
        first, after = edges[: len(edges) // 2 * 2 : 2], edges[1::2]
        size = np.abs(what)
        around = np.minimum(size[first - 1], size[after])
        short = when[after] - when[first - 1] <= max(_BLINK, 3 * median(np.diff(when)))
        short &= around > DRIVING * quantile(size, 0.95)
        if short.sum() >= _FEWEST:
            short &= around > _SURE * (white_noise(when[~zero], what[~zero]) or 0.0)
        if short.sum() < _FEWEST:
            continue
        known = [known_part(recording.time, v) for v in (rims if name == "ground_speed" else [ground])]
        other = np.mean([np.abs(np.interp(when, *one)) for one in known], axis=0)
        goes_on = other[first] > _GOES_ON * np.maximum(other[first - 1], other[after])
        count = int((after - first)[short & goes_on].sum())
        if count >= _FEWEST:
            notes.append(
                f"{name} is 0 in {count} samples between others at speed, while other speeds go on: zeros for values that were not there. "
                "Leave these cells empty (in a profile 'invalid: [0]', where no stop matters)."
            )
    return notes
