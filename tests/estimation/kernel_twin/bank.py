"""A bank of filters that differ in the scale of Q, mixed as an interacting multiple model (physics.md 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kernel_twin.filters import (
    GaussianFilter,
    Matrix,
    Observation,
    Update,
    Vector,
    huber_weights,
    score,
)

SMALLEST_PROBABILITY = 1e-12
"""No mode is ever ruled out."""


@dataclass(frozen=True)
class BankUpdate:
    """What one update of the bank did; the innovation's moments are the mixture's."""

    lanes: tuple[Update, ...]
    """Each filter's own update."""
    present: NDArray[np.bool_]
    """Which channels held a number, (m,)."""
    innovation: Vector
    """y - Σ p ŷ_b, (m,), NaN where missing."""
    innovation_variance: Vector
    """Of the mixture before weighting, (m,)."""
    weight: Vector
    """Huber weights, the same for all lanes, (m,)."""
    innovation_covariance: Matrix
    """S of the present channels, of the mixture with the weighted R, (p, p)."""
    nis: Any
    """Of the mixture, with the weighted R."""
    log_likelihood: Any
    """ln Σ p_b L_b."""
    probabilities: Vector
    """After the update, (lanes,)."""


class Bank:
    """Filters b with Q_b = diag(s_b walk dt + extra) and probabilities p_b (Blom and Bar-Shalom's IMM).

    A mode is left at the rate 1/dwell towards each other mode alike. Means and covariances are mixed before
    the prediction of every mix_stride-th update, over the time since the last mixing.

    Parameters
    ----------
    filters: one a mode, alike but for their state; their own Q is not used. They may differ in kind.
    walk: (n,), variance per second. scales: s_b, (lanes,). dwell: mean time in a mode, s.
    huber: as of :class:`GaussianFilter`, judged by the mixture's innovation; the filters' own is not used.
    """

    def __init__(
        self,
        filters: Sequence[GaussianFilter],
        walk: ArrayLike,
        scales: ArrayLike,
        *,
        dwell: float,
        mix_stride: int = 1,
        huber: float = 0.0,
    ) -> None:
        self.filters = list(filters)
        dtype = self.filters[0].P.dtype
        self.walk: Vector = np.asarray(walk, dtype)
        self.scales: Vector = np.asarray(scales, dtype)
        self.dwell, self.mix_stride, self.huber = dwell, mix_stride, huber
        self.probabilities: Vector = np.full(len(self.filters), 1 / dtype.type(len(self.filters)))
        self._since_mixing: Any = dtype.type(0)
        self._updates = 0

    def moments(self) -> tuple[Vector, Matrix]:
        """Mean (n,) and covariance (n, n) of the mixture."""
        return mixture(
            self.probabilities, np.stack([f.x for f in self.filters]), np.stack([f.P for f in self.filters])
        )

    def mix(self) -> None:
        """One IMM interaction over the time since the last."""
        lanes = len(self.filters)
        stay = np.exp(-self._since_mixing / self.dwell)
        leave = -np.expm1(-self._since_mixing / self.dwell) / (lanes - 1)
        transition = np.full((lanes, lanes), leave)
        np.fill_diagonal(transition, stay)
        joint = transition * self.probabilities[:, np.newaxis]  # from row to column
        arriving = joint.sum(axis=0)
        means, covariances = np.stack([f.x for f in self.filters]), np.stack([f.P for f in self.filters])
        for b, filter in enumerate(self.filters):
            filter.x, filter.P = mixture(joint[:, b] / arriving[b], means, covariances)
        self.probabilities = arriving
        self._since_mixing = self._since_mixing * 0

    def predict(self, u: Any, dt: float, *, extra: ArrayLike = 0.0, measured: bool = True) -> None:
        """Mix if it is time, then every filter over dt with u held; extra (n,) is added to Q's diagonal.

        measured: whether an update with some channel follows; without one there is no mixing.
        """
        self._updates += measured
        if measured and self._updates % self.mix_stride == 0:
            self.mix()
        for filter, scale in zip(self.filters, self.scales, strict=True):
            filter.predict(u, dt, Q=np.diag(scale * self.walk * dt + np.asarray(extra)))
        self._since_mixing = self._since_mixing + dt

    def update(
        self, y: ArrayLike, *, R: ArrayLike | None = None, seen: Sequence[Observation] | None = None
    ) -> BankUpdate:
        """Every filter with y (m,), NaN missing, and the probabilities by their likelihoods.

        R and seen, an observation a filter, replace the filters' own.
        """
        y = np.asarray(y, dtype=self.walk.dtype)
        p = self.probabilities
        seen = [filter.observe() for filter in self.filters] if seen is None else seen
        expected, spread = mixture(
            p, np.stack([o.mean for o in seen]), np.stack([o.covariance for o in seen])
        )
        noise = self.filters[0].R if R is None else np.asarray(R, dtype=self.walk.dtype)
        innovation = y - expected
        variance = np.diag(spread) + np.diag(noise)
        weight = huber_weights(innovation, variance, self.huber)
        lanes = tuple(
            filter.update(y, R=noise, seen=o, weight=weight)
            for filter, o in zip(self.filters, seen, strict=True)
        )
        present = lanes[0].present
        block = np.ix_(present, present)
        S = spread[block] + lanes[0].noise[block]
        nis, _ = score(innovation[present], S)

        log_likelihood = np.array([lane.log_likelihood for lane in lanes])
        best = np.max(log_likelihood)
        weighted = p * np.exp(log_likelihood - best)
        total = np.sum(weighted)
        if present.any():
            floored = np.maximum(weighted / total, SMALLEST_PROBABILITY)
            self.probabilities = floored / np.sum(floored)
        return BankUpdate(
            lanes,
            present,
            innovation,
            variance,
            weight,
            S,
            nis,
            best + np.log(total),
            self.probabilities.copy(),
        )

    def step(self, y: ArrayLike, u: Any = None, dt: float = 1.0) -> BankUpdate:
        """Predict over dt with u held, then update with y."""
        self.predict(u, dt, measured=not np.all(np.isnan(y)))
        return self.update(y)


def mixture(weights: Vector, means: Matrix, covariances: Matrix) -> tuple[Vector, Matrix]:
    """Mean (n,) and covariance (n, n) of a mixture: weights (k,), means (k, n), covariances (k, n, n)."""
    mean = weights @ means
    deviation = means - mean
    spread = np.sum(weights[:, np.newaxis, np.newaxis] * covariances, axis=0)
    return mean, spread + deviation.T @ (weights[:, np.newaxis] * deviation)
