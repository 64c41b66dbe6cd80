"""The noise policies: A_k and its sensitivities, the supervisor by hand, the bank against enumeration and
filterpy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kernel_twin import (
    DriveSupervisor,
    Input,
    Machine,
    SpeedSupervisor,
    TractionFilter,
    TractionModel,
    Tuning,
    memberships,
    supervise,
)
from kernel_twin.adaptation import AdaptiveFilter
from kernel_twin.filters import KalmanFilter

Array = NDArray[Any]


# ---- A_k ----


def run(problem: Any, tuning: Tuning, start: Any = None) -> TractionFilter:
    """The filter after the whole problem, in long double so that differences can be taken."""
    filter = TractionFilter(problem.machine, tuning, problem.x0, problem.P0.astype(np.longdouble))
    if start is not None:
        start(filter)
    for k in problem.instants:
        if k.restart is not None:
            filter.restart(*k.restart)
        filter.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)
    return filter


@pytest.mark.long  # the kernel's, which agree with these, are in test_kernel_agreement.py
@pytest.mark.parametrize("engine", ["exact", "unscented"])
@pytest.mark.parametrize("policy", ["adaptive", "supervised"])
def test_sensitivities_agree_with_differences_of_the_whole_recursion(engine, policy, problem):
    case = problem(
        3,
        wheels=2,
        steps=60,
        condition=1e4,
        missing=0.15,
        accelerometer=True,
        restarts=True,
        steady_rate=True,
    )
    assert any(k.restart for k in case.instants)
    tuning = Tuning(case.walk, engine=engine, policy=policy, rate=0.0, memory=1.0)
    rng = np.random.default_rng(0)
    a = np.exp(rng.uniform(-1, 1, 6))

    def scaled(j: int, change: float) -> tuple[Array, Array]:
        def start(filter: TractionFilter) -> None:
            assert filter._adaptive is not None
            scale = a.astype(np.longdouble)
            scale[j] *= np.exp(np.longdouble(change))
            filter._adaptive.adaptation.scale = scale

        return run(case, tuning, start).moments()

    reached = run(
        case, tuning, lambda filter: setattr(filter._adaptive.adaptation, "scale", a.astype(np.longdouble))
    )
    sd = np.sqrt(np.diag(reached.moments()[1]))
    for j in range(6):
        ahead, behind = scaled(j, 1e-4), scaled(j, -1e-4)
        dx, dP = reached.sensitivity(j)
        for sensitivity, difference, unit in [
            (dx, (ahead[0] - behind[0]) / 2e-4, sd),
            (dP, (ahead[1] - behind[1]) / 2e-4, np.outer(sd, sd)),
        ]:
            largest = np.max(np.abs(difference / unit))
            assert largest > 1e-7  # every noise is felt, those of μ and ρ_s too
            np.testing.assert_allclose(sensitivity / unit, difference / unit, rtol=0, atol=1e-6 * largest)


def test_restart_forgets_the_sensitivities_of_what_starts_anew(problem):
    filter = run(
        problem(5, wheels=2, steps=30), Tuning(problem(5, wheels=2, steps=30).walk, policy="adaptive")
    )
    before = filter.sensitivity(4)[1].copy()
    filter.restart(2.0, [1.0, 2.0, 3.0], [0.1, 0.2, 0.3])
    dx, dP = filter.sensitivity(4)
    assert not dx[:3].any()
    assert not dP[:3].any()
    assert not dP[:, :3].any()
    np.testing.assert_array_equal(dP[3:, 3:], before[3:, 3:])


def mismatch(filter: KalmanFilter, C: Array) -> float:
    """V with the L of the filter's present prior."""
    seen = filter.observe()
    S = seen.covariance + filter.R
    L = np.linalg.cholesky(S)
    delta = np.linalg.solve(L, np.linalg.solve(L, C - S).T)
    return float(np.sum(delta * delta))


