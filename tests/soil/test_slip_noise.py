"""SIMEX takes back most of what noise in slip did to a curve."""

from __future__ import annotations

import numpy as np
import pytest

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.slip_noise import correct_slip_noise


def test_correction_halves_the_bias_of_the_rate():
    plain, corrected = [], []
    for seed in range(6):
        slip, mu, run = pairs(seed, "effective", samples=2000, run_spread=0.0, A=0.45, k=15.0, d=0.0)
        noisy = slip + 0.02 * np.random.default_rng(seed + 100).standard_normal(slip.size)
        curve = AdhesionCurve("effective").fit(noisy, mu, run)
        result = correct_slip_noise(curve, noisy, mu, np.full(slip.size, 0.02))
        plain.append(result.plain["k"] - 15.0)
        corrected.append(result.corrected["k"] - 15.0)
    assert abs(np.mean(corrected)) < 0.5 * abs(np.mean(plain))


def test_small_noise_does_not_matter():
    slip, mu, run = pairs(1, a=0.85)
    result = correct_slip_noise(AdhesionCurve().fit(slip, mu, run), slip, mu, np.full(slip.size, 0.002))
    assert not result.matters
    assert "does not matter" in result.sentence


def test_without_a_deviation_it_says_so():
    slip, mu, run = pairs(1, a=0.85)
    with pytest.raises(InputError, match="no pair has a slip deviation"):
        correct_slip_noise(AdhesionCurve().fit(slip, mu, run), slip, mu, np.full(slip.size, np.nan))
