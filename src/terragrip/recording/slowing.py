"""Does the vehicle slow down by more than its torques explain? A friction brake does, which no channel tells of.

Specific force is thrust less pull less resistance, over the weight. Where the motors give next to nothing and more than the resistance just
before, and usually, holds the vehicle back, something brakes. A hill is in the specific force; soft ground is driven into under thrust, and
a tool's draught was there before (R).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.courses import points_of, smooth
from terragrip.recording.ranks import median, quantile
from terragrip.recording.turns import are_known, filled_channel
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.arrays import Floats
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_CALM = 0.4  # s
_MOVING = 0.15  # of the speed that a twentieth of the drive exceeds
_DRIVEN = 20.0  # s, at least
_OFF = 0.03  # of the weight: motors' thrust that is next to none
_MORE = 0.05  # of the weight: resistance beyond that before and the usual one
_LASTS = 0.3  # s
_BEFORE = 3.0  # s
_FEWEST = 2  # stretches


def slowing_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on stretches in which the vehicle surely slows down by more than the drive torques explain."""
    channels = recording.channels
    torques, rims = (
        [f"{name}_{w}" for w in vehicle.driven_radii] for name in ("drive_torque", "wheel_speed")
    )
    found = points_of(recording.time)
    slope_known = "acceleration_x" in channels or "pitch" in channels
    known = are_known(recording, "ground_speed", *torques, *rims)
    if (
        "brake" in channels
        or found is None
        or not (slope_known and known and torques)
        or 2 * found[1] > _CALM
    ):
        return []
    points, step = found

    def at(name: str) -> Floats:
        return smooth(np.interp(points, recording.time, filled_channel(recording, name)), _CALM, step)

    weight, radii = vehicle.mass * STANDARD_GRAVITY, list(vehicle.driven_radii.values())
    speed = at("ground_speed")
    rim = np.mean([r * at(name) for name, r in zip(rims, radii, strict=True)], axis=0)
    thrust = np.sum([at(name) / r for name, r in zip(torques, radii, strict=True)], axis=0) / weight
    pull = at("drawbar_force") / weight if "drawbar_force" in channels else 0.0
    if "acceleration_x" in channels:
        force = at("acceleration_x") / STANDARD_GRAVITY
    else:
        force = np.gradient(speed, step) / STANDARD_GRAVITY + np.sin(at("pitch"))
    spun = float(np.sum(vehicle.wheel_inertia / vehicle.wheel_radius**2)) / weight
    resistance = thrust - pull - spun * np.gradient(rim, step) - force
    moving = np.minimum(speed, rim) > _MOVING * quantile(speed, 0.95)
    if moving.sum() * step < _DRIVEN:
        return []
    usual = median(resistance[moving])
    held_back = moving & (np.abs(thrust) < _OFF) & (resistance > usual + _MORE)
    edges = np.flatnonzero(np.diff(np.r_[0, held_back.astype(np.int8), 0]))
    long, near = round(_BEFORE / step), round(_CALM / step)
    more = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        before = slice(max(first - long, 0), max(first - near, 0))
        if (end - first) * step < _LASTS or not moving[before].any() or speed[end - 1] > speed[first]:
            continue
        extra = np.mean(resistance[first:end]) - max(usual, median(resistance[before][moving[before]]))
        more += [float(extra)] if extra > _MORE else []
    if len(more) < _FEWEST:
        return []
    return [
        f"In {len(more)} stretches the vehicle slows down by {np.mean(more):.2g} of its weight more than torques, pull and resistance do, "
        "as by a friction brake: there adhesion and soil resistance are too high, and their intervals too narrow. Give its switch, pedal "
        "or pressure as the channel 'brake'."
    ]
