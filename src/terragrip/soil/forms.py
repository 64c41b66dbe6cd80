"""Curves of every form that soils are known to have, as far as they agree with a fit's bins: how far its curve may be off.

A fit of one form knows its curve at every slip as well as at its bins, for it takes the form as certain. Forms differ: the brush, the
exponential, Janosi's shear under a contact patch and the hyperbola rise alike at first and apart afterwards, and some fall. So curves

    mu(s) = A (h(q(p) k s; p) - f s),   dh/dx = (1 - h)^p

are drawn from what soils are like before any data (`PRIOR`), and drawn again by how well they agree with the bins (importance sampling;
Rubin 1987). With bins up to high slips few forms are left; beyond the bins they spread as far as soils do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from terragrip.arrays import Floats

PRIOR: Mapping[str, tuple[float, float, float, float]] = MappingProxyType(
    {
        "ln A": (float(np.log(0.55)), 0.4, -4.0, 1.5),
        "ln k": (float(np.log(11.0)), 0.7, 0.0, float(np.log(100.0))),
        "f": (0.1, 0.3, -0.5, 1.5),
        "p": (1.2, 0.5, 0.1, 2.5),
    }
)
"""Mean, SD and ends of each number before any data: height about .55, k about 11 (Brixius 7.5, the paper 11.4, Burckhardt's up to 30), a
fall of a tenth, p from the brush's 2/3 to the hyperbola's 2."""
MISFIT = 0.02
"""Relative error of a bin's mean beyond its scatter: the form is not the soil."""
_FLOOR = 1e-3
_CANDIDATES = 6000
_LEAST = 50.0
"""Candidates that must count (Kish's effective number): bins that none follows are believed less, until so many do."""


def shape_at(slip: Floats, rate: Floats, fall: Floats, power: Floats) -> Floats:
    """h(q k s; p) - f s, odd in slip; `rate` is ln k. All broadcast against `slip`.

    q makes every p reach 3/4 of its height at the exponential's slip, ln 4/k: how fast soils give grip is known, by what form is not.
    """
    return np.asarray(
        np.sign(slip) * _rise(np.exp(rate) * _three_quarters(power) / np.log(4.0) * np.abs(slip), power)
        - fall * slip
    )


def _rise(x: Floats, power: Floats) -> Floats:
    """h of dh/dx = (1 - h)^p, h(0) = 0, at x >= 0."""
    q = np.where(np.abs(1 - power) < 1e-4, 1e-4, 1 - power)
    return np.asarray(-np.expm1(np.log(np.maximum(1 - q * x, 1e-12)) / q))


def _three_quarters(power: Floats) -> Floats:
    """x at which h is 3/4."""
    q = np.where(np.abs(1 - power) < 1e-4, 1e-4, 1 - power)
    return np.asarray(-np.expm1(-q * np.log(4.0)) / q)


@dataclass(frozen=True)
class Forms:
    """Drawn curves: `height` A, `rate` ln k, `fall` f and `power` p, (draws, 1) each."""

    height: Floats
    rate: Floats
    fall: Floats
    power: Floats

    def value(self, slip: Floats) -> Floats:
        """mu (draws, slips) at slips (slips,); never against the pull: 0 where a fall would end below."""
        shape = np.sign(slip) * shape_at(np.abs(slip)[None, :], self.rate, self.fall, self.power)
        return np.asarray(np.where(shape * slip > 0, self.height * shape, 0.0))


def agreeing_forms(
    slip: Floats, mean: Floats, sd: Floats, slip_sd: float, common_sd: float, draws: int, seed: int = 0
) -> Forms:
    """Forms that agree with bins of means and their SD at slips, (bins,) each.

    slip_sd: of an error that all slips share (zero slip); common_sd: relative, of one that all means share (the torques' scale).
    """
    rng = np.random.default_rng(seed)
    rate, fall, power = (
        np.clip(mean + width * rng.standard_normal((_CANDIDATES, 1)), low, high)
        for mean, width, low, high in (PRIOR[name] for name in ("ln k", "f", "p"))
    )
    shape = shape_at(slip - slip_sd * rng.standard_normal((_CANDIDATES, 1)), rate, fall, power)
    weight = 1 / (sd**2 + (MISFIT * mean) ** 2 + _FLOOR**2)
    square = (weight * shape**2).sum(axis=1, keepdims=True)
    height = (weight * mean * shape).sum(axis=1, keepdims=True) / np.maximum(square, 1e-12)
    usual, width, *_ = PRIOR["ln A"]
    off = (weight * (height * shape - mean) ** 2).sum(axis=1)
    off = off + ((np.log(np.maximum(height[:, 0], 1e-9)) - usual) / width) ** 2
    off = off - off.min()
    while True:
        share = np.exp(-off / 2)
        share /= share.sum()
        if 1 / (share @ share) >= _LEAST:
            break
        off = off / 1.5
    chosen = rng.choice(_CANDIDATES, draws, p=share)
    scale = 1 + common_sd * rng.standard_normal((draws, 1))
    return Forms(height[chosen] * scale, rate[chosen], fall[chosen], power[chosen])