@pytest.mark.parametrize("factor", [3.0, 0.7])
def test_a_step_of_A_lowers_the_mismatch(factor):
    F, H, R, P0 = np.array([[1.0, 0.1], [0, 1.0]]), np.eye(2), np.diag([0.2, 0.4]), np.eye(2)
    walk = np.array([0.3, 0.5])

    def settled(a: Array) -> AdaptiveFilter:
        """The prior of an update after 50 steps with that A, its sensitivities along."""
        adaptive = AdaptiveFilter(KalmanFilter(F, H, np.zeros((2, 2)), R, [0, 0], P0), walk, 2, rate=0.0)
        adaptive.adaptation.scale = a
        for _ in range(50):
            adaptive.step([0.0, 0.0], dt=0.1)
        adaptive.predict(None, 0.1)
        return adaptive

    adaptive = settled(np.ones(2))
    seen = adaptive.filter.observe()
    S = seen.covariance + R
    C = factor * S
    adaptation = adaptive.adaptation
    adaptation.C, adaptation.rate = factor * np.eye(2), 0.05
    stepped = adaptation.stepped_scale(S, H @ adaptation.dP @ H.T)
    assert np.all((stepped > 1) == (factor > 1))
    before, after = settled(np.ones(2)).filter, settled(stepped).filter
    assert isinstance(before, KalmanFilter)
    assert isinstance(after, KalmanFilter)
    L = np.linalg.cholesky(S)
    whitened = [
        np.linalg.solve(L, np.linalg.solve(L, C - (f.observe().covariance + R)).T) for f in (before, after)
    ]
    assert np.sum(whitened[1] ** 2) < np.sum(whitened[0] ** 2)
    assert mismatch(after, C) < mismatch(before, C)  # with the L of each, too


@pytest.mark.sample(2)
@pytest.mark.parametrize("assumed", [0.1, 10.0])
def test_A_finds_a_wrong_noise_of_a_random_walk(assumed):
    rng = np.random.default_rng(7)
    true_walk, r, dt = 0.5, 0.04, 0.1
    x = np.cumsum(rng.normal(0, np.sqrt(true_walk * dt), 2500))
    y = x + rng.normal(0, np.sqrt(r), 2500)
    adaptive = AdaptiveFilter(
        KalmanFilter([[1.0]], [[1.0]], [[0.0]], [[r]], [0.0], [[1.0]]), [assumed * true_walk], 1, memory=10.0
    )
    result = []
    for k, value in enumerate(y):
        adaptive.step([value], dt=dt)
        if k > 1000:
            result.append(assumed * adaptive.adaptation.scale[0])
    assert (
        0.6 < np.exp(np.mean(np.log(result))) < 1.6
    )  # in shares of the true noise, though assumed 10 times off


@pytest.mark.long  # a random walk's: below; the kernel's A is compared in test_kernel_agreement.py
@pytest.mark.parametrize("assumed", [0.1, 10.0])
def test_A_finds_a_wrong_adhesion_noise_of_a_machine(assumed):
    rng = np.random.default_rng(1)
    machine = Machine(35.0, 9.81, 0.02, np.array([0.2]), np.array([0.27]), np.array([2.0]))
    model, held = TractionModel(machine), Input(np.array([20.0]), np.array([343.0]), 60.0)
    walk, r = np.array([1e-6, 1e-6, 1e-3, 1e-6]), np.array([1e-3, 4e-4, 1.0])
    truth = np.array([3.0, 0.5, 0.25, 0.08])
    tuning = Tuning(walk * [1, 1, assumed, 1], policy="adaptive", memory=10.0)
    filter = TractionFilter(machine, tuning, truth, np.diag([5e-4, 3e-5, 4e-5, 5e-6]))
    result = []
    for _ in range(2000):
        truth = model.transition(truth, held, 0.01) + rng.normal(size=4) * np.sqrt(walk * 0.01)
        y = model.output(truth, held) + rng.normal(size=3) * np.sqrt(r)
        y[2] = np.nan
        result.append(assumed * filter.step(0.01, held, held, np.zeros(4), y, r).adaptation[2])
    assert (
        0.4 < np.exp(np.mean(np.log(result[1000:]))) < 2.5
    )  # shares of the true noise; assumed 10 times off


