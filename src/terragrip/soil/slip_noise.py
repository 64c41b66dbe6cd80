"""The effect of slip noise on a curve, and its correction: simulation-extrapolation (SIMEX, Cook and Stefanski 1994).

Slip is itself an estimate. Samples sorted by a noisy slip flatten the steep part of the curve. Adding more noise of known size
shows how the parameters move with it; the trend is extrapolated back to no noise. Sorted by pull, noise enters only by the curve's bend,
and `pull_bins` removes that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import bin_pairs
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.least_squares import INTERCEPT

LEVELS = (0.5, 1.0, 1.5, 2.0)
REPEATS = 8
SAMPLES = 20_000


@dataclass(frozen=True)
class SlipNoise:
    """`plain` and `corrected` free parameters; `slip_std`: the median SD of the slips within the bins' range; `matters`: the corrected
    value is outside the plain fit's 95 % interval or more than 2 % away; `moved`: the corrected curve less the plain one over the used
    bins, relative to that (root mean squares)."""

    plain: Mapping[str, float]
    corrected: Mapping[str, float]
    slip_std: float
    matters: bool
    sentence: str
    moved: float = 0.0


def correct_slip_noise(
    curve: AdhesionCurve,
    slip: ArrayLike,
    adhesion: ArrayLike,
    slip_std: ArrayLike,
    seed: int = 0,
) -> SlipNoise:
    """Refit `curve` (already fitted to these pairs) with added slip noise and extrapolate the parameters back to none.

    slip, adhesion, slip_std: shape (n,); slip_std is the SD of the random part of each slip (a wrong radius is not noise).
    The curve's bins are by slip.
    Valid for noise up to about half the lowest bin's slip; beyond it, samples from below the range distort the trend.
    At most about 20 000 pairs are used, evenly drawn. A quadratic in the added variance is extrapolated to -1.
    Raises InputError where a noisy set has too few bins.
    """
    columns = np.stack([np.ravel(np.asarray(x, dtype=float)) for x in (slip, adhesion, slip_std)])
    columns = columns[:, np.isfinite(columns).all(axis=0)]
    if not columns.size:
        raise InputError("no pair has a slip deviation", hint="give estimates written by this Terragrip")
    s, mu, sd = columns[:, :: max(columns.shape[1] // SAMPLES, 1)]

    def again(noisy: Floats) -> dict[str, float]:
        return (
            curve.unfitted(bootstrap=0).fit_bins(bin_pairs(noisy, mu, None, curve.bins_.settings)).parameters_
        )

    rng = np.random.default_rng(seed)
    free = curve.free_
    base = again(s)
    rows = [[base[name] for name in free]]
    for level in LEVELS:
        fits = [again(s + np.sqrt(level) * sd * rng.standard_normal(s.size)) for _ in range(REPEATS)]
        rows.append([float(np.mean([fit[name] for fit in fits])) for name in free])
    table = np.array(rows)
    design = np.vander(np.concatenate(([0.0], LEVELS)), 3)
    coefficients = np.linalg.lstsq(design, table, rcond=None)[0]
    back = np.vander([-1.0], 3) @ coefficients
    shift = dict(zip(free, (back[0] - table[0]).tolist(), strict=True))
    plain = {name: float(curve.parameters_[name]) for name in free}
    corrected = {name: plain[name] + shift[name] for name in free}
    return shifted(curve, corrected, plain, s, sd, "use the corrected curve")


def shifted(
    curve: AdhesionCurve,
    corrected: Mapping[str, float],
    plain: Mapping[str, float],
    slip: Floats,
    slip_std: Floats,
    advice: str,
) -> SlipNoise:
    """The effect of noise on the free parameters of `curve`, in numbers and words; slip and its SD of all pairs (n,); `advice` if large."""
    settings = curve.bins_.settings
    inside = (slip >= settings.lower) & (slip < settings.upper) & np.isfinite(slip_std)
    noise = float(np.median(slip_std[inside])) if inside.any() else float(np.nanmedian(slip_std))
    matters = any(_beyond(curve, name, plain[name], corrected[name]) for name in plain)
    moves = ", ".join(f"{name} {plain[name]:.4g} -> {corrected[name]:.4g}" for name in plain)
    verdict = f"it matters: {advice}" if matters else "it does not matter here"
    sentence = f"Slip noise of {noise:.3f} (SD) moves {moves}; {verdict}."
    return SlipNoise(plain, corrected, noise, matters, sentence, _moved(curve, plain, corrected))


def _moved(curve: AdhesionCurve, plain: Mapping[str, float], corrected: Mapping[str, float]) -> float:
    def heights(free: Mapping[str, float]) -> Floats:
        given = {**curve.parameters_, **free}
        return CURVES[curve.model].value(curve.bins_.slip[curve.bins_.used], given, given.pop(INTERCEPT, 0.0))

    before = heights(plain)
    size = float(np.linalg.norm(before))
    return float(np.linalg.norm(heights(corrected) - before)) / max(size, 1e-9)


def _beyond(curve: AdhesionCurve, name: str, plain: float, corrected: float) -> bool:
    interval = curve.interval_.get(name)
    outside = interval is not None and not interval[0] <= corrected <= interval[1]
    return outside or abs(corrected - plain) > 0.02 * max(abs(plain), 1e-9)
