"""How far apart the lanes of a run are: as wide as the machine works, where its vehicle file does not state it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.maps.places import TURNED, Places, axial

if TYPE_CHECKING:
    from terragrip.arrays import Floats

FARTHEST = 6.0
"""Of the least distance: lanes farther apart leave ground between them that nothing works."""
AGAIN = 15.0
"""Of the least distance, along the way: what is nearer is the same lane."""
NEIGHBOURS = 100
"""Points that are looked at around one."""


def lane_spacing(places: Places, way: Floats, least: float) -> float:
    """Metres from a lane to the nearest parallel one, in the median of the way; 0 where that is less than `least` [m], or most of it
    has no other within `FARTHEST` of that. ``way`` [m] (n,) not decreasing."""
    from scipy.spatial import cKDTree

    known = np.isfinite(places.east) & np.isfinite(places.heading)
    new = np.diff(np.floor(way[known] / (0.5 * least)), prepend=-1.0) > 0
    east, north, heading, at = (x[known][new] for x in (places.east, places.north, places.heading, way))
    if len(at) < 2:
        return 0.0
    place = np.column_stack([east, north])
    count = min(NEIGHBOURS, len(at))
    distance, index = cKDTree(place).query(place, k=count, distance_upper_bound=FARTHEST * least)
    there = np.minimum(index, len(at) - 1)
    beside = (np.abs(at[there] - at[:, None]) > AGAIN * least) & (
        np.abs(axial(heading[there] - heading[:, None])) < TURNED
    )
    distance = np.where(beside, distance, np.inf)
    best = np.argmin(distance, axis=1)
    off = place[there[np.arange(len(at)), best]] - place
    across = np.abs(off[:, 1] * np.cos(heading) - off[:, 0] * np.sin(heading))
    middle = float(np.median(np.where(np.isfinite(distance.min(axis=1)), across, np.inf)))
    return middle if least <= middle < np.inf else 0.0
