"""The kernel's filter floor in NumPy: the same steps with the same arguments, from the generic parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from kernel_twin.adaptation import AdaptiveFilter
from kernel_twin.bank import Bank, BankUpdate
from kernel_twin.filters import (
    ExtendedKalmanFilter,
    GaussianFilter,
    LinearObservation,
    Matrix,
    Observation,
    Prediction,
    Update,
    Vector,
)
from kernel_twin.supervisor import RULES, DriveSupervisor, SpeedSupervisor
from kernel_twin.traction import Input, Machine, TractionModel
from kernel_twin.unscented import UnscentedKalmanFilter
from terragrip.physics.slip import slip

TORQUE_FLOOR = 0.02
"""Torques below this share of r m g a wheel count as this (drive supervisor)."""


@dataclass(frozen=True)
class Tuning:
    """How the filter runs; the defaults are the kernel's."""

    walk: ArrayLike
    """Q_0 as a density: variance per second of each state's random walk, (2n+2,)."""
    engine: Literal["exact", "unscented"] = "exact"
    policy: Literal["fixed", "adaptive", "supervised", "bank"] = "fixed"
    huber: float = 0.0
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    rate: float = 0.05
    memory: float = 3.0
    stride: int = 5
    window: float = 0.5
    wheel_speed_min: float = 0.5
    ground_speed_min: float = 0.1
    supervisor: Literal["speeds", "drive"] = "speeds"
    scales: Sequence[float] = (0.1, 1.0, 10.0, 100.0)
    dwell: float = 5.0
    mix_stride: int = 5


@dataclass(frozen=True)
class Step:
    """What one step did."""

    update: Update | BankUpdate
    gamma: Any
    """The supervisor's γ; 1 for adaptive, 0 for fixed and bank."""
    adaptation: Vector
    """a_j used in this step, (2n+2,)."""
    prediction: Prediction | None
    """For the smoother; None of a bank."""


