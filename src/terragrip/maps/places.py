"""Where a run's vehicle is, row by row: metres on a UTM grid, heading, outages and jumps of the positions cut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.errors import InputError
from terragrip.maps.plausible import refuse_impossible
from terragrip.physics.geodesy import metres_of
from terragrip.recording.lag import lag_between, speed_of, wheels_of, without_long_pauses

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.vehicle import Vehicle


OUTAGE_TIME = 1.0
"""Seconds between two fixes, or five usual periods if that is longer, beyond which the way between them is an outage ..."""
OUTAGE_WAY = 1.0
"""... where the vehicle drove more metres than this meanwhile."""
JUMP = 0.5
"""Metres by which a step of the positions may differ from the way driven, beside eight times its usual scatter and `JUMP_SHARE`."""
JUMP_SHARE = 0.3
LATEST = 2.0
"""Seconds by which positions are looked for behind the wheels at most."""
LEAST_STEPS = 12
"""Different positions along an axis, less one, that show to which step they are rounded."""
FROZEN = 1.0 / 3.0
"""Of the way driven over three stretches, one after the other: positions that move less stand still, though they tremble ..."""
FROZEN_WAY = 1.0
"""... each of so many metres, or eight times the positions' scatter (a turn is shorter than three), driven at `FROZEN` of the usual speed:
the way of a machine that is stuck is noise."""
LEAST_FIXES = 5
"""Fixes between two jumps or outages; fewer are taken for strays."""
TURNED = np.radians(25.0)
"""Beyond this angle from the main direction of the drive, or its reverse, the vehicle is on a headland."""


@dataclass(frozen=True)
class Places:
    """Where the vehicle is at each row of a run.

    ``east``, ``north`` (n,) [m] of the rear axle's centre, NaN where no position determines it; ``heading`` (n,) [rad, from east towards
    north]; ``headland`` (n,): the vehicle turns or drives across the run's main direction; ``notes``: sentences on removed positions.
    """

    east: Floats
    north: Floats
    heading: Floats
    headland: Bools
    scatter: float = 0.0
    notes: tuple[str, ...] = ()

    def of(self, forward: float, left: float) -> tuple[Floats, Floats]:
        """East and north (n,) [m] of a point of the vehicle, ``forward`` [m] of the rear axle's centre and to its ``left`` [m]."""
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        return self.east + forward * cosine - left * sine, self.north + forward * sine + left * cosine


def middle_of(latitude: Floats, longitude: Floats) -> tuple[float, float]:
    """The median latitude and longitude [deg] of positions (n,), also where they lie on both sides of 180°."""
    known = np.isfinite(latitude) & np.isfinite(longitude)
    first = float(longitude[known][0])
    around = np.remainder(longitude[known] - first + 180.0, 360.0) - 180.0
    east = np.remainder(first + float(np.median(around)) + 180.0, 360.0) - 180.0
    return float(np.median(latitude[known])), float(east)


