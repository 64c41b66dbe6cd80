"""The left and the right wheel of an axle compared: sentences for the user, never errors.

Straight ahead both roll alike and, within the accuracy of sensors and ground, need like torques, as the wheels of the other axles do. In a
turn the wheel that the drive makes faster than its hub pulls, and the slower one brakes: a torque follows its own wheel's slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.once import once
from terragrip.recording.ranks import quantile
from terragrip.recording.turns import (
    LEAST_TURN,
    WINDOW,
    are_known,
    filled,
    filled_channel,
    rim_speed,
    windows,
)
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle


_LEAST = 15  # windows of 2 s
_DRIVING = 0.3  # of the speed that a twentieth of the windows exceed
# Of the pace: wheels that leave a slower ground behind spin as their drive lets them, each by itself.
_SPUN = 0.5
_STRAIGHT = 0.03  # of the speed: the hubs' difference by the turn
_ROLL = 0.05  # of a rim's speed: radii of one axle's tyres differ by 2 %
_APART = 0.1  # the same, where only other axles show that it is straight: the furrow wheel of a plough slips .1 less
_PULLING = 0.1  # of an axle's load: torques that are compared
_UNEVEN = 0.22  # the logarithm of 1.25: uncalibrated torques of a wheel are 5 % off, two of them 7
_STEEPEST = 2.5  # m/s² sideways: machines hardly work across more than 15 degrees
_STEADY = 0.15  # quartiles of such a logarithm
_TOGETHER = 0.95  # correlation of an axle's pulls: what they do not share is 5 % of their ratio
_OPPOSED = 0.7  # correlation, of the other sign
_DECIDES = 0.5  # of a torque's standard deviation over windows
_HARD = 0.05  # of a wheel's load: mean torques of a sign
_TURNING = 0.03  # the same, in turns: sides that are driven against each other (of 185 right axles of development none correlates below
# -.63, and 16 of the 56 that turn so hard above .7, none between)


def side_warnings(recording: Recording, vehicle: Vehicle, turn: Floats | None) -> tuple[list[str], list[str]]:
    """Sentences on wheels of a wrong radius, and on torques of a wrong sign or scale. ``turn`` (n,) [rad/s], left positive: by a
    sensor.

    Without one the vehicle drives straight ahead where the rims of all axles agree; a difference on a single axle is then checked where the
    others agree.
    """
    drive = Drive.of(recording, vehicle, np.zeros(len(recording)) if turn is None else turn)
    if drive is None:
        return [], []
    straight = drive.straight
    if turn is None:
        rolling = _rolling_apart(drive.axles, straight, drive.level)
        straight &= np.all(drive.level, axis=0)
    else:
        rolling = [note for axle in drive.axles for note in _rolling(axle, straight, _ROLL)]
    opposed = [note for axle in drive.axles for note in _opposed(axle, straight)]
    return rolling, [] if rolling else opposed or _uneven(drive, straight, recording, vehicle)


def exchanged_torques(recording: Recording, vehicle: Vehicle, turn: Floats | None) -> list[str]:
    """Torques that oppose their wheels' slip in turns, on a vehicle whose sides are driven against each other there.

    Other errors of speeds, torques and yaw rate look the same: use this only where no other was found.
    """
    drive = None if turn is None else Drive.of(recording, vehicle, turn)
    if drive is None:
        return []
    odd = [
        "drive_torque_{} and drive_torque_{}".format(*axle.wheels)
        for axle in drive.axles
        if drive.contradicts(axle)
    ]
    if not odd:
        return []
    return [
        f"{', '.join(odd)} (or these wheels' speeds) may be exchanged: in turns the wheel that is faster than its hub would brake and the "
        "slower one pull. Check the wheel of each column."
    ]


@dataclass(frozen=True)
class Axle:
    """Window means of an axle's outer wheels (2, n), left and right: ``rims`` [m/s] and ``pulls`` [N], the latter None without torques."""

    name: str
    wheels: tuple[str, str]
    load: float
    rims: Floats
    pulls: Floats | None


