"""Extremely randomised trees that are fitted by scikit-learn and evaluated by NumPy: arrays alone, as `kernel_machine`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats, Ints, Singles
from terragrip.ground.classification.chances import doubting_log
from terragrip.ground.classification.kernel_machine import learner
from terragrip.ground.classification.standardization import centre_of

Codes = Ints

_TREES = 100
_LEAF = 2  # windows


@dataclass(frozen=True)
class Forest:
    """All trees' nodes in one list, a child after its parent; a leaf leads to itself.

    ``centre`` (features,) stands where a feature was not measured; ``roots`` (trees,); ``feature``, ``threshold``, ``left``
    and ``right`` (nodes,); ``share`` (nodes, classes) of each class in a leaf, every class weighing the same.
    """

    centre: Singles
    roots: npt.NDArray[np.int32]
    feature: npt.NDArray[np.int32]
    threshold: Singles
    left: npt.NDArray[np.int32]
    right: npt.NDArray[np.int32]
    share: Singles

    @classmethod
    def fit(cls, features: Floats, codes: Codes, seed: int) -> Forest:
        """Fit to ``features`` (n, features; NaN = not measured) with class ``codes`` (n,) 0..K-1 (Geurts et al. 2006).

        Raises InputError if scikit-learn is missing.
        """
        centre = centre_of(features).astype(np.float32)
        forest = learner("ensemble", "ExtraTreesClassifier")(
            _TREES, min_samples_leaf=_LEAF, class_weight="balanced", n_jobs=1, random_state=seed
        )
        trees = [one.tree_ for one in forest.fit(_filled(features, centre), codes).estimators_]
        sizes = [tree.node_count for tree in trees]
        roots = np.r_[0, np.cumsum(sizes)[:-1]].astype(np.int32)
        own = np.arange(sum(sizes))
        first = np.repeat(roots, sizes)
        leaf = np.concatenate([tree.children_left for tree in trees]) < 0
        left, right = (
            np.where(leaf, own, first + np.concatenate([getattr(tree, side) for tree in trees]))
            for side in ("children_left", "children_right")
        )
        feature = np.where(leaf, 0, np.concatenate([tree.feature for tree in trees]))
        share = np.concatenate([tree.value[:, 0] for tree in trees]) * leaf[:, None]
        share /= np.where(leaf, share.sum(axis=1), 1.0)[:, None]
        threshold = _rounded_down(np.concatenate([tree.threshold for tree in trees]))
        whole = (array.astype(np.int32) for array in (feature, left, right))
        feature, left, right = whole
        return cls(centre, roots, feature, threshold, left, right, share.astype(np.float32))

    def decide(self, features: Floats) -> Floats:
        """Log probabilities (n, classes), no class being ruled out, of windows with these features (n, features)."""
        result = np.empty((len(features), self.share.shape[1]))
        for begin in range(0, len(features), 1000):  # bounds the memory of a long drive
            block = _filled(features[begin : begin + 1000], self.centre)
            rows = np.arange(len(block))[:, None]
            node = np.broadcast_to(self.roots, (len(block), len(self.roots)))
            while True:
                low = block[rows, self.feature[node]] <= self.threshold[node]
                onward = np.where(low, self.left[node], self.right[node])
                if np.array_equal(onward, node):
                    break
                node = onward
            result[begin : begin + 1000] = self.share[node].mean(axis=1)
        return doubting_log(result)

    def check(self) -> None:
        """Raise ValueError on nodes that do not make trees."""
        own = np.arange(len(self.feature))
        ends = self.left == own
        onward = (self.left > own) & (self.right > own) | ends & (self.right == own)
        inside = (np.maximum(self.left, self.right) < len(own)) & (self.feature >= 0)
        if not (onward & inside & (self.feature < len(self.centre))).all():
            raise ValueError("a node leads out of its tree")
        if not len(self.roots) or self.roots.min() < 0 or self.roots.max() >= len(own):
            raise ValueError("a root is no node")


def _filled(features: Floats, centre: Singles) -> Singles:
    single = features.astype(np.float32)
    return np.where(np.isfinite(single), single, centre)


def _rounded_down(threshold: Floats) -> Singles:
    """Single precision that single-precision features compare with as with the double."""
    single = threshold.astype(np.float32)
    return np.where(single > threshold, np.nextafter(single, np.float32(-np.inf)), single)
