"""The unscented Kalman filter as the paper prints it, with physics.md 6's corrections."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kernel_twin.filters import (
    GaussianFilter,
    Matrix,
    Measurement,
    Noise,
    Observation,
    Transition,
    Vector,
)
from kernel_twin.linear_algebra import cholesky, solve_positive


class UnscentedKalmanFilter(GaussianFilter):
    """Sigma points through f(x, u, dt), redrawn before the update, then through h(x).

    The paper's equations, with these corrections: the stray "=" in ŷ is dropped, the sum for P runs over
    χ - K y (Joseph form) in place of P - K S Kᵀ, and R is not adapted. x' = f + q, y = h + r, noise additive.

    Parameters
    ----------
    f, h: see :data:`Transition` and :data:`Measurement`; a continuous model goes through :func:`runge_kutta`.
    Q, R, x0, P0, huber: as of :class:`GaussianFilter`.
    alpha, beta, kappa: spread of the points (Wan and van der Merwe). The default makes the centre's weight
        in the mean 0. alpha = 1e-3 costs nine digits and kappa = 3 - n makes that weight negative (physics.md 1): refused.
    vectorized: f and h take all points at once, (points, n).
    """

    def __init__(
        self,
        f: Transition,
        h: Measurement,
        Q: Noise,
        R: ArrayLike,
        x0: ArrayLike,
        P0: ArrayLike,
        *,
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 0.0,
        huber: float = 0.0,
        vectorized: bool = False,
    ) -> None:
        super().__init__(Q, R, x0, P0, huber=huber)
        self.f, self.h, self.vectorized = f, h, vectorized
        n = self.x.size
        spread = self.P.dtype.type(alpha) ** 2 * (n + self.P.dtype.type(kappa))  # n + λ
        if not spread >= n:
            raise ValueError(
                f"alpha²(n + kappa) = {spread} makes the centre weight negative; take at least {n}"
            )
        self.spread = spread
        self.mean_weights = np.full(2 * n + 1, 1 / (2 * spread))
        self.mean_weights[0] = (spread - n) / spread
        self.covariance_weights = self.mean_weights.copy()
        self.covariance_weights[0] += 1 - self.P.dtype.type(alpha) ** 2 + beta

    def sigma_points(self) -> Matrix:
        """χ (2n+1, n): the mean, and the mean ± the columns of L sqrt(n + λ) with P = L Lᵀ."""
        offsets = np.sqrt(self.spread) * cholesky(self.P).T
        return np.concatenate([self.x[np.newaxis], self.x + offsets, self.x - offsets])

    def _through(self, function: Callable[[Vector], Vector], points: Matrix) -> Matrix:
        """The function of every point, (2n+1, ...)."""
        return function(points) if self.vectorized else np.stack([function(point) for point in points])

    def _propagate(self, u: Any, dt: float) -> tuple[Vector, Matrix, Matrix]:
        """Predicted mean and covariance without Q, and the cross covariance (paper eq. 10 and 11)."""
        points = self.sigma_points()
        moved = self._through(lambda x: self.f(x, u, dt), points)
        mean = self.mean_weights @ moved
        weighted = self.covariance_weights[:, np.newaxis] * (moved - mean)
        return mean, (moved - mean).T @ weighted, (points - self.x).T @ weighted

    def observe(self, h: Measurement | None = None) -> Observation:
        """ŷ, S without R, and C, from points redrawn from the prediction (the paper's unnumbered equations before eq. 12)."""
        points = self.sigma_points()
        outputs = self._through(self.h if h is None else h, points)
        mean = self.mean_weights @ outputs
        return SigmaPointObservation(self.P, mean, points - self.x, outputs - mean, self.covariance_weights)


class SigmaPointObservation(Observation):
    """Channels seen through sigma points: deviations of the states (k, n) and of the outputs (k, m)."""

    def __init__(self, P: Matrix, mean: Vector, states: Matrix, outputs: Matrix, weights: Vector) -> None:
        self.mean = mean
        self.covariance = outputs.T @ (weights[:, np.newaxis] * outputs)
        self.cross = states.T @ (weights[:, np.newaxis] * outputs)
        self._P, self._states, self._outputs, self._weights = P, states, outputs, weights

    @cached_property
    def matrix(self) -> Matrix:
        """H = crossᵀ P⁻¹, of the statistical linearisation."""
        return solve_positive(self._P, self.cross).T

    def posterior(self, kept: NDArray[np.bool_], gain: Matrix, noise: Matrix) -> Matrix:
        rest = self._states - self._outputs[:, kept] @ gain.T
        return rest.T @ (self._weights[:, np.newaxis] * rest) + gain @ noise @ gain.T
