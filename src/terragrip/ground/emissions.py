"""How likely a block of a drive is on each known soil, and on a soil that nobody knows.

A known soil is its curve, its resistance and its roughness (the library's signature). The unknown soil is a broad law over what soils can
be at all, so that it wins where no known one fits. Densities are of the same quantities for all: rho_s, mu, ln SD of rho_s, ln SD of mu.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import PERIOD, Blocks
from terragrip.soil.library import Soil
from terragrip.soil.signature import OFFSET, Signature, curve_error, signature_in

Array = NDArray[np.float64]

UNKNOWN = "unknown"

# What an unknown soil can be: a grid over published ranges of rho_s on fields and roads (0.02 to 0.3; ASABE D497), of the curve's scale
# (ice to dry concrete), and over roughness, ln of rho_s's SD within a block.
_RESISTANCES = (0.03, 0.06, 0.09, 0.12, 0.16, 0.21, 0.27)
_SCALES = (0.15, 0.22, 0.33, 0.47, 0.66, 0.9, 1.2, 1.6)
_ROUGHNESSES = (-6.4, -5.7, -5.0, -4.3)
# Within such a soil, as the simulated campaign's soils have it in the mean.
_SCALE_SPREAD = 0.12
_RESISTANCE_SPREAD = 5.0
"""SD of a block's rho_s over the SD within blocks: rough soils vary at every length."""
_ADHESION_ROUGHNESS = 0.6
"""ln SD of mu less that of rho_s."""
_ROUGHNESS_COVARIANCE = np.array([[0.50, 0.24], [0.24, 0.32]])
_LEVEL_TIME, _ROUGHNESS_TIME = 3.5, 1.3
"""Seconds for which neighbouring blocks repeat each other, all soils alike: else the sharper of two laws would win by its name."""
_STRAY = 0.01
"""Share of blocks that even a known soil leaves to a broad law: a stone, a rut, a step of the tool."""
_BROAD_RESISTANCE, _BROAD_SCALE, _BROAD_ROUGHNESS = (0.12, 0.08), (0.85, 0.5), (-5.6, 0.8)
_CURVE_SPREAD = 0.10
"""SD of mu about its curve, relative, where a library says nothing of it."""


