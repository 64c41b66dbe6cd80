"""Positions in metres against the length of a degree by NGA's series for WGS 84."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.geodesy import metres_of


@pytest.mark.parametrize("latitude", [-60.0, 0.0, 45.0, 51.3])
def test_a_thousandth_of_a_degree(latitude: float) -> None:
    phi = np.radians(latitude)
    north_degree = 111_132.92 - 559.82 * np.cos(2 * phi) + 1.175 * np.cos(4 * phi)
    east_degree = 111_412.84 * np.cos(phi) - 93.5 * np.cos(3 * phi)
    north, east = metres_of(
        np.array([np.nan, latitude, latitude + 1e-3]), np.array([np.nan, 179.9995, -179.9995])
    )
    assert np.isnan(north[0])
    assert (north[1], east[1]) == (0.0, 0.0)
    assert north[2] == pytest.approx(north_degree / 1000, rel=1e-4)
    assert east[2] == pytest.approx(east_degree / 1000, rel=1e-4)  # across the date line
