"""What a machine did by its track: standing, turning on the headland, working, on the road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.physics.geodesy import metres_of
from terragrip.recording.stretches import without_pauses
from terragrip.report.runs import Run, label_stretches

STANDING, HEADLAND, WORK, ROAD = "standing", "headland", "work", "road"
PARTS = (WORK, HEADLAND, ROAD, STANDING)
SLOWEST = 0.2
"""Speed [m/s] under which a machine stands."""
TURN = np.radians(5.0)
"""Turn rate [rad/s] from which a machine turns: at 2 m/s a circle of 23 m radius."""
WINDOW = 6.0
"""Seconds that a heading is taken over."""
PASS = 10.0
"""Seconds that a straight stretch lasts at least: shorter ones belong to a turn on the headland."""
_PAUSE = 3600.0  # s
FASTER = 1.3
"""A stretch is road where it is driven faster than the passes' median speed by this factor."""


def parts_of(run: Run) -> NDArray[np.object_] | None:
    """What the machine did at each row (n,), one of PARTS, by its own positions alone; None where it has too few of them.

    Straight stretches between turns are passes. What is much faster than the usual pass is road; turns, and what is shorter than a pass
    between them, are headland.
    """
    if not {"latitude", "longitude"} <= set(run.estimates.columns):
        return None
    north, east = metres_of(run.estimated("latitude"), run.estimated("longitude"))
    fixed = np.isfinite(north) & np.isfinite(east)
    time = without_pauses(run.time, _PAUSE)
    if fixed.sum() < 20 or time[fixed][-1] - time[fixed][0] < 4 * PASS:
        return None
    grid = np.arange(time[fixed][0], time[fixed][-1], 1.0)
    x, y = (np.interp(grid, time[fixed], values[fixed]) for values in (east, north))
    speed, turn = _motion(x, y)
    standing = speed < SLOWEST
    if standing.all():
        return None
    what = np.where(standing, STANDING, np.where(turn > TURN, HEADLAND, WORK)).astype(object)
    for _, first, last in label_stretches(np.where(what == WORK, WORK, "").astype(object)):
        if last - first + 1 < PASS:
            what[first : last + 1] = HEADLAND
    passes = [(first, last) for name, first, last in label_stretches(what) if name == WORK]
    if passes:
        speeds = np.array([speed[a : b + 1].mean() for a, b in passes])
        usual = weighted_quantile(speeds, np.array([b - a + 1.0 for a, b in passes]), 0.5)
        for (first, last), mean in zip(passes, speeds, strict=True):
            if mean > FASTER * usual:
                what[first : last + 1] = ROAD
    nearest = np.clip(np.round(time - grid[0]).astype(int), 0, len(grid) - 1)
    return what[nearest]


def _motion(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Speed [m/s] and turn rate [rad/s, absolute] (n,) of positions a second apart, over WINDOW; a heading stays while it stands."""
    half = int(WINDOW // 2)
    index = np.arange(len(x))
    before, behind = np.maximum(index - half, 0), np.minimum(index + half, len(x) - 1)
    dx, dy, seconds = x[behind] - x[before], y[behind] - y[before], np.maximum(behind - before, 1)
    steps = np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0]))
    way = np.cumsum(steps)
    speed = (way[behind] - way[before]) / seconds
    known = np.hypot(dx, dy) > 0.5
    if not known.any():
        return speed, np.zeros(len(x))
    heading = np.unwrap(np.arctan2(dy, dx)[known])
    heading = np.interp(index, index[known], heading)
    return speed, np.abs(heading[behind] - heading[before]) / seconds


def weighted_quantile(values: Floats, weights: Floats, share: float) -> float:
    """The value under which a share of the weights lies, both (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][int(np.searchsorted(total, share * total[-1]))])
