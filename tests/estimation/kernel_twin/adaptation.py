"""The adaptation matrix A_k: process noise that follows the innovations (physics.md 6 (R))."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kernel_twin.filters import (
    GaussianFilter,
    Matrix,
    Observation,
    Prediction,
    Update,
    Vector,
)
from kernel_twin.linear_algebra import cholesky, solve_lower, solve_positive

SMALLEST, LARGEST = 0.05, 50.0
"""Bounds of a_j (R)."""
LARGEST_STEP = 0.2
"""Bound of one step of ln a_j."""
DAMPING = 1e-3
"""Keeps h_j from 0 where S does not feel a_j."""


class Adaptation:
    """Scales a_j of the n process noises, their sensitivities, and the remembered innovations (R).

    Innovations are whitened by the S = L Lᵀ of their own step, e = L⁻¹ν, and C, an exponential mean of e eᵀ that starts as I,
    is compared with I (docs/decisions/0024-whitened-innovations.md). With ΔS = C - I, V = tr(ΔS ΔSᵀ) is driven down: ln a_j moves by
    -η g_j/h_j, clipped to ±0.2, with g_j = 2 tr(ΔS ∂ΔS_j), h_j = 2‖∂ΔS_j‖² + 1e-3 and ∂ΔS_j = -L⁻¹ ∂S_j L⁻ᵀ of the present
    step. ∂S_j runs through the filter's whole recursion: the one-step derivative is exactly zero for the noises of μ and ρ_s.

    Parameters
    ----------
    states: n. outputs: the first m channels take part. rate: η. memory: of C, s.
    stride: a step of A at every stride-th update that has all m channels.
    order: of the m outputs in ν, which decides what L is; None: as they come.
    """

    def __init__(
        self,
        states: int,
        outputs: int,
        *,
        rate: float,
        memory: float,
        stride: int,
        order: Sequence[int] | None = None,
        dtype: Any = np.float64,
    ) -> None:
        self.order = np.arange(outputs) if order is None else np.array(order)
        self.outputs, self.rate, self.memory, self.stride = outputs, rate, memory, stride
        self.scale: Vector = np.ones(states, dtype)
        """a_j, (n,)."""
        self.dx: Matrix = np.zeros((states, states), dtype)
        """∂x/∂ln a_j, (n parameters, n)."""
        self.dP: NDArray[Any] = np.zeros((states, states, states), dtype)
        """∂P/∂ln a_j, (n parameters, n, n)."""
        self.C: Matrix = np.eye(outputs, dtype=dtype)
        """Remembered e eᵀ, (m, m), in the order of the channels."""
        self._complete_updates = 0

    def predict(self, F: Matrix, excitation: Vector) -> None:
        """∂x⁻ = F ∂x⁺, ∂P⁻ = F ∂P⁺ Fᵀ + E; excitation (n,) is the diagonal ∂Q_jj/∂ln a_j."""
        self.dx = self.dx @ F.T
        self.dP = F @ self.dP @ F.T
        each = np.arange(len(excitation))
        self.dP[each, each, each] += excitation

    def update(self, update: Update, dt: float) -> None:
        """Remember the innovations of a step of dt, step A if it is time, and carry the sensitivities on."""
        m = self.outputs
        order = self.order[update.present[:m][self.order]]
        if len(order):
            S = update.observation.covariance[:m, :m] + update.noise[:m, :m]
            self._remember(S, order, np.sqrt(update.weight[:m]) * update.innovation[:m], dt)
            if len(order) == m:
                self._complete_updates += 1
                if self._complete_updates % self.stride == 0:
                    H = update.observation.matrix[:m]
                    self.scale = self.stepped_scale(S, H @ self.dP @ H.T)
        self._carry(update)

    def _remember(self, S: Matrix, order: NDArray[np.intp], innovation: Vector, dt: float) -> None:
        block = np.ix_(order, order)
        white = solve_lower(cholesky(S[block]), innovation[order])
        share = -np.expm1(-self.C.dtype.type(dt) / self.memory)
        self.C[block] += share * (np.outer(white, white) - self.C[block])

    def stepped_scale(self, S: Matrix, dS: NDArray[Any]) -> Vector:
        """a (n,) after one step with the innovation covariance S (m, m), of sensitivities dS (n, m, m)."""
        block = np.ix_(self.order, self.order)
        L = cholesky(S[block])
        mismatch = self.C[block] - np.eye(self.outputs)
        gradient_of_mismatch = [-_whitened(L, one[block]) for one in dS]
        g = np.array([2 * np.sum(mismatch * one) for one in gradient_of_mismatch])
        h = np.array([2 * np.sum(one * one) for one in gradient_of_mismatch]) + DAMPING
        step = np.clip(-self.rate * g / h, -LARGEST_STEP, LARGEST_STEP)
        return np.clip(self.scale * np.exp(step), SMALLEST, LARGEST)

    def _carry(self, update: Update) -> None:
        """The sensitivities through an update as physics.md 6 prints them; Huber weights count as constants."""
        if not update.present.any():
            return
        H = update.observation.matrix[update.present]
        K, S, innovation = update.gain, update.innovation_covariance, update.innovation[update.present]
        dS = H @ self.dP @ H.T
        dK = _divided(self.dP @ H.T - K @ dS, S)
        d_innovation = -self.dx @ H.T
        self.dx = self.dx + dK @ innovation + d_innovation @ K.T
        twice = dK @ S @ K.T
        self.dP = self.dP - twice - K @ dS @ K.T - np.swapaxes(twice, -1, -2)

    def restart(self, fresh: NDArray[np.bool_]) -> None:
        """Forget the sensitivities of the states that start anew, fresh (n,)."""
        self.dx[:, fresh] = 0
        self.dP[:, fresh, :] = 0
        self.dP[:, :, fresh] = 0


def _whitened(L: Matrix, matrix: Matrix) -> Matrix:
    """L⁻¹ matrix L⁻ᵀ."""
    return solve_lower(L, solve_lower(L, matrix).T).T


def _divided(stack: NDArray[Any], S: Matrix) -> NDArray[Any]:
    """Each matrix of the stack (k, n, p) times S⁻¹ (p, p)."""
    rows = stack.reshape(-1, len(S))
    return solve_positive(S, rows.T).T.reshape(stack.shape)


class AdaptiveFilter:
    """Any filter with Q_k = [I + γ_k (A_k - I)] Q_0 + extra, Q_0 = diag(walk) dt (physics.md 6 (R)).

    Parameters
    ----------
    filter: its own Q is not used. walk: variance of each state's random walk per second, (n,).
    outputs: how many of the channels, from the first, take part in the adaptation.
    rate, memory [s], stride, order: of :class:`Adaptation`.
    """

    def __init__(
        self,
        filter: GaussianFilter,
        walk: ArrayLike,
        outputs: int,
        *,
        rate: float = 0.05,
        memory: float = 3.0,
        stride: int = 5,
        order: Sequence[int] | None = None,
    ) -> None:
        self.filter = filter
        self.walk: Vector = np.asarray(walk, dtype=filter.P.dtype)
        self.adaptation = Adaptation(
            filter.x.size,
            outputs,
            rate=rate,
            memory=memory,
            stride=stride,
            order=order,
            dtype=filter.P.dtype,
        )

    def predict(self, u: Any, dt: float, *, gamma: float = 1.0, extra: ArrayLike = 0.0) -> Prediction:
        """x, P and sensitivities over dt; gamma from 0 (Q_0 alone) to 1; extra (n,) adds to Q's diagonal."""
        a = self.adaptation.scale
        Q = np.diag((1 + gamma * (a - 1)) * self.walk * dt + np.asarray(extra))
        prediction = self.filter.predict(u, dt, Q=Q)
        self.adaptation.predict(prediction.transition, gamma * a * self.walk * dt)
        return prediction

    def update(
        self, y: ArrayLike, dt: float, *, R: ArrayLike | None = None, seen: Observation | None = None
    ) -> Update:
        """Take y as :meth:`GaussianFilter.update` does, dt after the last call; then adapt."""
        update = self.filter.update(y, R=R, seen=seen)
        self.adaptation.update(update, dt)
        return update

    def step(self, y: ArrayLike, u: Any = None, dt: float = 1.0, *, gamma: float = 1.0) -> Update:
        """Predict over dt with u held, then update with y and adapt."""
        self.predict(u, dt, gamma=gamma)
        return self.update(y, dt)
