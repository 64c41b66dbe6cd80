"""What columns say of each other: a distance run of a speed's unit, and slopes against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.formats.evidence import Evidence, slope_of

TIME = np.arange(0.0, 60.0, 0.1)
SPEED = 3.0 + np.sin(TIME / 5)  # m/s
WAY = np.cumsum(SPEED) * 0.1


@pytest.mark.parametrize(("speed", "unit"), [(1.0, "m/s"), (3.6, "km/h")])
@pytest.mark.parametrize("metres", [1.0, 1000.0, 0.125])
def test_a_distance_counter_tells_the_unit_of_a_speed(speed: float, unit: str, metres: float) -> None:
    """Metres, kilometres, or pulses of an eighth of a metre."""
    columns = {"v": speed * SPEED, "run": np.floor(WAY / metres / 1e-3) * 1e-3}
    finding = Evidence(columns, dict.fromkeys(columns, TIME)).against_distance("v", "run", metres)
    assert finding is not None
    assert (finding.agrees, finding.unit) == (True, unit)


def test_a_slope_is_that_of_least_squares_and_needs_eight_values_and_both_to_vary() -> None:
    x, y = np.arange(10.0), 3.0 * np.arange(10.0) + np.sin(np.arange(10.0))
    found = slope_of(np.r_[x, np.nan], np.r_[y, 1.0])
    assert found == pytest.approx((np.polyfit(x, y, 1)[0], np.corrcoef(x, y)[0, 1]))
    assert slope_of(x[:8], y[:8]) is not None
    assert slope_of(x[:7], y[:7]) is None
    assert slope_of(np.ones(10), y) is None
    assert slope_of(x, np.ones(10)) is None
