"""How likely a pair of slip and adhesion is on a soil of a given curve, both measured with error.

Driver and tool set the pull, and the ground answers by slip: before a pair is seen every pull is equally likely, on all soils alike. With
every slip equally likely instead, slips that are hardly known would speak for the flattest curve, which spreads its adhesion least.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terragrip.arrays import Floats
from terragrip.soil.blocks import LARGEST_SLIP, Blocks

OFFSET = 0.05
"""mu at which the spread about the curve is as much additive as proportional."""
FLAT = 0.3
"""Slope of a curve below which slips are equally likely rather than pulls: where it no longer rises no pull has a slip."""
_HALF = LARGEST_SLIP * np.linspace(0, 1, 19) ** 2
_ENDS = np.concatenate((-_HALF[:0:-1], _HALF))
"""Slips between which a curve is taken as straight, closer where it bends."""
_LEAST_SD = 1e-4


def log_density(
    curve: Callable[[Floats], Floats], blocks: Blocks, spread: float, shift: float = 0.0
) -> Floats:
    """Log density of blocks' mean slip and adhesion, (blocks,), on the soil whose mu at slips (n,) is `curve`.

    `spread`, `shift`: SD and mean of the ground's mu about the curve, relative to |mu| + `OFFSET`. Errors of the wheels are assumed alike.
    Exact for a curve of straight pieces: on each, slip is integrated out in closed form (a normal law times a piece of another).
    """
    from scipy.special import ndtr

    mu = curve(_ENDS)
    slope = np.diff(mu) / np.diff(_ENDS)
    scale = np.abs(mu[1:] + mu[:-1]) / 2 + OFFSET
    slip_variance, mu_variance = (
        ((np.sqrt(x) * blocks.share).sum(axis=1) ** 2)[:, None] + _LEAST_SD**2
        for x in (blocks.slip_variance, blocks.adhesion_variance)
    )
    mu_variance = mu_variance + (spread * scale) ** 2
    slip = blocks.mean_slip[:, None]
    off = blocks.mean_adhesion[:, None] - mu[:-1] - shift * scale - slope * (slip - _ENDS[:-1])
    total = mu_variance + slope**2 * slip_variance
    middle = slip + slope * slip_variance / total * off
    sd = np.sqrt(mu_variance * slip_variance / total)
    inside = ndtr((_ENDS[1:] - middle) / sd) - ndtr((_ENDS[:-1] - middle) / sd)
    logs = np.log(inside * (np.abs(slope) + FLAT) / np.sqrt(2 * np.pi * total) + 1e-300) - off**2 / (
        2 * total
    )
    return np.asarray(np.logaddexp.reduce(logs, axis=1))
