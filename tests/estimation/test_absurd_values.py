"""Values that nothing measures, as loggers write them: they cost their rows, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from tests.estimation.drives import drive, robot, with_values

from terragrip.estimation import estimate


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", ["ground_speed", "drawbar_force", "wheel_speed_fl"])
@pytest.mark.parametrize("value", [1e200, -1.7e308])
def test_one_value_that_nothing_measures_costs_its_row(name: str, value: float) -> None:
    """Without a warning of NumPy's, which are errors here, and with the same sentences."""
    base = drive(40.0)
    spoilt = with_values(base.recording, name, slice(700, 701), value)
    right, other = (estimate(log, robot()) for log in (base.recording, spoilt))
    assert other["event"][700] == "outlier"
    assert other.notes == right.notes
    for row in ("adhesion_rr", "slip_rr", "soil_resistance"):
        away = np.abs(other[row] - right[row])
        assert np.all(away[750:] < 0.2 * right[f"{row}_std"][750:])
