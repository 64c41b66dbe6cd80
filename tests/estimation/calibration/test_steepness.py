"""How steep shared curves are: slips with the ground speed's noise and a radius that all wheels have wrong."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation.calibration.sharing import Sharing, fit_shared_gains
from terragrip.estimation.calibration.steepness import Steepness, steepness_of

N = 400
SOIL = np.repeat([0, 1], N // 2)
TOP, RATE = np.array([0.4, 0.7])[SOIL], 15.0


def curves(
    noise: float = 0.0, shift: float = 0.0, known: float = 0.0, seed: int = 3
) -> tuple[Steepness, np.ndarray]:
    """The steepness found at adhesions of light work, and what is true."""
    rng = np.random.default_rng(seed)
    slip = rng.uniform(0.005, 0.08, N)
    level = TOP * -np.expm1(-RATE * slip)
    measured = slip + shift * (1 - slip) + noise * rng.standard_normal(N)
    return steepness_of(level, measured, SOIL, known, np.arange(N) // 4, np.zeros(N)), TOP * RATE * np.exp(
        -RATE * slip
    )


@pytest.mark.parametrize(
    ("noise", "shift", "known", "within"),
    [(0.0, 0.0, 0.0, 0.1), (0.03, 0.0, 0.0, 0.35), (0.03, 0.02, 0.02, 0.45), (0.0, -0.02, 0.02, 0.2)],
)
def test_neither_noise_nor_a_wrong_radius_flattens_the_curve(
    noise: float, shift: float, known: float, within: float
) -> None:
    for seed in range(5):
        found, true = curves(noise, shift, known, seed)
        assert abs(np.mean(found.of(None)) / np.mean(true) - 1) < within


def test_a_radius_that_nobody_knows_leaves_the_steepness_open() -> None:
    sure, unsure = curves(0.03)[0].relative_std, curves(0.03, known=0.05)[0].relative_std
    assert 0.0 < sure < unsure < 1.0


def test_a_late_ground_speed_does_not_bend_the_curve() -> None:
    """A machine that speeds up pulls more; .1 s late, its slips look like a curve a third flatter."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        slip = rng.uniform(0.005, 0.08, N)
        level = TOP * -np.expm1(-RATE * slip)
        rate = 3 * (level - level.mean()) + 0.2 * rng.standard_normal(N)
        measured = slip + 0.1 * rate + 0.01 * rng.standard_normal(N)
        true = np.mean(TOP * RATE * np.exp(-RATE * slip))
        taken, ignored = (
            np.mean(steepness_of(level, measured, SOIL, 0.005, np.arange(N) // 4, by).of(None)) / true
            for by in (rate, np.zeros(N))
        )
        assert abs(taken - 1) < 0.35
        assert ignored < 0.7


def test_gains_of_axles_that_slip_unlike_hold_with_a_radius_that_is_wrong_on_all() -> None:
    """Front wheels that slip by 1 % more than rear ones, all radii 2 % too large: gains came out 6 to 9 % apart, ten SDs."""
    scores = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        slip = rng.uniform(0.005, 0.08, N)[:, None] + np.array([0.01, 0.01, 0.0, 0.0])
        leverage = np.full((N, 4), 60.0)
        known = np.full((N, 4), 1.5)
        local = 1 + 0.02 * rng.standard_normal((N, 4))
        torque = known + leverage * TOP[:, None] * -np.expm1(-RATE * slip) * local
        seen = slip + 0.02 * (1 - slip) + 0.02 * rng.standard_normal(N)[:, None]
        data = Sharing(torque, known, leverage, seen, SOIL, np.arange(N) // 4, 0.003, np.full(4, 0.1), 0.02)
        fit = fit_shared_gains(data)
        assert fit is not None
        scores.append(fit.log_gain / np.sqrt(np.diag(fit.covariance)[:4]))
    assert np.sqrt(np.mean(np.square(scores))) < 1.5
