"""The NumPy reference of the bank of filters (IMM) against filterpy, enumeration and closed forms."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kernel_twin.bank import Bank, mixture
from kernel_twin.filters import KalmanFilter

Array = NDArray[Any]


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


@pytest.mark.long  # its weights are those of an enumeration: below
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
