"""Standard deviations of cells limited by the differences of repeated passes (docs/maps.md)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from terragrip.arrays import Floats
from terragrip.maps.cells import Cells

LEAST_REPEATS = 100
"""Pairs of passes over one cell that a share needs."""
LEAST_SHARE = 0.25
"""Passes that agree still better are no evidence: one log given twice, or values that are rounded alike."""
WORTH_A_WORD = 0.9
"""A share below which the user is warned."""


def share_of_repeats(passes: Cells) -> float:
    """The difference between passes over one cell as a share of that expected from their SDs; 1 if it is more, or there are too few.

    `passes`: a row per pass (:func:`terragrip.maps.cells.cells_of`). Consecutive passes over a cell are compared, without the constants
    that both share. The share is the robust SD (1.4826 times the median size) of the differences over their stated SDs. More than 1 is
    no error of the SDs: between two passes the ground may have changed. Never less than `LEAST_SHARE`.
    """
    order = np.lexsort((passes.time, passes.run, passes.row, passes.column))
    column, row = passes.column[order], passes.row[order]
    again = np.flatnonzero((column[1:] == column[:-1]) & (row[1:] == row[:-1]))
    if len(again) < LEAST_REPEATS:
        return 1.0
    first, second = order[again], order[again + 1]
    own = random_std(passes)
    size = np.abs(passes.value[second] - passes.value[first]) / np.hypot(own[first], own[second])
    return float(np.clip(1.4826 * np.median(size), LEAST_SHARE, 1.0))


def scaled(cells: Cells, share: float) -> Cells:
    """The cells with their SDs, except the constants, times `share`."""
    return replace(cells, std=np.hypot(share * random_std(cells), cells.constant))


def random_std(cells: Cells) -> Floats:
    """The part of the SDs (k,) that cells do not share."""
    return np.asarray(np.sqrt(np.maximum(cells.std**2 - cells.constant**2, 1e-18)))
