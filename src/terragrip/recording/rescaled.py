"""A wheel's speed or torque, or the ground speed, whose scale changes in the middle of a drive: sentences for the user, never errors.

What runs beside it shows it: the other wheel of the axle straight ahead, the positions. Slip and soil move these ratios as well, but not
from one sample to the next for the rest of the drive. The ground speed against the rims alone shows nothing: that is slip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.ranks import median, quantile
from terragrip.recording.sides import Axle, Drive
from terragrip.recording.stretches import DRIVING, instant_of, step_of
from terragrip.recording.track import Track
from terragrip.recording.turns import WINDOW, filled_channel
from terragrip.written_times import moment

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_LONG = 10  # windows of 2 s before and after
_SPEED = 0.06  # logarithm: rims of right logs moved by .028 at most (of 236 axles of development machines); a furrow wheel slips as much
_TORQUE = 0.25  # the same, of torques (.30 with three times the scatter, of 222)
_BEYOND_SPEED, _BEYOND_TORQUE = 4.0, 3.0  # standard deviations of a window
_EVEN = 0.3  # of the pace: rims beyond spin, or stand
_PULLING = 0.05  # of the axle's load
_COARSEST = 0.5  # s between samples: further apart nothing shows that a scale changed at once, and not a soil
_PAUSE = 20.0  # s between windows of like driving: over a longer one loads and ground change, too
_GAP, _SPAN = 0.1, 0.5  # s, and one and three samples: between, a scale has changed
_SHARE = 0.6  # of the step that is there at once


def rescaled_warnings(
    recording: Recording, vehicle: Vehicle, turn: Floats | None, track: Track | None
) -> list[str]:
    """A sentence on each speed and torque whose scale changes once; ``turn`` (n,) [rad/s]: by a sensor, left positive."""
    notes = _ground(recording, track)
    drive = Drive.of(recording, vehicle, np.zeros(len(recording)) if turn is None else turn)
    if drive is None:
        return notes
    rims = np.concatenate([axle.rims for axle in drive.axles])
    even: Bools = np.all(np.abs(rims - drive.pace) < _EVEN * drive.pace, axis=0)
    rows = drive.straight & even
    alike = rows if turn is not None else rows & np.all(drive.level, axis=0)
    for axle in drive.axles:
        others = [one for one in drive.axles if one is not axle]
        notes += _of_axle(
            recording, "wheel_speed", axle, drive.when, axle.rims, rows, even, [one.rims for one in others]
        )
        if axle.pulls is not None:
            pulling = (axle.pulls > 0).all(axis=0) & (axle.pulls.sum(axis=0) > _PULLING * axle.load)
            beside = [
                one.pulls
                for one in others
                if one.pulls is not None and (one.pulls[:, alike & pulling] > 0).all()
            ]
            notes += _of_axle(
                recording, "drive_torque", axle, drive.when, axle.pulls, alike & pulling, even, beside
            )
    return notes


def _of_axle(
    recording: Recording,
    quantity: str,
    axle: Axle,
    when: Floats,
    sides: Floats,
    rows: Bools,
    even: Bools,
    others: list[Floats],
) -> list[str]:
    """A sentence where the left over the right side (2, windows) of an axle steps in ``rows``, at an instant whose rims
    are ``even``; ``others``: those of other axles."""
    speed = quantity == "wheel_speed"
    left, right = sides[:, rows]
    step = step_of(
        np.log(left / right),
        _SPEED if speed else _TORQUE,
        beyond=_BEYOND_SPEED if speed else _BEYOND_TORQUE,
        long=_LONG,
    )
    if step is None:
        return []
    at, size = step
    names = [f"{quantity}_{wheel}" for wheel in axle.wheels]
    raw = [filled_channel(recording, name) for name in names]
    driving = np.logical_and.reduce([one > DRIVING * quantile(np.abs(one), 0.95) for one in raw])
    ratio = np.full(len(recording), np.nan)
    ratio[driving] = np.log(raw[0][driving] / raw[1][driving])
    tight = ~even[np.searchsorted((when[1:] + when[:-1]) / 2, recording.time)]
    ratio[tight] = np.nan  # its steps are the turn's
    instant = _instant(recording.time, ratio, when[rows], at, size)
    if instant is None:
        return []
    factor, name = float(np.exp(size)), names[0]
    either = f" (or that of {names[1]} {'falls' if factor > 1 else 'rises'} as much)"
    if others:  # which of the two moved beside another axle
        either, both = "", np.log(sides[:, rows] / np.mean(others, axis=(0, 1))[rows])
        moved = [abs(median(one[at:]) - median(one[:at])) for one in both]
        if moved[1] > moved[0]:
            factor, name = 1 / factor, names[1]
    wrong = ", and slip" if speed else ", or its zero moved, and adhesion"
    return [
        f"From {moment(instant)} s on {name} is {factor:.2f} times what it was before beside the axle's other wheel, from one sample to "
        f"the next{either}: its scale changed{wrong} is so far off before or after. Correct it there, or estimate the parts apart."
    ]


def _instant(time: Floats, ratio: Floats, when: Floats, at: int, size: float) -> float | None:
    """The instant of a step of a ``ratio`` (n,) near the one of windows whose middles are ``when``, None across a pause."""
    if when[at] - when[at - 1] > _PAUSE:
        return None
    first, last = when[max(at - 2, 0)] - WINDOW, when[min(at + 1, len(when) - 1)] + WINDOW
    rows = (time > first) & (time < last)
    spacing = median(np.diff(time[rows])) if rows.sum() > 2 else WINDOW
    if spacing > _COARSEST * (1 + 1e-6):
        return None
    return instant_of(
        time[rows], ratio[rows], size, gap=max(_GAP, spacing), span=max(_SPAN, 3 * spacing), share=_SHARE
    )


def _ground(recording: Recording, track: Track | None) -> list[str]:
    """A sentence where the ground speed steps beside that of the positions."""
    ground = recording.channels.get("ground_speed")
    if track is None or ground is None or np.isfinite(ground).sum() < 2:
        return []
    own = np.abs(np.interp(track.time, recording.time, filled_channel(recording, "ground_speed")))
    rows = ~track.gap & (np.minimum(own, track.speed) > DRIVING * quantile(own, 0.95))
    when, place = track.time[rows], np.floor((track.time[rows] - recording.time[0]) / WINDOW)
    starts = np.flatnonzero(np.diff(place, prepend=-1.0))
    if not len(starts):
        return []
    ratio = np.add.reduceat(np.log(own[rows] / track.speed[rows]), starts) / np.diff(starts, append=len(when))
    step = step_of(ratio, _SPEED, beyond=_BEYOND_SPEED, long=_LONG)
    if step is None:
        return []
    return [
        f"From about {when[starts][step[0]]:.4g} s on ground_speed is {np.exp(step[1]):.2f} times what it was before beside the "
        "positions' speed: its scale changed, and slip is off by as much before or after. Correct it there, or estimate the parts apart."
    ]
