"""Axles beside each other: sentences for the user, never errors.

Wheels on one ground share a curve of adhesion over slip, which rises ever less steeply: the axle that slips more pulls for its load at
least as much as the other, and at most as many times as much as it slips. Masses of two axles that are exchanged in the vehicle file, or
exchanged torques, show as the square of the masses' ratio.

A free wheel rolls with the ground, a driven one slips: on average over a drive its rim is the faster one. Speeds of two such axles that are
exchanged contradict that, or, with wheels of unlike size, roll too far or not far enough.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.mechanics import Means
from terragrip.recording.ranks import median, quantile
from terragrip.recording.turns import are_known, filled_channel, straight_rows
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle
    from terragrip.vehicle_parts import Axle

_LEAST = 15  # windows
_PULLING = 0.5  # of the thrust that a twentieth of the windows exceed
_STRAIGHT = 0.05  # of an axle's rims from side to side
_SLIP = 0.02  # less is of the size of the errors of the radii, which are a like share of the slip, and so of the adhesion;
_RADII = 0.01  # where the vehicle file states none
_UNEVEN = 0.25  # logarithm of 1.28: uncalibrated torques and the rear wheels' trodden track
_SURE = 2.0  # standard deviations of a torque's gain
_RESTORED = 0.4  # of the difference, at most, is left when what was exchanged is put right
_MOVING, _ROWS = 0.3, 100  # of the speed that a twentieth of the drive exceeds, in so many rows
_FASTER = 0.02  # logarithm of free rims over driven ones: of two radii known to 1 %. (101 right logs of development: at most -.009)
_ROLLS = 0.15  # logarithm of free rims over the ground: radii known to 10 %, and skidding on soft ground (the 101: -.04 to .02)
_STEADY = 0.5  # quartiles of that logarithm: a scale is one number, a machine that digs in has none
_ALIKE = 0.06  # the same, where another column is to be the right one


def axle_warnings(recording: Recording, vehicle: Vehicle, means: Means | None) -> list[str]:
    """A sentence on two driven axles whose thrusts, by their slips, would fit each other's masses, else on two that do not fit theirs.

    Other errors of torques and speeds look the same: use this only where no other was found.
    """
    names = list(vehicle.axles)
    driven = [k for k, axle in enumerate(vehicle.axles.values()) if axle.driven]
    wheels = {w for k in driven for w in vehicle.axles[names[k]].wheels}
    needed = {f"{quantity}_{w}" for w in wheels for quantity in ("drive_torque", "wheel_speed")}
    if means is None or len(driven) < 2 or not needed <= recording.channels.keys():
        return []
    thrust, slip, straight = _by_axle(recording, vehicle, means, driven)
    total = np.sum(list(thrust.values()), axis=0)
    known = np.isfinite(total) & straight
    if not known.any():
        return []
    rows = known & (total > _PULLING * max(quantile(total[known], 0.95), 0.0))
    if rows.sum() < _LEAST:
        return []
    pulls = _pulls(recording, vehicle, means, total)

    stated, gain = vehicle.uncertainty.wheel_radius, vehicle.uncertainty.drive_torque_gain or 0.0
    radii = _RADII if stated is None else np.sqrt(2) * stated  # of two axles' radii, each by itself

    def beyond(forces: dict[int, Floats], masses: Floats, slope: float, pair: tuple[int, int]) -> list[float]:
        of = [_difference(forces, vehicle, masses, means, pull, rows, pair) for pull in pulls]
        return [_beyond(one, slope) for one in of]

    uneven_loads: list[str] = []
    for a, b in combinations(driven, 2):
        slips = [median(slip[k][rows]) for k in (a, b)]
        if min(slips) < _SLIP:
            continue
        steepest = float(np.log(slips[0] / slips[1]))
        moved = {**thrust, a: thrust[b], b: thrust[a]}
        exchanged = vehicle.axle_mass.copy()
        exchanged[[a, b]] = exchanged[[b, a]]
        off = beyond(thrust, vehicle.axle_mass, steepest, (a, b))
        least, uneven = min(off, key=abs), _UNEVEN + radii / min(slips)
        if min(off) * max(off) <= 0 or abs(least) <= uneven:
            continue
        causes = {
            "the masses of the axles": beyond(thrust, exchanged, steepest, (a, b)),
            "the axle of each torque": beyond(moved, vehicle.axle_mass, steepest, (a, b)),
            "the axle of each wheel": beyond(moved, vehicle.axle_mass, -steepest, (a, b)),
        }
        likely = [what for what, left in causes.items() if min(map(abs, left)) < _RESTORED * abs(least)]
        strong, weak = (names[a], names[b]) if least > 0 else (names[b], names[a])
        note = f"The axle {strong} pulls {np.exp(abs(least)):.2g} times as much for its load as its slip and that of {weak} allow"
        if likely:
            return [f"{note}, and with the two exchanged it would not: check {', or '.join(likely)}."]
        if abs(least) > uneven + _SURE * gain:
            uneven_loads.append(
                f"{note}: check the masses of the axles (ballast and mounted tools shift them) and the scales of their torques."
            )
    return uneven_loads[:1]


def _beyond(difference: float, steepest: float) -> float:
    """What of a logarithm of two axles' thrusts over loads is beyond 0 and that of their slips (``steepest``), which a curve can give."""
    return difference - float(np.clip(difference, min(steepest, 0.0), max(steepest, 0.0)))


