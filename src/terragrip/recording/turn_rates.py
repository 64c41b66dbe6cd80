"""The gyroscope's rate of turn against that of positions and wheels: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.lag import is_copy
from terragrip.recording.once import once
from terragrip.recording.ranks import quantile
from terragrip.recording.track import Track
from terragrip.recording.turns import (
    LEAST_TURN,
    SURE,
    WINDOW,
    agreement,
    filled_channel,
    rim_speed,
    side_differences,
    windows,
)
from terragrip.recording.wrong_sign import WrongSign

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_ALIKE = 0.95  # correlation of two rates of turn that are in proportion
# Hubs over rims: skid-steered (measured: .45 to .62; a long one on a floor that grips turns by a fifth of that), steered, and at most.
_SCRUBBED, _STEERED, _MOST = 0.1, 0.7, 1.25
# Of the rims' pace from side to side, and of the driving: a turn, and much turning.
_UNLIKE, _OFTEN = 0.1, 0.1


def shown_turn(recording: Recording, track: Track | None) -> Floats | None:
    """The rate of turn (n,) by the gyroscope, else by the positions; None where they contradict each other."""
    yaw = recording.channels.get("angular_velocity_z")
    placed = None if track is None else track.at("turn", recording.time)
    if yaw is None or not np.nanmax(np.abs(yaw), initial=0.0):
        return placed
    if placed is None:
        return yaw
    return None if agreement(recording.time, yaw, placed) < -SURE else yaw


def turn_rate_warnings(recording: Recording, vehicle: Vehicle | None, track: Track | None) -> list[str]:
    """The gyroscope's rate of turn against that of the positions and that of the wheels' speeds from side to side."""
    yaw = recording.channels.get("angular_velocity_z")
    if yaw is None:
        return [] if vehicle is None or track is None else _mirrored(recording, vehicle, track)
    if vehicle is not None and _is_dead(recording, yaw, vehicle):
        return [
            "angular_velocity_z never changes while the wheels' speeds turn: its sensor is dead, and the slips of both sides are wrong in "
            "turns. Leave it out of the profile."
        ]
    text: dict[str, float] = {}
    if track is not None:
        text["the positions"] = agreement(recording.time, yaw, track.at("turn", recording.time))
    if vehicle is not None:
        text["the wheels' speeds"] = agreement(recording.time, yaw, _wheel_turn(recording, vehicle))
    scaled = _turn_scale(recording, yaw, vehicle, track) or _track_scale(recording, yaw, vehicle)
    if scaled:
        return [scaled]
    against = [who for who, value in text.items() if value < -SURE]
    agreed = [who for who, value in text.items() if value > SURE]
    if not against:
        return []
    if agreed:
        doubt = (
            "left and right wheels may be exchanged"
            if "the wheels' speeds" in against
            else "check the positions"
        )
        return [f"angular_velocity_z turns with {agreed[0]} and against {against[0]}: {doubt}."]
    return [opposite_turn(against)]


def opposite_turn(against: list[str]) -> WrongSign:
    """The sentence on a rate of turn that all of ``against`` contradict."""
    exchanged = {"the wheels' speeds": "left and right wheels", "the positions": "latitude and longitude"}
    or_else = "" if len(against) > 1 else f" If its sign is right, {exchanged[against[0]]} are exchanged."
    turn = f"{' and '.join(against)} turn the other way"
    return WrongSign(
        f"angular_velocity_z is of the wrong sign: {turn}. Left is positive: write 'sign: -1' for it in the profile.{or_else}",
        ["angular_velocity_z"],
        turn,
    )


def _is_dead(recording: Recording, yaw: Floats, vehicle: Vehicle) -> bool:
    """Whether a rate of turn (n,) is one value throughout while the rims differ from side to side in much of the driving."""
    shown = yaw[np.isfinite(yaw)]
    if len(shown) < 3 or np.ptp(shown) or not vehicle.knows_wheels:
        return False
    known = [w for w in vehicle.wheels if f"wheel_speed_{w}" in recording.channels]
    rims = [np.abs(rim_speed(recording, vehicle, w)) for w in known]
    if not rims:
        return False
    apart, pace = windows(
        recording.time, np.array([_wheel_turn(recording, vehicle, rims=True), np.mean(rims, axis=0)])
    )
    moving = pace > 0.3 * quantile(pace, 0.95) if len(pace) else np.zeros(0, dtype=bool)
    return bool(moving.any()) and float(np.mean(np.abs(apart[moving]) > _UNLIKE * pace[moving])) > _OFTEN


def _mirrored(recording: Recording, vehicle: Vehicle, track: Track) -> list[str]:
    """The positions' turns against those of the wheels, where no gyroscope decides."""
    if agreement(recording.time, _wheel_turn(recording, vehicle), track.at("turn", recording.time)) > -SURE:
        return []
    return [
        "The positions turn against the wheels' speeds: latitude and longitude, or left and right wheels, may be exchanged."
    ]


