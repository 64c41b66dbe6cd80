"""A soil library from tables of estimates, for tests."""

from __future__ import annotations

from collections.abc import Sequence

from terragrip.estimation import Estimates
from terragrip.soil.estimates import labelled_blocks, pairs_of
from terragrip.soil.learn import learn_soils
from terragrip.soil.library import SoilLibrary
from terragrip.soil.signature import maker, with_signatures


def learned(tables: Sequence[Estimates]) -> SoilLibrary:
    """The library of labelled tables, as `terragrip soils` learns it."""
    library = learn_soils([pair for k, one in enumerate(tables) for pair in pairs_of(one, str(k))]).library()
    blocks: dict[str, list] = {}
    for one in tables:
        for name, one_soil in labelled_blocks(one, None, "table"):
            blocks.setdefault(name, []).append(one_soil)
    return SoilLibrary(with_signatures(library.soils, blocks, maker(tables[0])))
