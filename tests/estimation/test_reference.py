"""The generic filters against a ten-line filter, against conditioning in one piece, and against closed
forms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kernel_twin.filters import ExtendedKalmanFilter, GaussianFilter, KalmanFilter, runge_kutta
from kernel_twin.linear_algebra import cholesky, solve_positive, symmetric
from kernel_twin.smoother import smooth
from kernel_twin.unscented import UnscentedKalmanFilter

ENGINES = ["linear", "extended", "unscented"]
Array = NDArray[Any]


class LinearProblem:
    """x' = F x + q, y = H x + r: full Q and P0 whose states differ by eight decades, not all of them seen."""

    def __init__(self, seed: int, states: int, channels: int, steps: int, dtype: Any = np.float64) -> None:
        rng = np.random.default_rng(seed)
        scale = 10 ** rng.uniform(-4, 4, states)

        def covariance(size: int) -> Array:
            half = rng.normal(size=(size, 2 * size))
            return half @ half.T / size

        drift = np.eye(states) + 0.2 * rng.normal(size=(states, states))
        drift *= 0.99 / np.max(
            np.abs(np.linalg.eigvals(drift))
        )  # what diverges would test only its own rounding
        self.F: Array = drift * scale[:, None] / scale
        self.H: Array = rng.normal(size=(channels, states)) / scale
        self.Q: Array = 0.1 * covariance(states) * np.outer(scale, scale)
        self.R: Array = 0.3 * covariance(channels)
        self.x0: Array = rng.normal(size=states) * scale
        self.P0: Array = (covariance(states) * np.outer(scale, scale)).astype(dtype)
        self.ys: Array = rng.normal(size=(steps, channels))
        self.ys[rng.random(self.ys.shape) < 0.2] = np.nan

    def filter(self, engine: str) -> GaussianFilter:
        rest = (self.Q, self.R, self.x0, self.P0)
        if engine == "linear":
            return KalmanFilter(self.F, self.H, *rest)
        if engine == "extended":
            return ExtendedKalmanFilter(
                lambda x, u, dt: self.F @ x,
                lambda x: self.H @ x,
                *rest,
                F=lambda x, u, dt: self.F,
                H=lambda x: self.H,
            )
        return UnscentedKalmanFilter(lambda x, u, dt: self.F @ x, lambda x: self.H @ x, *rest)


def assert_same_moments(got: tuple[Array, Array], expected: tuple[Array, Array], tolerance: float) -> None:
    """Means within a share of max(|x|, SD), covariances of the SDs' product."""
    sd = np.sqrt(np.diag(expected[1]))
    assert np.max(np.abs(got[0] - expected[0]) / np.maximum(np.abs(expected[0]), sd)) < tolerance
    assert np.max(np.abs(got[1] - expected[1]) / np.outer(sd, sd)) < tolerance


@pytest.mark.sample(5)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("states", "channels"), [(1, 1), (4, 1), (4, 4), (9, 3)])
def test_agrees_with_a_ten_line_filter(engine, states, channels, ten_line_filter):
    problem = LinearProblem(states, states, channels, steps=200)
    filter = problem.filter(engine)
    expected = ten_line_filter(problem.F, problem.H, problem.Q, problem.R, problem.x0, problem.P0, problem.ys)
    for y, moments in zip(problem.ys, expected, strict=True):
        filter.step(y)
        assert_same_moments((filter.x, filter.P), moments, 1e-10)