def _turn_scale(recording: Recording, yaw: Floats, vehicle: Vehicle | None, track: Track | None) -> str:
    """Where the rate of turn exceeds the others' by the factor of degrees to radians. A skid-steered vehicle turns by as little
    as a third of the turn by its wheels' speeds. Straight ahead none is in proportion: there hubs would differ from side to side."""
    others: dict[str, Floats] = {}
    if vehicle is not None and vehicle.track and vehicle.knows_wheels:
        rims = _wheel_turn(recording, vehicle, rims=True) / vehicle.track
        others["the wheels' speeds"] = rims
    if track is not None:
        others["the positions"] = track.at("turn", recording.time)
    has_speed = "ground_speed" in recording.channels
    pace = filled_channel(recording, "ground_speed") if has_speed else np.full(len(yaw), np.nan)
    turned, still = False, []
    for who, turn in others.items():
        known = np.isfinite(yaw) & np.isfinite(turn)
        if abs(agreement(recording.time, yaw, turn)) >= SURE:
            turned, ratio = True, float(np.sqrt(np.mean(yaw[known] ** 2) / np.mean(turn[known] ** 2)))
            if 12 < ratio < 100:
                return f"angular_velocity_z is {ratio:.2g} times the rate of turn of {who}: it may be in deg/s: 1 deg/s is 0.01745 rad/s."
            continue
        means = windows(recording.time, np.where(known & np.isfinite(pace), [yaw, turn, pace], np.nan))
        if vehicle is not None and vehicle.track and np.sum(np.abs(means[0])) * WINDOW >= LEAST_TURN:
            own, other, speed = np.sqrt(np.mean(means**2, axis=1))
            still += [who] * bool(own > max(12 * other, _UNLIKE * speed / vehicle.track))
    if turned or not still:
        return ""
    return (
        f"angular_velocity_z turns all the way, {' and '.join(still)} hardly at all: it may be in deg/s (1 deg/s is 0.01745 rad/s), "
        "or its zero is off. Slips are wrong by it."
    )


def _track_scale(recording: Recording, yaw: Floats, vehicle: Vehicle | None) -> str:
    """Where the turn by the gyroscope makes hubs differ from side to side by another size than the rims do: rims that scrub the vehicle
    round differ by more than the hubs, never by less."""
    if vehicle is None or not vehicle.track or not vehicle.knows_wheels:
        return ""
    rims = _wheel_turn(recording, vehicle, rims=True)
    if agreement(recording.time, yaw, rims) < _ALIKE:
        return ""
    known = np.isfinite(yaw) & np.isfinite(rims)
    hubs, sides = windows(recording.time, np.where(known, [vehicle.track * yaw, rims], np.nan))
    share = float(np.sqrt(np.sum(hubs**2) / np.sum(sides**2)))
    least = _STEERED if any(axle.steered for axle in vehicle.axles.values()) else _SCRUBBED
    if least < share < _MOST:
        return ""
    return (
        f"In turns the hubs differ from side to side by {share:.2f} times what the rims do, by angular_velocity_z and a track of "
        f"{vehicle.track:.3g} m, where {least} to {_MOST} is possible: check the track (between the wheel centres), the radii, and the "
        "gyroscope's scale. Slips are wrong in turns."
    )


@once
def _wheel_turn(recording: Recording, vehicle: Vehicle, *, rims: bool = False) -> Floats:
    """Yaw rate (n,) by right less left wheel speeds, up to a factor: the track, where ``rims`` selects rim speeds. An axle that is filled
    in from the ground speed shows no turn (docs/vehicle.md)."""
    channels, ground = recording.channels, recording.channels.get("ground_speed")
    measured = {
        wheel: (vehicle.radii[wheel] if rims else 1.0) * filled_channel(recording, name)
        for wheel in vehicle.wheels
        if (name := f"wheel_speed_{wheel}") in channels
        and not (ground is not None and is_copy(channels[name], ground))
    }
    parts = side_differences(vehicle, measured)
    return np.mean(parts, axis=0) if parts else np.full(len(recording), np.nan)