def test_A_stays_within_its_bounds():
    adaptive = AdaptiveFilter(
        KalmanFilter([[1.0]], [[1.0]], [[0.0]], [[1.0]], [0.0], [[1.0]]), [1.0], 1, rate=100.0, stride=1
    )
    rng = np.random.default_rng(0)
    largest = smallest = previous = 1.0
    for k in range(400):
        scale = float(adaptive.adaptation.scale[0])
        assert abs(np.log(scale / previous)) <= 0.2 + 1e-12
        previous, largest, smallest = scale, max(largest, scale), min(smallest, scale)
        adaptive.step([rng.normal(0, 100.0) if k < 200 else adaptive.filter.x[0]], dt=0.5)
    assert largest == 50.0
    assert smallest == 0.05


def test_A_remembers_innovations_softened_and_whitened_by_the_S_of_their_step():
    F = H = np.eye(2)
    P0, order = np.array([[3.0, 1.0], [1.0, 8.0]]), (1, 0)
    adaptive = AdaptiveFilter(
        KalmanFilter(F, H, np.zeros((2, 2)), np.eye(2), [0, 0], P0, huber=2.0),
        [0, 0],
        2,
        memory=2.0,
        order=order,
    )
    np.testing.assert_array_equal(adaptive.adaptation.C, np.eye(2))
    adaptive.step([10.0, np.nan], dt=0.5)  # alone: SD 2, so w = .4, and S = 3 + 1/.4
    share = 1 - np.exp(-0.5 / 2.0)
    C = np.eye(2)
    C[0, 0] += share * (0.4 * 10.0**2 / (3 + 1 / 0.4) - 1)
    np.testing.assert_allclose(adaptive.adaptation.C, C)
    seen = adaptive.filter.observe()
    update = adaptive.step([20.0, 1.0], dt=0.5)
    assert update.weight[0] < 0.5
    S = (seen.covariance + np.diag(1 / update.weight))[::-1, ::-1]
    white = np.linalg.solve(np.linalg.cholesky(S), (np.sqrt(update.weight) * update.innovation)[::-1])[::-1]
    np.testing.assert_allclose(adaptive.adaptation.C, C + share * (np.outer(white, white) - C))


@pytest.mark.long  # what A remembers of an innovation is checked by hand below
def test_a_wide_start_and_jumping_steps_leave_A_alone():
    """Neither says anything of Q: innovations that are as large as S says, a hundredfold different from one to the next."""
    rng = np.random.default_rng(3)
    F, H, R = np.eye(2), np.eye(2), np.diag([0.01, 0.01])
    walk = np.array([0.5, 0.5])
    adaptive = AdaptiveFilter(KalmanFilter(F, H, np.zeros((2, 2)), R, [0, 0], 1e6 * np.eye(2)), walk, 2)
    truth = 1e3 * rng.standard_normal(2)
    scales = []
    for k in range(3000):
        dt = 0.01 if k % 2 else 1.0
        truth = truth + np.sqrt(walk * dt) * rng.standard_normal(2)
        adaptive.step(truth + 0.1 * rng.standard_normal(2), dt=dt)
        scales.append(adaptive.adaptation.scale)
    assert np.min(scales) > 0.2
    assert np.max(scales) < 5


def test_gamma_blends_between_the_given_and_the_adapted_noise():
    def prior_variance(gamma: float) -> float:
        adaptive = AdaptiveFilter(KalmanFilter([[1.0]], [[1.0]], [[0.0]], [[1.0]], [0.0], [[1.0]]), [2.0], 1)
        adaptive.adaptation.scale = np.array([5.0])
        return float(adaptive.predict(None, 0.1, gamma=gamma, extra=[0.01]).covariance[0, 0])

    assert prior_variance(0.0) == pytest.approx(1 + 0.2 + 0.01)
    assert prior_variance(1.0) == pytest.approx(1 + 1.0 + 0.01)
    assert prior_variance(0.25) == pytest.approx(1 + 0.2 * (1 + 0.25 * 4) + 0.01)


def test_a_step_is_a_second_where_nothing_else_is_given():
    plain, said = (
        AdaptiveFilter(KalmanFilter([[1.0]], [[1.0]], [[0.0]], [[1.0]], [0.0], [[1.0]]), [2.0], 1)
        for _ in range(2)
    )
    plain.step([1.0])
    said.step([1.0], None, 1.0)
    assert (
        plain.filter.P[0, 0] == said.filter.P[0, 0] == pytest.approx(3 / 4)
    )  # 1 + 2 before the update, R = 1


