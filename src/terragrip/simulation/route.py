"""The way on the ground: points, heading and curvature along the path, and which soil lies where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.simulation.scenario import Plot, Route

Ints = npt.NDArray[np.int32]

EARTH_RADIUS = 6378137.0  # m, WGS 84 equatorial


@dataclass(frozen=True)
class Path:
    """A path sampled every ``spacing`` m: ``x`` along it (0 where the rear axle starts), the rest per point (n,)."""

    x: Floats
    east: Floats
    north: Floats
    heading: Floats
    curvature: Floats

    @property
    def spacing(self) -> float:
        return float(self.x[1] - self.x[0])

    def beside(self, offset: float) -> tuple[Floats, Floats]:
        """Points ``offset`` m to the left."""
        return self.east - offset * np.sin(self.heading), self.north + offset * np.cos(self.heading)


@dataclass(frozen=True)
class Soils:
    """Soils along a track: the index of the soil, of the one it changes to, and how much of it already (0..1), (n,)."""

    start: Ints
    end: Ints
    blend: Floats

    def share(self, soil: int) -> Floats:
        """Share of a soil (n,)."""
        return np.where(self.start == soil, 1 - self.blend, 0.0) + np.where(self.end == soil, self.blend, 0.0)

    @property
    def label(self) -> Ints:
        """The soil that prevails (n,)."""
        return np.where(self.blend < 0.5, self.start, self.end).astype(np.int32)

    @property
    def border(self) -> Bools:
        """Where one soil runs into another (n,)."""
        return self.start != self.end


def lay(route: Route, before: float, after: float, spacing: float) -> Path:
    """The path from ``before`` m behind the start to ``after`` m beyond the end of the route."""
    if route.segments:
        end = sum(segment.length for segment in route.segments)
        pieces = [(end, 0.0)]
        heading, origin = route.heading, route.start
    else:
        pieces, heading, origin = _rounded(route)
        end = sum(length for length, _ in pieces)
    n = int(np.ceil((before + end + after) / spacing)) + 1
    x = np.arange(n, dtype=np.float64) * spacing - before
    bounds = np.cumsum([0.0, *(length for length, _ in pieces)])
    piece = np.clip(np.searchsorted(bounds, x, side="right") - 1, 0, len(pieces) - 1)
    curvature = np.where((x >= 0) & (x < end), np.array([k for _, k in pieces])[piece], 0.0)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * spacing)])
    angle = heading + turned
    middle = 0.5 * (angle[1:] + angle[:-1])
    east = np.concatenate([[0.0], np.cumsum(np.cos(middle) * spacing)])
    north = np.concatenate([[0.0], np.cumsum(np.sin(middle) * spacing)])
    zero = int(np.searchsorted(x, 0.0))
    return Path(x, east - east[zero] + origin[0], north - north[zero] + origin[1], angle, curvature)


def _rounded(route: Route) -> tuple[list[tuple[float, float]], float, tuple[float, float]]:
    """Pieces (length, curvature) of a polygon line whose corners are arcs; the first heading; the first point."""
    points = np.array(route.path)
    steps = np.diff(points, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    turns = (np.diff(headings) + np.pi) % (2 * np.pi) - np.pi
    cut = np.abs(np.tan(turns / 2)) * route.turn_radius
    # A corner takes at most half of each side; its radius shrinks with it.
    room = 0.5 * np.minimum(lengths[:-1], lengths[1:])
    tangent = np.minimum(cut, room)
    pieces: list[tuple[float, float]] = []
    for k, length in enumerate(lengths):
        used = (tangent[k - 1] if k else 0.0) + (tangent[k] if k < len(turns) else 0.0)
        pieces.append((length - used, 0.0))
        if k < len(turns) and abs(turns[k]) > 1e-9:
            radius = tangent[k] / abs(np.tan(turns[k] / 2))
            pieces.append((radius * abs(turns[k]), float(np.sign(turns[k]) / radius)))
    first = (float(points[0, 0]), float(points[0, 1]))
    return [piece for piece in pieces if piece[0] > 1e-9], float(headings[0]), first


def soils_along(route: Route, names: tuple[str, ...], path: Path, offset: float, track: float) -> Soils:
    """Soils under the line ``offset`` m left of the path; borders are ramps of the route's width."""
    if route.segments:
        bounds = np.cumsum([segment.length for segment in route.segments])[:-1]
        later = (
            -route.skew * offset / track if track else 0.0
        )  # the right track (negative offset) comes later
        index = np.searchsorted(bounds + later, path.x, side="right")
        ids = np.array([names.index(segment.soil) for segment in route.segments], dtype=np.int32)[index]
    else:
        east, north = path.beside(offset)
        ids = np.full(len(path.x), names.index(str(route.around)), dtype=np.int32)
        for plot in route.plots:
            ids[inside(plot, east, north)] = names.index(plot.soil)
    return _ramped(ids, path.x, route.border)


def inside(plot: Plot, east: Floats, north: Floats) -> Bools:
    """Whether points lie in a plot's polygon (crossing number)."""
    out = np.zeros(len(east), dtype=bool)
    corners = plot.corners
    for (x1, y1), (x2, y2) in zip(corners, (*corners[1:], corners[0]), strict=True):
        crosses = (y1 > north) != (y2 > north)
        if y1 != y2:
            out ^= crosses & (east < (x2 - x1) * (north - y1) / (y2 - y1) + x1)
    return out


def _ramped(ids: Ints, x: Floats, width: float) -> Soils:
    start, end, blend = ids.copy(), ids.copy(), np.zeros(len(x))
    spacing = x[1] - x[0]
    for k in np.flatnonzero(np.diff(ids)):
        middle = x[k] + 0.5 * spacing
        low = max(int(np.ceil((middle - 0.5 * width - x[0]) / spacing)) - 1, 0)
        high = min(int(np.floor((middle + 0.5 * width - x[0]) / spacing)) + 1, len(x) - 1)
        ramp = np.clip((x[low : high + 1] - middle) / width + 0.5, 0.0, 1.0)
        start[low:high], end[low:high] = ids[k], ids[k + 1]
        # The point after the ramp keeps blend 1: a reader interpolates with the soils of the point before it.
        start[high] = end[high] = ids[k + 1]
        blend[low : high + 1] = ramp
    return Soils(start, end, blend)


def geographic(route: Route, east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude [deg] of local points [m]: a plane through the route's origin."""
    latitude = route.latitude + np.degrees(north / EARTH_RADIUS)
    longitude = route.longitude + np.degrees(east / (EARTH_RADIUS * np.cos(np.radians(route.latitude))))
    return latitude, longitude
