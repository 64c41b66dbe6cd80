"""One expert: the classifier for one set of sensors, its calibrated probabilities, and what it calls strange."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.ground.classification.chances import softmax
from terragrip.ground.classification.discriminants import Discriminants
from terragrip.ground.classification.forest import Forest
from terragrip.ground.classification.kernel_machine import KernelMachine
from terragrip.ground.classification.motion_law import MotionLaw
from terragrip.ground.classification.novelty import Strangeness
from terragrip.ground.classification.roles import roles_of
from terragrip.ground.classification.standardization import Standardization

Codes = Ints

_OFFSET = 0.5  # SD beforehand, in log odds: classes weigh the same, so offsets are small


@dataclass(frozen=True)
class Examples:
    """Windows to learn from: features (n, features), and of each its class code, recording, start [s] and the part of a
    cross-validation that holds it out (n,)."""

    features: Floats
    codes: Codes
    groups: Codes
    starts: Floats
    folds: Codes


@dataclass(frozen=True)
class Parts:
    """What judges a window: a machine; a forest where some features are of single wheels; a law where the motion is known."""

    standardization: Standardization
    machine: KernelMachine
    discriminants: Discriminants
    forest: Forest | None
    law: MotionLaw | None

    @classmethod
    def fit(cls, names: tuple[str, ...], windows: Examples, rows: Bools, forest: Forest | None) -> Parts:
        """Fit all other parts to the ``rows`` (n,) of the windows that the forest was fitted to; their features have these names."""
        roles, features, codes = roles_of(names), windows.features[rows], windows.codes[rows]
        own = features[:, roles.machine]
        scaling = Standardization.fit(own, codes, windows.groups[rows])
        points = scaling.apply(own)
        law = (
            MotionLaw.fit(features[:, roles.motion], features[:, roles.effects], codes) if roles.law else None
        )
        machine = KernelMachine.fit(points, codes)
        return cls(scaling, machine, Discriminants.fit(points, codes), forest, law)

    def decide(self, names: tuple[str, ...], features: Floats) -> tuple[Floats, Floats]:
        """Scores (parts, n, classes), the machine's first, and what makes windows strange (4, n), more being stranger."""
        roles = roles_of(names)
        own = features[:, roles.machine]
        points = self.standardization.apply(own)
        scores, distance = self.machine.decide(points)
        every = [scores]
        if self.forest is not None:
            every.append(self.forest.decide(features))
        if self.law is not None:
            every.append(self.law.decide(features[:, roles.motion], features[:, roles.effects]))
        among = [-scores.max(axis=1), distance, self.discriminants.distance(points)]
        odd = np.stack([*among, self.standardization.distance(own)])
        return np.stack(every), odd


@dataclass(frozen=True)
class Expert:
    """The parts for one set of sensor families, ``slopes`` (parts,) of their scores and ``offsets`` (classes,) that turn scores
    into probabilities, and the strangeness of known windows."""

    families: frozenset[str]
    features: tuple[str, ...]
    parts: Parts
    slopes: Floats
    offsets: Floats
    strangeness: Strangeness

    def judge(self, features: Floats) -> tuple[Floats, Floats]:
        """Probabilities (n, classes) and strangeness (n,) of windows with these features (n, features)."""
        scores, odd = self.parts.decide(self.features, features)
        return probabilities(scores, self.slopes, self.offsets), self.strangeness.of(odd)