@dataclass(frozen=True)
class Emissions:
    """Log likelihoods of blocks on the soils of a library; the last column is the unknown soil's."""

    soils: Mapping[str, Soil]
    made_by: str = ""
    """Method of the estimates (`signature.maker`); a signature made by another one tells no roughness."""

    @cached_property
    def signatures(self) -> dict[str, Signature | None]:
        """The soils' signatures; raises InputError where one is damaged."""
        return {name: signature_in(soil) for name, soil in self.soils.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What the library lacks, in plain sentences."""
        bare = [name for name, one in self.signatures.items() if one is None]
        foreign = [name for name, one in self.signatures.items() if one is not None and not self._rough(one)]
        said = []
        if bare:
            said.append(
                f"The library holds no signature of {', '.join(bare)}: recognised by curve and resistance alone, with less certainty."
            )
        if foreign:
            said.append(
                f"The library learned {', '.join(foreign)} from estimates by another method ({self.signatures[foreign[0]].made_by}), "  # type: ignore[union-attr]
                f"these are by {self.made_by}: their roughness is not compared."
            )
        return tuple(said)

    def _rough(self, signature: Signature) -> bool:
        return not (self.made_by and signature.made_by) or self.made_by == signature.made_by

    @property
    def names(self) -> tuple[str, ...]:
        """The soils, the unknown one last."""
        return (*self.soils, UNKNOWN)

    def log_likelihood(self, blocks: Blocks) -> Array:
        """(blocks, soils + CELLS): after the soils come what an unknown soil can be, cell by cell. 0 where nothing is known.

        Tempered: a block counts for PERIOD over the time in which blocks repeat each other.
        """
        known = blocks.known
        rough = known & np.isfinite(blocks.roughness).all(axis=1)
        level, roughness = _broad_level(blocks), _broad_roughness(blocks)
        columns = []
        for name, soil in self.soils.items():
            signature = self.signatures[name]
            mine = _tempered(known, _mixed(_level(soil, signature, blocks), level), _LEVEL_TIME)
            texture = roughness
            if signature is not None and self._rough(signature):
                texture = _mixed(_roughness(signature, blocks), roughness)
            columns.append(mine + _tempered(rough, texture, _ROUGHNESS_TIME))
        columns += list(self._cells(blocks, known, rough, level, roughness))
        return np.column_stack(columns)

    def _cells(
        self,
        blocks: Blocks,
        known: NDArray[np.bool_],
        rough: NDArray[np.bool_],
        level: Array,
        roughness: Array,
    ) -> Iterator[Array]:
        """Log likelihoods of the cells of the unknown soil, (blocks,) each: resistance within scale within roughness."""
        for r in _ROUGHNESSES:
            texture = _bivariate(
                blocks.roughness - np.array([r, r + _ADHESION_ROUGHNESS]), _ROUGHNESS_COVARIANCE
            )
            texture = _tempered(rough, _mixed(texture, roughness), _ROUGHNESS_TIME)
            variance = (_RESISTANCE_SPREAD * np.exp(r)) ** 2 + 0.01**2 + blocks.resistance_variance
            resistances = [_normal(blocks.resistance - x, variance) for x in _RESISTANCES]
            for a in _SCALES:
                error, own, scale = curve_error(Soil("", "exponential", {"a": a}), blocks)
                adhesion = _normal(error, _SCALE_SPREAD**2 + own) - np.log(scale)
                for resistance in resistances:
                    yield _tempered(known, _mixed(adhesion + resistance, level), _LEVEL_TIME) + texture


CELLS = len(_RESISTANCES) * len(_SCALES) * len(_ROUGHNESSES)
"""How many columns the unknown soil has."""


def _tempered(told: NDArray[np.bool_], logs: Array, seconds: float) -> Array:
    return np.where(told, logs, 0.0) * min(PERIOD / seconds, 1.0)


def _mixed(mine: Array, broad: Array) -> Array:
    return np.asarray(np.logaddexp(np.log(1 - _STRAY) + mine, np.log(_STRAY) + broad))


def _normal(error: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * (error**2 / variance + np.log(2 * np.pi * variance)))


def _broad_level(blocks: Blocks) -> Array:
    """rho_s and mu, independent and broad; mu about the paper's prototype curve."""
    shape = CURVES["exponential"].value(blocks.mean_slip, {"a": 1.0})
    spread = _BROAD_SCALE[1] * np.abs(shape) + OFFSET
    mean, sd = _BROAD_RESISTANCE
    resistance = _normal(blocks.resistance - mean, sd**2 + blocks.resistance_variance)
    return resistance + _normal(blocks.mean_adhesion - _BROAD_SCALE[0] * shape, spread**2)


def _broad_roughness(blocks: Blocks) -> Array:
    mean, sd = _BROAD_ROUGHNESS
    off = blocks.roughness - np.array([mean, mean + _ADHESION_ROUGHNESS])
    return np.asarray(_normal(off, np.full_like(off, sd**2)).sum(axis=1))


def _level(soil: Soil, signature: Signature | None, blocks: Blocks) -> Array:
    error, own, scale = curve_error(soil, blocks)
    if signature is None:
        wide = _relative_interval(soil)
        mu = _normal(error, _CURVE_SPREAD**2 + wide**2 + own) - np.log(scale)
        mean, sd = soil.resistance or _BROAD_RESISTANCE
        return mu + _normal(blocks.resistance - mean, sd**2 + blocks.resistance_variance)
    wide = _relative_interval(soil)
    first = np.sqrt(signature.level_sd[0] ** 2 + blocks.resistance_variance)
    second = np.sqrt(signature.level_sd[1] ** 2 + wide**2 + own)
    x, y = (blocks.resistance - signature.level[0]) / first, (error - signature.level[1]) / second
    rest = 1 - signature.level_correlation**2
    square = (x**2 - 2 * signature.level_correlation * x * y + y**2) / rest
    return np.asarray(-0.5 * square - np.log(2 * np.pi * first * second * scale) - 0.5 * np.log(rest))


def _relative_interval(soil: Soil) -> float:
    """Half width of the curve's 95 % interval over 1.96, relative to the parameter; of the first free parameter, its height."""
    for name, (low, high) in soil.interval.items():
        value = soil.parameters.get(name)
        if value:
            return float(abs(high - low) / (2 * 1.96 * abs(value)))
    return 0.0


def _roughness(signature: Signature, blocks: Blocks) -> Array:
    return _bivariate(blocks.roughness - signature.roughness, signature.roughness_covariance)


def _bivariate(off: Array, covariance: Array) -> Array:
    square = np.einsum("bi,ij,bj->b", off, np.linalg.inv(covariance), off)
    return np.asarray(-0.5 * square - 0.5 * np.log(np.linalg.det(2 * np.pi * covariance)))
