"""The second plant against statics, its own published formulas integrated another way, and balances of force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from terragrip.simulation.scenario import Robot
from terragrip.vehicle import Vehicle

pytest.importorskip("mujoco", reason="the second plant needs mujoco: install terragrip[dev]")

from second_plant import draw as second
from second_plant.plant import Ground, Waves, Work, run, static_loads
from second_plant.terramechanics import Wheel, soil_for, steady, stresses

G = 9.80665
VEHICLE = Vehicle.from_dict(
    {
        "mass": 139,
        "wheelbase": 0.638,
        "track": 0.554,
        "center_of_gravity_height": 0.3,
        "hitch_height": 0.25,
        "hitch_overhang": 0.1,
        "axles": {
            "front": {"mass": 54, "wheels": ["fl", "fr"]},
            "rear": {"mass": 85, "wheels": ["rl", "rr"]},
        },
        "wheel": {"radius": 0.2, "inertia": 0.15, "width": 0.1},
        "tire_rolling_resistance": 0.02,
        "bearing_resistance": 2.0,
    }
)
TYRE = Wheel(0.2, 0.1)
FIRM = soil_for(TYRE, 417.0, 0.003, exponent=0.8, exponent_slip=0.2, cohesion=5e3, friction=0.55, shear=0.01)
LOOSE = soil_for(
    TYRE, 417.0, 0.03, exponent=1.1, exponent_slip=0.8, cohesion=200.0, friction=0.45, shear=0.025
)
NONE = Waves(*(np.zeros(0) for _ in range(4)))


def drive(
    soils=(FIRM,),
    mix_at=(0.0,),
    mix=((1.0,),),
    pull=0.0,
    speed=0.6,
    curvature=0.0,
    duration=8.0,
    steers=False,
):
    ground = Ground(soils, np.array(mix_at), np.array(mix), (0.2,) * len(soils), NONE, NONE, NONE, NONE)
    work = Work(
        np.array([0.0, 1.0, 2.0, 100.0]), np.array([0.0, 0.0, speed, speed]), np.array([0.0, 0.0, curvature, curvature]),
        np.array([0.0]), np.array([pull]), 0.0, steers, duration,
    )  # fmt: skip
    return run(VEHICLE, VEHICLE.wheel_radius, Robot(), ground, work, 0.00125)


def test_stresses_are_the_published_integrals():
    """Wong and Reece's integrals by adaptive quadrature, one condition."""
    z, s, d = 0.02, 0.3, 0.2
    r, b = 0.2, 0.1
    entry = np.arccos(1 - z / r)
    top = (0.35 + 0.25 * s) * entry

    def sigma(angle):
        place = angle if angle > top else entry - angle / top * (entry - top)
        return LOOSE.stiffness * (r * (np.cos(place) - np.cos(entry))) ** (1.1 + 0.8 * d)

    def tau(angle):
        j = r * ((entry - angle) - (1 - s) * (np.sin(entry) - np.sin(angle)))
        return (200.0 + sigma(angle) * np.tan(0.45)) * (1 - np.exp(-j / 0.025))

    expected = [
        r * b * quad(f, 0, entry, points=[top], epsrel=1e-9)[0]
        for f in (
            lambda t: sigma(t) * np.cos(t), lambda t: tau(t) * np.sin(t), tau,
            lambda t: tau(t) * np.cos(t), lambda t: sigma(t) * np.sin(t),
        )
    ]  # fmt: skip
    np.testing.assert_allclose(stresses(LOOSE, TYRE, z, s, d), expected, rtol=5e-3)


def test_at_rest_loads_are_statics_and_nothing_moves():
    last = drive(speed=0.0, duration=4.0)
    np.testing.assert_allclose(last["load"][-1], static_loads(VEHICLE), rtol=1e-3)
    np.testing.assert_allclose(last["specific_z"][-1], G, rtol=1e-3)
    assert np.abs(last["speed"][200:]).max() < 1e-3


def test_a_steady_pull_balances_forces_on_the_published_curve():
    pull = 250.0
    done = drive(pull=pull, duration=12.0)
    forces = (done["adhesion"] * done["load"])[-1].sum()
    assert forces == pytest.approx(done["resistance"][-1].sum() + pull, rel=0.005)
    assert done["load"][-1].sum() == pytest.approx(139 * G, rel=0.01)
    # Pull at the hitch, and soil that holds the hubs back, move load to the rear axle.
    front = done["load"][-1][:2].sum()
    resisting = done["resistance"][-1].sum() * 0.2 + 0.02 * 139 * G * 0.2
    assert front == pytest.approx(54 * G - (pull * 0.25 + resisting) / 0.638, rel=0.03)
    for i in (0, 3):
        slip = 1 - done["hub_speed"][-1, i] / (0.2 * done["wheel_speed"][-1, i])
        adhesion, resistance, sinkage = steady(FIRM, TYRE, float(done["load"][-1, i]), np.array([slip]))
        assert done["adhesion"][-1, i] == pytest.approx(adhesion[0], rel=0.02)
        assert done["resistance"][-1, i] / done["load"][-1, i] == pytest.approx(resistance[0], rel=0.03)
        assert done["sinkage"][-1, i] == pytest.approx(
            sinkage[0], rel=0.03
        )  # tables are linear between nodes
        torque = (
            0.2 * (done["adhesion"][-1, i] + 0.02) * done["load"][-1, i]
            + 0.2 * 2.0 * done["wheel_speed"][-1, i]
        )
        assert done["torque"][-1, i] == pytest.approx(torque, rel=0.01)


