"""What noise in slip does to a curve, and the correction: simulation-extrapolation (SIMEX, Cook and Stefanski 1994).

Slip is itself an estimate. Samples sorted by a noisy slip flatten the steep part of the curve; sorted by pull, only the curve's bend
lets noise through. Adding still more noise of known size shows how the parameters move with it; the trend is followed back to no noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terragrip.errors import InputError
from terragrip.soil.bins import BY_PULL, bin_pairs
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.pull_bins import bin_by_pull

Array = NDArray[np.float64]

LEVELS = (0.5, 1.0, 1.5, 2.0)
REPEATS = 8
SAMPLES = 20_000


@dataclass(frozen=True)
class SlipNoise:
    """`plain` and `corrected` free parameters; `slip_std`: the median SD of the slips within the bins' range; `matters`: the shift leaves
    the plain fit's 95 % interval or exceeds 2 %."""

    plain: Mapping[str, float]
    corrected: Mapping[str, float]
    slip_std: float
    matters: bool
    sentence: str


def correct_slip_noise(
    curve: AdhesionCurve,
    slip: ArrayLike,
    adhesion: ArrayLike,
    slip_std: ArrayLike,
    pull: ArrayLike | None = None,
    metres: ArrayLike | None = None,
    seed: int = 0,
) -> SlipNoise:
    """Refit `curve` (already fitted to these pairs) with added slip noise and follow the parameters back to none.

    slip, adhesion, slip_std: shape (n,); slip_std is the SD of the random part of each slip (a wrong radius is not noise). pull and metres
    (n,), as `bin_by_pull` takes them, where the curve's bins are by pull; the pulls stay sorted as they were.
    Good for noise up to about half the lowest bin's slip; beyond it, samples from below the range spoil the trend.
    About 20 000 pairs at most are used, evenly taken. A quadratic in the added variance is extrapolated to -1.
    Raises InputError where a noisy set holds too few bins.
    """
    by_pull = curve.bins_.settings.by == BY_PULL
    given = (slip, adhesion, slip_std, *((pull, metres) if by_pull else ()))
    columns = np.stack([np.ravel(np.asarray(x, dtype=float)) for x in given])
    columns = columns[:, np.isfinite(columns).all(axis=0)]
    if not columns.size:
        raise InputError("no pair has a slip deviation", mend="give estimates written by this terragrip")
    step = max(columns.shape[1] // SAMPLES, 1)
    s, mu, sd, *others = columns[:, ::step]

    def again(noisy: Array) -> dict[str, float]:
        if by_pull:
            z, dx = others
            bins = bin_by_pull(noisy, mu, z, step * dx, None, curve.bins_.settings, curve.bins_.reference)
        else:
            bins = bin_pairs(noisy, mu, None, curve.bins_.settings)
        return curve.unfitted(bootstrap=0).fit_bins(bins).parameters_

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
    matters = any(_beyond(curve, name, plain[name], corrected[name]) for name in free)
    settings = curve.bins_.settings
    inside = (s >= settings.lower) & (s < settings.upper)
    noise = float(np.median(sd[inside] if inside.any() else sd))
    moves = ", ".join(f"{name} {plain[name]:.4g} -> {corrected[name]:.4g}" for name in free)
    verdict = "it matters: take the corrected curve" if matters else "it does not matter here"
    return SlipNoise(
        plain, corrected, noise, matters, f"Slip noise of {noise:.3f} (SD) moves {moves}; {verdict}."
    )


def _beyond(curve: AdhesionCurve, name: str, plain: float, corrected: float) -> bool:
    interval = curve.interval_.get(name)
    outside = interval is not None and not interval[0] <= corrected <= interval[1]
    return outside or abs(corrected - plain) > 0.02 * max(abs(plain), 1e-9)