def conditioned_in_one_piece(problem: LinearProblem, given: int) -> list[tuple[Array, Array]]:
    """Mean and covariance of x_1..x_T given the first ``given`` measurements, from their joint Gaussian."""
    steps, states = len(problem.ys), len(problem.x0)
    big_mean, big = [], np.zeros((steps * states, steps * states))
    x, P = problem.x0, problem.P0
    for k in range(steps):
        x, P = problem.F @ x, problem.F @ P @ problem.F.T + problem.Q
        big_mean.append(x)
        block = P
        for later in range(k, steps):
            big[later * states : (later + 1) * states, k * states : (k + 1) * states] = block
            big[k * states : (k + 1) * states, later * states : (later + 1) * states] = block.T
            block = problem.F @ block
    mean = np.concatenate(big_mean)
    H = np.kron(np.eye(steps), problem.H)
    R = np.kron(np.eye(steps), problem.R)
    y = problem.ys.ravel()
    seen = ~np.isnan(y) & (np.arange(y.size) < given * problem.ys.shape[1])
    scale = np.sqrt(np.diag(big))  # the states differ by eight decades, LAPACK need not see that
    Hs, unit = H[seen] * scale, big / np.outer(scale, scale)
    K = np.linalg.solve(Hs @ unit @ Hs.T + R[np.ix_(seen, seen)], Hs @ unit).T
    mean = mean + scale * (K @ (y - H @ mean)[seen])
    covariance = (unit - K @ Hs @ unit) * np.outer(scale, scale)
    each = [slice(k * states, (k + 1) * states) for k in range(steps)]
    return [(mean[k], covariance[k, k]) for k in each]


@pytest.mark.parametrize("engine", ENGINES)
def test_filter_and_smoother_agree_with_conditioning_in_one_piece(engine):
    problem = LinearProblem(11, 3, 2, steps=8)
    filter = problem.filter(engine)
    filtered, predictions = [], []
    for k, y in enumerate(problem.ys):
        predictions.append(filter.predict())
        filter.update(y)
        filtered.append((filter.x, filter.P))
        assert_same_moments(filtered[-1], conditioned_in_one_piece(problem, given=k + 1)[k], 1e-9)
    smoothed = smooth(filtered, predictions[1:])
    for got, expected in zip(smoothed, conditioned_in_one_piece(problem, given=8), strict=True):
        assert_same_moments(got, expected, 1e-9)
    with pytest.raises(ValueError, match="need 7 predictions"):
        smooth(filtered, predictions)


@pytest.mark.parametrize("engine", ENGINES)
def test_double_agrees_with_long_double(engine):
    coarse, fine = LinearProblem(5, 6, 2, 300), LinearProblem(5, 6, 2, 300, np.longdouble)
    a, b = coarse.filter(engine), fine.filter(engine)
    for y in coarse.ys:
        a.step(y)
        b.step(y)
    assert b.x.dtype == b.P.dtype == np.longdouble
    assert_same_moments((a.x, a.P), (b.x, b.P), 1e-11)


