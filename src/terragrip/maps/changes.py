"""Changes of the ground between passes and days: the change of each cell, and whether it is significant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.maps.anomalies import FALSE_DISCOVERIES, significant
from terragrip.maps.cells import Cells
from terragrip.maps.columns import Columns

Ints = npt.NDArray[np.int64]

MOST = 0.5
"""Share of the cells driven again whose change is one of the whole field."""


@dataclass(frozen=True)
class Changes(Columns):
    """Cells (k,) that were driven more than once: ``first`` and ``last`` value, ``difference`` with ``std``, ``p``, ``significant``; the
    runs of both (numbers) and the seconds between them where both are of one run, else NaN."""

    column: Ints
    row: Ints
    first: Floats
    last: Floats
    difference: Floats
    std: Floats
    p: Floats
    significant: Bools
    first_run: Ints
    last_run: Ints
    seconds: Floats


def changes_of(passes: Cells, share: float = FALSE_DISCOVERIES, *, same_machine: bool = True) -> Changes:
    """From the first to the last pass of each cell, in the order of the runs and of time.

    `passes`: one row per pass (:func:`terragrip.maps.cells.cells_of`). On one machine constants that all passes share cannot cause a
    change, except by what they weigh more in one of them (at another slip, say); between machines each has its own. `significant`
    controls the false discovery rate at `share`.
    """
    from scipy.special import ndtr

    order = np.lexsort((passes.time, passes.run, passes.row, passes.column))
    column, row = passes.column[order], passes.row[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (column[1:] != column[:-1]) | (row[1:] != row[:-1])
    begin = np.flatnonzero(new)
    end = np.r_[begin[1:], len(order)] - 1
    several = end > begin
    first, last = order[begin[several]], order[end[several]]
    variance = passes.std**2 - (passes.constant**2 if same_machine else 0.0)
    left = np.sum((passes.constants[last] - passes.constants[first]) ** 2, axis=1) if same_machine else 0.0
    difference = passes.value[last] - passes.value[first]
    std = np.sqrt(np.maximum(variance[first] + variance[last] + left, 1e-18))
    p = 2 * ndtr(-np.abs(difference) / std)
    same = passes.run[first] == passes.run[last]
    return Changes(
        passes.column[first], passes.row[first], passes.value[first], passes.value[last], difference, std, p,
        significant(p, share), passes.run[first], passes.run[last],
        np.where(same, passes.time[last] - passes.time[first], np.nan),
    )  # fmt: skip


def moved_zeros(changes: Changes, passes: Cells) -> str:
    """A sentence where most cells changed between runs of one machine, by no more than its constants would cause if they moved between
    the runs (two SDs of a difference); else ""."""
    between = changes.first_run != changes.last_run
    if not between.any():
        return ""
    shift, constant = float(np.median(changes.difference[between])), float(np.median(passes.constant))
    if np.mean(changes.significant[between]) < MOST or abs(shift) > 2 * np.sqrt(2) * constant:
        return ""
    return (
        f"most cells changed between the runs, by {shift:+.3f} in the median: the machine's constants (SD {constant:.3f}) would show that "
        "too, had they moved between the runs. Set zeros and tyre pressures before each, or drive a stretch of hard ground in both."
    )
