"""Random traction problems: badly scaled machines, full covariances, missing channels, spikes, uneven
time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))  # for kernel_filter.py and kernel_twin

from kernel_twin import Input, Machine, TractionModel


@dataclass(frozen=True)
class Instant:
    """The arguments of one filter step, and what happens before it."""

    dt: float
    before: Input
    now: Input
    q_input: NDArray[np.float64]
    y: NDArray[np.float64]
    r: NDArray[np.float64]
    restart: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class Problem:
    machine: Machine
    walk: NDArray[np.float64]
    x0: NDArray[np.float64]
    P0: NDArray[np.float64]
    instants: list[Instant]

    @property
    def wheels(self) -> int:
        return len(self.machine.radius)


def random_covariance(rng: np.random.Generator, size: int, condition: float) -> NDArray[np.float64]:
    """A full symmetric positive definite matrix with that condition number."""
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    half = basis * np.sqrt(np.geomspace(1 / condition, 1, size))
    matrix: NDArray[np.float64] = half @ half.T
    return matrix


def random_machine(rng: np.random.Generator, wheels: int) -> Machine:
    mass = 10 ** rng.uniform(1.5, 4.2)
    radius = rng.uniform(0.1, 1.0, wheels)
    inertia = mass / wheels * radius**2 * 10 ** rng.uniform(-1.5, 0, wheels)
    settling = 10 ** rng.uniform(-2, 1.2, wheels)  # r ρ_w/J, 1/s
    return Machine(mass, 9.81, rng.uniform(0, 0.06), radius, inertia, settling * inertia / radius)


def make_problem(
    seed: int,
    wheels: int,
    steps: int,
    *,
    condition: float = 1e9,
    scale: float = 1.0,
    missing: float = 0.0,
    spikes: float = 0.0,
    accelerometer: bool = False,
    restarts: bool = False,
    steady_rate: bool = False,
    loaded: bool = False,
) -> Problem:
    """Measurements that the model itself could have given, from a random start, with random inputs.

    condition: of P0. scale: P0 is multiplied by it. missing: share of values, and of whole instants.
    spikes: share of values that are 10 to 1000 SDs off. steady_rate: a fixed dt. loaded: a mass that grows by
    half, and a load on the hitch that comes and goes.
    """
    rng = np.random.default_rng(seed)
    machine = random_machine(rng, wheels)
    model = TractionModel(machine)
    n, nx = wheels, 2 * wheels + 2
    P0 = scale * random_covariance(rng, nx, condition)
    x0 = np.concatenate([rng.normal(0, 10, n), rng.normal(0, 2, 1), rng.uniform(-0.1, 0.8, n), [0.1]])
    walk = 10 ** np.concatenate([rng.uniform(-6, -2, n + 1), rng.uniform(-5, -1, n + 1)])
    r = 10 ** np.concatenate([rng.uniform(-6, 0, n + 1), rng.uniform(-4, 1, 1)])
    truth = x0 + np.linalg.cholesky(P0 / scale) @ rng.normal(size=nx)

    static = rng.uniform(0.3, 2, n) * machine.mass * machine.gravity / n

    def driven(x: NDArray[np.float64], phase: float) -> Input:
        """Torques and pull that hold speeds near some that wander, so that no speed outgrows its digits."""
        wheel_speed, ground_speed, adhesion, resistance = model.split(x)
        load, slope = static * (1 + 0.2 * np.sin(2 * phase + np.arange(n))), 0.1 * np.cos(phase)
        spin = 2 * (8 * np.sin(phase + np.arange(n)) - wheel_speed)
        acceleration = 2 * (1.5 * np.cos(phase) - ground_speed) + 9.81 * np.sin(slope)
        drag = (adhesion + machine.tire_rolling_resistance) * load + machine.bearing_resistance * wheel_speed
        mass = machine.mass * (1.5 - 0.5 * np.cos(phase)) if loaded else machine.mass
        hitch = 0.3 * machine.mass * 9.81 * np.sin(3 * phase) if loaded else 0.0
        thrust = adhesion @ load - resistance * (mass * 9.81 * np.cos(slope) + hitch)
        torque = machine.inertia * spin + machine.radius * drag
        return Input(torque, load, thrust - mass * acceleration, slope, mass if loaded else 0.0, hitch)

    instants = []
    before = driven(truth, 0.0)
    for k in range(steps):
        dt = (
            0.01
            if steady_rate
            else rng.choice([0.0, 0.002, 0.01, 0.013, 0.05, 0.4], p=[0.02, 0.2, 0.4, 0.2, 0.17, 0.01])
        )
        q_input = 10 ** rng.uniform(-9, -4, nx) * (rng.random() < 0.7) * (np.arange(nx) <= n)
        truth = model.transition(truth, before, dt) + rng.normal(size=nx) * np.sqrt(walk * dt + q_input)
        now = driven(truth, 0.005 * k)
        y = model.output(truth, now) + rng.normal(size=n + 2) * np.sqrt(r)
        y += (rng.random(n + 2) < spikes) * np.sqrt(r) * 10 ** rng.uniform(1, 3, n + 2)
        y[rng.random(n + 2) < missing] = np.nan
        if rng.random() < missing / 4:
            y[:] = np.nan
        if not accelerometer:
            y[-1] = np.nan
        restart = None
        if restarts and rng.random() < 0.01:
            truth[: n + 1] += rng.normal(0, 0.3, n + 1)
            walk_time = rng.choice([0.0, 3.0])
            restart = (walk_time, truth[: n + 1] + rng.normal(0, 0.1, n + 1), 10 ** rng.uniform(-4, 0, n + 1))
        instants.append(Instant(float(dt), before, now, q_input, y, r, restart))
        before = now
    return Problem(machine, walk, x0, P0, instants)


@pytest.fixture(scope="session")
def problem() -> Callable[..., Problem]:
    """:func:`make_problem`; the same problem for all who ask for it, so not to be changed."""
    return cache(make_problem)


def _ten_line_filter(F: Any, H: Any, Q: Any, R: Any, x: Any, P: Any, ys: Any) -> list[tuple[Any, Any]]:
    """The Kalman filter as every book has it, in the precision of its arguments' LAPACK."""
    out = []
    for y in ys:
        x, P = F @ x, F @ P @ F.T + Q
        seen = ~np.isnan(y)
        Hs, S = H[seen], H[seen] @ P @ H[seen].T + R[np.ix_(seen, seen)]
        K = np.linalg.solve(S, Hs @ P).T
        x, P = x + K @ (y[seen] - Hs @ x), P - K @ S @ K.T
        out.append((x, P))
    return out


@pytest.fixture(scope="session")
def ten_line_filter() -> Callable[..., list[tuple[Any, Any]]]:
    return _ten_line_filter
