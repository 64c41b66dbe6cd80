"""The unknown soil: any soil on a grid of possible soils.

One broad law would not do: over a stretch, a known soil that fits badly has the better density in every block than a law that is broad
in every block. A cell of the grid is as sharp as a known soil is, so that the cell which fits wins over known soils that do not. That
there are many cells, each as probable as the rest, is what a known soil that fits has ahead (Occam).
"""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.laws import (
    ADHESION_ROUGHNESS,
    ROUGHNESS_TIME,
    bivariate,
    broad_level,
    broad_roughness,
    mixed,
    normal,
    of_slip,
    tempered,
)
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import LARGEST_SLIP, Blocks
from terragrip.soil.signature import OFFSET, USUAL_CURVE

UNKNOWN = "unknown"

RESISTANCES = np.array([0.03, 0.06, 0.09, 0.12, 0.16, 0.21, 0.27])
"""rho_s of fields and roads (ASABE D497)."""
SCALES = np.array([0.15, 0.22, 0.33, 0.47, 0.66, 0.9, 1.2, 1.6])
"""Scale a of the paper's prototype curve: ice to dry concrete."""
ROUGHNESSES = np.array([-6.4, -5.7, -5.0, -4.3])
"""ln of rho_s's SD within a block."""
GRID = RESISTANCES.size * SCALES.size * ROUGHNESSES.size
CELLS = GRID + 1
"""How many soils the unknown one may be; the last is none on the grid, of the broad law alone."""

# Within such a soil, as the simulated campaign's soils have it in the mean.
_SCALE_SPREAD = 0.12
_RESISTANCE_SPREAD = 5.0  # SD of a block's rho_s over the SD within blocks: rough soils vary at every length
_LEAST_RESISTANCE_SD = 0.01
_ROUGHNESS_COVARIANCE = np.array([[0.50, 0.24], [0.24, 0.32]])


def cells(blocks: Blocks, weight: Floats) -> Floats:
    """Tempered log likelihoods (blocks, CELLS) of known blocks; `weight` (blocks,): what each block's level counts for."""
    rows = len(blocks)
    level = broad_level(blocks)
    broad = level[:, None, None, None]
    adhesion = _adhesion(blocks)[:, None, :, None]
    spread = (_RESISTANCE_SPREAD * np.exp(ROUGHNESSES)) ** 2 + _LEAST_RESISTANCE_SD**2
    off = blocks.resistance[:, None, None] - RESISTANCES
    resistance = normal(off, spread[:, None] + blocks.resistance_variance[:, None, None])[:, :, None, :]
    out = weight[:, None, None, None] * mixed(adhesion + resistance, broad)
    out = out + textures(blocks.roughness)[:, :, None, None]
    none = weight * level + tempered(broad_roughness(blocks.roughness), ROUGHNESS_TIME)
    return np.column_stack([out.reshape(rows, GRID), none])


def textures(roughness: Floats) -> Floats:
    """Tempered log likelihoods (blocks, ROUGHNESSES) of the roughness (blocks, 2) alone; 0 where it is not known."""
    middle = np.column_stack([ROUGHNESSES, ROUGHNESSES + ADHESION_ROUGHNESS])
    mine = bivariate(roughness[:, None, :] - middle, _ROUGHNESS_COVARIANCE)
    return tempered(mixed(mine, broad_roughness(roughness)[:, None]), ROUGHNESS_TIME)


def _adhesion(blocks: Blocks) -> Floats:
    """Log density of mu about the curve of each scale, (blocks, scales); as `signature.curve_error` has it."""
    curve = CURVES["exponential"]
    shape = (curve.value(blocks.slip, {"a": 1.0}) * blocks.share).sum(axis=1)[:, None]
    height = curve.value(np.array([LARGEST_SLIP]), {"a": 1.0})
    by_slip = np.minimum(
        np.abs(curve.slope(blocks.slip, {"a": 1.0})) * np.sqrt(blocks.slip_variance), 0.5 * height
    )
    scale = SCALES * np.abs(shape) + OFFSET
    error = (blocks.mean_adhesion[:, None] - SCALES * shape) / scale
    known = np.hypot(np.sqrt(blocks.adhesion_variance)[:, None, :], SCALES[:, None] * by_slip[:, None, :])
    own = ((known * blocks.share[:, None, :]).sum(axis=2) / scale) ** 2
    steepness = SCALES / USUAL_CURVE["a"]
    return normal(error, _SCALE_SPREAD**2 + own) - np.log(scale) + of_slip(own, _SCALE_SPREAD, steepness)
