"""A force whose zero moves, or whose signal goes, in the middle of a drive: sentences for the user, never errors.

The wheels' thrust Σ M/r less the drawbar force is the mass times dv/dt + g sin(pitch), plus a resistance (physics.md 1), at each instant:
a force that truly leaps moves the vehicle, or another force answers. One that leaps from a sample to the next and stays, and whose whole
leap the balance is left with, was not there. Pitch and accelerometer are not judged so: where a bump ends they leap as well, and a
filtered pitch is off by as much for seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import known_part, quantum
from terragrip.recording.noise import MAD_TO_SD
from terragrip.recording.pulls import PULL
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import unit_of
from terragrip.recording.stretches import DRIVING, LONG, gaps
from terragrip.recording.turns import are_known, filled, filled_channel
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import moment

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_SLOWEST = 0.15  # s between samples, 10 Hz with jitter: within more a speed control answers, and soil changes under the wheels
_SURE = 5.0  # standard deviations of its steps: no sample of a log leaps so far by chance
_LEAST = 0.05  # of the weight, or `PULL` beyond twice the next: leaps of right logs were .038 and 1.6 times at most (six on 156 drives)
_BEYOND = 3.0  # standard deviations of what the balance is left with all the time, as soil and hills change
_STEPS = 1.5  # of a channel's resolution: one step of it is no leap
_HALF = 0.5  # of it, at least, is between two samples
_REST = 0.25  # of it, at most, is answered, or gone again
_SLIPS = 1.5  # standard deviations by which slip goes with it: one of 15 moved zeros is not named for it
_SOON = 1.0  # s before and after: a tool's pull, or a start into other soil, leaps in part and is answered while it still changes


@dataclass(frozen=True)
class _Drive:
    """Instants (n,) halfway between rows, and which of them have `LONG` of driving one way on both sides."""

    time: Floats
    middle: Floats
    inside: Bools
    speed: Floats

    def shift(self, values: Floats, span: float = LONG) -> Floats:
        """The mean of a channel (n + 1,) over ``span`` [s] after each instant less that before it."""
        steps = np.diff(self.time)
        area = np.r_[0.0, np.cumsum(steps * (values[1:] + values[:-1]) / 2)]
        return self._bend(area, span)

    def unmoved(self, force: Floats, span: float = LONG) -> Floats:
        """The same of a force (n + 1,) over the mass, less the change of ground speed."""
        return self.shift(force, span) - self._bend(self.speed, span)

    def _bend(self, values: Floats, span: float) -> Floats:
        """The slope of values (n + 1,) over ``span`` after each instant less that before it."""
        at = [np.interp(self.middle + k * span, self.time, values) for k in (-1, 0, 1)]
        return np.asarray((at[2] - 2 * at[1] + at[0]) / span)


def leap_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on each force, or torques at once, whose leap nothing in the balance of forces answers."""
    channels, radii = recording.channels, vehicle.driven_radii
    drive = _drive_of(recording)
    if drive is None or not radii or not all(f"drive_torque_{wheel}" in channels for wheel in radii):
        return []
    parts = {
        f"drive_torque_{wheel}": channels[f"drive_torque_{wheel}"] / radius / vehicle.mass
        for wheel, radius in radii.items()
    }
    if "drawbar_force" in channels:
        parts["drawbar_force"] = -channels["drawbar_force"] / vehicle.mass
    climb = STANDARD_GRAVITY * np.sin(channels["pitch"]) if "pitch" in channels else np.zeros(len(recording))
    axles = [[f"drive_torque_{w}" for w in axle.wheels if w in radii] for axle in vehicle.axles.values()]
    return _unanswered(recording, drive, parts, climb, axles, _slip(recording, drive, radii))


def _slip(recording: Recording, drive: _Drive, radii: dict[str, float]) -> Floats:
    """The driven wheels' mean slip (n,), as far as rims and ground speed show it; 0 where a rim is in no channel."""
    names = [f"wheel_speed_{wheel}" for wheel in radii]
    if not are_known(recording, *names):
        return np.zeros(len(recording))
    rims = [filled_channel(recording, n) * r for n, r in zip(names, radii.values(), strict=True)]
    rim = np.mean(rims, axis=0)
    faster = np.where(np.abs(rim) < np.abs(drive.speed), drive.speed, rim)
    return np.asarray(1.0 - drive.speed / np.where(faster == 0.0, 1.0, faster) * (faster != 0.0), np.float64)


def _drive_of(recording: Recording) -> _Drive | None:
    time, ground = recording.time, recording.channels.get("ground_speed")
    if ground is None or np.isfinite(ground).sum() < 2 or not np.all(np.diff(time) > 0):
        return None
    if time[-1] - time[0] < 2 * LONG or median(np.diff(time)) > _SLOWEST:
        return None
    speed = filled_channel(recording, "ground_speed")
    middle = (time[1:] + time[:-1]) / 2
    least = DRIVING * quantile(np.abs(speed), 0.95)
    stops = np.r_[
        0,
        np.cumsum(
            (np.abs(speed) < least) | np.r_[False, np.diff(np.sign(speed)) != 0] | np.r_[False, gaps(time)]
        ),
    ]
    first, last = np.searchsorted(time, middle - LONG), np.searchsorted(time, middle + LONG)
    inside = (middle - LONG > time[0]) & (middle + LONG < time[-1]) & (stops[last] == stops[first])
    return _Drive(time, middle, inside, speed) if inside.any() else None


