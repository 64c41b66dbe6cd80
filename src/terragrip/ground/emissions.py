"""How likely a block of a drive is on each known soil, and on an unknown soil.

A known soil is its curve, its resistance and its roughness (the library's signature); the estimates' own standard deviations widen its law
block by block. Densities are of the same quantities for all soils: rho_s, mu, and the roughness of both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.ground.laws import (
    BROAD_RESISTANCE,
    ROUGHNESS_TIME,
    bivariate,
    broad_level,
    broad_roughness,
    level_weight,
    mixed,
    normal,
    of_slip,
    tempered,
)
from terragrip.ground.roughness import Roughness, shared
from terragrip.ground.unknown import CELLS, ROUGHNESSES, UNKNOWN, cells, textures
from terragrip.soil.blocks import Blocks
from terragrip.soil.library import Soil
from terragrip.soil.signature import USUAL_SOIL, Signature, curve_error, signature_in, steepness

_CURVE_SPREAD = 0.10
"""SD of mu about its curve, relative, where a library does not state it."""


@dataclass(frozen=True)
class Emissions:
    """Log likelihoods of blocks on the soils of a library, and on the cells of the unknown one.

    `made_by`: method of the estimates (`signature.maker`); a signature learned by another method tells nothing of roughness.
    `length` [m]: of vehicle and tool, over which levels repeat each other; 0: not known.
    """

    soils: Mapping[str, Soil]
    made_by: str = ""
    length: float = 0.0

    @cached_property
    def signatures(self) -> dict[str, Signature | None]:
        """The soils' signatures; raises InputError where one is damaged."""
        return {name: signature_in(soil) for name, soil in self.soils.items()}

    @cached_property
    def roughness(self) -> Roughness:
        """Of the soils whose signature can be compared with these estimates."""
        return shared({name: one for name, one in self.signatures.items() if one and self._comparable(one)})

    @property
    def names(self) -> tuple[str, ...]:
        """The soils, the unknown one last."""
        return (*self.soils, UNKNOWN)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the library lacks, in plain sentences."""
        bare = [name for name, one in self.signatures.items() if one is None]
        foreign = {
            name: one.made_by for name, one in self.signatures.items() if one and not self._comparable(one)
        }
        remarks = []
        if bare:
            remarks.append(
                f"The library holds no signature of {', '.join(bare)}: recognised by curve and resistance alone, with less certainty."
            )
        if foreign:
            remarks.append(
                f"The library learned {', '.join(foreign)} from estimates by {', '.join(sorted(set(foreign.values())))}, "
                f"these are by {self.made_by}: their roughness is not compared."
            )
        return tuple(remarks)

    @cached_property
    def states(self) -> NDArray[np.int64]:
        """Which soil each state belongs to, an index of `names` (states,).

        A known soil is one state; one whose roughness is not known has a state for each that the unknown soil may have, lest the
        unknown soil win by being sharp where this one must be broad. The unknown soil's cells come last.
        """
        per = [1 if name in self.roughness.means else ROUGHNESSES.size for name in self.soils]
        return np.repeat(np.arange(len(per) + 1), [*per, CELLS])

    def log_likelihood(self, blocks: Blocks, driven: Floats) -> Floats:
        """(blocks, states), tempered: a block counts for its share of the time and of the way over which blocks repeat each other.

        `driven` (blocks,): way since the block before [m]. 0 where a block tells nothing of the ground.
        """
        out = np.zeros((len(blocks), self.states.size))
        known = blocks.known
        out[known] = self._likelihood(blocks[known], level_weight(driven, self.length)[known])
        return out

    def _likelihood(self, blocks: Blocks, weight: Floats) -> Floats:
        roughness, level, usual = blocks.roughness, broad_level(blocks), steepness(USUAL_SOIL, blocks)
        columns = []
        for name, soil in self.soils.items():
            signature = self.signatures[name]
            mine = weight * mixed(_level(soil, signature, blocks, usual), level)
            if name not in self.roughness.means:
                columns.append(mine[:, None] + textures(roughness))
                continue
            own = bivariate(roughness - self.roughness.means[name], self.roughness.covariance)
            mine = mine + tempered(mixed(own, broad_roughness(roughness)), ROUGHNESS_TIME)
            columns.append(mine[:, None])
        return np.concatenate([*columns, cells(blocks, weight)], axis=1)

    def _comparable(self, signature: Signature) -> bool:
        return not (self.made_by and signature.made_by) or self.made_by == signature.made_by


def _level(soil: Soil, signature: Signature | None, blocks: Blocks, usual: Floats) -> Floats:
    """Log density of rho_s and mu on a known soil, (blocks,); `usual`: steepness of the usual curve."""
    error, own, scale = curve_error(soil, blocks)
    steeper = steepness(soil, blocks) / usual
    own = own + _relative_interval(soil) ** 2
    if signature is None:
        mean, sd = soil.resistance or BROAD_RESISTANCE
        mu = normal(error, _CURVE_SPREAD**2 + own) - np.log(scale) + of_slip(own, _CURVE_SPREAD, steeper)
        return mu + normal(blocks.resistance - mean, sd**2 + blocks.resistance_variance)
    first = np.sqrt(signature.level_sd[0] ** 2 + blocks.resistance_variance)
    second = np.sqrt(signature.level_sd[1] ** 2 + own)
    x, y = (blocks.resistance - signature.level[0]) / first, (error - signature.level[1]) / second
    correlation = signature.level_correlation
    covariance = np.array([[1.0, correlation], [correlation, 1.0]])
    both = bivariate(np.stack([x, y], axis=-1), covariance) - np.log(first * second * scale)
    return both + of_slip(own, signature.level_sd[1], steeper)


def _relative_interval(soil: Soil) -> float:
    """SD of the curve's first free parameter, its height, relative: its 95 % interval over 2 x 1.96; 0 where there is none."""
    for name, (low, high) in soil.interval.items():
        value = soil.parameters.get(name)
        if value:
            return float(abs(high - low) / (2 * 1.96 * abs(value)))
    return 0.0
