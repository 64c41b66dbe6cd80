"""A free axle beside a driven one: sentences for the user, never errors.

A free wheel rolls with the ground, a driven one slips: on average over a drive its rim is the faster one. Speeds of two such axles that are
exchanged contradict that, or, with wheels of unlike size, roll too far or not far enough.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.ranks import quantile
from terragrip.recording.turns import filled, straight_rows

if TYPE_CHECKING:
    from terragrip.arrays import Bools, Floats
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle
    from terragrip.vehicle_parts import Axle

_MOVING = 0.3  # of the speed that a twentieth of the drive exceeds
_LEAST = 100  # rows
_FASTER = 0.02  # logarithm of free rims over driven ones: of two radii known to 1 %. (101 right logs of development: at most -.009)
_ROLLS = 0.15  # logarithm of free rims over the ground: radii known to 10 %, and skidding on soft ground (the 101: -.04 to .02)
_STEADY = 0.5  # quartiles of that logarithm: a scale is one number, a machine that digs in has none
_ALIKE = 0.06  # the same, where another column is to be the right one


def free_axle_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on the first free axle whose rims do not go as the ground does, or go faster than those of a driven axle."""
    axles, ground = vehicle.axles, recording.channels.get("ground_speed")
    if ground is None or not np.isfinite(ground).any():
        return []
    speed = np.abs(filled(recording.time, ground))
    rows = straight_rows(recording, vehicle) & (speed > _MOVING * quantile(speed, 0.95))
    rolled = {name: _rolled(recording, axle, speed, rows) for name, axle in axles.items()}
    known = {name: turn for name, turn in rolled.items() if turn is not None}
    for free in (name for name in known if not axles[name].driven):
        low, own, high = known[free] * vehicle.radii[axles[free].wheels[0]]
        for driven in (name for name in known if axles[name].driven):
            other = known[driven][1] * vehicle.radii[axles[driven].wheels[0]]
            exchanged = (
                known[driven][1] * vehicle.radii[axles[free].wheels[0]],
                known[free][1] * vehicle.radii[axles[driven].wheels[0]],
            )
            is_odd = np.log(own / other) > _FASTER or abs(np.log(own)) > _ROLLS
            if is_odd and abs(np.log(exchanged[0])) < _ALIKE and exchanged[1] > exchanged[0]:
                return [
                    f"The rims of the free axle {free} go {own:.3g} times as fast as the ground and those of {driven}, which is driven, "
                    f"{other:.3g} times; exchanged {exchanged[0]:.3g} and {exchanged[1]:.3g}: the speeds of the two may be exchanged."
                ]
        if abs(np.log(own)) > _ROLLS and np.log(high / low) < _STEADY:
            return [
                f"The rims of the axle {free} go {own:.3g} times as fast as the ground, though nothing drives them: check their "
                "radius and the scale of their speeds."
            ]
    return []


def _rolled(recording: Recording, axle: Axle, speed: Floats, rows: Bools) -> Floats | None:
    """An axle's rate of turn over the ground speed [1/m]: quartiles (3,) of ``rows`` (n,); None where one of its wheels is not measured."""
    own = [recording.channels.get(f"wheel_speed_{wheel}") for wheel in axle.wheels]
    if not all(values is not None and np.isfinite(values).any() for values in own):
        return None
    rate = np.abs(np.mean([filled(recording.time, values) for values in own if values is not None], axis=0))
    used = rows & (rate > 0)
    return np.quantile(rate[used] / speed[used], [0.25, 0.5, 0.75]) if used.sum() >= _LEAST else None