def _unanswered(
    recording: Recording,
    drive: _Drive,
    parts: dict[str, Floats],
    climb: Floats,
    axles: list[list[str]],
    slip: Floats,
) -> list[str]:
    """Sentences on the leaps of ``parts`` (n,) [m/s²] of the balance that it is left with; ``axles``: the torques of each."""
    if any(np.isfinite(part).sum() < 2 for part in (*parts.values(), climb)):
        return []
    leaps = {name: _leaps(drive, part) for name, part in parts.items()}
    most = np.sum(np.abs(list(leaps.values())), axis=0)
    if not (most[drive.inside] > min(_LEAST, PULL) * STANDARD_GRAVITY).any():  # of most logs
        return []
    force = np.sum([filled(drive.time, part) for part in parts.values()], axis=0) - filled(drive.time, climb)
    left = drive.unmoved(force)
    spread = MAD_TO_SD * median(np.abs(left[drive.inside]))
    least = min(
        max(_LEAST * STANDARD_GRAVITY, _BEYOND * spread), max(PULL * STANDARD_GRAVITY, 2 * _BEYOND * spread)
    )
    for name, others in ((name, [o for o in axle if o != name]) for axle in axles for name in axle):
        alone = (leaps[name] != 0) & ~np.any([leaps[other] for other in others], axis=0)
        if others and alone.any():  # one that the axle's other wheel follows is the ground's
            beside = np.mean([filled(drive.time, parts[other]) for other in others], axis=0)
            apart = drive.shift(filled(drive.time, parts[name]) - beside)
            leaps[name][alone & (np.abs(apart - leaps[name]) > _HALF * np.abs(leaps[name]))] = 0.0
    leap = np.sum(list(leaps.values()), axis=0)
    rows = drive.inside & (np.abs(leap) > least) & (np.abs(left - leap) < _REST * np.abs(leap))
    rows &= np.abs(drive.unmoved(force, _SOON) - leap) < _HALF * np.abs(leap)
    # A tool that comes in or out leaps, and the drive answers by a leap a little later.
    total, first = np.r_[0.0, np.cumsum(leap)], np.searchsorted(drive.middle, drive.middle - _SOON)
    rows &= np.abs(
        total[np.searchsorted(drive.middle, drive.middle + _SOON)] - total[first] - leap
    ) < _HALF * np.abs(leap)
    # Wheels that slip less as they push less push less: the ground resists less from one metre to the next.
    turned = drive.shift(slip)
    known = MAD_TO_SD * median(np.abs(turned[drive.inside]))
    rows &= ~(turned * leap > _SLIPS * known * np.abs(leap))
    found: dict[tuple[str, ...], list[int]] = {}
    for k in np.flatnonzero(rows):
        found.setdefault(tuple(name for name in parts if leaps[name][k]), []).append(int(k))
    return [_sentence(recording, drive, names, instants) for names, instants in found.items()]


def _leaps(drive: _Drive, part: Floats) -> Floats:
    """By how much a channel (n + 1,) leaps from a sample to the next at each instant (n,), by the medians of three samples before and
    after; 0: no more than it does all the time."""
    when, what = known_part(drive.time, part)
    steps, result = np.diff(what), np.zeros(len(drive.middle))
    updates = np.diff(when[1:][steps != 0.0])
    # Held between values that are too far apart.
    if len(what) < 6 or not len(updates) or median(updates) > _SLOWEST:
        return result
    low, high = np.minimum(what[:-2], what[1:-1]), np.maximum(what[:-2], what[1:-1])
    calm = np.maximum(low, np.minimum(high, what[2:]))  # the median of three
    leaps = calm[3:] - calm[:-3]
    rows = (np.abs(leaps) > _SURE * MAD_TO_SD * median(np.abs(leaps))) & (np.diff(when)[2:-2] <= _SLOWEST)
    rows &= np.abs(steps[2:-2] - leaps) < _HALF * np.abs(leaps)
    if rows.any():
        rows &= np.abs(leaps) > _STEPS * quantum(what)
    # On rough ground, or pulling hard, a wheel's torque leaps more than in the rest of the drive.
    at = when[3:-2]
    for k in np.flatnonzero(rows):
        first, last = np.searchsorted(at, (at[k] - LONG, at[k] + LONG))
        rows[k] = np.abs(leaps[k]) > _SURE * MAD_TO_SD * median(np.abs(leaps[first:last]))
    result[np.searchsorted(drive.time, at[rows]) - 1] = leaps[rows]
    return result


def _sentence(recording: Recording, drive: _Drive, names: tuple[str, ...], instants: list[int]) -> str:
    k, times = instants[0], len(instants) - 1
    values = [filled_channel(recording, name) for name in names]
    to = ", ".join(f"from {value[k]:.3g} to {value[k + 1]:.3g}" for value in values)
    leap, stay, their = ("leap", "stay", "their") if len(names) > 1 else ("leaps", "stays", "its")
    return (
        f"{', '.join(names)} {leap} {to} {unit_of(names[0])} at {moment(drive.middle[k])} s"
        + (f", and {times} times more," if times else "")
        + f" and {stay} there, while neither the motion nor another force answers: {their} zero moved, or the signal was lost. Estimates "
        "are wrong by it before or after: correct these cells, or leave them empty."
    )
