"""Which wheel is which, by turns and straight stretches: sentences for the user, never errors.

In a turn the wheels of the outer side run faster, on every axle. Straight ahead the wheels of an axle, with equal load and equal slip,
need equal torques. A log with two exchanged wheels contradicts that, and exchanging them back restores it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.once import once
from terragrip.recording.ranks import quantile

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

Order = tuple[int, ...]
Axles = list[tuple[int, int]]

SURE = 0.5
"""Correlation from which two yaw rates agree, or with the opposite sign contradict each other."""

WINDOW = 2.0  # s
_MOST = 1e9  # of any unit: a larger value is an error, and its square may not be a number
LEAST_TURN = 1.5  # rad: with less there is no turn to compare
_CLEAR = 0.8  # correlation from which another order of the wheels is the right one
_SIZES = 0.4  # of the measured turn: the turn by the rims of an axle
_WIDE = 0.05  # of the wheels' speeds: their difference from side to side must exceed noise
_OTHER = 0.2  # of all turns: those to the rarer side
_RADII = 4.0  # the usual track, if none is given
_LEAST = 15  # windows straight ahead
_STRAIGHT = 0.05  # of the speed from side to side
_SLANT = 0.2  # of the sum of both sides' speeds
_TURNED = 0.15  # rad: wheels steered by less go 1 % further than the vehicle
_FEW = 30  # rows
_UNLIKE = np.log(1.35)  # of an axle's two torques: beyond the gains that `calibrate` accepts
_ALIKE = np.log(1.15)
_SURELY = 0.6  # of the windows


def filled(time: Floats, values: Floats) -> Floats:
    """Values (n,) on straight lines between those that are known."""
    known = np.isfinite(values)
    return np.interp(time, time[known], values[known]) if known.any() and not known.all() else values


@once
def filled_channel(recording: Recording, name: str) -> Floats:
    """The same of one channel of a log (n,)."""
    return filled(recording.time, recording.channels[name])


def are_known(recording: Recording, *names: str) -> bool:
    """Whether each of these channels has two values or more."""
    return all(np.isfinite(recording.channels.get(name, np.nan)).sum() > 1 for name in names)


def rim_speed(recording: Recording, vehicle: Vehicle, wheel: str) -> Floats:
    """A wheel's speed at its rim (n,) [m/s]."""
    return vehicle.radii[wheel] * filled_channel(recording, f"wheel_speed_{wheel}")


def side_differences(vehicle: Vehicle, rims: Mapping[str, Floats]) -> list[Floats]:
    """Of each axle whose outer wheels are both among ``rims`` (n,), the right one's less the left one's."""
    outer = [(axle.wheels[0], axle.wheels[-1]) for axle in vehicle.axles.values() if len(axle.wheels) > 1]
    return [rims[right] - rims[left] for left, right in outer if {left, right} <= rims.keys()]


def agreement(time: Floats, yaw: Floats, other: Floats) -> float:
    """Correlation about 0 of two rates of turn (n,) over windows of 2 s; 0 where there is little turning."""
    known = np.isfinite(yaw) & np.isfinite(other)
    if not known.any():
        return 0.0
    a, b = windows(time, np.where(known, [yaw, other], np.nan))
    return _correlation(a, b) if np.sum(np.abs(a)) * WINDOW >= LEAST_TURN else 0.0


def windows(time: Floats, values: Floats) -> Floats:
    """Means of channels (k, n) over the windows of 2 s in which all of them have a possible value (k, m)."""
    first = time[0]
    known = (np.abs(values) < _MOST).all(axis=0)
    if not known.all():
        time, values = time[known], values[:, known]
    if not len(time):
        return np.empty((len(values), 0))
    starts = np.flatnonzero(np.diff(np.floor((time - first) / WINDOW), prepend=-1.0))
    return np.add.reduceat(values, starts, axis=1) / np.diff(starts, append=len(time))


def _correlation(a: Floats, b: Floats) -> float:
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size else 0.0


