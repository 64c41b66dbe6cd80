"""Positions on the earth in metres."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats


def metres_of(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
    """North and east [m] (n,) of positions [deg] (n,) from the first one, in the plane that touches WGS 84 there.

    The radii of curvature are those of the first position; over 10 km north the scale is off by less than 2e-3.
    """
    known = np.isfinite(latitude) & np.isfinite(longitude)
    if not known.any():
        return latitude, longitude
    first = int(np.argmax(known))
    a, e2 = 6378137.0, 6.69437999014e-3
    sine = np.sin(np.radians(latitude[first]))
    bend = 1.0 - e2 * sine**2
    north = np.radians(latitude - latitude[first]) * a * (1 - e2) / bend**1.5
    around = np.remainder(longitude - longitude[first] + 180.0, 360.0) - 180.0
    east = np.radians(around) * a / np.sqrt(bend) * np.cos(np.radians(latitude[first]))
    return north, east
