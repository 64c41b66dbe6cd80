"""A support vector machine that is fitted by scikit-learn and evaluated by NumPy.

Evaluation needs arrays alone, so a stored classifier outlives scikit-learn's versions and is never pickled, and one
window costs one product of matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from itertools import combinations
from typing import Any

import numpy as np

from terragrip.arrays import Floats, Ints, Singles
from terragrip.errors import missing_package

PENALTY = 4.0
WIDTH = 0.4  # of the kernel, over the number of features: standardised features lie about sqrt(2 n) apart
_NEIGHBOURS = 5


@dataclass(frozen=True)
class KernelMachine:
    """One machine with a Gaussian kernel for each pair of classes.

    ``support`` (vectors, features), ``weights`` (vectors, pairs), ``offsets`` (pairs,), kernel ``width``; pairs in the
    order of `itertools.combinations`, positive for the first class.
    """

    support: Singles
    weights: Singles
    offsets: Floats
    width: float
    classes: int

    @classmethod
    def fit(cls, points: Floats, codes: Ints) -> KernelMachine:
        """Fit to ``points`` (n, features) with class ``codes`` (n,) 0..K-1, K >= 2, every class weighing the same.

        Raises InputError if scikit-learn is missing.
        """
        svm = learner("svm", "SVC")(
            C=PENALTY, gamma=WIDTH / points.shape[1], class_weight="balanced", cache_size=300
        )
        machine = svm.fit(points, codes)
        classes = len(machine.classes_)
        first = np.r_[0, np.cumsum(machine.n_support_)]
        dual = np.asarray(machine.dual_coef_)
        if classes == 2:  # scikit-learn turns the sign round for two classes only
            weights, offsets = -dual.T, -np.asarray(machine.intercept_)
        else:
            weights = np.zeros((len(machine.support_), classes * (classes - 1) // 2))
            for pair, (i, j) in enumerate(combinations(range(classes), 2)):
                rows_i, rows_j = slice(first[i], first[i + 1]), slice(first[j], first[j + 1])
                weights[rows_i, pair] = dual[j - 1, rows_i]
                weights[rows_j, pair] = dual[i, rows_j]
            offsets = np.asarray(machine.intercept_)
        support = np.asarray(machine.support_vectors_, dtype=np.float32)
        return cls(
            support, weights.astype(np.float32), offsets.astype(float), WIDTH / points.shape[1], classes
        )

    def decide(self, points: Floats) -> tuple[Floats, Floats]:
        """Scores (n, classes), and the log distance (n,) to the support vectors near each point (n, features)."""
        scores = np.empty((len(points), self.classes))
        distance = np.empty(len(points))
        lengths = np.einsum("ij,ij->i", self.support, self.support)
        near = min(_NEIGHBOURS, len(self.support)) - 1
        for begin in range(0, len(points), 2000):  # bounds the memory of a long drive
            rows = slice(begin, begin + 2000)
            block = points[rows].astype(np.float32)
            square = np.einsum("ij,ij->i", block, block)[:, None] + lengths - 2.0 * block @ self.support.T
            np.maximum(square, 0.0, out=square)
            pairs = np.exp(-self.width * square) @ self.weights + self.offsets
            scores[rows] = votes(pairs, self.classes)
            distance[rows] = 0.5 * np.log(np.partition(square, near, axis=1)[:, near] + 1e-6)
        return scores, distance


def votes(pairs: Floats, classes: int) -> Floats:
    """Score (n, classes) of each class: the mean of its soft votes, -1 to 1, against every other."""
    scores = np.zeros((len(pairs), classes))
    soft = np.tanh(pairs)
    for pair, (i, j) in enumerate(combinations(range(classes), 2)):
        scores[:, i] += soft[:, pair]
        scores[:, j] -= soft[:, pair]
    return scores / (classes - 1)


def learner(module: str, name: str) -> Any:
    """A class of scikit-learn; raises InputError where it is missing."""
    try:
        return getattr(import_module(f"sklearn.{module}"), name)
    except ImportError:
        raise missing_package("scikit-learn", "ground", "train a GroundClassifier") from None
