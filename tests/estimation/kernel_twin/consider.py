"""Considered constants: what cannot be distinguished from the data still widens the interval (Schmidt; physics.md 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kernel_twin.filters import Matrix, Prediction, Update, Vector
from kernel_twin.traction import Input, TractionModel, with_constant_error

COMPLEX_STEP = 1e-30
"""Im f(c + i h)/h is the derivative of an analytic f to rounding, without a difference."""


@dataclass(frozen=True)
class Constant:
    """A constant with a prior SD: a name of :func:`with_constant_error`, or ``acceleration_bias`` [m/s²]."""

    name: str
    std: float
    wheel: int | None = None


class Considered:
    """The sensitivities ξ = ∂x̂/∂c (n, constants) of the estimate to errors of considered constants.

    ξ⁻ = F ξ⁺ + ∂f/∂c, ξ⁺ = ξ⁻ - K (H ξ⁻ + ∂h/∂c): the recursion of the estimate itself, with the filter's
    gain. The error covariance is then P + ξ diag(σ²) ξᵀ, as in the Schmidt-Kalman filter but with the gain
    left as it is.
    """

    def __init__(self, model: TractionModel, constants: Sequence[Constant], dtype: Any = np.float64) -> None:
        self.model, self.constants = model, tuple(constants)
        self.sensitivity: Matrix = np.zeros((model.states, len(self.constants)), dtype)

    def predict(self, prediction: Prediction, x: Vector, u: Input, dt: Any) -> None:
        """Carry ξ through the prediction that led on from the mean x (n,) with the input u over dt."""
        errors = [
            self._by_constant(constant, u, lambda m, v: m.transition(x, v, dt)) for constant in self.constants
        ]
        self.sensitivity = prediction.transition @ self.sensitivity + self._columns(errors)

    def update(self, update: Update, x: Vector, u: Input) -> None:
        """Carry ξ through the update of the prior mean x (n,), u the input at that instant."""
        errors = []
        for constant in self.constants:
            if constant.name == "acceleration_bias":
                errors.append(np.eye(self.model.wheels + 2)[-1])
            else:
                errors.append(self._by_constant(constant, u, lambda m, v: m.output(x, v)))
        expected = update.observation.matrix @ self.sensitivity + self._columns(errors)
        self.sensitivity = self.sensitivity - update.gain @ expected[update.present]

    def covariance(self) -> Matrix:
        """ξ diag(σ²) ξᵀ, (n, n), to be added to P."""
        scaled = self.sensitivity * np.array([constant.std for constant in self.constants])
        return scaled @ scaled.T

    def _by_constant(self, constant: Constant, u: Input, function: Any) -> Vector:
        if constant.name == "acceleration_bias":
            return np.zeros(self.model.states)
        step = np.result_type(self.sensitivity, np.complex64).type(1j * COMPLEX_STEP)
        machine, v = with_constant_error(self.model.machine, u, constant.name, constant.wheel, step)
        return np.imag(function(TractionModel(machine), v)) / COMPLEX_STEP

    def _columns(self, vectors: Sequence[Vector]) -> Matrix:
        return np.stack(vectors, axis=-1).astype(self.sensitivity.dtype)
