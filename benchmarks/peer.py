"""The peer: filterpy's unscented Kalman filter on the very model that the kernel filters (physics.md 1).

It gets what costs `terragrip.estimate` work for nothing: vertical loads, checked tables, no missing values.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
GRAVITY = 9.80665


@dataclass(frozen=True)
class Machine:
    """Constants of the model for n wheels."""

    mass: float
    radius: FloatArray
    inertia: FloatArray
    bearing_resistance: FloatArray
    tire_rolling_resistance: float


@dataclass(frozen=True)
class Problem:
    """A filtering problem: constants, noise, and rows of inputs and measurements at a steady `dt` [s].

    `torque`, `load` (steps, n), `drawbar` (steps,): held over the step that leads to the row of `measured`
    (steps, n + 1), the wheel speeds and the ground speed. `walk` (2 n + 2,): variance a second of each
    state; `noise` (n + 1,): variances of the channels.
    """

    machine: Machine
    dt: float
    torque: FloatArray
    load: FloatArray
    drawbar: FloatArray
    measured: FloatArray
    walk: FloatArray
    noise: FloatArray
    start: FloatArray
    start_covariance: FloatArray


def run(problem: Problem, steps: int) -> tuple[FloatArray, float]:
    """Filter the first `steps` rows; the last state (2 n + 2,) and the seconds a step took.

    filterpy 2 draws the sigma points anew from the predicted moments, as physics.md 6 asks and the kernel does.
    """
    machine, n = problem.machine, problem.load.shape[1]

    def rates(x: FloatArray, torque: FloatArray, load: FloatArray, drawbar: float) -> FloatArray:
        arm = machine.radius * load
        rates = np.zeros_like(x)
        rates[:n] = (
            torque
            - arm * (x[n + 1 : 2 * n + 1] + machine.tire_rolling_resistance)
            - machine.radius * machine.bearing_resistance * x[:n]
        ) / machine.inertia
        rates[n] = (x[n + 1 : 2 * n + 1] @ load - drawbar) / machine.mass - x[-1] * GRAVITY
        return rates

    def transition(
        x: FloatArray, dt: float, torque: FloatArray, load: FloatArray, drawbar: float
    ) -> FloatArray:
        k1 = rates(x, torque, load, drawbar)
        k2 = rates(x + dt / 2 * k1, torque, load, drawbar)
        k3 = rates(x + dt / 2 * k2, torque, load, drawbar)
        k4 = rates(x + dt * k3, torque, load, drawbar)
        return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    states = 2 * n + 2
    points = MerweScaledSigmaPoints(states, alpha=1.0, beta=2.0, kappa=0.0)
    peer = UnscentedKalmanFilter(
        states, n + 1, problem.dt, hx=lambda x: x[: n + 1], fx=transition, points=points
    )
    peer.x, peer.P = problem.start.copy(), problem.start_covariance.copy()
    peer.Q, peer.R = np.diag(problem.walk * problem.dt), np.diag(problem.noise)
    begin = time.perf_counter()
    for k in range(steps):
        peer.predict(torque=problem.torque[k], load=problem.load[k], drawbar=float(problem.drawbar[k]))
        peer.update(problem.measured[k])
    return peer.x, (time.perf_counter() - begin) / steps
