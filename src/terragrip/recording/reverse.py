"""Speeds of a wrong sign, or without one while the vehicle drives backward: sentences for the user, never errors.

A receiver's speed over ground is the size of the velocity, and counters of ticks have no direction. Backward, a turn to the left makes
the left hub the faster one in size: with the sign lost, each side's slip is against the other side's hub.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.ranks import quantile
from terragrip.recording.schema import rim_names
from terragrip.recording.stretches import longest
from terragrip.recording.turns import LEAST_TURN, WINDOW, filled_channel, side_differences, windows
from terragrip.recording.wrong_sign import WrongSign
from terragrip.written_times import span

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FAST = 0.3  # of what a twentieth of the drive exceeds
_SHARE = 0.03  # of the driving that is backward
_ALIKE = 0.9  # of the rows, or windows, that have one sign
# Of the rows in motion: a ground speed without a sign is that of forward driving in most of them.
_MOSTLY = 0.75
_FEWEST = 5  # windows, or measured rows: a line between two says nothing of what is between
_NOISY = 0.5  # of their size, by which large values of noise change at least
_TOGETHER = 0.7  # correlation

_WRONG = "in reverse turns the slips of both sides are wrong."


def against_warnings(recording: Recording) -> list[str]:
    """A sentence on speeds of wheels, or of the drive train, that are against the ground speed while both are large, mostly."""
    channels = recording.channels
    speeds = ("ground_speed", *rim_names(channels))
    known = [n for n in speeds if np.isfinite(channels.get(n, np.nan)).sum() >= _FEWEST]
    if known[:1] != ["ground_speed"]:
        return []
    ground = filled_channel(recording, "ground_speed")
    large, odd = _large(ground), []
    for name in known[1:]:
        rim = channels[name]
        moving = _large(rim) & large
        if np.sum((rim * ground)[moving] < 0) > _MOSTLY * moving.sum() and _is_motion(rim):
            odd.append(name)
    odd = odd if odd and _is_motion(ground) else []
    if not odd:
        return []
    other = "" if odd != known[1:] else " (or for ground_speed, if the vehicle drove backward)"
    return [
        WrongSign(
            f"Against the direction of travel: {', '.join(odd)}. In the profile write 'sign: -1' for each{other}.",
            odd,
            "against the ground speed",
            sure=odd != known[1:],
        )
    ]


def reverse_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where the ground speed stays positive while the wheels turn backward, or where both do and a gyroscope shows it, and where
    both go against the torques."""
    channels, time = recording.channels, recording.time
    known = [w for w in vehicle.wheels if np.isfinite(channels.get(f"wheel_speed_{w}", np.nan)).any()]
    ground = channels.get("ground_speed")
    if ground is None or not known or np.isfinite(ground).sum() < _FEWEST:
        return []
    rims = {w: filled_channel(recording, f"wheel_speed_{w}") for w in known}
    rim, speed = np.mean(list(rims.values()), axis=0), filled_channel(recording, "ground_speed")
    moving = _large(rim) & _large(speed)
    back = moving & (rim < 0)
    slides = longest(time, moving & (rim > 0) & (speed < 0), np.ones(len(time), dtype=bool))
    if slides:
        return [
            f"ground_speed is negative {span(*slides)} while the wheels turn forward: its sign is wrong there, "
            "unless the vehicle slid backward."
        ]
    if not moving.any():
        return []
    torques = [filled_channel(recording, n) for n in channels if n.startswith("drive_torque_")]
    if torques and np.mean((back & (speed < 0))[moving]) > _ALIKE and np.mean(np.sum(torques, 0)[moving]) > 0:
        return [
            "Wheels and ground speed go backward all the way while the drive torques push forward: nothing drives so. Write 'sign: -1' for "
            "these speeds in the profile, or, if it drove backward, for the torques."
        ]
    if np.mean(back[moving]) >= _SHARE:
        ahead = moving & (rim > 0)
        if ahead.any() and np.mean(speed[back] > 0) > _ALIKE and np.mean(speed[ahead] > 0) > _ALIKE:
            return [
                f"ground_speed has no sign: it is positive while the wheels turn backward too, and {_WRONG} Give it the sign of the "
                "direction (in a profile 'forward:', with positions)."
            ]
        return []
    yaw = channels.get("angular_velocity_z")
    sides = side_differences(vehicle, rims)
    if yaw is None or not sides:
        return []
    turn, shown = windows(time, np.array([np.mean(sides, axis=0), yaw]))
    turning = _turns(turn) & _turns(shown)
    if np.sum(np.abs(shown)) * WINDOW < LEAST_TURN or not _go_alike(np.abs(turn), np.abs(shown)):
        return []
    against = float(np.mean((turn * shown)[turning] < 0)) if turning.sum() >= _FEWEST else 0.0
    if not 1 - _ALIKE < against < _ALIKE:
        return []
    return [
        f"In {against:.0%} of the turns angular_velocity_z contradicts the wheels' speeds: if these have no sign, that is reverse travel, "
        f"and {_WRONG} Give wheel and ground speeds the sign of the direction."
    ]


def _go_alike(a: Floats, b: Floats) -> bool:
    """Whether two sizes (n,) are of one thing: both vary, and together."""
    varied = len(a) > _FEWEST and float(min(np.ptp(a), np.ptp(b))) > 0.0
    return varied and float(np.corrcoef(a, b)[0, 1]) > _TOGETHER


def _turns(rate: Floats) -> Bools:
    """Which windows (n,) are turns, by the sharpest: in a drive with few of them noise is large beside most."""
    size = np.abs(rate)
    return size > _FAST * float(np.max(size, initial=0.0))


def _is_motion(values: Floats) -> bool:
    """Whether values (n,) change little from one to the next beside their size: the noise of a standstill has a sign by chance."""
    known = values[np.isfinite(values)]
    large = np.abs(known[_large(known)])
    return len(large) > 1 and float(np.median(np.abs(np.diff(known)))) < _NOISY * float(np.median(large))


def _large(values: Floats) -> Bools:
    """Which values (n,) are large beside those of the drive."""
    size = np.abs(values)
    finite = size[np.isfinite(size)]
    return size > _FAST * quantile(finite, 0.95) if len(finite) else np.zeros(len(values), dtype=bool)
