"""How steep the adhesion curves are that wheels share, from slip over adhesion.

A window's slip has the ground speed's noise, its adhesion little, so slip is regressed on adhesion: the other way round noise would
flatten the curve (as in :mod:`~terragrip.estimation.calibration.radii`). With m = A (1 - exp(-C s/A))::

    s_n = s_0 + τ a_n + x_j f(m_n),   f(m) = -A ln(1 - m/A),   x_j = 1/C_j of soil j,   dm/ds = C_j (1 - m/A)

τ is the ground speed's delay and a_n the relative rate of the rims: a machine that speeds up pulls more, so a late ground speed
would bend the curve. s_0 is what an error of all radii adds to every slip: without it light work on firm ground would look as flat as
mud. (R), our own construction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats, Ints

_PRIOR = (0.2, 0.15)  # x: mean and SD; C is 2 on grass, 8 on hard soil, 30 on asphalt
_LEAST, _MOST = 0.025, 1.0  # x
_ROOM = np.array([1.02, 1.04, 1.06, 1.1, 1.3, 1.6, 2.0, 3.0, 5.0])  # A over the largest level of a soil
_TOP = 0.98  # quantile that stands for the largest
_LEAST_LEVEL = 0.05
_DELAY = 0.1  # s, SD of the ground speed's delay
_ROUNDS = 10
_HUBER = 2.0


@dataclass(frozen=True)
class Steepness:
    """``by_form`` (m, n) dm/ds at each window; ``chance`` (m,): how likely each form is; ``relative_std``: of an error that all windows
    share, where the likeliest form is the right one."""

    by_form: Floats
    relative_std: float
    chance: Floats

    def of(self, form: int | None) -> Floats:
        """dm/ds (n,) of a form; None: of the likeliest."""
        return np.asarray(self.by_form[np.argmax(self.chance) if form is None else form])


def steepness_of(
    level: Floats, slip: Floats, soil: Ints, slip_std: float, block: Ints, by_delay: Floats
) -> Steepness:
    """The curves' steepness at levels (n,) of slips (n,); ``soil`` and ``block`` (n,) labels from 0.

    ``slip_std``: of an error that all slips share; ``by_delay`` (n,) 1/s: what a second's delay adds to each. Neighbouring windows repeat
    each other, so a stretch of track counts as one.
    """
    size, signed = np.abs(level), np.where(level < 0, -slip, slip)
    soils = int(soil.max()) + 1
    top = np.array([np.quantile(size[soil == j], _TOP) if np.any(soil == j) else 0.0 for j in range(soils)])
    repeats = len(level) / len(np.unique(block))
    ceiling = _ROOM[:, None] * np.maximum(top, _LEAST_LEVEL)[soil]
    share = np.minimum(size / ceiling, 0.98)
    sign = np.where(level < 0, -1.0, 1.0)
    common = np.column_stack([sign, sign * by_delay])
    losses, inverse, deviation = _regressed(
        -ceiling * np.log1p(-share), signed, soil, common, np.array([slip_std, _DELAY]), repeats
    )
    fits = len(np.unique(block)) * np.log(np.maximum(losses, 1e-9))
    chance = np.exp(np.min(fits) - fits)
    deviation_of_best = float(deviation[np.argmax(chance)])
    return Steepness((1 - share) / inverse[:, soil], deviation_of_best, chance / chance.sum())


def _regressed(
    form: Floats, slip: Floats, soil: Ints, common: Floats, common_std: Floats, repeats: float
) -> tuple[Floats, Floats, Floats]:
    """For forms (m, n) of the levels and terms (n, k) that all share, of SDs (k,).

    Returns the robust losses (m,), x_j (m, soils), and the relative SDs (m,) of their means.
    """
    soils, prior = int(soil.max()) + 1, _PRIOR[1] ** -2.0
    squared = (common[:, :, None] * common[:, None, :]).reshape(len(soil), -1)
    precision = np.diag(np.maximum(common_std, 1e-6) ** -2.0)
    inverse, by_all = np.full((len(form), soils), _PRIOR[0]), np.zeros((len(form), common.shape[1]))
    cell = (soils * np.arange(len(form))[:, None] + soil).ravel()

    def residual(inverse: Floats) -> Floats:
        return np.abs(slip - form * inverse[:, soil] - by_all @ common.T)

    def by_soil(values: Floats) -> Floats:
        """Sums of values (m, n) over each soil: (m, soils)."""
        return np.asarray(np.bincount(cell, values.ravel(), inverse.size), np.float64).reshape(inverse.shape)

    # A soil's term stands in its rows alone, so the normal equations are diagonal but for the terms that all share, which are solved first.
    for _ in range(_ROUNDS):
        rest = residual(inverse)
        noise = np.maximum(1.4826 * np.median(rest, axis=1, keepdims=True), 1e-4)
        weight = np.minimum(1.0, _HUBER * noise / np.maximum(rest, 1e-12)) / (noise**2 * repeats)
        weighted = weight * form
        own, target = by_soil(weighted * form) + prior, by_soil(weighted * slip) + prior * _PRIOR[0]
        crossed = np.stack([by_soil(weighted * term) for term in common.T], axis=2)
        lead = crossed / own[:, :, None]
        left = np.swapaxes(lead, 1, 2)
        covariance = np.linalg.inv(
            (weight @ squared).reshape(-1, *precision.shape) + precision - left @ crossed
        )
        by_all = (covariance @ ((weight * slip) @ common - (left @ target[..., None])[..., 0])[..., None])[
            ..., 0
        ]
        inverse = target / own - (lead @ by_all[..., None])[..., 0]
    inverse = np.clip(inverse, _LEAST, _MOST)
    counts = np.bincount(soil, minlength=soils) / len(soil)
    loss = np.mean(residual(inverse), axis=1)
    shared = counts @ lead
    spread = np.sqrt(counts**2 @ (1 / own).T + np.einsum("mj,mjk,mk->m", shared, covariance, shared))
    return loss, inverse, spread / (inverse @ counts)
