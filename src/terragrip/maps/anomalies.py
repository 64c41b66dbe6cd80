"""Anomalies of a map: firm patches and wet holes, as robust local outliers with the false discovery rate controlled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.maps.cells import Cells
from terragrip.recording.ranks import median

AROUND = 96
"""Cells around one, the nearest beyond `CORE`, whose median is what it should be."""
CORE = 4.5
"""Cell sizes around a cell that are left out of what is around it."""
SIDE = 6
"""Cells that a side of a cell's surroundings needs to be asked."""
REACH = 15.0
"""Cell sizes beyond which nothing is around."""
SMOOTH = 1.5
"""Cell sizes over which neighbouring residuals are judged together: a patch is larger than a cell."""
ONE_SD = 0.6827
"""Share of the scores that lie within one SD, where nothing is an anomaly."""
FALSE_DISCOVERIES = 0.05
"""Share of what is listed that may be chance (Benjamini and Hochberg 1995)."""
LEAST_CELLS = 2
"""Cells that a patch has at least."""
PLACES = 300
"""Discs elsewhere on the map that a patch is compared with."""
FREE = 0.25
"""Share of such a disc's cells that may be of patches."""
ROUND = 1.6
"""Radii of a disc, beside a cell, to which its cells reach at most; those at the field's edge are cut off."""
PATCH = 9
"""Cells of a patch by which it is said what a map can show."""
MEDIAN = 0.6745
"""Median size of a Gaussian variable of SD 1."""


@dataclass(frozen=True)
class Anomaly:
    """A patch unlike its surroundings: ``cells`` (indices), centre ``column``, ``row`` (in cells), its ``value``, the value ``around``
    nearest to it, the ``difference`` with its ``std``, and ``p``: how many patches as large and strong chance makes on such a map."""

    cells: Ints
    column: float
    row: float
    value: float
    around: float
    difference: float
    std: float
    p: float


def anomalies_of(cells: Cells) -> list[Anomaly]:
    """Patches of cells unlike their surroundings, the strongest first.

    A cell's residual is its distance beyond the medians of its surroundings on each side. Residuals of neighbours are combined by inverse
    variance; what each constant weighs more in them than around is added to it. The null is the scatter of such scores about the nearest
    of those medians (their 68 % quantile; Efron 2004: most of a field is no anomaly), so soil that varies as it does everywhere is not an
    anomaly, and a field of two soils is not one whose soil varies. Cells beyond it that touch are a patch, which is then judged as a whole
    by discs of as many cells elsewhere on the map. At most `FALSE_DISCOVERIES` of the cells, and of the listed patches, are due to chance.
    """
    from scipy.spatial import cKDTree
    from scipy.special import ndtr

    if len(cells) < AROUND:
        return []
    place = np.column_stack([cells.column, cells.row]).astype(float)
    tree = cKDTree(place)
    around, nearest, middle = _around(tree, place, cells.value, cells.constants)
    variance = np.maximum(cells.std**2 - cells.constant**2, 1e-12)
    constants = np.nan_to_num(cells.constants - middle)
    beyond, spread = _joined(tree, place, cells.value - around, variance)
    plain, _ = _joined(tree, place, cells.value - nearest, variance)
    shared = [_joined(tree, place, one, variance)[0] for one in constants.T]
    spread = np.hypot.reduce([spread, *shared])
    known = np.isfinite(plain) & np.isfinite(beyond)
    if known.sum() < AROUND:
        return []
    scale = float(np.quantile(np.abs(plain / spread)[known], ONE_SD))
    score = beyond / spread / max(scale, 1.0)
    p = np.where(known, 2 * ndtr(-np.abs(np.nan_to_num(score))), 1.0)
    patches = _patches(tree, place, significant(p, FALSE_DISCOVERIES), score)
    null = {size: _elsewhere(size, patches, cells, tree, constants) for size in set(map(_size, patches))}
    found = [_anomaly(patch, cells, tree, constants, null[_size(patch)]) for patch in patches]
    listed = significant(np.array([one.p for one in found]), FALSE_DISCOVERIES, 1)
    return sorted(compress(found, listed), key=lambda one: one.p)