@once
def straight_rows(recording: Recording, vehicle: Vehicle) -> Bools:
    """Rows (n,) in which the rims of each axle have like speeds from side to side, so no turn moves one, nor a steered one, far from the
    ground speed; if there are hardly any, those in which they turn the same way."""
    rows, forward = np.ones((2, len(recording)), dtype=bool)
    ahead = float(np.abs(vehicle.wheel_ahead).max())
    side = dict(zip(vehicle.wheels, vehicle.wheel_side.tolist(), strict=True))
    for axle in vehicle.axles.values():
        known = [w for w in (axle.wheels[0], axle.wheels[-1]) if f"wheel_speed_{w}" in recording.channels]
        rims = [rim_speed(recording, vehicle, w) for w in known]
        if len(axle.wheels) > 1 and len(rims) == 2:
            track = abs(side[axle.wheels[0]] - side[axle.wheels[-1]])
            slant = min(_SLANT, _TURNED * track / (2 * ahead)) if ahead * track > 0 else _SLANT
            rows &= np.abs(rims[1] - rims[0]) < slant * np.abs(rims[1] + rims[0])
            forward &= rims[0] * rims[1] > 0
    return rows if rows.sum() > _FEW else forward


def exchange_warnings(recording: Recording, vehicle: Vehicle, turn: Floats | None) -> list[str]:
    """Sentences on wheels whose speeds, or torques, may be exchanged. ``turn`` (n,) [rad/s], left positive: by a sensor."""
    place = {wheel: k for k, wheel in enumerate(vehicle.wheels)}
    axles = [(place[a.wheels[0]], place[a.wheels[-1]]) for a in vehicle.axles.values() if len(a.wheels) > 1]
    speeds, torques = (_of_wheels(recording, vehicle, name) for name in ("wheel_speed", "drive_torque"))
    if not axles or speeds is None or np.any(np.diff(recording.time) < 0):
        return []
    rims = speeds * vehicle.wheel_radius[:, None]
    found = _turned(recording.time, rims, axles, turn, vehicle)
    notes = [_sentence("wheel_speed", vehicle, found, "in turns")] if found else []
    if torques is not None:
        loads = np.array([a.mass for a in vehicle.axles.values() if len(a.wheels) > 1])
        means = windows(recording.time, np.r_[rims, torques])
        uneven = _uneven(means[: len(rims)], means[len(rims) :], vehicle.wheel_radius, axles, loads)
        notes += [_sentence("drive_torque", vehicle, uneven, "straight ahead")] if uneven else []
    return notes


def _of_wheels(recording: Recording, vehicle: Vehicle, quantity: str) -> Floats | None:
    """A quantity of all wheels (k, n), None where one has none."""
    known = [recording.channels.get(f"{quantity}_{wheel}") for wheel in vehicle.wheels]
    return (
        np.array([filled(recording.time, v) for v in known if v is not None])
        if all(v is not None for v in known)
        else None
    )


def _sentence(quantity: str, vehicle: Vehicle, found: list[tuple[int, int]], where: str) -> str:
    pairs = [" and ".join(f"{quantity}_{vehicle.wheels[k]}" for k in pair) for pair in found]
    return (
        f"{', or '.join(pairs)} may be exchanged: {where} left and right wheels do not agree between the axles now, but "
        "would then. Check the wheel of each column, torques too."
    )


def _exchanges(count: int, pairs: list[tuple[int, int]]) -> Iterator[tuple[tuple[int, int], Order]]:
    """Each pair of wheels with the order (count,) in which they are exchanged."""
    for a, b in pairs:
        order = list(range(count))
        order[a], order[b] = b, a
        yield (a, b), tuple(order)


