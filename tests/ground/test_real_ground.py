"""Real logs of other machines: nothing breaks, a laboratory floor does not change, and simulated soils are not read into them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from terragrip.estimation import Estimates, estimate
from terragrip.formats import read
from terragrip.ground.analysis import Settings, analyse
from terragrip.vehicle import Vehicle

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def estimated(log: Path, machine: str) -> Estimates:
    return estimate(
        read(log, EXAMPLES / machine / "profile.yaml"), Vehicle.load(EXAMPLES / machine / "vehicle.yaml")
    )


@pytest.mark.parametrize("online", [False, True])
def test_a_laboratory_floor_does_not_change(shared: Callable[[str], Path], online: bool) -> None:
    for name in ("log3300-180-3300-180", "log_3300x"):
        result = estimated(shared(f"data/alostar_4wd/{name}.txt"), "alostar_4wd")
        ground, _ = analyse(result, settings=Settings(online=online))
        assert ground.changes == ()
        assert ground.timeline.known.any()


def test_a_warthog_on_grass_is_not_a_made_up_soil(shared: Callable[[str], Path], library) -> None:
    """4 Hz wheel speeds, half the drive at rest: probabilities stay probabilities, and what no soil fits is unknown."""
    result = estimated(shared("data/drive_warthog/raw20hz/warthog_wheels_grass.csv.gz"), "drive_warthog")
    ground, table = analyse(result, library)
    np.testing.assert_allclose(ground.timeline.probabilities.sum(axis=1), 1)
    assert (ground.timeline.soil[ground.timeline.known] == "unknown").mean() > 0.9
    assert np.isfinite(table["soil_probability"]).all()
    assert any("shows the ground" in note for note in ground.notes)