def least_difference(cells: Cells, found: list[Anomaly], size: int = PATCH) -> float:
    """The difference from its surroundings from which a patch of `size` cells is told from chance on this map, beside those `found`; NaN
    where the map is too small to have anomalies. A patch of which single cells do not stand out needs more."""
    from scipy.spatial import cKDTree
    from scipy.special import ndtri

    if len(cells) < AROUND:
        return math.nan
    tree = cKDTree(np.column_stack([cells.column, cells.row]).astype(float))
    constants = np.nan_to_num(cells.constants - _around(tree, tree.data, cells.value, cells.constants)[2])
    usual, share, std = _elsewhere(size, [one.cells for one in found], cells, tree, constants)
    return float(-ndtri(FALSE_DISCOVERIES / (2 * share * len(cells))) * usual * std)


def significant(p: Floats, share: float, tests: int | None = None) -> Bools:
    """Which p-values (n,) are significant at a false discovery rate of `share` (Benjamini and Hochberg 1995).

    `tests`: of how many these are the smallest, where they are not all; 1 where p is the number that chance makes, not its probability.
    """
    order = np.argsort(p)
    below = np.flatnonzero(p[order] <= share * np.arange(1, len(p) + 1) / max(tests or len(p), 1))
    chosen = np.zeros(len(p), dtype=bool)
    if len(below):
        chosen[order[: below[-1] + 1]] = True
    return chosen


