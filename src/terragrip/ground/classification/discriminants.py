"""How far a window lies from known ones in the few directions in which grounds differ most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats, Ints, Singles

_SHRINKAGE = 0.1
_KEPT = 400  # windows of each ground
_NEIGHBOURS = 10


@dataclass(frozen=True)
class Discriminants:
    """Fisher's linear discriminants: ``axes`` (features, classes - 1), and known windows ``points`` (n, classes - 1) along them."""

    axes: Singles
    points: Singles

    @classmethod
    def fit(cls, points: Floats, codes: Ints) -> Discriminants:
        """Fit to standardised ``points`` (n, features) with class ``codes`` (n,) 0..K-1, every class weighing the same."""
        from scipy.linalg import eigh

        classes = [points[codes == code] for code in range(int(codes.max()) + 1)]
        size = points.shape[1]
        within = np.mean([np.cov(p.T, bias=True).reshape(size, size) for p in classes], axis=0)
        within = (1 - _SHRINKAGE) * within + (_SHRINKAGE * np.trace(within) / size + 1e-9) * np.eye(size)
        between = np.cov(np.stack([p.mean(axis=0) for p in classes]).T).reshape(size, size)
        count = min(len(classes) - 1, size)
        axes = eigh(between, within, subset_by_index=[size - count, size - 1])[1].astype(np.float32)
        kept = [p[:: -(-len(p) // _KEPT)] for p in classes]
        return cls(axes, np.concatenate(kept).astype(np.float32) @ axes)

    def distance(self, points: Floats) -> Floats:
        """Log distance (n,) to the tenth nearest known window."""
        near = min(_NEIGHBOURS, len(self.points)) - 1
        result = np.empty(len(points))
        for begin in range(0, len(points), 1000):  # bounds the memory of a long drive
            block = points[begin : begin + 1000].astype(np.float32) @ self.axes
            square = sum((block[:, k, None] - self.points[:, k]) ** 2 for k in range(block.shape[1]))
            result[begin : begin + 1000] = np.partition(square, near, axis=1)[:, near]
        return 0.5 * np.log(result + 1e-12)