@dataclass(frozen=True)
class Drive:
    """Axles in windows (n,) with the middles ``when`` [s]: their mean ``pace`` and the difference of their ``hubs`` in turns [m/s],
    whether they are ``driving`` and do not spin, and the sum of all turns (``turned``) [rad]."""

    axles: tuple[Axle, ...]
    when: Floats
    pace: Floats
    hubs: Floats
    driving: Bools
    turned: float

    @classmethod
    def of(cls, recording: Recording, vehicle: Vehicle, turn: Floats) -> Drive | None:
        """None without a track, axles of two sides, or enough windows."""
        if not vehicle.track or np.any(np.diff(recording.time) < 0):
            return None
        axles, when, shown = _axles(recording, vehicle, turn)
        if not axles or len(shown) < _LEAST:
            return None
        pace = np.abs(np.mean([axle.rims for axle in axles], axis=(0, 1)))
        turned = WINDOW * float(np.abs(shown).sum())
        driving = pace > _DRIVING * quantile(pace, 0.95)
        if "ground_speed" in recording.channels:
            ground = filled(recording.time, np.abs(recording.channels["ground_speed"]))
            driving &= ~(np.interp(when, recording.time, ground) < _SPUN * pace)
        return cls(tuple(axles), when, pace, vehicle.track * shown, driving, turned)

    @property
    def straight(self) -> Bools:
        """Windows (n,) of driving straight ahead, by the turn."""
        return self.driving & (np.abs(self.hubs) < _STRAIGHT * self.pace)

    @property
    def level(self) -> list[Bools]:
        """Of each axle, the windows (n,) in which its rims agree: where no sensor shows a turn, all of them do straight ahead."""
        return [np.abs(np.diff(axle.rims, axis=0)[0]) < _STRAIGHT * self.pace for axle in self.axles]

    def contradicts(self, axle: Axle) -> bool:
        """Whether an axle's torques, apart from the part due to pace and pull, oppose the slips from side to side."""
        rows = self.driving
        if axle.pulls is None or rows.sum() < _LEAST or self.turned < LEAST_TURN:
            return False
        common = np.column_stack([np.ones(rows.sum()), self.pace[rows], axle.pulls.sum(axis=0)[rows]])
        pair = np.column_stack([np.diff(axle.rims, axis=0)[0] - self.hubs, np.diff(axle.pulls, axis=0)[0]])[
            rows
        ]
        slip, pull = (pair - common @ np.linalg.lstsq(common, pair, rcond=None)[0]).T
        size, hard = float(np.sqrt(np.mean(slip**2) * np.mean(pull**2))), float(np.sqrt(np.mean(pull**2)))
        return hard > _TURNING * axle.load / 2 and float(np.mean(slip * pull)) < -_OPPOSED * size


@once
def _axles(recording: Recording, vehicle: Vehicle, turn: Floats) -> tuple[list[Axle], Floats, Floats]:
    """Axles of two sides with both speeds known, time, and the turn, as means over the windows that have them all."""
    radius = vehicle.radii
    rows: list[Floats] = [recording.time, turn]
    found: list[tuple[str, tuple[str, str], float, int, bool]] = []
    for name, axle in vehicle.axles.items():
        sides = (axle.wheels[0], axle.wheels[-1])
        if len(axle.wheels) < 2 or not are_known(recording, *(f"wheel_speed_{w}" for w in sides)):
            continue
        powered = are_known(recording, *(f"drive_torque_{w}" for w in sides))
        found.append((name, sides, axle.mass * STANDARD_GRAVITY, len(rows), powered))
        rows += [rim_speed(recording, vehicle, w) for w in sides]
        rows += [filled_channel(recording, f"drive_torque_{w}") / radius[w] for w in sides] if powered else []
    means = windows(recording.time, np.array(rows))
    axles = [
        Axle(name, sides, load, means[at : at + 2], means[at + 2 : at + 4] if powered else None)
        for name, sides, load, at, powered in found
    ]
    return axles, means[0], means[1]


def _rolling_apart(axles: tuple[Axle, ...], driving: Bools, level: list[Bools]) -> list[str]:
    """Rims of one axle with different speeds where all others' are alike (``level``), where nothing else shows the turn."""
    if len(axles) < 2:
        return []
    notes = []
    for k, axle in enumerate(axles):
        others = np.all([rows for j, rows in enumerate(level) if j != k], axis=0)
        notes += _rolling(axle, driving & others, _APART)
    return notes if len(notes) == 1 else []


def _rolling(axle: Axle, straight: Bools, least: float) -> list[str]:
    """Rims with speeds straight ahead that differ by the logarithm ``least`` or more."""
    left, right = axle.rims[:, straight]
    if straight.sum() < _LEAST or (right == 0).any():
        return []
    low, ratio, high = np.quantile(left / right, [0.25, 0.5, 0.75])
    if abs(np.log(max(ratio, 1e-9))) < least or low < 1 < high:
        return []
    # A wheel that spins, or an axle that stands: a scale is one number.
    if low <= 0 or np.log(high / low) > _STEADY:
        return []
    if axle.pulls is not None:  # a furrow wheel slips less, but only where the axle pulls
        light = straight & (np.abs(axle.pulls.sum(axis=0)) < _PULLING * axle.load)
        rolls = (
            np.quantile(axle.rims[0, light] / axle.rims[1, light], 0.5) if light.sum() >= _LEAST else ratio
        )
        if abs(np.log(max(rolls, 1e-9))) < least:
            return []
    a, b = axle.wheels
    return [
        f"Straight ahead the rim of {a} goes {ratio:.2f} times as fast as that of {b}: check the scale of wheel_speed_{a} and "
        f"wheel_speed_{b} (ticks per turn, gear ratio), and both radii."
    ]


