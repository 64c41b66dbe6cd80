"""The roughness of known soils, learned from all soils of a library together.

How much a block's roughness scatters is one covariance for all soils: with one each, learned from a minute, the soil whose blocks happened
to scatter less or more would win by that. And each mean is drawn towards the mean of all by as much as its own few blocks leave open
(empirical Bayes; James and Stein 1961): where the soils differ by no more than such means do by chance, roughness tells nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.laws import ROUGHNESS_TIME
from terragrip.soil.blocks import PERIOD
from terragrip.soil.signature import Signature


@dataclass(frozen=True)
class Roughness:
    """Means (2,) of soils by name, and the covariance (2, 2) of a block about its soil's (of no soil: ones); as `Signature` has them."""

    means: Mapping[str, Floats]
    covariance: Floats


def shared(signatures: Mapping[str, Signature]) -> Roughness:
    """The roughness of soils whose signatures hold one, and can be compared; the others are left out."""
    shown = {name: one for name, one in signatures.items() if one.roughness is not None}
    if not shown:
        return Roughness({}, np.eye(2))
    blocks = np.array([one.blocks for one in shown.values()], dtype=float)
    covariance = np.average([one.roughness_covariance for one in shown.values()], axis=0, weights=blocks)
    means = np.array([one.roughness for one in shown.values()])
    centre = means.mean(axis=0)
    off = means - centre
    by_chance = ROUGHNESS_TIME / (PERIOD * blocks)  # variance of a mean over that of a block
    square = np.einsum("ki,ij,kj->", off, np.linalg.inv(covariance), off) / 2
    between = max(square / max(len(shown) - 1, 1) - by_chance.mean(), 0.0)
    kept = between / (between + by_chance)
    return Roughness(dict(zip(shown, centre + kept[:, None] * off, strict=True)), covariance)
