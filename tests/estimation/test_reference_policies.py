"""The noise policies: A_k and its sensitivities, the supervisor by hand, the bank against enumeration and
filterpy.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terragrip.estimation.reference import (
    AdaptiveFilter,
    Bank,
    DriveSupervisor,
    Input,
    KalmanFilter,
    Machine,
    SpeedSupervisor,
    TractionFilter,
    TractionModel,
    Tuning,
    memberships,
    supervise,
)
from terragrip.estimation.reference.bank import mixture

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


@pytest.mark.parametrize("assumed", [0.1, 1.0, 10.0])
def test_A_finds_a_wrong_noise_of_a_random_walk(assumed):
    rng = np.random.default_rng(7)
    true_walk, r, dt = 0.5, 0.04, 0.1
    x = np.cumsum(rng.normal(0, np.sqrt(true_walk * dt), 6000))
    y = x + rng.normal(0, np.sqrt(r), 6000)
    adaptive = AdaptiveFilter(
        KalmanFilter([[1.0]], [[1.0]], [[0.0]], [[r]], [0.0], [[1.0]]), [assumed * true_walk], 1, memory=10.0
    )
    result = []
    for k, value in enumerate(y):
        adaptive.step([value], dt=dt)
        if k > 3000:
            result.append(assumed * adaptive.adaptation.scale[0])
    assert (
        0.6 < np.exp(np.mean(np.log(result))) < 1.6
    )  # in shares of the true noise, though assumed 10 times off


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


# ---- bank ----


def random_bank(seed: int, lanes: int, **options: Any) -> tuple[Bank, Array]:
    rng = np.random.default_rng(seed)
    F, H = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[1.0, 0.0], [0.3, 1.0]])
    filters = []
    for _ in range(lanes):
        half = rng.normal(size=(2, 4))
        filters.append(
            KalmanFilter(F, H, np.zeros((2, 2)), np.diag([0.3, 0.2]), rng.normal(size=2), half @ half.T)
        )
    bank = Bank(filters, [0.5, 0.2], np.geomspace(0.1, 10, lanes), **options)
    bank.probabilities = rng.dirichlet(np.ones(lanes))
    return bank, rng.normal(0, 2, size=(60, 2))


def assert_close(a: Any, b: Any) -> None:
    np.testing.assert_allclose(np.asarray(a, float), np.asarray(b, float), rtol=1e-10, atol=1e-12)


def test_bank_agrees_with_filterpy():
    filterpy = pytest.importorskip("filterpy.kalman")
    dt, dwell = 0.2, 1.5
    bank, ys = random_bank(4, 3, dwell=dwell)
    stay = np.exp(-dt / dwell)
    M = np.full((3, 3), (1 - stay) / 2)
    np.fill_diagonal(M, stay)
    theirs = []
    for lane, scale in zip(bank.filters, bank.scales, strict=True):
        one = filterpy.KalmanFilter(dim_x=2, dim_z=2)
        one.x, one.P, one.F, one.H, one.R = lane.x.copy(), lane.P.copy(), lane.F, lane.H, lane.R
        one.Q = np.diag(scale * bank.walk * dt)
        theirs.append(one)
    imm = filterpy.IMMEstimator(theirs, bank.probabilities.copy(), M)
    for k, y in enumerate(ys):
        if k == 0:  # ours mixes over the time since the last mixing: none yet
            bank._since_mixing = dt
        bank.step(y, dt=dt)
        imm.predict()
        imm.update(y)
        assert_close(bank.probabilities, imm.mu)
        mean, covariance = bank.moments()
        assert_close(mean, imm.x)
        assert_close(covariance, imm.P)


def test_bank_agrees_with_enumeration_while_nothing_is_merged():
    bank, ys = random_bank(9, 3, dwell=2.0, mix_stride=4)
    branches = [
        (p, f.x, f.P, s) for p, f, s in zip(bank.probabilities, bank.filters, bank.scales, strict=True)
    ]
    F, H, R = bank.filters[0].F, bank.filters[0].H, bank.filters[0].R
    evidence = 1.0
    for y, dt in zip(ys[:3], [0.1, 0.3, 0.2], strict=True):
        update = bank.step(y, dt=dt)
        grown = []
        for p, x, P, s in branches:
            x, P = F @ x, F @ P @ F.T + np.diag(s * bank.walk * dt)
            S, nu = H @ P @ H.T + R, y - H @ x
            K = P @ H.T @ np.linalg.inv(S)
            density = np.exp(-nu @ np.linalg.inv(S) @ nu / 2) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
            grown.append((p * density, x + K @ nu, P - K @ S @ K.T, s))
        total = sum(p for p, *_ in grown)
        branches = [(p / total, x, P, s) for p, x, P, s in grown]
        evidence *= total
        assert_close(update.log_likelihood, np.log(total))
        assert_close(bank.probabilities, [p for p, *_ in branches])
    # the mixing before the fourth step over all pairs of (mode left, mode entered)
    stay = np.exp(-0.6 / 2.0)
    pairs = [
        (p * (stay if i == j else (1 - stay) / 2), x, P, j)
        for (i, (p, x, P, _)), j in itertools.product(enumerate(branches), range(3))
    ]
    bank.mix()
    for j, lane in enumerate(bank.filters):
        into = [(p, x, P) for p, x, P, entered in pairs if entered == j]
        weight = sum(p for p, *_ in into)
        mean = sum(p * x for p, x, _ in into) / weight
        spread = sum(p * (P + np.outer(x - mean, x - mean)) for p, x, P in into) / weight
        assert_close(bank.probabilities[j], weight)
        assert_close(lane.x, mean)
        assert_close(lane.P, spread)
    assert evidence > 0


def test_mixing_keeps_the_moments_of_the_mixture():
    bank, _ = random_bank(2, 4, dwell=1.0)
    before = bank.moments()
    bank._since_mixing = 0.7
    bank.mix()
    for a, b in zip(before, bank.moments(), strict=True):
        assert_close(a, b)


def test_bank_of_one_scale_is_a_single_filter():
    bank, ys = random_bank(6, 4, dwell=1.0, huber=1.5)
    bank.scales = np.ones(4)
    first = bank.filters[0]
    for lane in bank.filters:
        lane.x, lane.P = first.x.copy(), first.P.copy()
    single = KalmanFilter(
        first.F, first.H, lambda dt: np.diag(bank.walk * dt), first.R, first.x, first.P, huber=1.5
    )
    for y in ys:
        got, expected = bank.step(y, dt=0.1), single.step(y, dt=0.1)
        assert_close(got.weight, expected.weight)
        assert_close(got.nis, expected.nis)
        assert_close(got.log_likelihood, expected.log_likelihood)
        assert_close(bank.moments()[0], single.x)
        assert_close(bank.moments()[1], single.P)
    assert np.min(got.weight) <= 1


def test_bank_weights_by_the_mixture_and_leaves_missing_channels_out():
    bank, _ = random_bank(3, 3, dwell=1.0, huber=2.0)
    p = bank.probabilities.copy()
    bank.predict(None, 0.1)
    expected = np.stack([f.observe().mean for f in bank.filters])
    covariance = np.stack([f.observe().covariance for f in bank.filters])
    mean, spread = mixture(p, expected, covariance)
    update = bank.update([50.0, np.nan])
    sd = np.sqrt(spread[0, 0] + 0.3)
    assert update.weight[0] == pytest.approx(2 * sd / (50 - mean[0]))
    assert update.innovation[0] == pytest.approx(50 - mean[0])
    assert update.nis == pytest.approx((50 - mean[0]) ** 2 / (spread[0, 0] + 0.3 / update.weight[0]))
    kept = bank.probabilities.copy()
    bank.update([np.nan, np.nan])
    np.testing.assert_array_equal(bank.probabilities, kept)


def test_bank_finds_the_scale_that_made_the_data():
    rng = np.random.default_rng(5)
    for true_scale in (0.1, 10.0):
        F = H = np.eye(1)
        bank = Bank(
            [KalmanFilter(F, H, [[0.0]], [[0.01]], [0.0], [[1.0]]) for _ in range(3)],
            [0.5],
            [0.1, 1.0, 10.0],
            dwell=100.0,
        )
        x, result = 0.0, []
        for _ in range(500):
            x += rng.normal(0, np.sqrt(true_scale * 0.5 * 0.1))
            bank.step([x + rng.normal(0, 0.1)], dt=0.1)
            result.append(bank.probabilities[0 if true_scale < 1 else 2])
        assert np.mean(result[100:]) > 0.8