def _around(tree: Any, place: Floats, value: Floats, constants: Floats) -> tuple[Floats, Floats, Floats]:
    """The expected value of each cell (n,), the median of that of its four sides which is nearest to its value, and those of the constants
    (n, K) around it.

    The first is the cell's value clipped to the range of the medians of the surrounding cells on the sides. At the border of two
    soils one side agrees with it, so a border is no anomaly; a value between the sides' medians agrees with its surroundings.
    The surroundings are `AROUND` cells, the nearest beyond `CORE` and within `REACH`; a side with less than `SIDE` of them is
    ignored. NaN if fewer than half of them, or no side, are there.
    """
    inner = int(np.ceil(np.pi * CORE**2)) + 1
    count = min(AROUND + inner, len(place))
    distance, index = tree.query(place, k=count, distance_upper_bound=REACH)
    near = np.isfinite(distance) & (distance > CORE)
    index = np.minimum(index, len(value) - 1)
    offset = place[index] - place[:, None, :]
    sides = []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            inside = near & (sign * offset[:, :, axis] > 0)
            enough = inside.sum(axis=1) >= SIDE
            sides.append(_medians(np.where(inside & enough[:, None], value[index], np.nan)))
    low, high = np.fmin.reduce(sides), np.fmax.reduce(sides)
    known = (near.sum(axis=1) >= AROUND // 2) & np.isfinite(low)
    away = np.abs(np.array(sides) - value)
    nearest = np.array(sides)[np.where(np.isfinite(away), away, np.inf).argmin(axis=0), np.arange(len(value))]
    around = near & known[:, None]
    middle = np.reshape(
        [_medians(np.where(around, one[index], np.nan)) for one in constants.T], constants.T.shape
    ).T
    return np.where(known, np.clip(value, low, high), np.nan), np.where(known, nearest, np.nan), middle


def _medians(values: Floats) -> Floats:
    """The median (n,) of each row (n, k) without its NaN; `np.nanmedian`, by masked arrays, takes 20 times as long."""
    ordered, count, rows = np.sort(values, axis=1), np.isfinite(values).sum(axis=1), np.arange(len(values))
    return np.asarray((ordered[rows, (count - 1) // 2] + ordered[rows, count // 2]) / 2)


def _joined(tree: Any, place: Floats, residual: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Mean residual over `SMOOTH` by inverse variance, and its SD."""
    distance, index = tree.query(place, k=min(9, len(place)), distance_upper_bound=SMOOTH)
    index = np.minimum(index, len(residual) - 1)
    usable = np.isfinite(distance) & np.isfinite(residual[index])
    weight = np.where(usable, 1 / variance[index], 0.0)
    total = weight.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.sum(weight * np.nan_to_num(residual[index]), axis=1) / total
        spread = 1 / np.sqrt(total)
    mean[~np.isfinite(residual)] = np.nan
    return mean, spread


def _patches(tree: Any, place: Floats, chosen: Bools, score: Floats) -> list[Ints]:
    """Chosen cells of one sign that touch, including at corners."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs = tree.query_pairs(1.5, output_type="ndarray")
    alike = chosen[pairs[:, 0]] & chosen[pairs[:, 1]] & (score[pairs[:, 0]] * score[pairs[:, 1]] > 0)
    pairs = pairs[alike]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(place), len(place)))
    label = connected_components(graph, directed=False)[1]
    rows = np.flatnonzero(chosen)
    order = rows[np.argsort(label[rows], kind="stable")]
    if not len(order):
        return []
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return [patch for patch in np.split(order, cuts) if len(patch) >= LEAST_CELLS]


def _size(patch: Ints) -> int:
    """Cells of the discs that a patch is compared with: two sizes for each factor of e."""
    return math.ceil(math.exp(round(2 * math.log(len(patch))) / 2))


def _usual(score: Floats) -> tuple[float, float]:
    """The usual size of scores, as the SD of a Gaussian and no less than 1, what is stated; and the share of them that are not 0. Without
    any, all is usual."""
    if not len(score):
        return math.inf, 1.0
    size = np.abs(score[score != 0])
    usual = float(np.median(size)) / MEDIAN if len(size) else 1.0
    return max(usual, 1.0), (len(size) + 1) / (len(score) + 1)


def _elsewhere(
    size: int, patches: list[Ints], cells: Cells, tree: Any, constants: Floats
) -> tuple[float, float, float]:
    """`_usual` of the differences, in their SDs, of discs of `size` cells from what is around them, `patches` left out, and their usual
    SD."""
    place = tree.data
    patch = np.zeros(len(place), dtype=bool)
    patch[[cell for one in patches for cell in one]] = True
    middles = np.unique(np.linspace(0, len(place) - 1, PLACES).astype(np.intp))
    distance, index = (
        x.reshape(len(middles), -1) for x in tree.query(place[middles], k=min(size, len(place)))
    )
    whole = distance[:, -1] < ROUND * math.sqrt(size / math.pi) + 1
    discs = index[whole & (patch[index].mean(axis=1) <= FREE)]
    found = np.array([_against(one, cells, tree, constants) for one in discs]).reshape(-1, 3)
    value, base, std = found.T
    return *_usual((value - base) / std), float(np.median(std)) if len(std) else math.nan


def _against(patch: Ints, cells: Cells, tree: Any, constants: Floats) -> tuple[float, float, float]:
    """The mean of a patch by inverse variance, what it should be by the cells around it as a whole, and the SD of the difference. Those
    around its single cells reach past the rest of a narrow strip, which is no patch."""
    weight = 1 / np.maximum(cells.std[patch] ** 2 - cells.constant[patch] ** 2, 1e-12)
    value, *shared = np.average(
        np.column_stack([cells.value[patch], constants[patch]]), axis=0, weights=weight
    ).tolist()
    std = float(np.hypot.reduce([1 / np.sqrt(weight.sum()), *shared]))
    return value, _beside(patch, cells, tree, value), std


def _anomaly(
    patch: Ints, cells: Cells, tree: Any, constants: Floats, null: tuple[float, float, float]
) -> Anomaly:
    from scipy.special import ndtr

    value, base, std = _against(patch, cells, tree, constants)
    usual, share, _ = null
    p = 2 * share * ndtr(-abs(value - base) / (std * usual)) * len(cells)
    column, row = tree.data[patch].mean(axis=0) + 0.5
    return Anomaly(patch, float(column), float(row), value, base, value - base, std, float(p))


def _beside(patch: Ints, cells: Cells, tree: Any, value: float) -> float:
    """A patch's value clipped to the range of the medians of the cells on its sides, those that touch it left out."""
    from scipy.spatial import cKDTree

    place = tree.data
    middle = place[patch].mean(axis=0)
    reach = np.hypot(*(place[patch] - middle).T).max() + 2 * CORE
    near = np.array(tree.query_ball_point(middle, reach, return_sorted=False))
    near = near[cKDTree(place[patch]).query(place[near])[0] > SMOOTH]
    offset = place[near] - middle
    sides = [near[sign * offset[:, axis] > 0] for axis in (0, 1) for sign in (-1, 1)]
    medians = [median(cells.value[side]) for side in sides if len(side) >= SIDE]
    return float(np.clip(value, min(medians), max(medians))) if medians else value
