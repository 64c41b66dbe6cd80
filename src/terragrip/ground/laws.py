"""Small laws that emissions are made of: normal densities, a broad law for outliers, and tempering."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import PERIOD, Blocks
from terragrip.soil.signature import OFFSET, USUAL_CURVE

LEVEL_TIME, ROUGHNESS_TIME = 3.5, 1.3
"""Seconds for which neighbouring blocks repeat each other. All soils alike: else the sharper of two laws would win by its name."""
LEVEL_WAY = 0.75
"""Lengths of vehicle and tool over which levels repeat each other: the same ground is under one wheel after the other."""
BROAD_RESISTANCE, BROAD_SCALE = (0.12, 0.08), (USUAL_CURVE["a"], 0.5)
"""Mean and SD over all grounds of rho_s (0.02 to 0.3 on fields and roads; ASABE D497) and of the scale of mu's curve."""
ADHESION_ROUGHNESS = 0.6
"""ln SD within a block of mu, less that of rho_s: what the simulated campaign's soils have in the mean."""
_BROAD_ROUGHNESS = (-5.6, 0.8)
_STRAY = 0.01
"""Share of blocks that a soil leaves to the broad law: a stone, a rut, a step of the tool."""


def tempered(logs: Floats, seconds: float) -> Floats:
    """Log likelihoods of blocks that repeat each other for `seconds`: each counts for PERIOD / seconds; 0, which tells nothing, for NaN."""
    return np.where(np.isnan(logs), 0.0, logs * min(PERIOD / seconds, 1.0))


def level_weight(driven: Floats, length: float) -> Floats:
    """What the level of each block counts for, (blocks,), from the way driven since the one before [m] and the vehicle's length [m].

    Of length 0 nothing is known: by time alone.
    """
    usual = np.full(len(driven), PERIOD / LEVEL_TIME)
    return np.minimum(usual, driven / (LEVEL_WAY * length)) if length else usual


def mixed(mine: Floats, broad: Floats) -> Floats:
    """Log density of a law with outliers; NaN stays, as of a roughness that is not known."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.logaddexp(np.log(1 - _STRAY) + mine, np.log(_STRAY) + broad))


def normal(error: Floats, variance: Floats) -> Floats:
    """Log density of a normal law, elementwise."""
    return np.asarray(-0.5 * (error**2 / variance + np.log(2 * np.pi * variance)))


def of_slip(own: Floats, spread: float, steepness: Floats) -> Floats:
    """What makes a log density of mu one of slip, for the share of the error about a curve that the estimates' own variance has beside the
    soil's spread; slope of the curve over the usual one's.

    The pull is given, slip is measured, and mostly it is slip that errs. As a density of mu, a flat curve would win by its name: it makes
    the same error of slip a small one of mu.
    """
    return np.asarray(own / (own + spread**2) * np.log(steepness))


def bivariate(off: Floats, covariance: Floats) -> Floats:
    """Log density of a normal law of pairs, (blocks, 2) to (blocks,)."""
    (a, b), (_, c) = covariance
    determinant = a * c - b * b
    x, y = off[..., 0], off[..., 1]
    square = (c * x * x - 2 * b * x * y + a * y * y) / determinant
    return np.asarray(-0.5 * square - np.log(2 * np.pi) - 0.5 * np.log(determinant))


def broad_level(blocks: Blocks) -> Floats:
    """Log density of rho_s and mu, independent and broad, mu about the paper's prototype curve (blocks,)."""
    shape = CURVES["exponential"].value(blocks.mean_slip, {"a": 1.0})
    spread = BROAD_SCALE[1] * np.abs(shape) + OFFSET
    mean, sd = BROAD_RESISTANCE
    resistance = normal(blocks.resistance - mean, sd**2 + blocks.resistance_variance)
    return resistance + normal(blocks.mean_adhesion - BROAD_SCALE[0] * shape, spread**2)


def broad_roughness(roughness: Floats) -> Floats:
    """Log density of the roughness of any ground (blocks,)."""
    mean, sd = _BROAD_ROUGHNESS
    off = roughness - np.array([mean, mean + ADHESION_ROUGHNESS])
    return normal(off[:, 0], np.full(len(off), sd**2)) + normal(off[:, 1], np.full(len(off), sd**2))
