"""The yaw rate of a log whose sensor is missing or silent: a wheel's slip is relative to its hub's speed, which depends on the turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from terragrip.arrays import Floats
from terragrip.estimation.rims import Rim, rims_of
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.track import Track, track_of
from terragrip.recording.window_means import averaged
from terragrip.vehicle import Vehicle

_YAW_RATE = "angular_velocity_z"
_CALM = 4.0  # s over which a yaw rate is taken from positions
_MOVING = 0.1  # m/s
_WINDOW = 2.0  # s
_TURNING = 0.04  # relative difference of the rims from side to side
_MUCH = 0.1  # share of the driving


def turn_in(log: LogBlocks, sample: Recording, vehicle: Vehicle) -> tuple[Track | None, list[str]]:
    """The motion by the positions, where no sensor measures how fast the machine turns, and a sentence on it.

    ``sample``: rows of the log, by which it is judged whether the machine turned where nothing tells how fast.
    """
    channels = sample.channels
    rims = rims_of(vehicle, channels)
    if not any(rim.side or rim.ahead for rim in rims):
        return None, []
    if _YAW_RATE in channels:
        return None, _unseen_turns(sample, rims)
    track = track_of(_positions(log), _CALM) if {"latitude", "longitude"} <= set(channels) else None
    if track is not None and np.isfinite(track.turn).any():
        return track, ["The rate of turn is that of the positions."]
    return None, _unseen_turns(sample, rims)


def _positions(log: LogBlocks) -> Recording:
    """The positions of a whole log."""
    names = ("latitude", "longitude")
    parts = [(block.time, *(block.channels[name] for name in names)) for block in log.blocks()]
    time, *columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Recording(time, dict(zip(names, columns, strict=True)))


def _unseen_turns(log: Recording, rims: Sequence[Rim]) -> list[str]:
    """A sentence on a rate of turn that is missing, or silent: after a second without it the estimator takes the drive for straight."""
    if np.any(np.diff(log.time) < 0):  # refused where the estimator meets it
        return []
    names = [*(rim.channel for rim in rims), *([_YAW_RATE] if _YAW_RATE in log.channels else [])]
    speeds = {name: log.channels[name] for name in names}
    calm = averaged(replace(log, channels=speeds, labels={}), _WINDOW).channels
    left, right = (_rim_means([rim for rim in rims if rim.side * sign > 0], calm) for sign in (1, -1))
    with np.errstate(invalid="ignore"):
        mean = np.abs(left + right) / 2
        moving, turning = mean > _MOVING, np.abs(left - right) > _TURNING * mean
    turning &= np.isnan(calm.get(_YAW_RATE, np.nan))
    share = float(np.mean(turning[moving])) if moving.any() else 0.0
    if share < _MUCH:
        return []
    advice = "Log the yaw rate throughout" if _YAW_RATE in log.channels else "Give a yaw rate, or positions"
    return [
        f"The rims of left and right differ in {share:.0%} of the driving, where no signal shows how fast the machine turned: the slips of "
        f"both sides are wrong there. {advice}."
    ]


def _rim_means(rims: Sequence[Rim], speeds: Mapping[str, Floats]) -> Floats:
    """Mean rim speed (windows,) [m/s] of some wheels, NaN where one was not measured."""
    return np.mean([rim.radius * speeds[rim.channel] for rim in rims] or [np.full(1, np.nan)], axis=0)
