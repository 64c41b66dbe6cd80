"""Libraries learned from drawn drives, and one simulated campaign in small."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from ground_drives import COARSE, FINE, GRASS, Ground, drive
from ground_library import learned
from terragrip.soil.library import SoilLibrary


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