def test_likelihood_and_nis_agree_with_the_joint_density():
    problem = LinearProblem(3, 2, 2, steps=1)
    problem.ys[:] = [[0.4, -0.7]]
    filter = problem.filter("linear")
    update = filter.step(problem.ys[0])
    prior = problem.F @ problem.P0 @ problem.F.T + problem.Q
    S = problem.H @ prior @ problem.H.T + problem.R
    nu = problem.ys[0] - problem.H @ problem.F @ problem.x0
    assert update.nis == pytest.approx(nu @ np.linalg.inv(S) @ nu, rel=1e-10)
    density = np.exp(-update.nis / 2) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
    assert np.exp(update.log_likelihood) == pytest.approx(density, rel=1e-10)
    np.testing.assert_allclose(update.innovation, nu, rtol=1e-10)
    np.testing.assert_allclose(update.innovation_variance, np.diag(S), rtol=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
def test_nothing_measured_changes_nothing(engine):
    filter = LinearProblem(8, 4, 2, steps=1).filter(engine)
    x, P = filter.x.copy(), filter.P.copy()
    update = filter.update([np.nan, np.nan])
    np.testing.assert_array_equal(filter.x, x)
    np.testing.assert_array_equal(filter.P, P)
    assert update.nis == update.log_likelihood == 0
    assert not update.present.any()


def test_filterpy_agrees_on_a_linear_problem():
    filterpy = pytest.importorskip("filterpy.kalman")
    problem = LinearProblem(21, 4, 2, steps=100)
    problem.ys = np.nan_to_num(problem.ys)
    theirs = filterpy.KalmanFilter(dim_x=4, dim_z=2)
    theirs.x, theirs.P = problem.x0.copy(), problem.P0.copy()
    theirs.F, theirs.H, theirs.Q, theirs.R = problem.F, problem.H, problem.Q, problem.R
    for engine in ENGINES:
        ours = problem.filter(engine)
        theirs.x, theirs.P = problem.x0.copy(), problem.P0.copy()
        for y in problem.ys:
            ours.step(y)
            theirs.predict()
            theirs.update(y)
        assert_same_moments((ours.x, ours.P), (theirs.x, theirs.P), 1e-9)


def test_unscented_moments_of_a_square_are_exact():
    # for x ~ N(m, p): E x² = m² + p, var x² = 4 m² p + 2 p², cov(x, x²) = 2 m p; with n + κ = 3, β = 0
    m, p, r = 0.7, 0.3, 0.05
    filter = UnscentedKalmanFilter(
        lambda x, u, dt: x, lambda x: x**2, [[0.0]], [[r]], [m], [[p]], alpha=1, beta=0, kappa=2
    )
    update = filter.update([1.3])
    variance, cross = 4 * m**2 * p + 2 * p**2 + r, 2 * m * p
    innovation = 1.3 - (m**2 + p)
    assert update.innovation[0] == pytest.approx(innovation, rel=1e-14)
    assert update.innovation_variance[0] == pytest.approx(variance, rel=1e-14)
    assert filter.x[0] == pytest.approx(m + cross / variance * innovation, rel=1e-14)
    assert filter.P[0, 0] == pytest.approx(p - cross**2 / variance, rel=1e-13)


@pytest.mark.parametrize("size", [1, 3])
def test_a_covariance_of_another_size_than_the_state_is_refused(size):
    with pytest.raises(ValueError, match=rf"2 states, P0 has the shape \({size}, {size}\)"):
        KalmanFilter(np.eye(2), [[1.0, 0.0]], np.eye(2), [[1.0]], [0.0, 0.0], np.eye(size))


def test_by_default_the_variance_of_a_square_about_zero_is_exact():
    """Var x² = 2 p² of x ~ N(0, p): of a normal distribution beta = 2 is right (Wan and van der Merwe)."""
    filter = UnscentedKalmanFilter(lambda x, u, dt: x, lambda x: x**2, [[0.0]], [[0.05]], [0.0], [[0.3]])
    assert filter.update([1.3]).innovation_variance[0] == pytest.approx(2 * 0.3**2 + 0.05, rel=1e-14)


def pendulum(x: Array, u: float) -> Array:
    return np.stack([x[..., 1], u - 9.81 * np.sin(x[..., 0]) - 0.1 * x[..., 1]], axis=-1)


@pytest.mark.sample(2)
@pytest.mark.parametrize("vectorized", [False, True])
def test_nonlinear_filters_follow_a_pendulum(vectorized):
    rng = np.random.default_rng(2)
    f = runge_kutta(pendulum, substeps=2)
    noise = (lambda dt: np.diag([1e-8, 1e-4]) * dt, [[0.01]], [0.5, 0.0], np.diag([0.3, 0.3]))
    unscented = UnscentedKalmanFilter(f, lambda x: np.sin(x[..., :1]), *noise, vectorized=vectorized)
    extended = ExtendedKalmanFilter(f, lambda x: np.sin(x[:1]), *noise)
    truth = np.array([0.9, -0.2])
    errors = []
    for k in range(400):
        u = np.sin(k / 30)
        truth = f(truth, u, 0.02)
        y = np.sin(truth[:1]) + rng.normal(0, 0.1, 1)
        unscented.step(y, u, 0.02)
        extended.step(y, u, 0.02)
        if k > 100:
            errors.append([(g.x - truth) / np.sqrt(np.diag(g.P)) for g in (unscented, extended)])
    normalised = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(normalised < 2)
    assert np.all(normalised > 0.1)
    np.testing.assert_allclose(unscented.x, extended.x, atol=0.02)


def test_runge_kutta_has_fourth_order():
    def error(substeps: int) -> float:
        x = runge_kutta(lambda x, u: -x + u, substeps)(np.array([1.0]), 2.0, 1.0)
        return abs(float(x[0]) - (2 - np.exp(-1)))

    assert error(4) / error(8) == pytest.approx(16, rel=0.25)


def test_huber_softens_by_the_prior_and_leaves_the_rest():
    F, H, R, P0 = np.eye(2), np.eye(2), np.diag([0.5, 0.5]), np.array([[1.5, 0.2], [0.2, 0.5]])
    filter = KalmanFilter(F, H, np.zeros((2, 2)), R, [0, 0], P0, huber=2.0)
    update = filter.update([10.0, 1.0])  # prior SDs √2 and 1
    w = 2 * np.sqrt(2) / 10
    np.testing.assert_allclose(update.weight, [w, 1.0], rtol=1e-15)
    by_hand = KalmanFilter(F, H, np.zeros((2, 2)), np.diag([0.5 / w, 0.5]), [0, 0], P0)
    expected = by_hand.update([10.0, 1.0])
    assert_same_moments((filter.x, filter.P), (by_hand.x, by_hand.P), 1e-14)
    assert update.nis == pytest.approx(expected.nis)
    np.testing.assert_allclose(update.innovation_variance, [2.0, 1.0])  # before weighting


def test_joseph_form_keeps_a_definite_covariance_where_the_printed_form_does_not():
    rng = np.random.default_rng(0)
    P0 = 1e6 * np.eye(4)
    printed = P0.copy()
    F = np.eye(4) + np.diag([0.01] * 3, 1)
    H, R = np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 1e-4, 0.0, 0.0]]), 1e-10 * np.eye(2)
    filters = [
        KalmanFilter(F, H, np.zeros((4, 4)), R, np.zeros(4), P0),
        UnscentedKalmanFilter(lambda x, u, dt: F @ x, lambda x: H @ x, np.zeros((4, 4)), R, np.zeros(4), P0),
    ]
    smallest = np.inf
    for _ in range(20):
        y = rng.normal(0, 1e-5, 2)
        printed = F @ printed @ F.T
        S = H @ printed @ H.T + R
        K = np.linalg.solve(S, H @ printed).T
        printed = printed - K @ S @ K.T
        smallest = min(smallest, np.min(np.diag(printed)))
        for filter in filters:
            filter.step(y)
            cholesky(filter.P)
    assert smallest < 0  # what the correction is for


