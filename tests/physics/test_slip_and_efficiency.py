"""Slip, ratios and efficiency against figures worked by hand from paper eq. 5-7."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.physics.efficiency import gross_traction, motion_resistance, net_traction, tractive_efficiency
from terragrip.physics.slip import slip


@pytest.mark.parametrize(
    ("omega", "v", "expected"),
    [
        (5.0, 0.8, 0.2),  # r ω = 1.0
        (5.0, 1.0, 0.0),
        (5.0, 0.0, 1.0),  # spinning on the spot
        (0.0, 0.8, -1.0),  # locked
        (3.0, 0.8, -0.25),  # r ω = 0.6, pushed
        (-5.0, -0.8, 0.2),  # backwards
        (-5.0, 0.8, 0.2),  # only magnitudes enter
    ],
)
def test_slip_by_hand(omega, v, expected):
    assert slip(omega, v, 0.2) == pytest.approx(expected, abs=1e-15)


def test_slip_is_nan_only_where_wheel_and_vehicle_stand():
    omega = np.array([0.0, 0.2, 0.3, 0.2, np.nan, 5.0])
    v = np.array([0.0, 0.04, 0.04, 0.06, 0.5, np.nan])
    got = slip(omega, v, 0.2)
    assert np.isnan(got).tolist() == [True, True, False, False, True, True]
    assert np.isfinite(slip(0.2, 0.04, 0.2, standstill_speed=0.03))
    assert np.isnan(slip(0.0, 0.0, 0.2, standstill_speed=0.0))


def test_slip_broadcasts_wheels_over_one_ground_speed():
    got = slip([[5.0, 4.0], [5.0, 5.0]], np.array([[0.8], [1.0]]), [0.2, 0.25])
    np.testing.assert_allclose(got, [[0.2, 0.2], [0.0, 0.2]], atol=1e-15)


@given(st.floats(-50, 50), st.floats(-5, 5))
def test_slip_lies_within_its_range(omega, v):
    got = float(slip(omega, v, 0.2))
    assert np.isnan(got) or -1 <= got <= 1


def test_slip_grows_by_one_minus_s_times_a_radius_error():
    true, wrong = slip(5.0, 0.8, 0.2), slip(5.0, 0.8, 0.2 * 1.03)
    assert wrong - true == pytest.approx((1 - true) * 0.03, rel=0.03)  # physics.md 4


def test_ratios_by_hand():
    assert net_traction(0.5, 0.08) == pytest.approx(0.42)
    assert gross_traction(0.5, 0.02) == pytest.approx(0.52)
    assert motion_resistance(0.08, 0.02) == pytest.approx(0.10)
    # κ/(κ + ρ)(1 - s) = .42/.52 * .9
    assert tractive_efficiency(0.5, 0.08, 0.02, 0.1) == pytest.approx(0.42 / 0.52 * 0.9)


def test_efficiency_where_there_is_no_pull_or_no_drive():
    got = tractive_efficiency(
        adhesion=[0.08, 0.05, -0.1, 0.5, np.nan],
        soil_resistance=[0.08, 0.08, -0.2, 0.08, 0.08],
        tire_resistance=0.02,
        slip=[np.nan, -0.3, 0.1, np.nan, 0.1],
    )
    np.testing.assert_array_equal(got, [0.0, 0.0, np.nan, np.nan, np.nan])


def test_efficiency_is_pull_power_over_wheel_power():
    mu, rho_s, rho_t, omega, v, r, load = 0.45, 0.07, 0.03, 4.0, 0.7, 0.2, 340.0
    wheel_power = (mu + rho_t) * load * r * omega
    pull_power = (mu - rho_s) * load * v
    got = tractive_efficiency(mu, rho_s, rho_t, slip(omega, v, r))
    assert got == pytest.approx(pull_power / wheel_power, rel=1e-14)
