"""What all Kalman filters share, and the two that work with matrices: linear and extended.

Slow and readable. All work in the precision of ``P0``: give it as ``numpy.longdouble`` and everything is computed so.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kernel_twin.linear_algebra import cholesky, solve_lower, solve_positive, symmetric

Matrix = NDArray[Any]
Vector = NDArray[Any]
Transition = Callable[[Vector, Any, float], Vector]
"""f(x, u, dt): the state after dt seconds with the input u held."""
Measurement = Callable[[Vector], Vector]
"""h(x): what the sensors read."""
Noise = ArrayLike | Callable[[float], ArrayLike]
"""Q, the covariance that one prediction adds, or a function of dt that gives it."""


@dataclass(frozen=True)
class Prediction:
    """What one prediction of n states did."""

    before: Matrix
    """P before, (n, n)."""
    mean: Vector
    """x after, (n,)."""
    covariance: Matrix
    """P after, Q included, (n, n)."""
    cross: Matrix
    """Covariance of the states before (rows) and after (columns), (n, n): P Fᵀ."""

    @cached_property
    def transition(self) -> Matrix:
        """F (n, n); of an unscented filter that of the statistical linearisation, crossᵀ P⁻¹."""
        return solve_positive(self.before, self.cross).T


class Observation(ABC):
    """What the filter expects m channels to read, before it has seen them."""

    mean: Vector
    """ŷ, (m,)."""
    covariance: Matrix
    """H P Hᵀ without R, (m, m)."""
    cross: Matrix
    """P Hᵀ, (n, m)."""

    @property
    @abstractmethod
    def matrix(self) -> Matrix:
        """H (m, n), where need be that of the statistical linearisation."""

    @abstractmethod
    def posterior(self, kept: NDArray[np.bool_], gain: Matrix, noise: Matrix) -> Matrix:
        """P after the kept channels in Joseph form; P - K S Kᵀ as printed loses definiteness under
        rounding.
        """


@dataclass(frozen=True)
class Update:
    """What one update did: m channels, of which p were present."""

    present: NDArray[np.bool_]
    """Which channels held a number, (m,)."""
    innovation: Vector
    """y - ŷ, (m,), NaN where missing."""
    innovation_variance: Vector
    """Diagonal of H P Hᵀ + R before any weighting, (m,)."""
    weight: Vector
    """Huber weights, (m,), 1 where missing."""
    noise: Matrix
    """R as used, weighted, (m, m)."""
    observation: Observation
    """What was expected."""
    gain: Matrix
    """K, (n, p)."""
    innovation_covariance: Matrix
    """S of the present channels with the weighted R, (p, p)."""
    nis: Any
    """νᵀ S⁻¹ ν, a scalar."""
    log_likelihood: Any
    """Of the present channels, a scalar."""


class GaussianFilter(ABC):
    """The part that every Kalman filter shares. x (n,) and P (n, n) are public and may be set.

    Parameters
    ----------
    Q: covariance that one prediction adds, (n, n), or a function of dt.
    R: measurement covariance, (m, m).
    x0, P0: first mean (n,) and covariance (n, n).
    huber: 0, or the number of innovation SDs beyond which a channel is trusted less: its variance in R is
        divided by w = huber SD/|ν|. Never a hard gate (physics.md 6). All weights come from the prior.
    """

    def __init__(self, Q: Noise, R: ArrayLike, x0: ArrayLike, P0: ArrayLike, *, huber: float = 0.0) -> None:
        self.P: Matrix = symmetric(np.array(P0, dtype=np.result_type(np.asarray(P0), np.float64)))
        self.x: Vector = np.array(x0, dtype=self.P.dtype)
        self.Q = Q
        self.R: Matrix = np.array(R, dtype=self.P.dtype)
        self.huber = huber
        if self.P.shape != (self.x.size, self.x.size):
            raise ValueError(f"x0 has {self.x.size} states, P0 has the shape {self.P.shape}")

    @abstractmethod
    def _propagate(self, u: Any, dt: float) -> tuple[Vector, Matrix, Matrix]:
        """Mean after, covariance after without Q, and cross covariance of before and after."""

    @abstractmethod
    def observe(self, h: Measurement | None = None) -> Observation:
        """What the channels are expected to read now, by the filter's own h or by another."""

    def predict(self, u: Any = None, dt: float = 1.0, *, Q: ArrayLike | None = None) -> Prediction:
        """x and P over dt with the input u held; Q (n, n) replaces the filter's own for this step."""
        if Q is None:
            Q = self.Q(dt) if callable(self.Q) else self.Q
        mean, covariance, cross = self._propagate(u, dt)
        covariance = symmetric(covariance + np.asarray(Q, dtype=self.P.dtype))
        prediction = Prediction(self.P, mean, covariance, cross)
        self.x, self.P = mean, covariance
        return prediction

    def update(
        self,
        y: ArrayLike,
        *,
        R: ArrayLike | None = None,
        h: Measurement | None = None,
        seen: Observation | None = None,
        weight: Vector | None = None,
    ) -> Update:
        """Update by the measurement y (m,) (paper eq. 12 and 13); NaN is a missing channel, all NaN changes nothing.

        R and h replace the filter's own; weight (m,) replaces the Huber weights, seen the observation.
        """
        y = np.asarray(y, dtype=self.P.dtype)
        noise = self.R if R is None else np.asarray(R, dtype=self.P.dtype)
        seen = self.observe(h) if seen is None else seen
        present = ~np.isnan(y)
        innovation = y - seen.mean
        variance = np.diag(seen.covariance) + np.diag(noise)
        weight = huber_weights(innovation, variance, self.huber) if weight is None else weight
        softened = noise / np.sqrt(np.outer(weight, weight))

        block = np.ix_(present, present)
        S = symmetric(seen.covariance[block] + softened[block])
        gain = solve_positive(S, seen.cross[:, present].T).T
        nis, likelihood = score(innovation[present], S)
        if present.any():
            self.x = self.x + gain @ innovation[present]
            self.P = symmetric(seen.posterior(present, gain, softened[block]))
        return Update(present, innovation, variance, weight, softened, seen, gain, S, nis, likelihood)

    def step(self, y: ArrayLike, u: Any = None, dt: float = 1.0) -> Update:
        """Predict over dt with u held, then update with y."""
        self.predict(u, dt)
        return self.update(y)


