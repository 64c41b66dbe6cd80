"""What noise in slip does to a curve, and the correction: simulation-extrapolation (SIMEX, Cook and Stefanski 1994).

Slip is itself an estimate. Samples sorted by a noisy slip flatten the steep part of the curve. Adding still more noise of known size
shows how the parameters move with it; the trend is followed back to no noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terragrip.errors import InputError
from terragrip.soil.bins import bin_pairs
from terragrip.soil.fit import AdhesionCurve

Array = NDArray[np.float64]

LEVELS = (0.5, 1.0, 1.5, 2.0)
REPEATS = 8
SAMPLES = 60_000


@dataclass(frozen=True)
class SlipNoise:
    """`plain` and `corrected` free parameters; `slip_std`: the root mean square of the slip noise; `matters`: the shift leaves the
    plain fit's 95 % interval or exceeds 2 %."""

    plain: Mapping[str, float]
    corrected: Mapping[str, float]
    slip_std: float
    matters: bool
    sentence: str


def correct_slip_noise(
    curve: AdhesionCurve, slip: ArrayLike, adhesion: ArrayLike, slip_std: ArrayLike, seed: int = 0
) -> SlipNoise:
    """Refit `curve` (already fitted to these pairs) with added slip noise and follow the parameters back to none.

    slip, adhesion, slip_std: shape (n,); slip_std is the SD of the random part of each slip (a wrong radius is not noise).
    Good for noise up to about half the lowest bin's slip; beyond it, samples from below the range spoil the trend.
    At most 60 000 pairs are used, evenly taken. A quadratic in the added variance is extrapolated to -1.
    Raises InputError where a noisy set holds too few bins.
    """
    s, mu, sd = (np.ravel(np.asarray(x, dtype=float)) for x in (slip, adhesion, slip_std))
    good = np.isfinite(s) & np.isfinite(mu) & np.isfinite(sd)
    s, mu, sd = s[good], mu[good], sd[good]
    if not s.size:
        raise InputError("no pair has a slip deviation", mend="give estimates written by this terragrip")
    step = max(s.size // SAMPLES, 1)
    s, mu, sd = s[::step], mu[::step], sd[::step]
    rng = np.random.default_rng(seed)
    free = curve.free_
    base = _fit(curve, s, mu)
    rows = [[base[name] for name in free]]
    for level in LEVELS:
        fits = [
            _fit(curve, s + np.sqrt(level) * sd * rng.standard_normal(s.size), mu) for _ in range(REPEATS)
        ]
        rows.append([float(np.mean([fit[name] for fit in fits])) for name in free])
    table = np.array(rows)
    design = np.vander(np.concatenate(([0.0], LEVELS)), 3)
    coefficients = np.linalg.lstsq(design, table, rcond=None)[0]
    back = np.vander([-1.0], 3) @ coefficients
    shift = dict(zip(free, (back[0] - table[0]).tolist(), strict=True))
    plain = {name: float(curve.parameters_[name]) for name in free}
    corrected = {name: plain[name] + shift[name] for name in free}
    matters = any(_beyond(curve, name, plain[name], corrected[name]) for name in free)
    noise = float(np.sqrt(np.mean(sd**2)))
    moves = ", ".join(f"{name} {plain[name]:.4g} -> {corrected[name]:.4g}" for name in free)
    verdict = "it matters: take the corrected curve" if matters else "it does not matter here"
    return SlipNoise(
        plain, corrected, noise, matters, f"Slip noise of {noise:.3f} (SD) moves {moves}; {verdict}."
    )


def _fit(curve: AdhesionCurve, slip: Array, adhesion: Array) -> dict[str, float]:
    again = AdhesionCurve(curve.model, curve.fixed, curve.intercept, curve.weights, curve.bins, bootstrap=0)
    return again.fit_bins(bin_pairs(slip, adhesion, None, curve.bins)).parameters_


def _beyond(curve: AdhesionCurve, name: str, plain: float, corrected: float) -> bool:
    interval = curve.interval_.get(name)
    outside = interval is not None and not interval[0] <= corrected <= interval[1]
    return outside or abs(corrected - plain) > 0.02 * max(abs(plain), 1e-9)
