"""Libraries learned from drawn drives, and one simulated campaign in small."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from ground_drives import COARSE, FINE, GRASS, Ground, drive
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
        for name, found in labelled_blocks(one, None, "table"):
            blocks.setdefault(name, []).append(found)
    return SoilLibrary(with_signatures(library.soils, blocks, maker(tables[0])))


@pytest.fixture(scope="session")
def library() -> SoilLibrary:
    """grass, fine and coarse as `drives` draws them, two runs each."""
    grounds: dict[str, Ground] = {"grass": GRASS, "fine": FINE, "coarse": COARSE}
    return learned(
        [
            drive(10 * k + run, [(name, g, 60)])
            for k, (name, g) in enumerate(grounds.items())
            for run in (1, 2)
        ]
    )