def zone_of(latitude: Floats, longitude: Floats) -> int:
    """EPSG code of the UTM zone (of a polar grid beyond 84° N and 80° S) around the median of positions [deg] (n,). Norway's south-west
    is of zone 32."""
    north, east = middle_of(latitude, longitude)
    if not -80.0 <= north <= 84.0:
        return 32661 if north > 0 else 32761
    norway = 56.0 <= north < 64.0 and 3.0 <= east < 6.0
    zone = 32 if norway else int((east + 180.0) // 6.0) % 60 + 1
    return (32600 if north >= 0 else 32700) + zone


def has_positions(estimates: Estimates) -> bool:
    """Whether any row has a position."""
    return {"latitude", "longitude"} <= set(estimates.columns) and bool(
        np.any(np.isfinite(estimates["latitude"]) & np.isfinite(estimates["longitude"]))
    )


def places_of(estimates: Estimates, epsg: int, datum: str = "EPSG:4326", file: str | None = None) -> Places:
    """Where the vehicle is at each row.

    `epsg`: the grid; `datum`: the coordinate reference system of latitude and longitude. The antenna is at the vehicle file's
    ``antenna``, or over the rear axle's centre. Between fixes the place is interpolated; outages and jumps are removed, and positions
    that are certainly behind the wheels are moved back. Raises InputError if there are no positions, or if speed or turns contradict
    them (:mod:`terragrip.maps.plausible`).
    """
    if not has_positions(estimates):
        raise InputError("has no positions", file=file, hint="estimate a log with latitude and longitude")
    latitude, longitude = estimates["latitude"], estimates["longitude"]
    vehicle, way = estimates.vehicle, np.maximum.accumulate(np.nan_to_num(estimates["distance"]))
    fixes = _fixes(latitude, longitude)
    refuse_impossible(estimates, fixes, file)
    east, north = _projected(latitude[fixes], longitude[fixes], epsg, datum)
    late, notes = _late(estimates, estimates.time[fixes], east, north)
    when = estimates.time[fixes] - late
    driven = np.diff(np.interp(when, estimates.time, way))
    excess = np.hypot(np.diff(east), np.diff(north)) - driven
    usual = _scatter(excess)
    frozen = _frozen(when, east, north, driven, usual)
    piece, cut = _pieces(when, driven, excess, usual, frozen)
    notes += cut
    x, y = _between(estimates.time, when, east, piece), _between(estimates.time, when, north, piece)
    heading = _heading(x, y, way, _base(vehicle), np.nan_to_num(estimates["ground_speed"]))
    antenna = vehicle.antenna
    if antenna is not None:
        cosine, sine = np.cos(heading), np.sin(heading)
        x, y = x - antenna.x * cosine + antenna.y * sine, y - antenna.x * sine - antenna.y * cosine
    return Places(
        x,
        y,
        heading,
        _headland(heading, way),
        max(usual, 0.5 * _step(latitude[fixes], longitude[fixes])),
        notes,
    )


def _base(vehicle: Vehicle) -> float:
    """Half the metres over which a heading is taken."""
    return max(0.5, 0.5 * (vehicle.wheelbase or 0.0))


def _fixes(latitude: Floats, longitude: Floats) -> Ints:
    """Rows with a new position: repeated ones are held, not measured."""
    rows = np.flatnonzero(np.isfinite(latitude) & np.isfinite(longitude))
    fresh = np.r_[True, (np.diff(latitude[rows]) != 0) | (np.diff(longitude[rows]) != 0)]
    return np.asarray(rows[fresh])


def _projected(latitude: Floats, longitude: Floats, epsg: int, datum: str) -> tuple[Floats, Floats]:
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    try:
        system = CRS.from_user_input(datum)
    except ProjError as error:
        raise InputError(
            f"{datum!r} is not a coordinate reference system", place="--datum", hint="write e.g. EPSG:4258"
        ) from error
    if not system.is_geographic:
        raise InputError(
            f"{datum!r} ({system.name}) is not in latitude and longitude",
            place="--datum",
            hint="name that of the receiver's degrees, e.g. EPSG:4258; convert metres of a grid to degrees first",
        )
    transformer = Transformer.from_crs(system, epsg, always_xy=True)
    east, north = transformer.transform(longitude, latitude)
    return np.asarray(east), np.asarray(north)


def _late(estimates: Estimates, time: Floats, east: Floats, north: Floats) -> tuple[float, tuple[str, ...]]:
    """Seconds by which the positions are behind the wheels, 0 if that is not certain, and a sentence on it."""
    names = [
        name for name in estimates.columns if name.startswith("wheel_speed_") and not name.endswith("_std")
    ]
    wait = np.diff(time)
    if not names or len(time) < LEAST_FIXES:
        return 0.0, ()
    speed = np.hypot(np.diff(east), np.diff(north)) / np.maximum(wait, 1e-9)
    clock = without_long_pauses(estimates.time)
    wheels = wheels_of(clock, {name: estimates[name] for name in names})
    middles = np.interp(time[1:] - 0.5 * wait, estimates.time, clock)
    fixes = speed_of(middles, {"ground_speed": speed})
    lag = None if wheels is None or fixes is None else lag_between(wheels, fixes, reach=LATEST)
    if lag is None or not lag.is_of_the_clock or lag.seconds < 0:
        return 0.0, ()
    word = f"The positions are {lag.seconds:.2f} ± {lag.std:.2f} s behind the wheels and are shifted by it."
    return lag.seconds, (word,)


def _scatter(excess: Floats) -> float:
    return 1.4826 * float(np.median(np.abs(excess - np.median(excess)))) if len(excess) else 0.0


def _step(latitude: Floats, longitude: Floats) -> float:
    """The step [m] to which positions are rounded: the smallest difference between two of them along either axis."""
    gaps = [np.diff(np.unique(np.round(along, 4))) for along in metres_of(latitude, longitude)]
    return max(float(gap.min()) if len(gap) >= LEAST_STEPS else 0.0 for gap in gaps)


def _frozen(time: Floats, east: Floats, north: Floats, driven: Floats, usual: float) -> Bools:
    """The fixes (n,) that stand still while the vehicle drives ``driven`` (n - 1,) [m]; ``usual`` [m] is their scatter."""
    way, last = np.r_[0.0, np.cumsum(driven)], len(driven)
    stretch = max(FROZEN_WAY, 8.0 * usual)
    end = np.searchsorted(way, way + stretch)
    there = end <= last
    end = np.minimum(end, last)
    quick = stretch / np.maximum(time[end] - time, 1e-9)
    still = there & (np.hypot(east[end] - east, north[end] - north) < FROZEN * (way[end] - way))
    still &= quick > FROZEN * np.median(np.interp(np.linspace(0, way[-1], 1000), way, quick))
    first = np.flatnonzero(still & still[end] & still[end[end]])
    change = np.bincount(first, minlength=last + 2) - np.bincount(end[end[end[first]]], minlength=last + 2)
    return np.asarray(np.cumsum(change[: last + 1]) > 0)


def _pieces(
    time: Floats, driven: Floats, excess: Floats, usual: float, frozen: Bools
) -> tuple[Ints, tuple[str, ...]]:
    """The number of the unbroken piece of each fix (n,), -1 for strays; sentences on removed positions.

    Of the steps (n - 1,) the way ``driven`` and the ``excess`` of the positions over it [m], with its ``usual`` scatter; ``frozen`` (n,).
    """
    if len(time) < 2:
        return np.full(len(time), -1), ("There are fewer than two positions.",)
    wait = np.diff(time)
    jump = np.abs(excess - np.median(excess)) > JUMP + 8 * usual + JUMP_SHARE * driven
    outage = (wait > max(OUTAGE_TIME, 5 * float(np.median(wait)))) & (driven > OUTAGE_WAY)
    piece = np.r_[0, np.cumsum(jump | outage | (frozen[1:] != frozen[:-1]))]
    count = np.bincount(piece)
    stray = (count < LEAST_FIXES)[piece] | frozen
    notes = []
    if frozen.any():
        notes.append(
            f"Positions that stand still while the wheels drive {driven[frozen[:-1]].sum():.0f} m, the first at "
            f"{time[frozen][0]:.1f} s, left empty."
        )
    if outage.any():
        notes.append(
            f"{counted(outage, 'outage')} of the positions, {driven[outage].sum():.0f} m of way, left empty."
        )
    if (jump & ~outage).any():
        where = time[1:][jump & ~outage][0]
        notes.append(f"{counted(jump & ~outage, 'jump')} of the positions cut, the first at {where:.1f} s.")
    return np.where(stray, -1, piece), tuple(notes)


def counted(which: Bools, noun: str) -> str:
    """The number with its noun: 1 jump, 2 jumps."""
    count = int(which.sum())
    return f"{count} {noun}{'s' * (count != 1)}"


def _between(time: Floats, fixed: Floats, values: Floats, piece: Ints) -> Floats:
    """Values at the fixes interpolated to all rows (n,), NaN outside the pieces."""
    out = np.full(len(time), np.nan)
    good = np.flatnonzero(piece >= 0)
    if not len(good):
        return out
    when = fixed[good]
    after = np.clip(np.searchsorted(when, time, side="left"), 0, len(good) - 1)
    before = np.clip(np.searchsorted(when, time, side="right") - 1, 0, len(good) - 1)
    inside = (time >= when[0]) & (time <= when[-1]) & (piece[good[after]] == piece[good[before]])
    out[inside] = np.interp(time[inside], when, values[good])
    return out


def _heading(east: Floats, north: Floats, way: Floats, base: float, speed: Floats) -> Floats:
    """Course over `base` metres behind and ahead (n,) [rad], reversed when driving backward; NaN where no place is known."""
    known = np.isfinite(east)
    heading = np.full(len(east), np.nan)
    if known.sum() < 2:
        return heading
    rows = np.flatnonzero(known)
    begin = np.r_[0, np.flatnonzero(np.diff(rows) > 1) + 1]
    for first, last in zip(begin, np.r_[begin[1:], len(rows)], strict=True):
        part = rows[first:last]
        s = way[part]
        fresh = np.r_[True, np.diff(s) > 1e-6]
        x, y, at = east[part][fresh], north[part][fresh], s[fresh]
        dx = np.interp(s + base, at, x) - np.interp(s - base, at, x)
        dy = np.interp(s + base, at, y) - np.interp(s - base, at, y)
        heading[part] = np.arctan2(dy, dx)
    back = speed < 0
    heading[back] = np.remainder(heading[back] + 2 * np.pi, 2 * np.pi) - np.pi
    return heading


def _headland(heading: Floats, way: Floats) -> Bools:
    """Where the vehicle does not drive along the main direction of the run or back (n,).

    The main direction is the mean of the doubled angle over the path (axial mean, Mardia and Jupp 2000). A run without one, of which
    half would be headland, has no headlands.
    """
    length = np.r_[0.0, np.diff(way)]
    known = np.isfinite(heading)
    if not length[known].sum() > 0:
        return np.zeros(len(heading), dtype=bool)
    bins = np.bincount((np.remainder(heading[known], np.pi) / np.pi * 36).astype(int) % 36, length[known], 36)
    ring = np.convolve(np.r_[bins[-1], bins, bins[0]], np.ones(3), mode="valid")
    centre = (int(ring.argmax()) + 0.5) * np.pi / 36
    near = known & (np.abs(axial(heading - centre)) < TURNED)
    main = centre + 0.5 * np.angle(np.sum(length[near] * np.exp(2j * (heading[near] - centre))))
    headland = known & (np.abs(axial(heading - main)) > TURNED)
    if length[headland].sum() > 0.5 * length[known].sum():
        return np.zeros(len(heading), dtype=bool)
    return np.asarray(headland)


def axial(angle: Floats) -> Floats:
    """An angle of a line without direction, between -π/2 and π/2."""
    return np.asarray(np.remainder(angle + np.pi / 2, np.pi) - np.pi / 2)
