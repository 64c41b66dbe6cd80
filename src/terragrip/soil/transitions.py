"""Where the vehicle and its tool are on one soil: the geometric transition mask (physics.md 7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def settled(distance: ArrayLike, soil: ArrayLike, length: float) -> NDArray[np.bool_]:
    """True where the label has been the same over the last `length` metres driven, shape (n,).

    distance [m] along the path (n,), not decreasing; soil: labels (n,), empty = unlabelled, never settled. `length` [m]: from the label's
    reference point to the rearmost wheel or tool. The start of a recording counts as settled: the ground behind it is not known.
    """
    path = np.asarray(distance, dtype=float)
    labels = np.asarray(soil, dtype=object)
    labelled = np.array([bool(x) and x == x for x in labels], dtype=bool)
    if not path.size:
        return np.zeros(0, dtype=bool)
    change = np.concatenate(([False], labels[1:] != labels[:-1]))
    index = np.maximum.accumulate(np.where(change, np.arange(path.size), -1))
    since = np.where(index < 0, np.inf, path - path[np.maximum(index, 0)])
    return np.asarray(labelled & (since >= length))
