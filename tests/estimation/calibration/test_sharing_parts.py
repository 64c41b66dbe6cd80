"""Wheels that share a curve: levels, spreads and sensitivities against weighted means and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation.calibration.sharing import Sharing, _inverse, _Problem, fit_shared_gains

W = 3


def rows(n: int = 60, seed: int = 4, soil: np.ndarray | None = None) -> Sharing:
    draws = np.random.default_rng(seed)
    slip = draws.uniform(0.05, 0.3, n)[:, None] + 0.02 * draws.standard_normal((n, W))
    leverage = 60.0 + 5.0 * draws.standard_normal((n, W))
    known = 2.0 + 0.1 * draws.standard_normal((n, W))
    torque = known + leverage * 0.5 * (1 - np.exp(-9 * slip)) + draws.standard_normal((n, W))
    labels = np.zeros(n, dtype=int) if soil is None else soil
    return Sharing(torque, known, leverage, slip, labels, np.arange(n) // 3, 0.01, np.full(W, 0.5))


VALUES = np.r_[0.02, -0.01, -0.01, 0.001, -0.002, 0.001, 0.3, -0.2, 0.1]


def test_a_windows_level_is_the_mean_of_its_wheels_by_their_spread() -> None:
    data = rows()
    problem = _Problem.of(data)
    level, residual, spread = problem._levels(VALUES)
    for n in (0, 7, 59):
        gain, radius, offset = np.exp(VALUES[:3]), VALUES[3:6], VALUES[6:]
        lever = gain * data.leverage[n]
        apart = data.slip[n] - data.slip[n].mean() + (1 - data.slip[n]) * radius
        rest = data.torque[n] - offset - gain * data.known[n] - lever * problem.steepness[n] * apart
        own = np.hypot(0.1 * abs(np.median(rest / lever)) * lever, 0.02 * np.median(np.abs(data.torque)))
        np.testing.assert_allclose(spread[n], own)
        assert level[n] == pytest.approx(np.average(rest / lever, weights=lever**2 / own**2))
        np.testing.assert_allclose(residual[n], rest - level[n] * lever)


def test_torques_that_are_mostly_nothing_keep_a_noise_to_divide_by() -> None:
    data = rows()
    assert (
        _Problem.of(replace(data, torque=np.where(np.arange(60)[:, None] % 3, 0.0, data.torque))).torque_noise
        > 0
    )


def test_a_soil_needs_thirty_windows_for_a_scatter_of_its_own() -> None:
    data = rows(soil=np.repeat([0, 1], [31, 29]))
    local = _Problem.of(data).refined(np.zeros(9)).local
    assert (local[31:] == 0.1).all()
    level, residual, _ = _Problem.of(data)._levels(np.zeros(9))
    size = np.maximum(np.abs(data.leverage * level[:, None]), 0.02 * np.median(np.abs(data.torque)))
    share = np.median(np.abs(residual / size), axis=1)
    np.testing.assert_allclose(local[:31], 1.4826 * np.median(share[:31]))
    quiet = replace(data, torque=data.known + data.leverage * 0.3, slip=np.full_like(data.slip, 0.2))
    assert _Problem.of(quiet).refined(np.zeros(9)).local[0] == pytest.approx(0.01)


@pytest.mark.parametrize(("windows", "fitted"), [(29, False), (30, True)])
def test_thirty_windows_are_needed(windows: int, fitted: bool) -> None:
    fit = fit_shared_gains(rows(windows))
    assert (fit is not None) is fitted
    if fit is not None:
        assert (fit.windows, fit.blocks) == (30, 10)
        assert np.mean(fit.log_gain) == pytest.approx(0.0, abs=1e-9)
        assert np.mean(fit.radius) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(fit.covariance[W:, W:].sum(axis=0), 0.0, atol=1e-9)


def test_gains_answer_to_loads_as_a_fit_with_other_loads_does() -> None:
    data = rows(200)
    fit = fit_shared_gains(data)
    assert fit is not None
    for wheel in range(W):
        moved = replace(data, leverage=data.leverage * (1 + 0.01 * (np.arange(W) == wheel)))
        other = fit_shared_gains(moved)
        assert other is not None
        change = (other.log_gain - fit.log_gain) / 0.01
        np.testing.assert_allclose(fit.load_sensitivity[:W, wheel], change, atol=0.03)
    assert fit.load_sensitivity[0, 0] < -0.3  # more load, less gain


def test_a_wheel_that_jumps_now_and_then_keeps_its_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three times the torque in every twentieth window: by least squares its gain would move by a tenth."""
    data = rows(200)
    spoilt = data.torque.copy()
    spoilt[::20, 1] *= 3.0
    plain, robust = fit_shared_gains(data), fit_shared_gains(replace(data, torque=spoilt))
    monkeypatch.setattr("terragrip.estimation.calibration.sharing._HUBER", 1e9)
    squares = fit_shared_gains(replace(data, torque=spoilt))
    assert plain is not None
    assert robust is not None
    assert squares is not None
    assert abs(robust.log_gain[1] - plain.log_gain[1]) < 0.5 * abs(squares.log_gain[1] - plain.log_gain[1])


def test_the_covariance_is_that_of_leaving_out_each_block_and_of_the_priors() -> None:
    """Every block left out once and fitted anew (jackknife); what the priors' own errors add stands apart."""
    bearing = np.array(
        [0.3, 1.0, 1.7]
    )  # so that a wheel's level counts by its load, beside one noise of the torques
    data = rows(200)
    data = replace(
        data, leverage=bearing * data.leverage, torque=data.known + bearing * (data.torque - data.known)
    )
    problem = replace(_Problem.of(data).refined(np.zeros(3 * W)), torque_noise=2.0)
    best = problem.solve(np.zeros(3 * W), 1.0)
    values = []
    for kept in (data.block != label for label in np.unique(data.block)):
        parts = {
            name: getattr(data, name)[kept]
            for name in ("torque", "known", "leverage", "slip", "soil", "block")
        }
        curves = replace(problem.curves, by_form=problem.curves.by_form[:, kept])
        rest = replace(problem, data=replace(data, **parts), curves=curves, local=problem.local[kept])
        values.append(rest.solve(best, 1.0))
    apart = np.array(values) - np.mean(values, axis=0)
    fit = problem.fit(best, 1.0)
    inverse = _inverse(fit.normal)
    expected = apart.T @ apart * (1 - 1 / len(values)) + inverse @ (fit.variance**2 * problem.prior) @ inverse
    result = problem.covariance(best, 1.0, data.block)
    np.testing.assert_allclose(np.diag(result), np.diag(expected), rtol=0.1)


def test_what_is_not_determined_stays_nothing_in_an_inverse() -> None:
    matrix = np.diag([4.0, 0.0, 1e-8])
    np.testing.assert_allclose(_inverse(matrix), np.diag([0.25, 0.0, 1e8]), rtol=1e-9)
    square = np.array([[2.0, 1.0], [1.0, 3.0]])
    np.testing.assert_allclose(_inverse(square), np.linalg.inv(square))