def test_impossible_arguments_are_refused():
    with pytest.raises(ValueError, match="centre weight negative"):
        UnscentedKalmanFilter(
            lambda x, u, dt: x, lambda x: x, np.eye(2), np.eye(2), [0, 0], np.eye(2), alpha=1e-3
        )
    with pytest.raises(ValueError, match="3 states, P0"):
        KalmanFilter(np.eye(3), np.eye(3), np.eye(3), np.eye(3), [0, 0, 0], np.eye(2))
    with pytest.raises(np.linalg.LinAlgError, match="pivot 1"):
        cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))


@given(st.integers(1, 12), st.integers(0, 10**6))
def test_linear_algebra_agrees_with_lapack(size, seed):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(size, size + 2))
    A, B = half @ half.T, rng.normal(size=(size, 3))
    np.testing.assert_allclose(cholesky(A), np.linalg.cholesky(A), atol=1e-10)
    np.testing.assert_allclose(A @ solve_positive(A, B), B, atol=1e-7)
    long = solve_positive(A.astype(np.longdouble), B)
    assert long.dtype == np.longdouble


def test_of_an_asymmetry_half_goes_either_way():
    uneven = np.array([[[1.0, 2.0], [4.0, 5.0]], [[0.0, 1.0], [0.0, 3.0]]])
    np.testing.assert_array_equal(symmetric(uneven), [[[1.0, 3.0], [3.0, 5.0]], [[0.0, 0.5], [0.5, 3.0]]])
