"""The drive torques against the drawbar force and the motion: sentences for the user, never errors.

At every instant the wheels' thrust Σ M/r is the pull, the force that moves the mass, and a resistance (physics.md 1). So thrust follows
the sum of the first two at once; a lag is an error of a channel, and so is a thrust that no ground bears, or a pull of another unit.
Starts and stops distinguish the scales of all three (forces.py). Where a tool pulls unmeasured, the thrust follows an unknown force.

Converters that log the size of a current, and meters of power, have no sign. Where pull and motion show that the wheels must brake, thrust
of that size with the other sign closes the balance, and the logged one does not. Where noise, or a change of direction, takes a torque
through 0, one without a sign turns back there, as often in a narrow band beside 0 as in the next one, where a torque that is never negative
by nature hardly comes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.recording.courses import CALM, lag_of, points_of, quick, smooth
from terragrip.recording.mechanics import Fit, Means
from terragrip.recording.ranks import median, quantile
from terragrip.recording.turns import are_known, filled, filled_channel
from terragrip.recording.window_means import window_means, windows_of
from terragrip.recording.wrong_sign import WrongSign
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
_WINDOW = 1.0  # s, at least, and two samples of the ground speed
_MOVES = 0.15  # of the speed that a twentieth of the windows exceed
_WINDOWS = 20  # windows in motion
_STEADY = 0.1  # m/s²: a vehicle that slows down less than that does not brake
_BRAKES = 0.3  # m/s² of braking thrust over the mass: more than offset of torques and grade make
_FEWEST = 4  # such windows
_NEAR = 0.1  # of the smaller neighbour: a dip to 0, as often as to the band beside it
_DIPS = 12  # (right logs moved up until none is negative: 10)
_AS_HARD = 0.5  # of the braking thrust, with the other sign: a motor that is off while another brake works has none of it


def torque_warnings(recording: Recording, vehicle: Vehicle, means: Means | None) -> list[str]:
    """Sentences on torques of another scale than the pull, and on torques that are late or early."""
    return _scale_warnings(recording, vehicle, means) or _lag_warnings(recording, vehicle)


def _scale_warnings(recording: Recording, vehicle: Vehicle, means: Means | None) -> list[str]:
    if means is None or not means.thrusts:
        return []
    rest = means.thrust
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
        shown = f"{mean:.2g} times the weight on average, while the vehicle drives forward"
        names = [f"drive_torque_{wheel}" for wheel in vehicle.driven_radii]
        return [WrongSign.of(names, shown, "forward is", who="The drive torques over the wheel radius are")]
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


def _courses(recording: Recording, vehicle: Vehicle) -> tuple[Floats, Floats, float] | None:
    """Quick changes of the thrust, and of the pull plus the rims' accelerating force, over the mass (n,) [m/s²], 0 where the vehicle hardly
    moves, and the distance [s] of their points; None where a torque or a wheel speed is missing, or the log is short."""
    radii, time = vehicle.driven_radii, recording.time
    names = [f"{quantity}_{w}" for w in radii for quantity in ("drive_torque", "wheel_speed")]
    if not radii or not are_known(recording, *names):
        return None
    found = points_of(time)
    if found is None:
        return None
    points, step = found

    def at(values: Floats) -> Floats:
        return np.interp(points, time, values)

    def known(name: str) -> Floats:
        return filled_channel(recording, name)

    thrusts = [known(f"drive_torque_{w}") / radius for w, radius in radii.items()]
    thrust = at(np.sum(thrusts, axis=0)) / vehicle.mass
    rim = at(np.mean([radius * known(f"wheel_speed_{w}") for w, radius in radii.items()], axis=0))
    force = np.gradient(smooth(rim, CALM, step), step)
    if are_known(recording, "drawbar_force"):
        force = force + at(known("drawbar_force")) / vehicle.mass
    moving = rim > _MOVING * quantile(rim, 0.95)
    return np.where(moving, quick(thrust, step), 0.0), np.where(moving, quick(force, step), 0.0), step


def _lag_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    courses = _courses(recording, vehicle)
    if courses is None:
        return []
    thrust, force, step = courses
    seconds, alike, without = lag_of(thrust, force, step, _WITHIN)
    towing = "drawbar_force" in recording.channels
    least = max(_LAG if towing else _UNSEEN_LAG, 2 * step)
    if abs(seconds) <= least or alike < _ALIKE or alike - without < _BETTER or abs(seconds) >= _WITHIN - step:
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


def sign_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where no torque is ever below 0 and they turn back at 0, or the motion shows that the wheels braked, or drove backward, as
    hard as they pulled."""
    radii, channels = vehicle.driven_radii, recording.channels
    names = [f"drive_torque_{wheel}" for wheel in radii]
    ground = channels.get("ground_speed")
    if not names or ground is None or not all(name in channels for name in names):
        return []
    if min(float(np.nanmin(channels[name], initial=0.0)) for name in names) < 0.0:
        return []
    dips = np.sum([_dips(channels[name]) for name in names], axis=0)
    if dips[0] >= _DIPS and dips[0] > max(dips[1] / 2, dips[2]):
        return [
            f"{', '.join(names)} are never below 0, but {dips[0]} times they fall to 0 from one sample to the next and rise again as far: "
            "the torques have no sign. Log them with it (against the forward direction negative)."
        ]
    known = recording.time[np.isfinite(ground)]
    if len(known) < _WINDOWS or np.any(np.diff(recording.time) < 0):
        return []
    length = max(_WINDOW, 2 * median(np.diff(known)))
    place, starts = windows_of(recording.time, length)

    def mean(values: Floats) -> Floats:
        plain = window_means(filled(recording.time, values), place, len(starts))
        return np.r_[np.nan, (plain[:-2] + 2 * plain[1:-1] + plain[2:]) / 4, np.nan]

    speed = window_means(ground, place, len(starts))
    needed = np.r_[np.nan, (speed[2:] - speed[:-2]) / (2 * length), np.nan]
    slows = needed < -_STEADY
    if "drawbar_force" in channels:
        needed = needed + mean(channels["drawbar_force"]) / vehicle.mass
    if "pitch" in channels:
        needed = needed + STANDARD_GRAVITY * mean(np.sin(channels["pitch"]))
    thrust = np.sum([mean(channels[n]) / r for n, r in zip(names, radii.values(), strict=True)], axis=0)
    thrust = thrust / vehicle.mass
    rows = np.isfinite(thrust) & np.isfinite(needed)
    rows &= np.abs(np.nan_to_num(speed)) > _MOVES * float(np.nanquantile(np.abs(speed), 0.95))
    ahead = rows & (speed > 0) & ~slows
    if rows.sum() < _WINDOWS or not ahead.any():
        return []
    resistance = max(median((thrust - needed)[ahead]), 0.0)
    expected = needed + np.sign(np.nan_to_num(speed)) * resistance
    braking = rows & (expected < -_BRAKES)
    if braking.sum() < _FEWEST:
        return []
    share = -float(np.sum((thrust * expected)[braking]) / np.sum(expected[braking] ** 2))
    if share < _AS_HARD:
        return []
    when = float(braking.sum() * length)
    return [
        f"{', '.join(names)} are never below 0, but for {when:.3g} s the wheels brake or drive backward by the motion, as hard as these "
        "say that they pull: the torques have no sign. Log them with it (against the forward direction negative)."
    ]


def _dips(values: Floats) -> Ints:
    """How often a torque (n,) that is never negative dips between two samples to within `_NEAR` of 0, to as far beyond, and to 0 itself, as
    one does that is cut there."""
    known = values[np.isfinite(values)]
    known = known[np.flatnonzero(np.diff(known, prepend=np.nan))]  # each value once, however long it is held
    inner, least = known[1:-1], _NEAR * np.minimum(known[:-2], known[2:])
    return np.array(
        [
            np.sum((inner > 0) & (inner < least)),
            np.sum((inner >= least) & (inner < 2 * least)),
            np.sum(inner == 0),
        ]
    )