def test_freely_rolling_it_is_held_back_by_soil_tyre_and_bearing_alone():
    """Motors off: the tangential force is what tyre and bearing ask, and the machine slows down by soil and these."""
    ground = Ground((FIRM,), np.zeros(1), np.ones((1, 1)), (0.2,), NONE, NONE, NONE, NONE)
    speeds = np.array([0.0, 1.0, np.nan])
    work = Work(np.array([0.0, 2.0, 4.0]), speeds, np.zeros(3), np.zeros(1), np.zeros(1), 0.0, False, 4.6)
    done = run(VEHICLE, VEHICLE.wheel_radius, Robot(), ground, work, 0.00125)
    k = -20
    assert np.abs(done["torque"][k]).max() < 1e-3
    spin = 0.15 * np.gradient(done["wheel_speed"], 1 / 200, axis=0)[k] / 0.2
    expected = -(0.02 * done["load"][k] + 2.0 * done["wheel_speed"][k] + spin)
    np.testing.assert_allclose(done["adhesion"][k] * done["load"][k], expected, rtol=0.05)
    braking = (done["adhesion"] * done["load"] - done["resistance"])[k].sum() / 139
    assert done["acceleration"][k] == pytest.approx(braking - G * np.sin(done["pitch"][k]), abs=0.02)


def test_it_turns_as_it_is_steered():
    for steers, least in (
        (False, 0.05),
        (True, 0.15),
    ):  # skidding sideways, four wheels turn far less than asked
        done = drive(curvature=0.25, duration=10.0, steers=steers)
        turned = done["rate_z"][-1] / done["speed"][-1]
        assert least < turned < 0.3, steers
        assert done["wheel_speed"][-1, 1] > 1.05 * done["wheel_speed"][-1, 0]


def test_it_digs_itself_in_where_slip_sinks_the_wheels_and_not_where_it_does_not():
    mix = {
        "mix_at": (0.0, 3.0, 4.0),
        "mix": ((1.0, 0.0), (1.0, 0.0), (0.0, 1.0)),
        "pull": 150.0,
        "duration": 25.0,
    }
    done = drive(soils=(FIRM, LOOSE), **mix)
    assert done["speed"][-1] < 0.01
    assert (0.2 * done["wheel_speed"][-1]).mean() > 0.4
    assert done["sinkage"][-1].max() > 2 * done["sinkage"][done["travel"] < 2.5].max()
    assert done["resistance"][-1].sum() > 3 * done["resistance"][1000].sum()
    assert not np.abs(done["speed"]).max() > 0.65
    firm = drive(soils=(FIRM, replace(FIRM, exponent_slip=0.0)), **mix)
    assert firm["speed"][-1] > 0.3


@pytest.mark.parametrize("task", ["work", "digging"])
def test_drawn_machines_keep_the_balance_the_truth_claims(task):
    kind, seed = second.kinds()[0], 20
    result, same = (second.draw(kind, seed, rate=50.0, task=task) for _ in range(2))
    pd.testing.assert_frame_equal(result.truth, same.truth)
    np.testing.assert_array_equal(result.recording.time, result.truth.time)
    t, v = result.truth, result.vehicle
    moving = t.true_ground_speed > 0.05
    for i, w in enumerate(v.wheels):
        radius, load = result.true_parameters["wheel_radius"][w], t[f"true_vertical_load_{w}"]
        spin = v.wheel_inertia[i] * np.gradient(t[f"true_wheel_speed_{w}"], t.time)
        drag = (
            radius * v.tire_rolling_resistance * load
            + v.wheel_radius[i] * v.bearing_resistance * t[f"true_wheel_speed_{w}"]
        )
        torque = spin + radius * t[f"true_adhesion_{w}"] * load + drag
        error = (torque - t[f"true_drive_torque_{w}"])[moving]
        assert error.abs().median() < 0.01 * radius * load.median()
    assert (t.true_soil_resistance[moving] > 0).all()
    assert np.abs(t.true_slope).max() < 0.3
    loads = sum(t[f"true_vertical_load_{w}"] for w in v.wheels)
    assert loads[moving].mean() == pytest.approx(v.mass * G, rel=0.02)
    if task == "digging":
        assert t.stuck.iloc[-1]
    else:
        assert t.stuck.mean() < 0.05


def test_another_drive_is_of_the_same_machine_on_other_ground():
    kind = second.kinds()[0]
    work = second.draw(kind, 3, rate=20.0)
    other = second.another_drive(kind, work.seed, rate=20.0, duration=8.0)
    assert other.vehicle.to_dict() == work.vehicle.to_dict()
    assert other.true_parameters == work.true_parameters
    assert other.truth["true_ground_speed"].max() > 0.1
    rows = len(other.truth)
    assert not np.allclose(other.truth["true_slope"], work.truth["true_slope"][:rows], atol=1e-4)
