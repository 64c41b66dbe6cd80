"""An axle that steers and is not stated to, a joint that bends: sentences for the user, never errors.

Wheels that steer go along their own path, which in a turn of curvature k is √(1 + (L k)²) times that of an axle that does not, L behind.
Rims of another axle that keep to that ratio, and to 1 straight ahead, show it; on a machine that scrubs round they do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.ranks import median, quantile
from terragrip.recording.turns import SURE, filled_channel, rim_speed, side_differences, windows

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_MOVING = 0.3  # of the speed that a twentieth of the drive exceeds
_STRAIGHT, _TURN = 0.005, 0.03  # logarithm of the paths' ratio
_FEWEST = 10  # windows of either
# Of that logarithm, in this share of the turns: other slip of the axles in turns is less.
_NEAR, _MOST = 0.4, 0.8
_BENDS = 0.03  # of slip: more than slip itself differs by from side to side


def steering_warnings(recording: Recording, vehicle: Vehicle, turn: Floats | None) -> list[str]:
    """A sentence where the first or last axle goes through turns as one that steers, and none is stated to; ``turn`` (n,) [rad/s]."""
    every = list(vehicle.axles.items())
    axles = every[0], every[-1]
    needed = {"ground_speed", *(f"wheel_speed_{w}" for _, axle in axles for w in axle.wheels)}
    states = vehicle.articulated or any(axle.steered for _, axle in every)
    if turn is None or states or not needed <= recording.channels.keys():
        return []
    ground = filled_channel(recording, "ground_speed")
    rims = [np.mean([rim_speed(recording, vehicle, w) for w in axle.wheels], axis=0) for _, axle in axles]
    *rims, ground, rate = windows(recording.time, np.array([*rims, ground, turn]))
    if not len(rate):
        return []
    pace = np.abs(ground)
    moving = (rims[0] * ground > 0) & (rims[1] * ground > 0) & (pace > _MOVING * quantile(pace, 0.95))
    path = np.log1p((vehicle.axle_to_rear[0] * rate[moving] / pace[moving]) ** 2) / 2
    straight, turns = path < _STRAIGHT, path > _TURN
    if min(straight.sum(), turns.sum()) < _FEWEST:
        return []
    for (name, axle), own, other in zip(axles, rims, rims[::-1], strict=True):
        beside = other if axle.driven else ground  # on a headland what is driven slips less
        ratio = np.log(own[moving] / beside[moving])
        share = (ratio[turns] - median(ratio[straight])) / path[turns]
        if np.mean(np.abs(share - 1.0) < _NEAR) > _MOST:
            most = -np.expm1(-quantile(path[turns], 0.95))
            return [
                f"In turns the wheels of the axle {name} go faster than the others, as wheels that steer do: write 'steered: true' for it "
                f"in the vehicle file, or slip is wrong there, its own by up to {most:.2f}."
            ]
    return []


def joint_warnings(recording: Recording, vehicle: Vehicle, turn: Floats | None) -> list[str]:
    """A sentence where the halves of an articulated vehicle turn by different rates while its joint bends: ``turn`` (n,) [rad/s] is that of
    one of them. The intervals hold what the rims differ by."""
    wheels = {w for axle in vehicle.axles.values() for w in axle.wheels}
    if (
        turn is None
        or not vehicle.articulated
        or not {f"wheel_speed_{w}" for w in wheels} <= recording.channels.keys()
    ):
        return []
    rims = {w: rim_speed(recording, vehicle, w) for w in wheels}
    sides = side_differences(vehicle, rims)
    if len(sides) < 2:
        return []
    first, last, pace = windows(
        recording.time, np.array([sides[0], sides[-1], np.abs(np.mean(list(rims.values()), axis=0))])
    )
    if len(pace) < _FEWEST:
        return []
    moving, bending = pace > _MOVING * quantile(pace, 0.95), (first - last) / 2
    off = np.abs(bending[moving]) / pace[moving]  # of a wheel's slip, half the track beside the middle
    bends = off > _BENDS
    # The turn grows as the joint bends; wheels that spin do not follow that.
    if bends.sum() < _FEWEST or np.corrcoef(bending, np.gradient(first + last))[0, 1] < SURE:
        return []
    return [
        f"In {np.mean(bends):.0%} of the driving the joint bends: front and rear then turn by different rates, of which the log has one, "
        f"and slips of the other's wheels are off by up to {quantile(off, 0.95):.2f}, which their intervals hold."
    ]