def huber_weights(innovation: Vector, variance: Vector, bound: float) -> Vector:
    """w (m,): 1 within ``bound`` SDs and where ν is NaN, bound SD/|ν| beyond; bound 0 switches it off."""
    weight = np.ones_like(variance)
    if bound > 0:
        limit = bound * np.sqrt(variance)
        beyond = np.abs(innovation) > limit  # False for NaN
        weight[beyond] = limit[beyond] / np.abs(innovation[beyond])
    return weight


def score(innovation: Vector, S: Matrix) -> tuple[Any, Any]:
    """νᵀ S⁻¹ ν and the Gaussian log-likelihood of ν (p,) with the covariance S (p, p); 0, 0 for p = 0."""
    factor = cholesky(S)
    white = solve_lower(factor, innovation)
    nis = white @ white
    log_determinant = 2 * np.sum(np.log(np.diag(factor)))
    return nis, -(nis + log_determinant + innovation.size * np.log(2 * np.pi)) / 2


class LinearObservation(Observation):
    """Channels that read H x, or that are linearised so at x."""

    def __init__(self, P: Matrix, mean: Vector, H: Matrix) -> None:
        self.mean = mean
        self.cross = P @ H.T
        self.covariance = H @ self.cross
        self._P, self._H = P, H

    @property
    def matrix(self) -> Matrix:
        return self._H

    def posterior(self, kept: NDArray[np.bool_], gain: Matrix, noise: Matrix) -> Matrix:
        rest = np.eye(len(self._P), dtype=self._P.dtype) - gain @ self._H[kept]
        return rest @ self._P @ rest.T + gain @ noise @ gain.T