class TractionFilter:
    """Estimates (ω, v, μ, ρ_s) from wheel speeds, ground speed and, where there is one, an accelerometer.

    Parameters
    ----------
    machine, tuning: see there. x0 (2n+2,), P0 (2n+2, 2n+2): the first mean and covariance; P0's dtype is the
        precision of everything.
    """

    def __init__(self, machine: Machine, tuning: Tuning, x0: ArrayLike, P0: ArrayLike) -> None:
        self.dtype = np.result_type(np.asarray(P0), np.float64)
        self.model = TractionModel(machine.in_precision(self.dtype))
        self.tuning = tuning
        self.walk: Vector = np.asarray(tuning.walk, self.dtype)
        self.time: Any = self.dtype.type(0)
        n = self.model.wheels
        self._last_seen: Vector = np.full(n + 1, np.nan, self.dtype)
        self._adaptive: AdaptiveFilter | None = None
        self._bank: Bank | None = None
        if tuning.policy == "bank":
            lanes = [self._engine(x0, P0) for _ in tuning.scales]
            self._bank = Bank(
                lanes,
                self.walk,
                tuning.scales,
                dwell=tuning.dwell,
                mix_stride=tuning.mix_stride,
                huber=tuning.huber,
            )
        else:
            self._single = self._engine(x0, P0)
            if tuning.policy != "fixed":
                self._adaptive = AdaptiveFilter(
                    self._single,
                    self.walk,
                    n + 1,
                    rate=tuning.rate,
                    memory=tuning.memory,
                    stride=tuning.stride,
                    order=(*reversed(range(n)), n),  # as channels are taken: last wheel first, then v
                )
        # the γ of calm travel until the supervisor has spoken
        gamma = {"adaptive": 1.0, "supervised": RULES[0, 0]}.get(tuning.policy, 0.0)
        self._gamma: Any = self.dtype.type(gamma)
        self._supervisor: SpeedSupervisor | DriveSupervisor
        if tuning.supervisor == "speeds":
            self._supervisor = SpeedSupervisor(tuning.window, tuning.wheel_speed_min, tuning.ground_speed_min)
        else:
            weight = self.model.machine.mass * self.model.machine.gravity
            self._supervisor = DriveSupervisor(
                tuning.window, TORQUE_FLOOR * self.model.machine.radius * weight / n
            )

    def _engine(self, x0: ArrayLike, P0: ArrayLike) -> GaussianFilter:
        no_noise = np.zeros((self.model.states, self.model.states))
        no_channels = np.zeros((0, 0))  # each step brings its own Q, R and h
        common: tuple[Any, ...] = (self.model.transition, _silent, no_noise, no_channels, x0, P0)
        if self.tuning.engine == "exact":  # the model is affine, so that linearising it loses nothing
            return ExtendedKalmanFilter(*common, F=self.model.transition_matrix, huber=self.tuning.huber)
        return UnscentedKalmanFilter(
            *common,
            alpha=self.tuning.alpha,
            beta=self.tuning.beta,
            kappa=self.tuning.kappa,
            huber=self.tuning.huber,
            vectorized=True,
        )

    def moments(self) -> tuple[Vector, Matrix]:
        """x (2n+2,) and P (2n+2, 2n+2); of a bank the mixture's."""
        if self._bank is not None:
            return self._bank.moments()
        return self._single.x, self._single.P

    def sensitivity(self, j: int) -> tuple[Vector, Matrix]:
        """∂x/∂ln a_j (2n+2,) and ∂P/∂ln a_j (2n+2, 2n+2) of an adaptive filter."""
        assert self._adaptive is not None
        return self._adaptive.adaptation.dx[j], self._adaptive.adaptation.dP[j]

    def step(
        self,
        dt: float,
        before: Input,
        now: Input,
        q_input: ArrayLike,
        y: ArrayLike,
        r: ArrayLike,
    ) -> Step:
        """Predict over dt with ``before`` held, then update with the channels of y that are numbers.

        Parameters
        ----------
        q_input: (2n+2,), variance that this step adds to each state on top of the walk.
        y: (n+2,), NaN is missing. r: (n+2,), their variances. now: the input at the instant of y.
        """
        self.time = self.time + self.dtype.type(dt)
        now = now.in_precision(self.dtype)
        if self.tuning.policy == "supervised":
            self._gamma = self._supervise(np.asarray(y, self.dtype), now)
        return self._advance(dt, before, now, q_input, y, r)

    def predict(self, dt: float, before: Input, q_input: ArrayLike) -> None:
        """A step without any measurement; the supervisor's γ stays as it was."""
        self.time = self.time + self.dtype.type(dt)
        channels = self.model.wheels + 2
        now = before.in_precision(self.dtype)
        self._advance(dt, before, now, q_input, np.full(channels, np.nan), np.ones(channels))

    def _advance(
        self,
        dt: Any,
        before: Input,
        now: Input,
        q_input: ArrayLike,
        y: ArrayLike,
        r: ArrayLike,
    ) -> Step:
        before, dt = before.in_precision(self.dtype), self.dtype.type(dt)
        y, q_input = np.asarray(y, self.dtype), np.asarray(q_input, self.dtype)
        R = np.diag(np.asarray(r, self.dtype))
        unadapted = np.ones(self.model.states, self.dtype)
        if self._bank is not None:
            self._bank.predict(before, dt, extra=q_input, measured=not np.isnan(y).all())
            seen = [self._observation(lane, now) for lane in self._bank.filters]
            mixed = self._bank.update(y, R=R, seen=seen)
            return Step(mixed, self._gamma, unadapted, None)
        if self._adaptive is None:
            prediction = self._single.predict(before, dt, Q=np.diag(self.walk * dt + q_input))
            plain = self._single.update(y, R=R, seen=self._observation(self._single, now))
            return Step(plain, self._gamma, unadapted, prediction)
        scale = self._adaptive.adaptation.scale
        prediction = self._adaptive.predict(before, dt, gamma=self._gamma, extra=q_input)
        update = self._adaptive.update(y, dt, R=R, seen=self._observation(self._single, now))
        return Step(update, self._gamma, scale, prediction)

    def _observation(self, filter: GaussianFilter, now: Input) -> Observation:
        """What the filter expects of the channels with the input ``now``."""
        if isinstance(filter, ExtendedKalmanFilter):
            expected = self.model.output(filter.x, now)
            return LinearObservation(filter.P, expected, self.model.output_matrix(filter.x, now))
        return filter.observe(lambda points: self.model.output(points, now))

    def _supervise(self, y: Vector, now: Input) -> Any:
        """γ_k from the measurements up to and with y."""
        n = self.model.wheels
        self._last_seen = np.where(np.isnan(y[: n + 1]), self._last_seen, y[: n + 1])
        wheel_speed, ground_speed = self._last_seen[:n], self._last_seen[n]
        if isinstance(self._supervisor, SpeedSupervisor):
            return self._supervisor.gamma(self.time, wheel_speed, ground_speed)
        slips = slip(
            wheel_speed,
            ground_speed,
            self.model.machine.radius,
            standstill_speed=self.tuning.ground_speed_min,
        )
        known = ~np.isnan(slips)
        return self._supervisor.gamma(self.time, now.torque, np.mean(slips[known]) if known.any() else np.nan)

    def restart(self, walk_time: float, outputs: ArrayLike, variances: ArrayLike) -> None:
        """Start (ω, v) anew at outputs (n+1,) with variances (n+1,), uncorrelated.

        The marginal of (μ, ρ_s) is kept; walk_time [s] of the parameters' random walk is added. For
        standstill (0), a long gap, a change of direction. What was adapted, and the supervisor's window,
        stay.
        """
        fresh = np.arange(self.model.states) <= self.model.wheels
        lanes: list[tuple[GaussianFilter, Any]] = (
            [(self._single, 1)]
            if self._bank is None
            else list(zip(self._bank.filters, self._bank.scales, strict=True))
        )
        for filter, scale in lanes:
            walked = filter.P + np.diag(scale * self.walk * walk_time)
            filter.x = np.where(fresh, np.append(outputs, np.zeros(sum(~fresh))), filter.x)
            filter.P = np.where(np.outer(~fresh, ~fresh), walked, 0)
            filter.P[fresh, fresh] = variances
        if self._adaptive is not None:
            self._adaptive.adaptation.restart(fresh)


def _silent(x: Vector) -> Vector:
    """No channels."""
    return x[..., :0]
