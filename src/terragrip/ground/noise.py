"""How much each signal varies on one ground, and what a step counts for: measured on the drive itself.

Two parts: noise of the estimates, new in every step, and the ground's own variation from place to place, which a vehicle's length
averages. Both from medians of differences between steps, so that changes of the ground do not pass for noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.signals import LAWS
from terragrip.ground.steps import A_LENGTH

LEAST = 40
"""Steps that measure the noise; fewer leave the usual one."""
_REPEATS = 2.0
"""Steps for which the ground's own variation repeats itself: a third of the vehicle, over which its wheels average it."""
_MEDIAN = 0.6745 * np.sqrt(2)
"""Median of the differences of two normal numbers over their SD."""


class Noise(NamedTuple):
    """SD of a step on one ground and what it counts for of an independent one, (signals,) each."""

    within: Floats
    weight: Floats


def noise_of(signals: Floats, names: Sequence[str]) -> Noise:
    """The noise of a drive's signals (steps, signals), NaN where not measured; of few steps the usual variation of the ground alone."""
    usual = [LAWS[name].within for name in names]
    return Noise(
        *np.array([_measured(x[np.isfinite(x)], sd) for x, sd in zip(signals.T, usual, strict=True)]).T
    )


def _measured(x: Floats, usual: float) -> tuple[float, float]:
    """SD and weight of one signal (steps,). Ground that varies by more than its usual share, as where every third step is a border, has
    changes."""
    if x.size < LEAST:
        return usual, 1 / _REPEATS
    fast, both = (np.median(np.abs(x[lag:] - x[:-lag])) / _MEDIAN for lag in (1, A_LENGTH))
    ground = np.clip(both**2 - fast**2, (usual / 2) ** 2, usual**2)
    variance = ground + fast**2
    return float(np.sqrt(variance)), float(variance / (_REPEATS * ground + fast**2))
