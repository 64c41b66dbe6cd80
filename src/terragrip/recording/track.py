"""What a recording's positions tell of its motion: speed over ground, rate of turn, grade."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.physics.geodesy import metres_of

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

Floats = npt.NDArray[np.float64]

WINDOW = 2.0
"""Length [s] of the stretch that a parabola is laid through; five fixes at least."""

_SLOWEST = 0.3  # m/s: slower, a course is noise
_GRADE_WAY = 10.0  # m


@dataclass(frozen=True)
class Track:
    """At each fix: ``time`` (n,) [s], ``speed`` (n,) [m/s], ``turn`` (n,) [rad/s, to the left], ``grade`` (n,) [rad, uphill].

    ``turn`` and ``grade`` are NaN where the vehicle hardly moves; ``grade`` too where there is no altitude.
    """

    time: Floats
    speed: Floats
    turn: Floats
    grade: Floats

    def at(self, name: str, time: Floats) -> Floats:
        """A column at other instants (m,), NaN further from a fix than the window is long."""
        values = getattr(self, name)
        known = np.isfinite(values)
        if known.sum() < 2:
            return np.full(len(time), np.nan)
        when = self.time[known]
        found = np.interp(time, when, values[known])
        place = np.clip(np.searchsorted(when, time), 1, len(when) - 1)
        far = np.minimum(np.abs(time - when[place - 1]), np.abs(time - when[place])) > WINDOW
        return np.where(far, np.nan, found)


def track_of(recording: Recording) -> Track | None:
    """Motion by the positions, None without any to speak of.

    Positions that repeat are no fixes. Over each five fixes or more a parabola is fitted by least squares (Savitzky and Golay 1964, for
    uneven steps); its derivatives at the middle give speed and turn: (x' y'' - y' x'')/v², which a reversing vehicle does not change.
    """
    channels = recording.channels
    if "latitude" not in channels or "longitude" not in channels:
        return None
    north, east = metres_of(channels["latitude"], channels["longitude"])
    rows = np.flatnonzero(np.isfinite(north) & np.isfinite(east))
    if len(rows) < 2:
        return None
    fresh = np.r_[True, (np.diff(north[rows]) != 0) | (np.diff(east[rows]) != 0)]
    rows = rows[fresh]
    if len(rows) < 10:
        return None
    time, north, east = recording.time[rows], north[rows], east[rows]
    span = max(5, int(WINDOW / max(float(np.median(np.diff(time))), 1e-6)) | 1)
    if len(rows) < span:
        return None
    shown, half = np.lib.stride_tricks.sliding_window_view, span // 2
    middle = slice(half, len(rows) - half)
    ago = shown(time, span) - time[middle, None]
    (vn, an), (ve, ae) = (_parabola(ago, shown(x, span) - x[middle, None]) for x in (north, east))
    speed = np.hypot(vn, ve)
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = (ve * an - vn * ae) / speed**2  # x east, y north: to the left is positive
    slow = (speed < _SLOWEST) | (np.ptp(ago, axis=1) > 3 * max(WINDOW, float(np.median(np.ptp(ago, axis=1)))))
    turn[slow] = np.nan
    grade = _grade(recording, time[middle], speed)
    return Track(time[middle], speed, turn, np.where(slow, np.nan, grade))


def _parabola(ago: Floats, values: Floats) -> tuple[Floats, Floats]:
    """First and second derivative (n,) at 0 of parabolas through rows of (n, k)."""
    basis = np.stack([np.ones_like(ago), ago, ago**2 / 2], axis=2)
    normal = np.einsum("nki,nkj->nij", basis, basis)
    right = np.einsum("nki,nk->ni", basis, values)
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    return found[:, 1], found[:, 2]


def _grade(recording: Recording, time: Floats, speed: Floats) -> Floats:
    """Grade (n,) [rad] from altitude over the way, as a straight line over `_GRADE_WAY` metres on either side."""
    altitude = recording.channels.get("altitude")
    if altitude is None or np.isfinite(altitude).sum() < 2:
        return np.full(len(time), np.nan)
    known = np.isfinite(altitude)
    height = np.interp(time, recording.time[known], altitude[known])
    way = np.r_[0.0, np.cumsum(np.diff(time) * (speed[1:] + speed[:-1]) / 2)]
    low, high = (np.interp(way + d, way, height) for d in (-_GRADE_WAY / 2, _GRADE_WAY / 2))
    run = np.clip(way + _GRADE_WAY / 2, 0, way[-1]) - np.clip(way - _GRADE_WAY / 2, 0, way[-1])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(run > _GRADE_WAY / 4, np.arctan((high - low) / run), np.nan)