def _turned(
    time: Floats, rims: Floats, axles: Axles, turn: Floats | None, vehicle: Vehicle
) -> list[tuple[int, int]]:
    """A left and a right wheel that, exchanged, make every axle turn as ``turn`` does, or without one as the others do."""
    if turn is not None:
        *means, shown = windows(time, np.r_[rims, turn[None]])
    else:
        means, shown = list(windows(time, rims)), None
    wheels = measured = np.array(means)
    if wheels.shape[1] == 0 or (shown is None and len(axles) < 2):
        return []
    width = vehicle.track or _RADII * float(np.mean(vehicle.wheel_radius))
    pace = float(np.sqrt(np.mean(wheels**2)))
    if shown is None:  # the part in proportion to the speed is due to the radii
        common = wheels.mean(axis=0)
        wheels = wheels - np.outer(wheels @ common / max(float(common @ common), 1e-12), common)

    straight = tuple(range(len(rims)))

    def agree(order: Order) -> float:
        """The smallest correlation of an axle's turn with the measured one."""
        ordered = wheels[list(order)]
        turns = [(ordered[right] - ordered[left]) / width for left, right in axles]
        against = turns[0] if shown is None else shown
        if np.sum(np.abs(against)) * WINDOW < LEAST_TURN:
            return 0.0
        if shown is None and width * np.sqrt(np.mean(against**2)) < _WIDE * pace:
            return 0.0
        sizes = [float(np.sum(one**2)) for one in turns]
        alike = min(sizes) > _SIZES**2 * max(sizes[0], float(np.sum(against**2)))
        if shown is None and order != straight and not _both_ways(measured[list(order)], axles):
            return 0.0
        return min(_correlation(against, one) for one in turns) if alike else 0.0

    if agree(straight) > SURE or (shown is not None and len(axles) == 1):
        return []
    pairs = [(left, right) for left, _ in axles for _, right in axles]
    if shown is not None and all(_correlation(shown, wheels[r] - wheels[le]) < -SURE for le, r in axles):
        return []  # all of them: the turn's own sign, or whole sides
    return [pair for pair, order in _exchanges(len(rims), pairs) if agree(order) > _CLEAR]


def _both_ways(rims: Floats, axles: Axles) -> bool:
    """Whether the turns by the rims (k, n) of each axle are to both sides: slip of one axle beyond another looks like turns to one side."""
    sides = (rims[right] - rims[left] for left, right in axles)
    return all(
        min(turn[turn > 0].sum(), -turn[turn < 0].sum()) > _OTHER * np.abs(turn).sum() for turn in sides
    )


def _uneven(
    rims: Floats, torques: Floats, radii: Floats, axles: Axles, loads: Floats
) -> list[tuple[int, int]]:
    """Two wheels of two axles whose torques, exchanged, make every axle pull alike on both sides straight ahead: of those pairs the one
    with which the axles pull in proportion to their loads."""
    if len(axles) < 2 or not rims.shape[1]:
        return []
    total, pace = (torques / radii[:, None]).sum(axis=0), np.abs(rims).mean(axis=0)
    apart = np.max([np.abs(rims[right] - rims[left]) for left, right in axles], axis=0)
    rows = (total > 0.3 * quantile(total, 0.95)) & (apart < _STRAIGHT * pace)
    if rows.sum() < _LEAST:
        return []
    mean = np.median(torques[:, rows], axis=1)
    if (mean <= 0).any():
        return []

    def off(order: Order) -> tuple[float, float]:
        """The largest difference between an axle's sides, and how far the axles' pulls are from their loads, both as logarithms."""
        ordered = mean[list(order)] / radii
        sides = np.array([[ordered[left], ordered[right]] for left, right in axles])
        share = np.log(sides.sum(axis=1) / loads)
        return float(np.max(np.abs(np.log(sides[:, 0] / sides[:, 1])))), float(np.ptp(share))

    straight = tuple(range(len(rims)))
    sure = [
        _surely(torques[left, rows] / radii[left], torques[right, rows] / radii[right])
        for left, right in axles
    ]
    if sum(sure) < 2 or off(straight)[0] < _UNLIKE:
        return []
    sides = [k for axle in axles for k in axle]
    same = {frozenset(axle) for axle in axles}
    pairs = [pair for pair in combinations(sides, 2) if frozenset(pair) not in same]
    restored = [
        (off(order)[1], pair) for pair, order in _exchanges(len(rims), pairs) if off(order)[0] < _ALIKE
    ]
    return [min(restored)[1]] if restored else []


def _surely(left: Floats, right: Floats) -> bool:
    """Whether an axle's two pulls (n,) are unlike to the same side in most windows: what hills and a chassis shift comes and goes."""
    most = max(np.mean(left > np.exp(_UNLIKE) * right), np.mean(right > np.exp(_UNLIKE) * left))
    return bool(most > _SURELY)
