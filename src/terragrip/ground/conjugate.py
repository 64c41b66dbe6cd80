"""The conjugate model of a signal on one ground: normal, its mean and variance unknown, normal-inverse-gamma before (Murphy 2007).

Neighbouring steps repeat each other: a step counts for `weight` of an independent one, in the update and in the likelihood alike.
Change points while driving and afterwards use this one model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from terragrip.arrays import Floats
from terragrip.ground.noise import Noise
from terragrip.ground.signals import LAWS

SHAPE = 8.0
"""Shape of the prior on the variance: as sure of it as sixteen independent steps would make one."""


@dataclass(frozen=True)
class Model:
    """Prior of each signal, (signals,) each: mean, count, shape, scale of the normal-inverse-gamma law; what a step counts for."""

    mean: Floats
    count: Floats
    shape: Floats
    scale: Floats
    weight: Floats

    @classmethod
    def of(cls, names: Sequence[str], noise: Noise) -> Model:
        """The model of signals by name, with their `noise` on one ground."""
        laws, (within, weight) = [LAWS[name] for name in names], noise
        return cls(
            mean=np.array([law.mean for law in laws]),
            count=(within / np.array([law.sd for law in laws])) ** 2,
            shape=np.full(len(laws), SHAPE),
            scale=SHAPE * within**2,
            weight=weight,
        )

    def evidence(self, count: Floats, total: Floats, square: Floats) -> Floats:
        """Log evidence of stretches, summed over signals: from the number of steps with each signal, their sums and sums of squares, all
        (stretches, signals)."""
        n = count * self.weight
        kappa, alpha = self.count + n, self.shape + n / 2
        first, second = total * self.weight, square * self.weight
        middle = (self.count * self.mean + first) / kappa
        beta = self.scale + 0.5 * np.maximum(second + self.count * self.mean**2 - kappa * middle**2, 0.0)
        logs = gammaln(alpha) - gammaln(self.shape) + self.shape * np.log(self.scale) - alpha * np.log(beta)
        logs += 0.5 * (np.log(self.count) - np.log(kappa)) - 0.5 * n * np.log(2 * np.pi)
        return np.asarray(logs.sum(axis=1))
