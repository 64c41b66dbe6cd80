"""Slip that no ground lets a wheel have, by its torque: sentences for the user, never errors.

Slip vanishes with the torque, and a wheel that pulls turns faster than its hub travels (physics.md 2). A radius, a gear ratio or a scale
that is off adds the same slip to all rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.copies import one_signal
from terragrip.recording.noise import white_noise
from terragrip.recording.once import once
from terragrip.recording.ranks import median, quantile
from terragrip.recording.stretches import longest
from terragrip.recording.turns import side_differences, straight_rows
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import span

if TYPE_CHECKING:
    from terragrip.recording.mechanics import Means
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

RATIOS = (0.6, 2.2)
"""Rim speed over ground speed that may still be slip; beyond it is a unit."""

_LEAST = 25  # windows
_LIGHT = 0.12  # adhesion: below it a wheel slips by no more than its adhesion (a stiffness of 1, where the softest soils have 2) and
_RADIUS = 0.3  # a mistake that the torques' balance would be blamed for, or
_TYRE = 0.03  # what is left where they are right (right logs: -.001 at most)
_LIGHTEST = 15  # windows, or a tenth of these
_PULLING = 0.05  # of the weight: thrust that is beyond the offsets of torques
_MOST = 0.75  # of the windows with such a thrust
_RADII = 0.01  # radii that are known so well are right
_SLOWER = 0.1  # of the hub's speed: radii are known to that, or
# to so many of the file's standard deviations, and a receiver's errors
_RADII_SURE, _SLOWER_LEAST = 4.0, 0.04
_SURE = 3.0  # standard errors of the receiver's noise: at 1 Hz a stretch has five of its samples
_TURNING = 0.1  # of the hub's speed, that a length times the rate of turn comes to
_ELSEWHERE = (
    " The vehicle turns there: if ground_speed is measured ahead of its rear axle or beside its middle, write where ('antenna' in "
    "the vehicle file)."
)


def radius_warnings(recording: Recording, vehicle: Vehicle, means: Means) -> list[str]:
    """Much slip with hardly any torque, and none with much; beyond `RATIOS` `unit_warnings` names the unit that may be wrong."""
    return _light(recording, vehicle, means, _RADIUS) or _against_the_pull(recording, vehicle, means)


def light_warnings(recording: Recording, vehicle: Vehicle, means: Means | None) -> list[str]:
    """A sentence on wheels that slip where they hardly pull, by what is left where torques and radii are right."""
    return [] if means is None else _light(recording, vehicle, means, _TYRE)


def _light(recording: Recording, vehicle: Vehicle, means: Means, least: float) -> list[str]:
    """A sentence on rims that go faster than their hubs, straight ahead, where they hardly pull, or brake: by ``least`` of their speed more
    than the softest ground explains, or slower by `_RADIUS`, in the lightest windows of an axle, left and right together (exchanged torques
    oppose their slips).

    Torques that are too small look the same."""
    radii, share = vehicle.driven_radii, vehicle.mass * STANDARD_GRAVITY / len(vehicle.wheels)
    straight = _straight(recording, vehicle, means)
    off: dict[str, float] = {}
    for axle in vehicle.axles.values():
        ways, pulls = dict[str, Floats](), list[Floats]()
        for wheel in [w for w in axle.wheels if w in radii]:
            torque, way = recording.channels.get(f"drive_torque_{wheel}"), _rolled(recording, wheel, means)
            if torque is not None and way is not None:
                ways[wheel] = way / radii[wheel]
                pulls.append(means.of(torque) / (radii[wheel] * share))
        if not ways:
            continue
        slip, adhesion = 1 - np.mean(list(ways.values()), axis=0), np.mean(pulls, axis=0)
        rows = np.flatnonzero((adhesion < _LIGHT) & np.isfinite(slip) & straight)
        rows = rows[np.argsort(adhesion[rows])[: max(_LIGHTEST, len(rows) // 10)]]
        faster = slip - np.maximum(adhesion, 0.0)
        slower = np.where(adhesion > -_LIGHT, -slip - _RADIUS + least, -np.inf)
        if len(rows) < _LIGHTEST or quantile(np.maximum(faster, slower)[rows], 1 - _MOST) <= least:
            continue
        shown = {wheel: median(way[rows]) for wheel, way in ways.items()}
        off |= {
            w: way * radii[w]
            for w, way in shown.items()
            if abs(1 - way) > least and RATIOS[0] <= 1 / way <= RATIOS[1]
        }
    if not off:
        return []
    apparent, stated = (
        float(np.median(list(off.values()))),
        float(np.median([vehicle.driven_radii[w] for w in off])),
    )
    return [
        f"With hardly a torque the wheels {', '.join(off)} slip by {1 - apparent / stated:.2f}, more than any ground allows: they roll "
        f"{apparent:.3g} m per radian, but the stated radius is {stated:.3g} m. Check the radius (not the diameter), the gear ratio and "
        "the ticks per turn, then the torques' scale; 'terragrip calibrate' finds the radii."
    ]


@once
def _straight(recording: Recording, vehicle: Vehicle, means: Means) -> Bools:
    """The windows (n,) all of whose rows are straight ahead."""
    return means.of(straight_rows(recording, vehicle).astype(np.float64)) == 1.0


@once
def _rolled(recording: Recording, wheel: str, means: Means) -> Floats | None:
    """How far a wheel rolls a radian [m] in each window (n,)."""
    turning = recording.channels.get(f"wheel_speed_{wheel}")
    if turning is None:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(means.speed / means.plain(turning)[means.rows])


def _against_the_pull(recording: Recording, vehicle: Vehicle, means: Means) -> list[str]:
    """Rims that go slower than the ground straight ahead, all while they pull."""
    radii, channels = vehicle.driven_radii, recording.channels
    rolled = {w: _rolled(recording, w, means) for w in radii}
    known = {w: way for w, way in rolled.items() if way is not None}
    if not radii or len(known) < len(radii) or not all(f"drive_torque_{w}" in channels for w in radii):
        return []
    slip = 1 - np.mean([way / radii[w] for w, way in known.items()], axis=0)
    thrust = np.sum([means.of(channels[f"drive_torque_{w}"]) / r for w, r in radii.items()], axis=0)
    straight = _straight(recording, vehicle, means)
    rows = np.isfinite(slip) & straight & (thrust > _PULLING * vehicle.mass * STANDARD_GRAVITY)
    if rows.sum() < _LEAST or quantile(slip[rows], _MOST) >= -_RADII:
        return []
    slower = 1 - 1 / (1 - median(slip[rows]))
    if 1 - slower < RATIOS[0]:
        return []
    return [
        f"While the wheels pull, straight ahead, their rims go {slower:.1%} slower than the ground, which no wheel that pulls does: their "
        "radii are too small, or ground_speed too large. Check both; 'terragrip calibrate' finds the radii."
    ]


def slower_warnings(
    recording: Recording, vehicle: Vehicle, means: Means | None, turn: Floats | None
) -> list[str]:
    """A sentence on rims that for a part of the drive go surely slower than their hubs while they pull; ``turn`` (n,) [rad/s]: by a
    sensor, left positive. None: straight ahead, and each hub may be slower by the turn that the rims of all axles show."""
    if means is None:
        return []
    when = means.middles
    straight = _straight(recording, vehicle, means)
    sides = dict(zip(vehicle.wheels, vehicle.wheel_side, strict=True))
    if turn is None:
        usable, slowed = straight, dict.fromkeys(sides, np.min(_inner(recording, vehicle, means), axis=0))
    else:
        yaw = means.of(turn)
        usable, slowed = np.isfinite(yaw), {wheel: yaw * side for wheel, side in sides.items()}
        if vehicle.articulated:  # while its joint bends the other half turns faster or slower than this one
            bent = np.max(_inner(recording, vehicle, means), axis=0)
            slowed = {wheel: np.maximum(slower, bent) for wheel, slower in slowed.items()}
    least = _PULLING * vehicle.mass * STANDARD_GRAVITY / len(vehicle.wheels)
    stated = vehicle.uncertainty.wheel_radius
    slower = _SLOWER if stated is None else min(_SLOWER, max(_RADII_SURE * stated, _SLOWER_LEAST))
    ground = recording.channels["ground_speed"]
    measured = np.isfinite(ground)
    found: dict[str, tuple[float, float]] = {}
    wheels: dict[str, Floats] = {}
    for wheel, radius in vehicle.driven_radii.items():
        spin, torque = (recording.channels.get(f"{name}_{wheel}") for name in ("wheel_speed", "drive_torque"))
        if spin is not None and torque is not None:
            rim = radius * means.plain(spin)[means.rows]
            wheels[wheel] = np.array([rim, means.speed - slowed[wheel], means.of(torque) / radius])
    # How wheels share one torque was not measured: behind a lock the outer one brakes in a turn.
    groups = one_signal(recording, [f"drive_torque_{wheel}" for wheel in wheels])
    for wheel in wheels:
        name = f"drive_torque_{wheel}"
        alike = next((group for group in groups if name in group), [name])
        rim, hub, thrust = np.mean([wheels[one.removeprefix("drive_torque_")] for one in alike], axis=0)
        rows = (hub - rim > slower * hub) & (thrust > least) & usable
        stretch = longest(when, rows, np.isfinite(hub - rim) & np.isfinite(thrust))
        if stretch is None:
            continue
        within = (when >= stretch[0]) & (when <= stretch[1])
        samples = measured & (
            np.abs(recording.time - np.mean(stretch)) <= (np.ptp(stretch) + means.length) / 2
        )
        noise = vehicle.sensors.ground_speed or white_noise(recording.time[measured], ground[measured]) or 0.0
        if np.mean((hub - rim - slower * hub)[within]) > _SURE * noise / np.sqrt(samples.sum()):
            found[wheel] = stretch
    if not found:
        return []
    first, last = max(found.values(), key=lambda stretch: stretch[1] - stretch[0])
    turning = turn is not None and _turns(vehicle, means, turn, (when >= first) & (when <= last))
    if len(found) == len(vehicle.driven_radii):
        what = "ground_speed, or all wheels' speeds, are"
    else:
        what = "their speeds, or the rate of turn, are" if turning else "their speeds are"
    placed = vehicle.antenna is not None or vehicle.radar is not None
    return [
        f"{span(first, last).capitalize()} the rims of {', '.join(found)} go slower than their hubs by more than {slower:.0%} while they "
        f"pull, which no wheel that pulls does: {what} wrong there, and so is slip."
        + (_ELSEWHERE if turning and not placed else "")
    ]


def _turns(vehicle: Vehicle, means: Means, turn: Floats, within: Bools) -> bool:
    """Whether the vehicle turns in windows (n,), so that a ground speed measured elsewhere, or the turn, may explain slower rims."""
    length = max(vehicle.wheelbase or 0.0, vehicle.track or 0.0)
    return median(np.abs(means.of(turn) * length / means.speed)[within]) >= _TURNING


def _inner(recording: Recording, vehicle: Vehicle, means: Means) -> Floats:
    """By how much [m/s] the inner hubs of each axle may be slower than the vehicle in each window (axles, n): half of what the rims of left
    and right differ by. A turn shows on every axle, so where no joint bends the least counts."""
    rims = {
        wheel: radius * means.plain(recording.channels[name])[means.rows]
        for wheel, radius in vehicle.radii.items()
        if (name := f"wheel_speed_{wheel}") in recording.channels
    }
    apart = [np.abs(one) / 2 for one in side_differences(vehicle, rims)]
    return np.array(apart or [np.zeros(int(means.rows.sum()))])
