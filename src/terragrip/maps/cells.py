"""Block statistics: readings of many runs become cells of a grid, each with value, SD, count and passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.maps.columns import Columns
from terragrip.maps.slopes import without_slope
from terragrip.maps.values import Reading

Ints = npt.NDArray[np.int64]

PASS_TIME = 10.0
"""Seconds of absence from a cell after which the vehicle's return is another pass."""
HALVES = 2
"""Parts of a cell's length whose scatter tells how much a cell's mean errs; finer ones are too alike to be so many."""
CORRELATED = 2.5
"""Wheel radii of way over which the estimator's random error is one error: unseen loads vary over 1.25 radii to either side
(docs/families.md)."""
LEAST_WAY = 0.05
"""Metres of wheel way; less in a cell says nothing."""
LEAST_X = 0.1
"""Where a cell was read at less than this share of the reference (x), its value would be an extrapolation ..."""
VAGUE_X = 0.35
"""... and where x is uncertain by more than this share of itself, a guess. So it is where the share is more than this of the x ..."""
MOST = 0.75
"""... that this share of the cells stays below, in the same way: alone by its own x, a cell passes by an error that makes it large."""


@dataclass(frozen=True)
class Pieces(Columns):
    """Consecutive rows of one reading in one part of a cell, as arrays (m,).

    ``column``, ``row``: the cell; ``run``: number of the run; ``time`` [s] of the first row; ``metres`` driven; ``x``, ``y``, their
    constants (m, K), errors by a slope (m, 2) and SDs summed over the metres; ``rows``: their number; ``headland``: whether the first
    row is on a headland. The signs of x, y and constants are reversed for braked wheels.
    """

    column: Ints
    row: Ints
    run: Ints
    time: Floats
    metres: Floats
    x: Floats
    y: Floats
    constants: Floats
    x_constants: Floats
    local: Floats
    random: Floats
    x_random: Floats
    rows: Ints
    headland: Bools


@dataclass(frozen=True)
class Cells(Columns):
    """Cells of one quantity (k,), or of its passes: grid ``column`` and ``row``, ``value``, ``std``, ``constants`` (k, K): the part of it
    that all cells share, by constant and with sign; ``count`` of rows, ``passes``; ``run``, ``time`` of the first pass; ``headland``
    share of the distance."""

    column: Ints
    row: Ints
    value: Floats
    std: Floats
    constants: Floats
    count: Ints
    passes: Ints
    run: Ints
    time: Floats
    headland: Floats

    @property
    def constant(self) -> Floats:
        """The SD (k,) of what all cells share."""
        return np.asarray(np.linalg.norm(self.constants, axis=1))


def pieces_of(reading: Reading, time: Floats, way: Floats, size: float, run: int, headland: Bools) -> Pieces:
    """A reading's rows summed over parts of cells of `size` [m]; `way` [m] (n,) not decreasing."""
    rows = np.flatnonzero(reading.good)
    column = np.floor(reading.east[rows] / size).astype(np.int64)
    line = np.floor(reading.north[rows] / size).astype(np.int64)
    part = np.floor(way[rows] / (size / HALVES)).astype(np.int64)
    new = (np.diff(column) != 0) | (np.diff(line) != 0) | (np.diff(part) != 0)
    begin = np.flatnonzero(np.r_[True, new][: len(rows)])
    step = np.diff(way, prepend=way[:1])[rows]

    def total(values: Floats) -> Floats:
        return _sums((step * values[rows].T).T, begin)

    y = total(reading.y)
    turned = np.where(y < 0, -1.0, 1.0) if reading.turns else np.ones(len(y))
    constants, x_constants = (
        turned[:, None] * total(values) for values in (reading.constants, reading.x_constants)
    )
    pieces = Pieces(
        column[begin], line[begin], np.full(len(begin), run), time[rows][begin], total(np.ones(len(time))), turned * total(reading.x),
        turned * y, constants, x_constants, total(reading.local), total(reading.random), total(reading.x_random),
        np.diff(np.r_[begin, len(rows)]), headland[rows][begin],
    )  # fmt: skip
    return pieces.where(pieces.metres > 0)


