"""Motion from a recording's positions: speed over ground, rate of turn, grade."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.physics.geodesy import metres_of
from terragrip.recording.ranks import median, quantile
from terragrip.recording.stretches import without_pauses
from terragrip.recording.window_means import averaged

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


WINDOW = 2.0
"""Length [s] of the stretch to which a parabola is fitted; five fixes at least. Longer: less noise, and turns rounded off."""

_SLOWEST = 0.3  # m/s: slower, a course is noise
_VAGUE_TURN = 0.03  # rad/s, and
_VAGUE_GRADE = 0.02  # rad: SDs above which no value is given
_GRADE_WAY = 16.0  # m
_FEWEST = 10  # fixes
_JUMP = 1.0  # m, or what is driven from fix to fix at the speed that a twentieth of the drive exceeds,
_FAST = 0.95
_OFF = 5.0  # times what half of the steps are off at least, or
_LONGER = 8.0  # times what half of them change in length: a receiver that takes another correction
_PAUSE = 1e4  # s: a fit across more, where a clock was set, has no solution
_DENSE = 40
"""Fixes a window: denser ones, as of positions interpolated to the rate of the wheels, count as their means."""
_BLOCK = 200_000
"""Numbers of windows at once: the hour of a logger that counts minutes for seconds has windows of 2400 fixes, gigabytes together."""


@dataclass(frozen=True)
class Track:
    """At each fix: ``time`` (n,) [s], ``north`` and ``east`` (n,) [m], ``speed`` (n,) [m/s], ``turn`` (n,) [rad/s, to the left] and
    ``grade`` (n,) [rad, uphill], from ``altitude`` (n,) [m]; ``gap`` (n,): whether fixes are missing or jump there; ``jumps`` (k,) [s].

    ``turn`` and ``grade`` are NaN where the vehicle hardly moves, or the positions are too noisy; ``grade`` too without altitude.
    """

    time: Floats
    north: Floats
    east: Floats
    speed: Floats
    turn: Floats
    altitude: Floats
    gap: Bools
    jumps: Floats = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def grade(self) -> Floats:
        """Grade (n,) [rad, uphill]; slower than all the rest, and seldom needed."""
        found = _grade(self.time, self.speed, self.altitude)
        found[(self.speed < _SLOWEST) | self.gap] = np.nan
        return found

    def at(self, name: str, time: Floats) -> Floats:
        """A column at other instants (m,), NaN further from a fix than the window is long; ``turn`` also where the vehicle hardly moves: it
        may turn on the spot, which its positions do not show."""
        values = getattr(self, name)
        known = np.isfinite(values)
        if known.sum() < 2:
            return np.full(len(time), np.nan)
        when = self.time[known]
        result = np.interp(time, when, values[known])
        place = np.clip(np.searchsorted(when, time), 1, len(when) - 1)
        far = np.minimum(np.abs(time - when[place - 1]), np.abs(time - when[place])) > WINDOW
        if name == "turn":
            place = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
            far |= np.minimum(self.speed[place - 1], self.speed[place]) < _SLOWEST
        return np.where(far, np.nan, result)


def track_of(recording: Recording, window: float = WINDOW) -> Track | None:
    """Motion by the positions, None if there are too few.

    Positions that repeat are no fixes. Over each five fixes or more a parabola is fitted by least squares (Savitzky and Golay 1964, for
    uneven steps). Its derivatives at the middle give speed and turn: (x' y'' - y' x'')/v², which a reversing vehicle does not change.
    """
    channels = recording.channels
    if "latitude" not in channels or "longitude" not in channels:
        return None
    north, east = metres_of(channels["latitude"], channels["longitude"])
    rows = np.flatnonzero(np.isfinite(north) & np.isfinite(east))
    if len(rows) < 2:
        return None
    rows = rows[np.r_[True, (np.diff(north[rows]) != 0) | (np.diff(east[rows]) != 0)]]
    fresh = replace(
        recording, time=recording.time[rows], channels={"north": north[rows], "east": east[rows]}, labels={}
    )
    means = averaged(fresh, window / _DENSE)
    time, north, east, fixes = means.time, means.channels["north"], means.channels["east"], len(means)
    if fixes < _FEWEST:
        return None
    span = max(5, int(window / max(median(np.diff(time)), 1e-6)) | 1)
    if fixes < span:
        return None
    half = span // 2
    middle = slice(half, fixes - half)
    near = without_pauses(time, _PAUSE)
    fits = [_fitted(near, x, np.arange(half, fixes - half), span, 2) for x in (north, east)]
    (_, vn, an), (_, ve, ae) = (result.T for result, _ in fits)
    an, ae, bent = 2 * an, 2 * ae, 2 * np.hypot(fits[0][1][:, 2], fits[1][1][:, 2]) / np.sqrt(2)
    speed = np.hypot(vn, ve)
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = (ve * an - vn * ae) / speed**2  # x east, y north: to the left is positive
    reach = (time[2 * half :] - time[middle]) - (time[: fixes - 2 * half] - time[middle])
    jumps = _jumps(time, north, east)
    gap = (reach > 3 * max(window, median(reach))) | (jumps[2 * half :] > jumps[: fixes - 2 * half])
    turn[(speed < _SLOWEST) | gap | ~(bent < _VAGUE_TURN * speed)] = np.nan
    altitude = _altitude(recording, time[middle])
    where = time[1:][np.diff(jumps) > 0]
    return Track(time[middle], north[middle], east[middle], speed, turn, altitude, gap, where)


def _jumps(time: Floats, north: Floats, east: Floats) -> Ints:
    """How many jumps there were up to each fix (n,): steps far off the mean of those two before and two behind, ahead or aside, or far
    longer than these (which starts and turns between slow fixes hide less).

    No vehicle comes further off than it drives meanwhile: a robot at .6 m/s with 5 fixes a second jumps from .12 m on.
    """
    wait = np.diff(time)
    velocity = np.array([np.diff(north), np.diff(east)]) / wait
    around = np.pad(velocity, ((0, 0), (2, 2)), mode="edge")
    before, behind, speed = around[:, :-4], around[:, 4:], np.hypot(*velocity)
    off = wait * np.hypot(*(velocity - (before + behind) / 2))
    beside = np.pad(off, 2)  # of the steps that one jump puts off it is that of the largest
    jumps = off > np.minimum(_JUMP, quantile(speed, _FAST) * wait) + _OFF * median(off)
    jumps &= off > np.maximum(beside[:-4], beside[4:])
    longer = wait * (speed - np.maximum(np.hypot(*before), np.hypot(*behind)))
    jumps |= longer > _JUMP + _LONGER * median(np.abs(np.diff(speed * wait)))
    return np.r_[0, np.cumsum(jumps)]


def _altitude(recording: Recording, time: Floats) -> Floats:
    """Altitude [m] at instants (n,), NaN without any."""
    altitude = recording.channels.get("altitude")
    if altitude is None or np.isfinite(altitude).sum() < 2:
        return np.full(len(time), np.nan)
    known = np.isfinite(altitude)
    return np.interp(time, recording.time[known], altitude[known])


def _fitted(at: Floats, values: Floats, rows: Ints, span: int, degree: int) -> tuple[Floats, Floats]:
    """Coefficients (n, 1 + degree) of polynomials through the `span` samples around each of rows (n,), about that sample, and their SDs
    from the scatter of all."""
    parts = [
        _moments_solved(_around(at, some, span), _around(values, some, span), degree)
        for some in np.array_split(rows, -(-len(rows) * span // _BLOCK))
    ]
    result, variance, square, scale = (np.concatenate(each) for each in zip(*parts, strict=True))
    spread = np.sqrt(median(square) * variance)
    return np.asarray(result / scale), np.asarray(spread / scale)


def _around(values: Floats, rows: Ints, span: int) -> Floats:
    """The `span` values around each of rows (n,), less the one there: (n, span)."""
    shown = np.lib.stride_tricks.sliding_window_view(values, span)
    return np.asarray(shown[rows - span // 2] - values[rows, None])


def _moments_solved(ago: Floats, values: Floats, degree: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Of polynomials through rows of (n, k), in units of scale (n, 1 + degree): coefficients, their variances for an error of 1, the mean
    square of what is left (n,), and scale."""
    size = np.maximum(np.abs(ago).max(axis=1, keepdims=True), 1e-9)
    place, powers = np.arange(degree + 1), [np.ones_like(ago)]
    for _ in range(2 * degree):
        powers.append(powers[-1] * (ago / size))
    moments = np.stack([power.sum(axis=1) for power in powers], axis=1)
    normal = moments[:, place[:, None] + place]
    right = np.stack([np.sum(powers[k] * values, axis=1) for k in place], axis=1)
    result = np.linalg.solve(normal, right[..., None])[..., 0]
    freedom = ago.shape[1] - degree - 1
    left = values - sum(result[:, k, None] * powers[k] for k in place)
    square = np.sum(left**2, axis=1) / freedom
    return result, np.diagonal(np.linalg.inv(normal), axis1=1, axis2=2), square, size**place


def _grade(time: Floats, speed: Floats, height: Floats) -> Floats:
    """Grade (n,) [rad]: cubics through the altitude over `_GRADE_WAY` metres, which do not flatten hills as straight lines do."""
    unknown = np.full(len(time), np.nan)
    if np.isnan(height).all() or not (speed[1:] > _SLOWEST).any():
        return unknown
    way = np.r_[0.0, np.cumsum(np.diff(time) * (speed[1:] + speed[:-1]) / 2)]
    step = median(np.diff(way)[speed[1:] > _SLOWEST])
    span = max(7, int(_GRADE_WAY / max(step, 1e-6)) | 1)
    if len(way) < span:
        return unknown
    half = span // 2
    rows = np.arange(half, len(way) - half)
    behind, ahead = way[rows] - way[rows - half], way[rows + half] - way[rows]
    rows = rows[np.minimum(behind, ahead) > _GRADE_WAY / 4]  # else the vehicle stood, and altitude drifted
    if not rows.size:
        return unknown
    rise, spread = _fitted(way, height, rows, span, 3)
    unknown[rows] = np.where(spread[:, 1] < _VAGUE_GRADE, np.arctan(rise[:, 1]), np.nan)
    return unknown
