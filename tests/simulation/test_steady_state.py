"""The plant at rest and in steady motion, against closed forms worked out here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

G = 9.80665
MASS, WHEELBASE, REAR_TO_CG, CG_HEIGHT, HITCH_HEIGHT = 139.0, 0.638, 54 / 139 * 0.638, 0.30, 0.25
RADIUS, TIRE, BEARING = 0.2, 0.02, 2.0


def adhesion(slip: float, a: float) -> float:
    return a * (1 - 0.52 * np.exp(0.01 * slip) - 0.48 * np.exp(-11.36 * slip))


def test_load_at_rest_is_the_axles_mass(quiet, drive):
    trace = drive(quiet(speed=[[0, "off"]], duration=1))
    np.testing.assert_allclose(trace["load"][-1], np.array([27, 27, 42.5, 42.5]) * G, rtol=1e-9)


def test_load_at_rest_on_a_slope(quiet, drive):
    slope = 0.06
    scenario = quiet(
        speed=[[0, "off"]],
        duration=6,
        route={"segments": [{"soil": "even", "length": 60}], "slope": {"mean": slope}},
        tools=[],
    )
    trace = drive(scenario)
    front = (MASS * G * np.cos(slope) * REAR_TO_CG - MASS * G * np.sin(slope) * CG_HEIGHT) / WHEELBASE
    assert abs(trace["speed"][-1]) < 1e-4  # rolling resistance holds it
    np.testing.assert_allclose(trace["load"][-1, :2].sum(), front, rtol=1e-4)
    np.testing.assert_allclose(trace["load"][-1].sum(), MASS * G * np.cos(slope), rtol=1e-6)


@pytest.mark.parametrize(
    ("a", "rho", "rho_slip", "draught", "slope"),
    [(0.85, 0.12, 0.0, 200.0, 0.0), (1.42, 0.05, 0.02, 500.0, 0.02), (0.40, 0.07, 0.05, 40.0, -0.01)],
)
def test_steady_motion_balances_forces(quiet, drive, a, rho, rho_slip, draught, slope):
    scenario = quiet(
        soils={
            "even": {"curve": {"name": "exponential", "a": a}, "resistance": rho, "resistance_slip": rho_slip}
        },
        tools=[{"mass": 60, "length": 2.0, "dig_in": draught}],
        route={"segments": [{"soil": "even", "length": 60}], "slope": {"mean": slope}},
        duration=20,
    )
    last = drive(scenario, stride=10).rows[-1:]
    trace = drive(scenario, stride=10)
    normal, pull = MASS * G * np.cos(slope), draught + 60 * G * np.sin(slope)

    def surplus(slip: float) -> float:
        return (adhesion(slip, a) - rho - rho_slip * slip) * normal - pull - MASS * G * np.sin(slope)

    slip = brentq(surplus, 0.0, 0.5)
    mu = adhesion(slip, a)
    front = (normal * REAR_TO_CG - MASS * G * np.sin(slope) * CG_HEIGHT - pull * HITCH_HEIGHT) / WHEELBASE
    load = np.repeat([front / 2, (normal - front) / 2], 2)
    assert last.shape[0] == 1
    np.testing.assert_allclose(trace["slip"][-1], slip, atol=2e-5)
    np.testing.assert_allclose(trace["speed"][-1], 0.6 * (1 - slip), rtol=1e-4)
    np.testing.assert_allclose(trace["load"][-1], load, rtol=1e-4)
    np.testing.assert_allclose(trace["drawbar"][-1], pull, rtol=1e-4)
    torque = RADIUS * (mu + TIRE) * load + RADIUS * BEARING * 3.0
    np.testing.assert_allclose(trace["torque"][-1], torque, rtol=2e-4)
    np.testing.assert_allclose(trace.rolling_force[-1].sum() / normal, rho + rho_slip * slip, rtol=1e-4)


def test_motors_never_exceed_torque_and_power(quiet, drive):
    hard = {"even": {"curve": {"name": "exponential", "a": 1.42}, "resistance": 0.05}}
    scenario = quiet(soils=hard, tools=[{"mass": 60, "dig_in": 780}], speed=[[0, 0], [1, 4.0]], duration=8)
    trace = drive(scenario)
    power = (trace["torque"] * trace["wheel_speed"]).sum(axis=1)
    settled = trace["time"] > 3
    assert power[settled].max() < 1600 * 1.002
    assert power[settled].max() > 1600 * 0.9  # the limit is what holds it back
    assert trace["wheel_speed"][-1].mean() < 0.9 * 4.0 / RADIUS
    assert np.abs(trace["torque"]).max() <= 130.0 + 1e-9


def test_coasting_wheels_are_braked_by_tyre_and_bearing_alone(quiet, drive):
    """Motors off, mu = -(rho_t + bearing): a free-rolling pass, from which a radius can be read."""
    scenario = quiet(tools=[], speed=[[0, 0], [1, 1.0], [3, "off"]], duration=3.6)
    trace = drive(scenario)
    k = -1
    assert abs(trace["torque"][k]).max() < 1e-6
    inertial = 0.15 * trace["wheel_acceleration"][k]
    expected = -(TIRE + (BEARING * trace["wheel_speed"][k] + inertial / RADIUS) / trace["load"][k])
    np.testing.assert_allclose(trace["adhesion"][k], expected, rtol=1e-9)
    assert np.all(trace["slip"][k] < 0)
    assert np.all(trace["slip"][k] > -0.02)


PEAKED = {"name": "pacejka", "B": 8.0, "C": 1.9, "D": 0.5, "E": 0.6}
CURVE_EXAMPLES = [
    {"name": "exponential", "a": 0.4},
    {"name": "burckhardt", "c1": 0.1946, "c2": 94.129, "c3": 0.0646},  # snow
    {"name": "burckhardt", "c1": 0.05, "c2": 306.39, "c3": 0.0},  # ice: steep
    {"name": "schreiber_kutzbach", "a": 0.5, "b": 0.55, "c": 8.0, "d": 0.05},
    {"name": "brixius", "mobility": 30},
    {"name": "wismer_luth", "wheel_numeric": 25},
    PEAKED,
]


@pytest.mark.parametrize("curve", CURVE_EXAMPLES, ids=lambda c: c["name"])
def test_any_curve_model_is_followed_over_all_slips(quiet, drive, curve):
    """A machine that digs itself in runs through every slip; adhesion lies on its model, without a model's intercept."""
    from terragrip.physics.adhesion import CURVES

    soils = {"even": {"curve": curve, "resistance": 0.02}}
    tool = [{"mass": 60, "length": 2.0, "added": [[0, 0], [3, 1500]]}]
    trace = drive(quiet(soils=soils, tools=tool, driver={"acts": False}, duration=15))
    model = CURVES[curve["name"]]
    parameters = model.complete({k: v for k, v in curve.items() if k != "name"})
    slip = trace["slip"][:, 3]
    assert slip.max() > 0.95
    expected = np.sign(slip) * model.positive(np.abs(slip), parameters)
    np.testing.assert_allclose(trace["adhesion"][:, 3], expected, atol=2e-6)
