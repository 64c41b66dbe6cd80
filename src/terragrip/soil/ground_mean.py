"""The curve of the ground as a whole: what sorting by slip does to it where the ground varies, and the correction.

Slip answers to the ground: under one pull a weak spot slips more than a strong one. So the bins of high slip hold weak spots, and the
bins of 5 % slip leave the strongest ground out; a fit that counts each bin alike is drawn down (PHYSICS 5 has the fit, not this). The
pull, and with it adhesion, does not answer to the ground. Choosing samples by adhesion and counting them by the metres driven gives the
scale of the ground's mean curve: a = sum(mu dx) / sum(g(s) dx). Random errors of slip cancel in the sum but for g's curvature, which is
known: the mean of e^(-k s) under normal errors is e^(k^2 sigma^2 / 2) too large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terragrip.physics.adhesion import CURVES
from terragrip.soil.fit import AdhesionCurve

Array = NDArray[np.float64]

MATTERS = 0.03
"""Relative shift of the scale beyond which it is said."""
_ROUNDS = 50
_WIDEST = 0.1


@dataclass(frozen=True)
class GroundMean:
    """`plain`: the scale by the bins; `mean`: of the ground's mean curve; `interval`: its 95 % by clusters, None with fewer than 3.

    `metres`: of wheel path that count. `matters`: the two differ by more than 3 %.
    """

    plain: float
    mean: float
    interval: tuple[float, float] | None
    metres: float
    matters: bool
    sentence: str


def mean_over_ground(
    curve: AdhesionCurve,
    slip: ArrayLike,
    adhesion: ArrayLike,
    metres: ArrayLike,
    cluster: ArrayLike | None = None,
    slip_std: ArrayLike = 0.0,
    common_sd: float = 0.0,
    bootstrap: int = 1000,
    seed: int = 0,
) -> GroundMean | None:
    """Scale a of the mean curve of the ground driven over, beside the fitted `curve`'s; all arrays (n,).

    metres: path of the wheel that each sample stands for [m]; cluster: integer labels (run) for the interval; slip_std: SD of
    the random part of each slip, taken as 0 where it is NaN and as 0.1 where it is more. Samples count where adhesion exceeds
    that of the curve at the bins' lowest slip. common_sd: relative SD of an error of adhesion that all runs share (the machine's
    torque scale); no drawing of runs shows it, so it widens the interval. None where the fit has other free parameters than one
    scale, or no sample counts.
    """
    if curve.model != "exponential" or curve.free_ != ("a",):
        return None
    s, mu, dx = (np.ravel(np.asarray(x, dtype=float)) for x in (slip, adhesion, metres))
    labels = np.zeros(s.size, dtype=np.int64) if cluster is None else np.ravel(np.asarray(cluster))
    noise = np.broadcast_to(
        np.clip(np.nan_to_num(np.ravel(np.asarray(slip_std, dtype=float))), 0.0, _WIDEST), s.shape
    )
    good = np.isfinite(s) & np.isfinite(mu) & (dx > 0)
    s, mu, dx, noise, labels = s[good], mu[good], dx[good], noise[good], labels[good]
    height = _height(curve, s, noise)
    least = float(_height(curve, np.array([curve.bins.lower]), np.zeros(1))[0])
    plain = a = float(curve.parameters_["a"])
    counts = mu > a * least
    for _ in range(_ROUNDS):
        below = float((height[counts] * dx[counts]).sum())
        if below <= 0:
            return None
        before, a = a, float((mu[counts] * dx[counts]).sum()) / below
        counts = mu > a * least
        if abs(a - before) < 1e-6 * a:
            break
    interval = _interval(
        mu[counts] * dx[counts], height[counts] * dx[counts], labels[counts], a, bootstrap, seed, common_sd
    )
    shift = a / plain - 1
    matters = abs(shift) > MATTERS
    sentence = f"Counted by metres of ground, a is {a:.3g}, "
    sentence += (
        f"{shift:+.1%} from the bins' fit: bins of slip gather weak spots and the noise of slip."
        if matters
        else "as the bins say."
    )
    return GroundMean(plain, a, interval, float(dx[counts].sum()), matters, sentence)


def _height(curve: AdhesionCurve, slip: Array, noise: Array) -> Array:
    """The curve of scale 1 (n,), at positive slips unbiased by normal errors of SD `noise` (n,)."""
    q = curve.parameters_
    terms = ((q["p"], q["alpha_1"]), (1 - q["p"], q["alpha_2"]))
    unbiased = 1 - sum(share * np.exp(rate * slip - (rate * noise) ** 2 / 2) for share, rate in terms)
    plain = CURVES[curve.model].value(slip, {**q, "a": 1.0})
    return np.asarray(np.where(slip > 0, unbiased, plain))


def _interval(
    above: Array,
    below: Array,
    labels: NDArray[np.int64],
    a: float,
    bootstrap: int,
    seed: int,
    common_sd: float,
) -> tuple[float, float] | None:
    """95 % interval of the ratio of sums, clusters drawn with replacement, widened as `AdhesionCurve` does and by what is common to all."""
    _, index = np.unique(labels, return_inverse=True)
    sums = np.stack([np.bincount(index, weights=values) for values in (above, below)])
    clusters = sums.shape[1]
    if clusters < 3 or not bootstrap:
        return None
    from scipy.special import stdtrit

    draws = np.random.default_rng(seed).multinomial(clusters, np.full(clusters, 1 / clusters), size=bootstrap)
    top, bottom = sums @ draws.T
    widen = stdtrit(clusters - 1, 0.975) / 1.959964 * np.sqrt(clusters / (clusters - 1))
    found = a + (top / np.maximum(bottom, 1e-300) - a) * widen
    low, high = np.percentile(found[bottom > 0], [2.5, 97.5])
    shared = 1.959964 * common_sd * a
    return a - float(np.hypot(a - low, shared)), a + float(np.hypot(high - a, shared))
