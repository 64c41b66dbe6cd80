"""The motion equations by hand, and their algebraic inverse on a random state."""

import numpy as np
import pytest

from terragrip.physics import motion


def test_wheel_by_hand():
    # M - r μ F - r ρ_t F - r ρ_w ω = 30 - .2*.3*400 - .2*.05*400 - .2*2*4 = 30 - 24 - 4 - 1.6 = .4; over .16
    got = motion.wheel_acceleration(
        4.0, 30.0, 0.3, 400.0, radius=0.2, inertia=0.16, tire_resistance=0.05, bearing_resistance=2.0
    )
    assert got == pytest.approx(2.5)


def test_vehicle_by_hand():
    # Σ μ F = .3*400 + .2*600 = 240; (240 - 100)/100 = 1.4; ρ_s g = .05*10 = .5
    arguments = ([0.3, 0.2], [400.0, 600.0], 100.0, 0.05)
    constants = {"mass": 100.0, "gravity": 10.0}
    assert motion.ground_acceleration(*arguments, 0.0, **constants) == pytest.approx(0.9)
    assert motion.specific_force(*arguments, 0.0, **constants) == pytest.approx(0.9)
    uphill = motion.ground_acceleration(*arguments, np.arcsin(0.6), **constants)
    assert uphill == pytest.approx(1.4 - 0.4 - 6.0)
    # an accelerometer does not see the slope, but for the cosine
    assert motion.specific_force(*arguments, np.arcsin(0.6), **constants) == pytest.approx(1.0)


@pytest.mark.parametrize("wheels", [1, 4, 8])
def test_the_algebraic_estimate_inverts_the_motion(wheels):
    rng = np.random.default_rng(wheels)
    shape = (5, wheels)
    wheel = {
        "radius": rng.uniform(0.2, 0.9, wheels),
        "inertia": rng.uniform(0.1, 80, wheels),
        "tire_resistance": 0.03,
        "bearing_resistance": rng.uniform(0, 3, wheels),
    }
    vehicle = {"mass": 3000.0, "gravity": 9.81}
    omega, torque, mu = rng.normal(0, 5, shape), rng.normal(0, 900, shape), rng.uniform(-0.2, 0.8, shape)
    load = rng.uniform(300, 9000, shape)
    drawbar, rho, slope = rng.normal(0, 3000, 5), rng.uniform(0, 0.3, 5), rng.uniform(-0.3, 0.3, 5)

    spin = motion.wheel_acceleration(omega, torque, mu, load, **wheel)
    accel = motion.ground_acceleration(mu, load, drawbar, rho, slope, **vehicle)
    got_mu = motion.algebraic_adhesion(omega, spin, torque, load, **wheel)
    np.testing.assert_allclose(got_mu, mu, rtol=1e-12, atol=1e-13)
    got_rho = motion.algebraic_soil_resistance(got_mu, load, drawbar, accel, slope, **vehicle)
    np.testing.assert_allclose(got_rho, rho, rtol=1e-11, atol=1e-12)