def _by_axle(
    recording: Recording, vehicle: Vehicle, means: Means, driven: list[int]
) -> tuple[dict[int, Floats], dict[int, Floats], Bools]:
    """Thrust [N] and slip of each axle (n,), and the windows without a turn."""
    axles, channels = list(vehicle.axles.values()), recording.channels
    thrust, slip = {}, {}
    straight = np.ones(len(means.speed), dtype=bool)
    for k in driven:
        rims = [vehicle.radii[w] * means.of(channels[f"wheel_speed_{w}"]) for w in axles[k].wheels]
        rim = np.mean(rims, axis=0)
        thrust[k] = np.sum(
            [means.of(channels[f"drive_torque_{w}"]) / vehicle.radii[w] for w in axles[k].wheels], axis=0
        )
        slip[k] = 1 - means.speed / np.where(rim > 0, rim, np.nan)
        straight &= np.isfinite(slip[k]) & (np.ptp(rims, axis=0) < _STRAIGHT * np.abs(rim))
    return thrust, slip, straight


def _pulls(recording: Recording, vehicle: Vehicle, means: Means, total: Floats) -> list[Floats]:
    """What may be pulled (n,) [N]: as measured, else nothing, and all that the thrust leaves."""
    if "drawbar_force" in recording.channels:
        return [np.nan_to_num(means.of(recording.channels["drawbar_force"]))]
    climb = 0.0 if means.climb is None else np.nan_to_num(means.climb)
    return [
        np.zeros(len(total)),
        np.maximum(np.nan_to_num(total) - vehicle.mass * (means.change + climb), 0.0),
    ]


def _difference(
    thrust: dict[int, Floats], vehicle: Vehicle, masses: Floats, means: Means, pull: Floats,
    rows: Bools, pair: tuple[int, int],
) -> float:  # fmt: skip
    """The logarithm of one axle's thrust over load, over that of another: median of the windows; 0 where one brakes or lifts."""
    climb = 0.0 if means.climb is None else np.nan_to_num(means.climb)
    loads = vehicle.axle_loads(
        masses,
        drawbar=pull,
        acceleration=means.change,
        slope=np.arcsin(np.clip(climb / STANDARD_GRAVITY, -1.0, 1.0)),
    )
    first, second = (median((thrust[k] / np.maximum(loads[:, k], 1e-9))[rows]) for k in pair)
    return float(np.log(first / second)) if min(first, second) > 0 and loads[rows].min() > 0 else 0.0


def free_axle_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on the first free axle whose rims do not go as the ground does, or go faster than those of a driven axle."""
    axles, ground = vehicle.axles, recording.channels.get("ground_speed")
    if ground is None or not np.isfinite(ground).any():
        return []
    speed = np.abs(filled_channel(recording, "ground_speed"))
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
    names = [f"wheel_speed_{wheel}" for wheel in axle.wheels]
    if not are_known(recording, *names):
        return None
    rate = np.abs(np.mean([filled_channel(recording, name) for name in names], axis=0))
    used = rows & (rate > 0)
    return np.quantile(rate[used] / speed[used], [0.25, 0.5, 0.75]) if used.sum() >= _ROWS else None
