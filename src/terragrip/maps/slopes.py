"""A slope that nothing measures, found where lanes are driven both ways: it is added to the soil resistance uphill and subtracted downhill.

Around each cell the passes over the nearest cells are fitted by resistance and its trend over the place, and by the slope up to the east
and to the north, which acts by the heading. The prior of the slope is its stated SD: where all lanes go one way, it stays. Local regression
with a kernel that reaches to a fixed number of neighbours (Cleveland 1979), with a Gaussian prior.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints

if TYPE_CHECKING:
    from terragrip.maps.cells import Pieces

NEIGHBOURS = 32
"""Passes over cells that are fitted together: some three lanes, and less than hills are long."""
ROUNDS = 3
"""Fits, each with the scatter about the one before."""
CHUNK = 20_000
"""Cells fitted at once."""
FLAT = 1e-9
"""Weight of the prior of what has none, against a singular fit where all passes lie on a line."""


def without_slope(pieces: Pieces, cell: Ints, each: Ints) -> Pieces:
    """The pieces with the slope found taken out of y, and ``local`` (m, 2): the error by what is left of it.

    `cell`, `each` (m,): number of the cell and of the pass of each piece, from 0, not decreasing.
    """
    if not pieces.local.any():
        return pieces
    begin = np.flatnonzero(np.diff(each, prepend=-1))
    x = np.add.reduceat(pieces.x, begin)
    value, lever = np.add.reduceat(pieces.y, begin) / x, np.add.reduceat(pieces.local, begin) / x[:, None]
    metres = np.add.reduceat(pieces.metres, begin)
    place = np.column_stack([pieces.column, pieces.row])[begin].astype(float)
    first = np.flatnonzero(np.diff(cell, prepend=-1))
    at = np.column_stack([pieces.column, pieces.row])[first].astype(float)
    slope, covariance = _fitted(at, place, value, lever, np.minimum(metres / np.median(metres), 1.0))
    factor = np.linalg.cholesky(covariance)
    return replace(
        pieces,
        y=pieces.y - np.sum(pieces.local * slope[cell], axis=1),
        local=np.einsum("mi,mij->mj", pieces.local, factor[cell]),
    )


def _fitted(at: Floats, place: Floats, value: Floats, lever: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """The slope around places `at` (k, 2), in its stated SDs (k, 2), and its covariance (k, 2, 2), by passes (n, ...)."""
    from scipy.spatial import cKDTree

    count = min(NEIGHBOURS, len(place))
    distance, index = cKDTree(place).query(at, k=np.arange(1, count + 1))
    near = (1 - (distance / (1.01 * distance[:, -1:] + 1e-9)) ** 3) ** 3 * weight[index]
    slope, covariance = np.zeros((len(at), 2)), np.zeros((len(at), 2, 2))
    variance = float(np.var(value)) + 1e-12
    for _ in range(ROUNDS):
        squares, freedom = 0.0, 0.0
        for start in range(0, len(at), CHUNK):
            rows = slice(start, start + CHUNK)
            i, w = index[rows], near[rows]
            design = np.concatenate([np.ones((*i.shape, 1)), place[i] - at[rows, None, :], lever[i]], axis=2)
            weighted = w[:, :, None] * design
            normal = np.swapaxes(weighted, 1, 2) @ design
            prior = variance * np.array([FLAT, FLAT, FLAT, 1.0, 1.0])
            inverse = np.linalg.inv(normal + np.diag(prior))
            found = (inverse @ np.einsum("knj,kn->kj", weighted, value[i])[:, :, None])[:, :, 0]
            slope[rows], covariance[rows] = found[:, 3:], variance * inverse[:, 3:, 3:]
            squares += float(np.sum(w * (value[i] - np.einsum("kni,ki->kn", design, found)) ** 2))
            freedom += float(w.sum() - np.sum(weighted @ inverse * weighted))
        variance = squares / max(freedom, 1e-9) + 1e-12
    return slope, covariance