def cells_of(parts: Sequence[Pieces], correlated: float) -> tuple[Cells, Cells]:
    """The cells of one quantity, and the same by pass. `correlated` [m]: `CORRELATED` wheel radii.

    A cell's value is Σ y/Σ x: random errors of x average out and do not reduce it, as they would in least squares. Its variance is the
    larger of two, plus that of the constants, which no number of passes reduces. The first is the scatter of the pieces (K Σ
    metres/(Σ x)², K pooled over the map: variation of the ground within a cell, and random errors over a piece). The second is the
    estimator's own random variance, once for every `correlated` metres of wheel travel. A slope that nothing measures is taken out as
    far as lanes both ways show it; what is left is added whole: all passes may lie on one side of a hill.
    """
    joined = Pieces.joined(parts)
    joined = joined.where(np.lexsort((joined.time, joined.run, joined.row, joined.column)))
    new_cell = _starts(joined.column, joined.row)
    new_pass = new_cell | _starts(joined.run) | (np.diff(joined.time, prepend=-np.inf) > PASS_TIME)
    cell = np.cumsum(new_cell) - 1
    joined = without_slope(joined, cell, np.cumsum(new_pass) - 1)
    scatter = _scatter(joined, cell)
    passes = np.bincount(cell, new_pass).astype(np.int64) if len(cell) else np.zeros(0, dtype=np.int64)
    whole = _summed(joined, new_cell, scatter, correlated, passes)
    each = _summed(joined, new_pass, scatter, correlated, np.ones(int(new_pass.sum()), dtype=np.int64))
    return whole, each


def _sums(values: npt.NDArray[Any], begin: Ints) -> npt.NDArray[Any]:
    """Sums of values (n, ...) from each place of `begin` to the next."""
    return np.asarray(np.add.reduceat(values, begin, axis=0) if len(begin) else values[:0])


def _starts(*columns: npt.NDArray[np.generic]) -> Bools:
    new = np.zeros(len(columns[0]), dtype=bool)
    new[:1] = True
    for column in columns:
        new[1:] |= column[1:] != column[:-1]
    return new


def _scatter(pieces: Pieces, cell: Ints) -> float:
    """K [y² m]: the variance of y - value x over a metre, over all cells with two pieces or more and a value: without demand on the
    ground y/x is any number."""
    if not len(cell):
        return 0.0
    x, metres = np.bincount(cell, pieces.x), np.bincount(cell, pieces.metres)
    known = x > LEAST_X * metres
    value = np.divide(np.bincount(cell, pieces.y), x, out=np.zeros(len(x)), where=known)
    rows = known[cell]
    freedom = int(rows.sum()) - int(known.sum())
    if freedom <= 0:
        return 0.0
    return float(np.sum(((pieces.y - value[cell] * pieces.x) ** 2 / pieces.metres)[rows]) / freedom)


def _summed(pieces: Pieces, start: Bools, scatter: float, correlated: float, passes: Ints) -> Cells:
    begin = np.flatnonzero(start)

    def total(values: Floats) -> Floats:
        return _sums(values, begin)

    metres, x = total(pieces.metres), total(pieces.x)
    safe = np.where(x > 0, x, np.nan)
    value = total(pieces.y) / safe
    x_share = total(pieces.x_random) / safe
    random = np.hypot(total(pieces.random) / safe, value * x_share)
    constants = (total(pieces.constants).T - value * total(pieces.x_constants).T) / safe
    once = np.minimum(1.0, correlated / np.maximum(metres, 1e-9))
    local = np.linalg.norm(total(pieces.local), axis=1) / safe
    std = np.sqrt(
        np.maximum(scatter * metres / safe**2, random**2 * once) + local**2 + np.sum(constants**2, axis=0)
    )
    rows = _sums(pieces.rows, begin).astype(np.int64)
    headland = total(pieces.metres * pieces.headland) / np.maximum(metres, 1e-9)
    cells = Cells(
        pieces.column[begin], pieces.row[begin], value, std, constants.T, rows, passes, pieces.run[begin], pieces.time[begin], headland
    )  # fmt: skip
    usual = (np.quantile(x / metres, MOST) if len(x) else 0.0) * metres
    vague = x_share * np.sqrt(once) * x > VAGUE_X * np.minimum(x, usual)
    known = (metres > LEAST_WAY) & (x > LEAST_X * metres) & ~vague
    return cells.where(known)
