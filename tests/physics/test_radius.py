"""Tire deflection and radii by hand (physics.md 4)."""

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.estimation.settings import wheel_radii
from terragrip.physics.radius import biderman_deflection, hadekel_deflection, loaded_radius, rolling_radius
from terragrip.vehicle import Vehicle


def test_hadekel_by_hand():
    # sqrt(.5 * .25) = .35355; 2π * 100 kPa * .35355 = 222 144 N/m
    got = hadekel_deflection(4442.88, unloaded_radius=0.5, width=0.5, inflation_pressure=1e5)
    assert got == pytest.approx(0.02, rel=1e-5)


def test_biderman_solves_its_quadratic():
    load, p, p0, c1, c2 = np.array([100.0, 900.0]), 1.2e5, 0.3e5, 4e-7, 1.5
    h = biderman_deflection(load, inflation_pressure=p, carcass_pressure=p0, c1=c1, c2=c2)
    np.testing.assert_allclose(h**2 - c2 * load / (p + p0) * h - c1 * load, 0, atol=1e-17)
    assert np.all(h > 0)


def test_a_softer_or_heavier_tire_sinks_more():
    tire = {"unloaded_radius": 0.2, "width": 0.1}
    soft, firm = (hadekel_deflection(340.0, inflation_pressure=p, **tire) for p in (5e4, 1e5))
    assert soft == pytest.approx(2 * firm)


def test_rolling_radius_lies_between_loaded_and_free():
    arm = loaded_radius(0.5, 0.02)
    assert arm == pytest.approx(0.48)
    assert rolling_radius(0.5, arm) == pytest.approx(2.5 * 0.5 * 0.48 / (0.75 + 0.48))
    assert arm < rolling_radius(0.5, arm) < 0.5
    assert rolling_radius(0.5, 0.5) == pytest.approx(0.5)


def test_a_wheels_radii_follow_its_load_and_a_tire_that_caves_in_is_refused():
    tire = {"radius": 0.5, "inertia": 1.0, "width": 0.5}
    data = {
        "mass": 2000.0,
        "wheelbase": 2.0,
        "track": 1.5,
        "center_of_gravity_height": 0.5,
        "hitch_height": 0.4,
    }
    data["axles"] = {
        "front": {"mass": 1000.0, "wheels": ["fl", "fr"]},
        "rear": {"mass": 1000.0, "wheels": ["rl", "rr"]},
    }

    def vehicle(pressure: float) -> Vehicle:
        return Vehicle.from_dict(
            {**data, "wheel": {**tire, "radius_model": {"name": "hadekel", "pressure": pressure}}}
        )

    arms, rolling = wheel_radii(vehicle(1e5))
    sunk = 500 * 9.80665 / 222144.1  # as above
    np.testing.assert_allclose(arms, 0.5 - sunk, rtol=1e-6)
    np.testing.assert_allclose(rolling, rolling_radius(0.5, 0.5 - sunk), rtol=1e-6)
    with pytest.raises(InputError, match=r"deflects a tire of 0\.5 m"):
        wheel_radii(vehicle(5e3))
