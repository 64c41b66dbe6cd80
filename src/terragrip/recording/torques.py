"""The drive torques against the drawbar force and the wheels' change of speed: sentences for the user, never errors.

At every instant the wheels' thrust Σ M/r is the pull, the force that moves the mass, and a resistance (physics.md 1). So thrust follows
the sum of the first two at once; a lag is an error of a channel, and so is a thrust that no ground bears, or a pull of another unit.
Starts and stops distinguish the scales of all three (forces.py). Where a tool pulls unmeasured, the thrust follows an unknown force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.courses import CALM, lag_of, points_of, quick, smooth
from terragrip.recording.mechanics import Fit, Means
from terragrip.recording.ranks import quantile
from terragrip.recording.turns import filled
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle


_MOST = 1.0  # of the weight: a mean thrust over a whole drive that no ground supports
_LEAST = 0.02  # of the weight: a thrust that is hardly ever exceeded; tires on a road need .01, and starts more (right logs: .07 at least)
_BRAKING = 0.06  # of the weight: a mean that brakes a drive down a 10 % grade throughout
_WITHIN = 2.0  # s, the largest lag searched
_MOVING = 0.3  # of the rims' speed that a twentieth of the drive exceeds
_LAG = 0.2  # s, and two samples: tyres and filters cause .1, rarely .15
_UNSEEN_LAG = 0.3  # s, where a tool may pull unmeasured: an engine's governor answers it within .2
_ALIKE = 0.7  # correlation at the lag
_BETTER = 0.05  # than without it
_FORCES = {"kN": 1e3, "daN": 10.0, "lbf": 4.448}  # N; daN is used for the kilogram's weight, too
_FACTOR = 1.5


def torque_warnings(
    recording: Recording, vehicle: Vehicle, means: Means | None, beyond_pull: dict[str, Floats]
) -> list[str]:
    """Sentences on torques of another scale than the pull, and on torques that are late or early; ``beyond_pull``: thrusts as
    `thrusts_of` gives them."""
    return _scale_warnings(recording, vehicle, means, beyond_pull) or _lag_warnings(recording, vehicle)


def _scale_warnings(
    recording: Recording, vehicle: Vehicle, means: Means | None, beyond_pull: dict[str, Floats]
) -> list[str]:
    if means is None or not beyond_pull:
        return []
    rest = np.sum(list(beyond_pull.values()), axis=0)
    towing = "drawbar_force" in recording.channels
    pull = means.of(recording.channels["drawbar_force"]) / vehicle.mass if towing else np.zeros_like(rest)
    thrust = rest + pull
    mean = float(np.nanmean(thrust)) / STANDARD_GRAVITY if np.isfinite(thrust).any() else 0.0
    check = "(at the wheel, not at the motor: the gear ratio counts), the wheel radius and the mass"
    if mean > _MOST:
        return [
            f"The drive torques over the wheel radius are {mean:.2g} times the weight on average, which no ground can bear: check "
            f"the torques' unit and scale {check}."
        ]
    left = rest - means.moved(recording)
    if mean < -_BRAKING and np.nanmean(left) < 0:  # else a slope, or a trailer, pushes
        return [
            f"The drive torques over the wheel radius are {mean:.2g} times the weight on average, while the vehicle drives "
            "forward: write 'sign: -1' for each in the profile."
        ]
    most = quantile(np.abs(thrust[np.isfinite(thrust)]), 0.95) / STANDARD_GRAVITY if mean else 1.0
    if most < _LEAST:
        return [
            f"The drive torques over the wheel radius stay below {most:.2g} times the weight, with which no vehicle starts or rolls on "
            f"ground: check the torques' unit and scale {check}."
        ]
    if not towing:
        return []
    return _pull_scale(means.fit(thrust - means.moved(recording), pull))


def _pull_scale(fit: Fit) -> list[str]:
    """The drawbar force alone of another scale: the thrust beyond what moves the mass, over it."""
    if not fit.is_another_scale or fit.slope < 0:
        return []
    unit = min(_FORCES, key=lambda name: abs(np.log(fit.slope / _FORCES[name])))
    near = abs(np.log(fit.slope / _FORCES[unit])) < np.log(_FACTOR)
    return [
        f"The wheels' thrust changes by {fit.slope:.2g} times what the drawbar force does, beyond the force that moves the vehicle: "
        + (
            f"it may be in {unit}: write 'unit: {unit}' for it in the profile."
            if near
            else "check the units and scales of both."
        )
    ]


@dataclass(frozen=True)
class _Course:
    """Thrust, and pull plus the rims' accelerating force, over the mass (n,) [m/s²] on points ``step`` [s] apart, while ``moving``."""

    step: float
    thrust: Floats
    force: Floats
    moving: Bools

    @classmethod
    def of(cls, recording: Recording, vehicle: Vehicle) -> _Course | None:
        """None where a torque or a wheel speed is missing, or the log is short."""
        radii, channels, time = vehicle.driven_radii, recording.channels, recording.time
        names = [f"{quantity}_{w}" for w in radii for quantity in ("drive_torque", "wheel_speed")]
        if not radii or not all(np.isfinite(channels.get(name, np.nan)).sum() > 1 for name in names):
            return None
        found = points_of(time)
        if found is None:
            return None
        points, step = found

        def at(values: Floats) -> Floats:
            return np.interp(points, time, values)

        def known(name: str) -> Floats:
            return filled(time, channels[name])

        thrusts = [known(f"drive_torque_{w}") / radius for w, radius in radii.items()]
        thrust = at(np.sum(thrusts, axis=0)) / vehicle.mass
        rim = at(np.mean([radius * known(f"wheel_speed_{w}") for w, radius in radii.items()], axis=0))
        force = np.gradient(smooth(rim, CALM, step), step)
        if np.isfinite(channels.get("drawbar_force", np.nan)).sum() > 1:
            force = force + at(known("drawbar_force")) / vehicle.mass
        moving = rim > _MOVING * quantile(rim, 0.95)
        return cls(step, quick(thrust, step), quick(force, step), moving)

    def lag(self) -> tuple[float, float, float]:
        """The lag of the thrust [s], the correlation there, and without a lag."""
        a, b = np.where(self.moving, self.thrust, 0.0), np.where(self.moving, self.force, 0.0)
        return lag_of(a, b, self.step, _WITHIN)


def _lag_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    course = _Course.of(recording, vehicle)
    if course is None:
        return []
    seconds, alike, without = course.lag()
    towing = "drawbar_force" in recording.channels
    least = max(_LAG if towing else _UNSEEN_LAG, 2 * course.step)
    if (
        abs(seconds) <= least
        or alike < _ALIKE
        or alike - without < _BETTER
        or abs(seconds) >= _WITHIN - course.step
    ):
        return []
    side, by = (
        ("behind", "the torques are")
        if seconds > 0
        else ("ahead of", f"{'these' if towing else 'the speeds'} are")
    )
    what = "drawbar force and wheel speeds" if towing else "the wheel speeds"
    unseen = (
        ""
        if towing
        else " A tool's pull that is not logged, and that a slow speed control answers, looks the same."
    )
    return [
        f"The drive torques are {abs(seconds):.2f} s {side} {what}, judged by the force that these require (correlation {alike:.2f}, "
        f"{without:.2f} unshifted): if {by} late, write 'delay: {abs(seconds):.2f} s' for it in a profile.{unseen}"
    ]