# ---- supervisor ----


def test_memberships_by_hand():
    for change, expected in [
        (0.0, (1, 0, 0)),
        (0.02, (1, 0, 0)),
        (0.03, (0.75, 0.25, 0)),
        (0.06, (0, 1, 0)),
        (0.10, (0, 1, 0)),
        (0.15, (0, 0.5, 0.5)),
        (0.20, (0, 0, 1)),
        (9.0, (0, 0, 1)),
    ]:
        np.testing.assert_allclose(memberships(change), expected, atol=1e-14)


def test_table_by_hand():
    for (row, column), expected in {
        (0, 0): 0.1,
        (0, 0.08): 0.4,
        (0, 1): 0.8,
        (0.08, 0): 0.4,
        (0.08, 0.08): 0.6,
        (0.08, 1): 0.9,
        (1, 0): 0.8,
        (1, 0.08): 0.9,
        (1, 1): 1.0,
    }.items():
        assert supervise(row, column) == pytest.approx(expected)
    # .75 small .25 medium against .5 medium .5 large: .75(.5*.4+.5*.8) + .25(.5*.6+.5*.9)
    assert supervise(0.03, 0.15) == pytest.approx(0.75 * 0.6 + 0.25 * 0.75)


def test_speed_supervisor_sees_a_step_of_known_size():
    supervisor = SpeedSupervisor(0.5, wheel_speed_min=0.5, ground_speed_min=0.1)
    gammas = []
    for k in range(101):  # 1 s at 100 Hz: wheel 2 at 10 rad/s, from .4 s on 15 % more
        t = k / 100
        gammas.append(supervisor.gamma(t, np.array([5.0, 10.0 if t < 0.395 else 11.5]), 1.0))
    assert gammas[39] == pytest.approx(0.1)
    # the reference is 0 s and not in the mean: .01 .. .39 of 10, now of 11.5
    assert gammas[40] == pytest.approx(supervise(1.5 / ((39 * 10 + 11.5) / 40), 0.0), rel=1e-9)
    # at .6 s the reference is .1 s, the mean over .11 .. .6: 29 of 10 and 21 of 11.5
    assert gammas[60] == pytest.approx(supervise(1.5 / ((29 * 10 + 21 * 11.5) / 50), 0.0), rel=1e-9)
    assert gammas[89] == pytest.approx(supervise(1.5 / 11.5, 0.0), rel=1e-9)
    assert gammas[90] == pytest.approx(0.1)  # the reference, .4 s, is after the change


def test_supervisor_floors_small_speeds_and_waits_for_channels():
    supervisor = SpeedSupervisor(0.5, wheel_speed_min=2.0, ground_speed_min=0.5)
    assert supervisor.gamma(0.0, np.array([np.nan]), np.nan) == pytest.approx(0.1)
    assert supervisor.gamma(0.1, np.array([0.0]), np.nan) == pytest.approx(0.1)  # no reference yet
    for t in (0.2, 0.4, 0.6):
        supervisor.gamma(t, np.array([0.0]), 0.0)
    # the reference is .1 s: ω from 0 to .3, the mean below ω_min = 2: .15; v unknown there: 0
    assert supervisor.gamma(0.61, np.array([0.3]), 1.0) == pytest.approx(supervise(0.15, 0.0))


def test_supervisor_keeps_few_instants_at_a_high_rate():
    supervisor = SpeedSupervisor(0.5, 0.5, 0.1)
    for k in range(5000):
        supervisor.gamma(k / 5000, np.array([1.0]), 1.0)
        assert len(supervisor._window._kept) <= 52


def test_drive_supervisor_by_hand():
    supervisor = DriveSupervisor(0.5, torque_min=[1.0, 10.0])
    for k in range(51):
        supervisor.gamma(k / 100, np.array([20.0, 2.0]), 0.10)
    # wheel 2: 2 to 2.8 N m over its floor of 10: .08, slip .10 to .14 over .25: .16
    assert supervisor.gamma(0.51, np.array([20.0, 2.8]), 0.14) == pytest.approx(supervise(0.08, 0.16))
    assert supervisor.gamma(0.52, np.array([20.0, 2.0]), np.nan) == pytest.approx(0.1)
