"""The yaw rate of a log whose sensor is missing or silent: a wheel's slip is relative to its hub's speed, which depends on the turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.estimation.rims import Rim, rims_of
from terragrip.physics.slip import middle_speed
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.survey import joined
from terragrip.recording.track import Track, track_of
from terragrip.recording.window_means import averaged
from terragrip.vehicle import Vehicle
from terragrip.written_times import moment

_YAW_RATE = "angular_velocity_z"
_KEPT = 1.0  # s that the estimator goes on with a rate of turn
_CALM = 4.0  # s over which a yaw rate is taken from positions
_MOVING = 0.1  # m/s
_WINDOW = 2.0  # s
_TURNING = 0.04  # relative difference of the rims from side to side
_MUCH = 0.1  # share of the driving
_MOVED = 0.02  # share of the ground speed, and of the driving


@dataclass(frozen=True)
class ShownTurn:
    """The rate of turn by the positions (``track``): throughout, or in the ``silences`` (k, 2) [s] of a gyroscope."""

    track: Track
    silences: Floats | None = None

    def over(self, recording: Recording) -> Floats:
        """The rate of turn (n,) [rad/s] to be used in a recording's rows, NaN where nothing shows it."""
        placed = self.track.at("turn", recording.time)
        if self.silences is None:
            return placed
        return np.where(self._silent(recording.time), placed, recording.channels[_YAW_RATE])

    def shows(self) -> bool:
        """Whether the positions tell a turn where it is needed."""
        known = self.track.time[np.isfinite(self.track.turn)]
        return bool(np.any(self._silent(known)))

    def _silent(self, time: Floats) -> Bools:
        """Which instants (n,) are without a gyroscope's rate, that of the last before a silence not among them."""
        if self.silences is None:
            return np.ones(len(time), dtype=bool)
        starts, ends = self.silences.T
        return np.searchsorted(starts, time) > np.searchsorted(ends, time, side="right")


def turn_in(log: LogBlocks, sample: Recording, vehicle: Vehicle) -> tuple[ShownTurn | None, list[str]]:
    """The rate of turn by the positions, where no sensor measures how fast the machine turns, and sentences on it and what it changes.

    ``sample``: rows of the log, by which it is judged whether the machine turned where nothing shows how fast.
    """
    turn, notes = _turn_in(log, sample, vehicle)
    return turn, [*notes, *_at_the_antenna(sample, vehicle, turn)]


def _at_the_antenna(sample: Recording, vehicle: Vehicle, turn: ShownTurn | None) -> list[str]:
    """A sentence where much is taken off the ground speed since it is measured at the vehicle file's antenna."""
    if vehicle.antenna is None or vehicle.radar is not None:
        return []
    ground, (ahead, side) = sample.channels.get("ground_speed"), vehicle.receiver
    yaw = sample.channels.get(_YAW_RATE) if turn is None else turn.over(sample)
    if ground is None or yaw is None:
        return []
    moved = np.abs(middle_speed(ground, yaw, ahead=ahead, side=side) - ground) > _MOVED * np.abs(ground)
    driving = np.isfinite(yaw) & (np.abs(ground) > _MOVING)
    if not driving.any() or np.mean(moved[driving]) < _MOVED:
        return []
    return [
        f"The ground speed is taken as measured at the antenna, {ahead:.3g} m ahead of what the vehicle turns about and {side:.3g} m to "
        "its left: what turns add to it there is taken off. If a radar measures it, write 'radar: {y: 0 m}' in the vehicle file."
    ]


def _turn_in(log: LogBlocks, sample: Recording, vehicle: Vehicle) -> tuple[ShownTurn | None, list[str]]:
    """The rate of turn, and a sentence on it."""
    channels = sample.channels
    rims = rims_of(vehicle, channels)
    if not any(rim.side or rim.ahead for rim in rims) and vehicle.receiver == (0.0, 0.0):
        return None, []
    unseen = _unseen_turns(sample, rims)
    if not {"latitude", "longitude"} <= set(channels) or (_YAW_RATE in channels and not unseen):
        return None, unseen
    whole = _turns(log)
    track = track_of(whole, _CALM)
    if track is None:
        return None, unseen
    shown = ShownTurn(track, _silences(whole) if _YAW_RATE in channels else None)
    if not shown.shows():
        return None, unseen
    said = "The rate of turn is that of the positions."
    if _YAW_RATE in channels:
        said = f"{_YAW_RATE} falls silent where the machine turns: the rate of turn is that of the positions there."
    if len(track.jumps):
        said += f" They jump {len(track.jumps)} times, first at {moment(track.jumps[0])} s: it is not known there."
    return shown, [said, *_unseen_turns(sample.with_channels(**{_YAW_RATE: shown.over(sample)}), rims)]


def _turns(log: LogBlocks) -> Recording:
    """What shows the turns of a whole log."""
    names = ("latitude", "longitude", _YAW_RATE)
    parts = [
        Recording(block.time, {n: block.channels[n] for n in names if n in block.channels})
        for block in log.blocks()
    ]
    return joined(parts, parts[-1])


def _silences(log: Recording) -> Floats:
    """Begin and end (k, 2) [s] of where a gyroscope has no value for longer than the estimator keeps one."""
    known = log.time[np.isfinite(log.channels[_YAW_RATE])]
    edges = np.r_[-np.inf, known, np.inf]
    long = np.diff(edges) > _KEPT
    return np.column_stack([edges[:-1][long], edges[1:][long]])


def _unseen_turns(log: Recording, rims: Sequence[Rim]) -> list[str]:
    """A sentence on a rate of turn that is missing, or silent: the estimator then assumes straight driving."""
    sides = [[rim for rim in rims if rim.side * sign > 0] for sign in (1, -1)]
    if not all(sides) or np.any(np.diff(log.time) < 0):  # the latter is refused where the estimator meets it
        return []
    names = [*(rim.channel for rim in rims), *([_YAW_RATE] if _YAW_RATE in log.channels else [])]
    speeds = {name: log.channels[name] for name in names}
    calm = averaged(replace(log, channels=speeds, labels={}), _WINDOW).channels
    left, right = (np.mean([rim.radius * calm[rim.channel] for rim in side], axis=0) for side in sides)
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
        f"both sides may be wrong by that, which their intervals hold. {advice}."
    ]