def _opposed(axle: Axle, straight: Bools) -> list[str]:
    """Torques that rise on one side where they fall on the other, straight ahead."""
    if axle.pulls is None or straight.sum() < _LEAST:
        return []
    left, right = axle.pulls[:, straight]
    means = axle.pulls[:, straight].mean(axis=1)
    # Offsets of a free axle have signs, too.
    if np.abs(means).max() < _HARD * axle.load / 2 or not (
        are_opposed(left, right) and one_pulls(left, right)
    ):
        return []
    return [opposed_note(axle.wheels[int(np.argmin(means))])]


def are_opposed(left: Floats, right: Floats) -> bool:
    """Whether of two wheels' torques (n,) one falls where the other rises, with means of unlike sign."""
    if not np.ptp(left) or not np.ptp(right) or left.mean() * right.mean() > 0:
        return False
    return float(np.corrcoef(left, right)[0, 1]) <= -_OPPOSED


def one_pulls(left: Floats, right: Floats) -> bool:
    """Whether the means of two such torques (n,) are large enough beside their changes to say which wheel pulls: hills, and a drive
    that brakes as much as it pulls, give small means of either sign."""
    return bool(min(abs(left.mean()), abs(right.mean())) > _DECIDES * max(left.std(), right.std()))


def opposed_note(wheel: str) -> WrongSign:
    """The sentence on the wheel whose torque is of the opposite sign."""
    shown = "falls where that of the axle's other wheel rises, straight ahead"
    return WrongSign.of([f"drive_torque_{wheel}"], shown, "forward is")


def _share(axle: Axle, pulls: Floats, straight: Bools) -> float | None:
    """The logarithm of an axle's left pull over its right one, None where it is not steady.

    Where it pulls little an offset of a torque would count as much as its scale: there, of the pulls' changes.
    """
    rows = straight & (pulls.min(axis=0) > 0) & (pulls.sum(axis=0) > _PULLING * axle.load)
    if rows.sum() >= _LEAST:
        low, share, high = np.quantile(np.log(pulls[0, rows] / pulls[1, rows]), [0.25, 0.5, 0.75])
        return float(share) if high - low < _STEADY else None
    own = pulls[:, straight]
    if straight.sum() < _LEAST or not np.ptp(own, axis=1).all():
        return None
    return (
        float(np.log(np.std(own[0]) / np.std(own[1])))
        if np.corrcoef(own[0], own[1])[0, 1] > _TOGETHER
        else None
    )


def _uneven(drive: Drive, straight: Bools, recording: Recording, vehicle: Vehicle) -> list[str]:
    """An axle with one torque steadily larger than the other straight ahead, where the other axles' are alike, and no slope across which
    the vehicle drives makes it so."""
    shares: dict[str, float] = {}
    for axle in drive.axles:
        share = None if axle.pulls is None else _share(axle, axle.pulls, straight)
        if share is not None:
            shares[axle.name] = share
    notes = []
    for axle in drive.axles:
        share, others = shares.get(axle.name), [other for key, other in shares.items() if key != axle.name]
        if (
            share is None
            or not others
            or min(abs(share), np.abs(share - np.array(others)).min()) < _UNEVEN
            or max(map(abs, others)) > _UNEVEN / 2
            or _leaning(drive.when[straight], shares, axle.name, recording, vehicle)
        ):
            continue
        a, b = axle.wheels
        notes.append(
            f"Straight ahead drive_torque_{a} is {np.exp(share):.2f} times drive_torque_{b}, and other axles' torques are alike: check the "
            "scale of both; 'terragrip calibrate' finds their gains."
        )
    return notes


def _leaning(
    when: Floats, shares: dict[str, float], name: str, recording: Recording, vehicle: Vehicle
) -> bool:
    """Whether a slope across shifts as much load as the torques of the axle ``name`` differ by: by roll or accelerometer at the instants
    ``when`` (n,) [s], else one at which all axles' torques are in proportion to their loads (one that pivots leans less)."""
    level, leaning = vehicle.wheel_shares
    lost = dict(zip(vehicle.wheels, (leaning / level).tolist(), strict=True))
    channels, time = recording.channels, recording.time
    if "roll" in channels:
        sideways = STANDARD_GRAVITY * np.sin(np.interp(when, time, filled(time, channels["roll"])))
    elif "acceleration_y" in channels:
        sideways = np.interp(when, time, filled(time, channels["acceleration_y"]))
    else:
        sideways = np.full(1, np.nan)
    known = float(np.mean(sideways))
    tried = np.linspace(-_STEEPEST, _STEEPEST, 51) if np.isnan(known) else np.array([known])
    compared = shares if np.isnan(known) else {name: shares[name]}
    off = [
        share + 2 * np.arctanh(np.clip(lost[vehicle.axles[axle].wheels[0]] * tried, -0.9, 0.9))
        for axle, share in compared.items()
    ]
    return bool((np.abs(off).max(axis=0) < _UNEVEN / 2).any())
