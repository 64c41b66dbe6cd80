"""One expert: the classifier for one set of sensors, its calibrated probabilities, and what it calls strange."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.ground.classification.features import of_one_wheel
from terragrip.ground.classification.forest import Forest
from terragrip.ground.classification.kernel_machine import KernelMachine
from terragrip.ground.classification.standardization import Standardization

Floats = npt.NDArray[np.float64]
Codes = npt.NDArray[np.intp]

LEVELS: Floats = np.r_[0.0, np.geomspace(1e-4, 1.0, 400)]


@dataclass(frozen=True)
class Expert:
    """A machine on the features of one set of sensor families, and beside it a forest where some are of single wheels.

    The machine takes the first features, the forest all: those of single wheels stand last. ``slopes`` (1 or 2,) of the
    machine's and the forest's scores, and ``offsets`` (classes,), turn scores into probabilities; ``usual`` is mean and SD
    of the score of the winner and of the log distance (2, 2), ``strange`` (levels,) the strangeness that a share of known
    windows exceeds.
    """

    families: frozenset[str]
    features: tuple[str, ...]
    standardization: Standardization
    machine: KernelMachine
    forest: Forest | None
    slopes: Floats
    offsets: Floats
    usual: Floats
    strange: Floats

    def judge(self, features: Floats) -> tuple[Floats, Floats]:
        """Probabilities (n, classes) and strangeness (n,) of windows with these features (n, features)."""
        own = features[:, : len(self.standardization.centre)]
        scores, distance = self.machine.decide(self.standardization.apply(own))
        every = [scores] if self.forest is None else [scores, self.forest.decide(features)]
        chances = probabilities(np.stack(every), self.slopes, self.offsets)
        return chances, strangeness(scores, distance, self.usual)

    def novelty(self, strange: Floats) -> Floats:
        """Share (n,) of windows on known grounds, from runs not trained on, that are at least as strange."""
        return np.interp(strange, self.strange[::-1], LEVELS[::-1])


def train(
    families: frozenset[str],
    names: Sequence[str],
    features: Floats,
    codes: Codes,
    groups: Codes,
    folds: Codes,
    threads: int,
    seed: int,
) -> Expert:
    """Fit an expert; ``folds`` (n,) says which part of a cross-validation a window is held out in.

    What is said of probabilities and strangeness is learnt from windows of recordings that were held out.
    """

    shared = sum(not of_one_wheel(name) for name in names)
    own = features[:, :shared]

    def fitted(rows: npt.NDArray[np.bool_]) -> tuple[Standardization, KernelMachine, Forest | None]:
        scaling = Standardization.fit(own[rows], codes[rows], groups[rows])
        machine = KernelMachine.fit(scaling.apply(own[rows]), codes[rows])
        forest = Forest.fit(features[rows], codes[rows], seed) if shared < len(names) else None
        return scaling, machine, forest

    everything = np.ones(len(codes), dtype=bool)
    parts = [everything, *(folds != fold for fold in range(int(folds.max()) + 1))]
    with ThreadPoolExecutor(threads) as pool:  # the solver works outside the interpreter's lock
        machines = list(pool.map(fitted, parts))
    classes = machines[0][1].classes
    parts_of = 1 if machines[0][2] is None else 2
    every, distance = np.empty((parts_of, len(codes), classes)), np.empty(len(codes))
    for fold, (scaling, machine, forest) in enumerate(machines[1:]):
        out = folds == fold
        every[0, out], distance[out] = machine.decide(scaling.apply(own[out]))
        if forest is not None:
            every[1, out] = forest.decide(features[out])
    scores = every[0]
    weight = 1.0 / np.bincount(codes)[codes]
    weight /= weight.sum()
    slopes, offsets = calibrate(every, codes, weight)
    best = scores.max(axis=1)
    usual = np.array([_mean_and_spread(best, weight), _mean_and_spread(distance, weight)])
    odd = strangeness(scores, distance, usual)
    order = np.argsort(-odd)
    share = np.cumsum(weight[order])
    levels = np.interp(LEVELS, np.r_[0.0, share], np.r_[odd[order[0]] + 1e-6, odd[order]])
    strange = np.minimum.accumulate(levels) - 1e-12 * np.arange(len(levels), dtype=float)
    return Expert(families, tuple(names), *machines[0], slopes, offsets, usual, strange)


def probabilities(scores: Floats, slopes: Floats, offsets: Floats) -> Floats:
    """Softmax (n, classes) of the scaled, added and shifted scores (parts, n, classes)."""
    logits = np.tensordot(slopes, scores, axes=1) + offsets
    odds = np.exp(logits - logits.max(axis=1, keepdims=True))
    return odds / odds.sum(axis=1, keepdims=True)


def strangeness(scores: Floats, distance: Floats, usual: Floats) -> Floats:
    """How far (n,) windows are from any known ground: no class wins clearly, and nothing known lies near.

    Each is measured in its own standard deviations over known windows; their sum tells more than either.
    """
    (best, spread), (far, width) = usual
    return (best - scores.max(axis=1)) / spread + (distance - far) / width


def calibrate(scores: Floats, codes: Codes, weight: Floats) -> tuple[Floats, Floats]:
    """Slopes (parts,) and offsets (classes,) under which softmax probabilities of scores (parts, n, classes) are most likely.

    Platt's scaling for many classes; with several parts it stacks them (Wolpert 1992), none with a slope below zero.
    """
    from scipy.optimize import minimize

    rows = np.arange(len(codes))
    parts = len(scores)
    hit = np.zeros_like(scores[0])
    hit[rows, codes] = 1.0

    def loss(parameters: Floats) -> tuple[float, Floats]:
        slopes, offsets = np.exp(parameters[:parts]), parameters[parts:]
        found = probabilities(scores, slopes, offsets)
        # A weak pull to no offset keeps a class that never errs finite.
        value = -(weight * np.log(found[rows, codes] + 1e-12)).sum() + 1e-3 * (parameters**2).sum()
        off = (found - hit) * weight[:, None]
        gradient = np.r_[slopes * (off * scores).sum(axis=(1, 2)), off.sum(axis=0)] + 2e-3 * parameters
        return value, gradient

    classes = scores.shape[2]
    start = np.r_[np.ones(parts), np.zeros(classes)]
    bounds = [(-3, 5)] * parts + [(-8, 8)] * classes
    best = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds)
    return np.exp(best.x[:parts]), best.x[parts:]


def _mean_and_spread(values: Floats, weight: Floats) -> tuple[float, float]:
    mean = float((weight * values).sum())
    spread = float(np.sqrt((weight * (values - mean) ** 2).sum()))
    return mean, spread if spread > 1e-9 else 1.0