def train(
    families: frozenset[str], names: tuple[str, ...], windows: Examples, threads: int, seed: int
) -> Expert:
    """Fit an expert; calibrations of probabilities and strangeness are learnt from windows of recordings that were held out."""
    codes, folds = windows.codes, windows.folds
    everything = np.ones(len(codes), dtype=bool)
    learnt_from = [everything, *(folds != fold for fold in range(int(folds.max()) + 1))]
    # scikit-learn changes the process's warning filters meanwhile, a forest for each of its trees: no two forests at a time.
    with _one_thread_each(), warnings.catch_warnings():
        forests = [
            Forest.fit(windows.features[rows], codes[rows], seed) if roles_of(names).forest else None
            for rows in learnt_from
        ]
        # The solvers work outside the interpreter's lock; threads of the linear algebra's own would only wait for one another.
        with ThreadPoolExecutor(threads) as pool:
            fitted = list(pool.map(lambda *given: Parts.fit(names, windows, *given), learnt_from, forests))
            held_out = [(parts, windows.features[folds == k]) for k, parts in enumerate(fitted[1:])]
            result = list(pool.map(lambda pair: pair[0].decide(names, pair[1]), held_out))
    scores = np.empty((len(result[0][0]), len(codes), result[0][0].shape[2]))
    odd = np.empty((len(result[0][1]), len(codes)))
    for fold, (of_scores, of_odd) in enumerate(result):
        scores[:, folds == fold], odd[:, folds == fold] = of_scores, of_odd
    same = np.ones(len(codes))
    strangeness = Strangeness.fit(odd, _class_weights(same, codes), windows.groups, windows.starts)
    # Windows of one recording have common errors: a long one gives more evidence than a short one, but not in proportion.
    _, of_recording, size = np.unique(windows.groups, return_inverse=True, return_counts=True)
    weight = _class_weights(same / np.sqrt(size[of_recording]), codes)
    slopes, offsets = calibrate(scores, codes, weight, len(size))
    return Expert(families, names, fitted[0], slopes, offsets, strangeness)


def probabilities(scores: Floats, slopes: Floats, offsets: Floats) -> Floats:
    """Softmax (n, classes) of the scaled, added and shifted scores (parts, n, classes)."""
    return softmax(np.tensordot(slopes, scores, axes=1) + offsets)


def calibrate(scores: Floats, codes: Codes, weight: Floats, recordings: int) -> tuple[Floats, Floats]:
    """Slopes (parts,) and offsets (classes,) under which softmax probabilities of scores (parts, n, classes) are most likely.

    Platt's scaling for many classes; with several parts it stacks them (Wolpert 1992), none with a slope below zero. Offsets
    are normal beforehand, and what speaks for others are as many witnesses as there are ``recordings``.
    """
    from scipy.optimize import minimize

    rows = np.arange(len(codes))
    parts = len(scores)
    hit = np.zeros_like(scores[0])
    hit[rows, codes] = 1.0

    def loss(parameters: Floats) -> tuple[float, Floats]:
        slopes, offsets = np.exp(parameters[:parts]), parameters[parts:]
        result = probabilities(scores, slopes, offsets)
        value = -(weight * np.log(result[rows, codes] + 1e-12)).sum() + (pull * parameters**2).sum()
        off = (result - hit) * weight[:, None]
        gradient = np.r_[slopes * (off * scores).sum(axis=(1, 2)), off.sum(axis=0)] + 2 * pull * parameters
        return value, gradient

    classes = scores.shape[2]
    # The weak prior on slopes keeps those of parts without errors finite.
    pull = np.r_[np.full(parts, 1e-3), np.full(classes, 1e-4 + 0.5 / (_OFFSET**2 * recordings))]
    start = np.r_[np.ones(parts), np.zeros(classes)]
    bounds = [(-3, 5)] * parts + [(-8, 8)] * classes
    best = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds)
    return np.exp(best.x[:parts]), best.x[parts:]


def _class_weights(weight: Floats, codes: Codes) -> Floats:
    """The weights (n,), scaled so that every class weighs the same and all together one."""
    return weight / np.bincount(codes, weights=weight)[codes] / (int(codes.max()) + 1)


def _one_thread_each() -> AbstractContextManager[Any]:
    try:
        from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]
    except ImportError:  # comes with scikit-learn, whose absence `KernelMachine.fit` names
        return nullcontext()
    return cast("AbstractContextManager[Any]", threadpool_limits(limits=1))
