"""The points of a map: the vehicle's path, a point for each quarter of a cell, with the estimates there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.maps.places import Places

if TYPE_CHECKING:
    from terragrip.estimation import Estimates


SPACING = 0.25
"""Of a cell's size, along the way."""
_SKIPPED = ("latitude", "longitude", "altitude", "distance", "warning", "channels", "supervisor", "nis")


@dataclass(frozen=True)
class Points:
    """Points (n,): number of the ``run``, ``time`` [s], ``east``, ``north`` [m] of the rear axle, ``heading`` [rad], ``headland``,
    ``values`` by column of the estimates (the mean over the point's distance; SDs likewise, because neighbours have the same error),
    ``soil``, ``event``."""

    run: npt.NDArray[np.int64]
    time: Floats
    east: Floats
    north: Floats
    heading: Floats
    headland: Bools
    values: dict[str, Floats]
    soil: npt.NDArray[np.object_]
    event: npt.NDArray[np.object_]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """All parts one after another; a column that a part lacks is NaN there."""
        names = list(dict.fromkeys(name for part in parts for name in part.values))
        values = {
            name: np.concatenate([part.values.get(name, np.full(len(part), np.nan)) for part in parts])
            for name in names
        }
        plain = [one.name for one in fields(cls) if one.name != "values"]
        return cls(
            values=values, **{name: np.concatenate([getattr(part, name) for part in parts]) for name in plain}
        )


def points_of(estimates: Estimates, places: Places, way: Floats, size: float, run: int) -> Points:
    """A run's points, `SPACING` of a cell apart; rows without a place are left out."""
    rows = np.flatnonzero(np.isfinite(places.east))
    number = np.floor(way[rows] / (SPACING * size))
    begin = np.flatnonzero(np.r_[True, (np.diff(number) != 0) | (np.diff(rows) > 1)])
    count = np.diff(np.r_[begin, len(rows)])

    def mean(values: Floats) -> Floats:
        known = np.isfinite(values[rows])
        total = np.add.reduceat(np.where(known, values[rows], 0.0), begin)
        many = np.add.reduceat(known, begin)
        return np.where(many > 0, total / np.maximum(many, 1), np.nan)

    names = [
        n
        for n in estimates.columns
        if n not in _SKIPPED and not n.startswith(("warning_", "curve_", "adaptation_"))
    ]
    middle = rows[np.minimum(begin + count // 2, len(rows) - 1)]
    labels = estimates.soil
    return Points(
        np.full(len(begin), run), estimates.time[middle], mean(places.east), mean(places.north), places.heading[middle],
        places.headland[middle], {name: mean(estimates[name]) for name in names}, labels[middle], estimates["event"][middle],
    )  # fmt: skip