class KalmanFilter(GaussianFilter):
    """Linear: x' = F x + B u + q, y = H x + r. F and B may be functions of dt; Q, R, x0, P0 as the base's."""

    def __init__(
        self,
        F: ArrayLike | Callable[[float], ArrayLike],
        H: ArrayLike,
        Q: Noise,
        R: ArrayLike,
        x0: ArrayLike,
        P0: ArrayLike,
        *,
        B: ArrayLike | Callable[[float], ArrayLike] | None = None,
        huber: float = 0.0,
    ) -> None:
        super().__init__(Q, R, x0, P0, huber=huber)
        self.F, self.B = F, B
        self.H: Matrix = np.asarray(H, dtype=self.P.dtype)

    def _propagate(self, u: Any, dt: float) -> tuple[Vector, Matrix, Matrix]:
        F = np.asarray(self.F(dt) if callable(self.F) else self.F, dtype=self.P.dtype)
        mean = F @ self.x
        if self.B is not None:
            mean = mean + np.asarray(self.B(dt) if callable(self.B) else self.B, dtype=self.P.dtype) @ u
        cross = self.P @ F.T
        return mean, F @ cross, cross

    def observe(self, h: Measurement | None = None) -> Observation:
        if h is not None:
            raise ValueError("a linear filter measures by its matrix H and takes no other h")
        return LinearObservation(self.P, self.H @ self.x, self.H)


class ExtendedKalmanFilter(GaussianFilter):
    """Linearised at the mean: f(x, u, dt), h(x) with their Jacobians, by central differences if not given.

    Parameters
    ----------
    f, h: see :data:`Transition` and :data:`Measurement`; a continuous model goes through :func:`runge_kutta`.
    F: ∂f/∂x (n, n) as a function of x, u, dt. H: ∂h/∂x (m, n) as a function of x. Q, R, x0, P0 as the base's.
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
        F: Callable[[Vector, Any, float], Matrix] | None = None,
        H: Callable[[Vector], Matrix] | None = None,
        huber: float = 0.0,
    ) -> None:
        super().__init__(Q, R, x0, P0, huber=huber)
        self.f, self.h, self.F, self.H = f, h, F, H

    def _propagate(self, u: Any, dt: float) -> tuple[Vector, Matrix, Matrix]:
        F = jacobian(lambda x: self.f(x, u, dt), self.x) if self.F is None else self.F(self.x, u, dt)
        cross = self.P @ F.T
        return self.f(self.x, u, dt), F @ cross, cross

    def observe(self, h: Measurement | None = None) -> Observation:
        own, h = h is None, self.h if h is None else h
        H = self.H(self.x) if own and self.H is not None else jacobian(h, self.x)
        return LinearObservation(self.P, h(self.x), H)


def jacobian(function: Callable[[Vector], Vector], x: Vector) -> Matrix:
    """∂function/∂x (m, n) at x (n,) by central differences, each step the cube root of the rounding unit."""
    step = np.cbrt(np.finfo(x.dtype).eps) * np.maximum(np.abs(x), 1)
    columns = []
    for i in range(x.size):
        ahead, behind = x.copy(), x.copy()
        ahead[i] += step[i]
        behind[i] -= step[i]
        columns.append((function(ahead) - function(behind)) / (ahead[i] - behind[i]))
    return np.stack(columns, axis=-1)


def runge_kutta(derivative: Callable[[Vector, Any], Vector], substeps: int = 1) -> Transition:
    """f(x, u, dt) of a continuous model dx/dt = derivative(x, u): classical fourth order, equal substeps."""

    def transition(x: Vector, u: Any, dt: float) -> Vector:
        h = dt / substeps
        for _ in range(substeps):
            k1 = derivative(x, u)
            k2 = derivative(x + h / 2 * k1, u)
            k3 = derivative(x + h / 2 * k2, u)
            k4 = derivative(x + h * k3, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return x

    return transition
