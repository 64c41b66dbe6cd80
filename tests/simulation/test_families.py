"""Random machines: what follows from mechanics whatever was drawn, similarity, and the split."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.physics.loads import axle_loads
from terragrip.simulation import Scenario, families, simulate
from terragrip.simulation.family_machines import LAYOUTS
from terragrip.simulation.terrain import build
from terragrip.vehicle import Vehicle

G = 9.80665
SOME = list(families.machines("development", 6, first_seed=40))


@pytest.fixture(scope="module")
def drawn():
    return [families.draw(kind, seed, rate=50.0) for kind, seed in SOME]


def test_truth_obeys_the_equation_of_motion_on_every_layout(drawn):
    """Paper eq. 3, any number of axles and wheels: tangential forces less pull, soil and slope."""
    for result in drawn:
        t, mass = result.truth, result.vehicle.mass
        pull = sum(t[f"true_adhesion_{w}"] * t[f"true_vertical_load_{w}"] for w in result.vehicle.wheels)
        soil = t.true_soil_resistance * mass * G * np.cos(t.true_slope)
        force = pull - t.true_drawbar_force - soil - mass * G * np.sin(t.true_slope)
        on_a_row = np.abs(t.time * 200 - np.rint(t.time * 200)) < 1e-6
        moving = on_a_row & (t.true_ground_speed > 0.05)
        assert moving.sum() > 1000
        np.testing.assert_allclose((mass * t.true_acceleration)[moving], force[moving], atol=1e-7 * mass * G)


def test_wheels_obey_their_equation_with_their_own_radius_and_inertia(drawn):
    for result in drawn:
        t, v = result.truth, result.vehicle
        quiet = (t.true_ground_speed > 0.05) & (t.true_acceleration.abs() < 0.01)
        for i, w in enumerate(v.wheels):
            radius, load = result.true_parameters["wheel_radius"][w], t[f"true_vertical_load_{w}"]
            omega = t[f"true_wheel_speed_{w}"]
            resisting = radius * (
                (t[f"true_adhesion_{w}"] + v.tire_rolling_resistance) * load + v.bearing_resistance * omega
            )
            error = (t[f"true_drive_torque_{w}"] - resisting)[quiet]
            assert error.abs().median() < 0.01 * radius * load.mean() + 3 * v.wheel_inertia[i] * 0.05


def test_drawn_machines_move_and_do_work(drawn):
    for (kind, _), result in zip(SOME, drawn, strict=True):
        low, high = families.MASSES[kind.mass]
        assert low <= result.vehicle.mass <= high
        t = result.truth
        assert (t.true_ground_speed > 0.02).mean() > 0.7
        assert t.stuck.mean() < 0.05


@pytest.mark.parametrize("counts", [counts for _, counts in LAYOUTS], ids=str)
def test_loads_at_rest_are_statics(counts):
    """On a slope, standing: each axle's load is the rigid body's, shared evenly by its wheels."""
    mass, slope = 60.0, 0.05
    share = np.linspace(1.0, 1.4, len(counts))
    names = [f"axle{k}" for k in range(len(counts))]
    vehicle = {
        "mass": mass,
        "track": 0.4,
        "center_of_gravity_height": 0.2,
        "wheelbase": 0.9,
        "axles": {
            name: {
                "mass": float(mass * s / share.sum()),
                "wheels": [f"{name}{side}" for side in "lr"[:count]],
            }
            for name, s, count in zip(names, share, counts, strict=True)
        },
        "wheel": {"radius": 0.15, "inertia": 0.05},
    }
    scenario = Scenario.from_dict(
        {
            "vehicle": vehicle,
            "sensors": {"use": "exact", "wheel_force": None},
            "soils": {"even": {"curve": {"name": "exponential", "a": 0.85}, "resistance": 0.12}},
            "route": {"segments": [{"soil": "even", "length": 20}], "slope": {"mean": slope}},
            "speed": [[0, "off"]],
            "duration": 6,
        }
    )
    last = simulate(scenario, 1).truth.iloc[-1]
    made = Vehicle.from_dict(vehicle)
    expected = axle_loads(made.axle_mass, made.axle_to_rear, center_of_gravity_height=0.2, slope=slope)
    for axle, name in enumerate(names):
        assert last[f"true_vertical_load_{name}"] == pytest.approx(expected[axle], rel=2e-3)
        for w in made.axles[name].wheels:
            assert last[f"true_vertical_load_{w}"] == pytest.approx(expected[axle] / counts[axle], rel=2e-3)


def test_a_machine_twice_as_long_does_the_same_at_its_own_pace():
    """Froude: lengths 2, forces 8, torques 16, inertia 32, speeds and times root 2: slip and adhesion are the same."""
    small, large = _scaled(1.0), _scaled(2.0)
    s, t = simulate(small, 3).truth, simulate(large, 3).truth
    beat = np.sqrt(2.0)
    for column, factor in (
        ("true_slip_fl", 1.0), ("true_adhesion_rr", 1.0), ("true_soil_resistance", 1.0), ("true_ground_speed", beat),
        ("true_drive_torque_rl", 16.0), ("true_vertical_load_fr", 8.0), ("true_drawbar_force", 8.0),
    ):  # fmt: skip
        at = s.time.to_numpy()[(s.time > 4) & (s.time < 9)]
        expected = factor * np.interp(at, s.time, s[column])
        result = np.interp(at * beat, t.time, t[column])
        np.testing.assert_allclose(result, expected, atol=0.01 * np.abs(expected).max(), err_msg=column)


def _scaled(scale: float) -> Scenario:
    beat = np.sqrt(scale)
    wheel = {"radius": 0.2 * scale, "inertia": 0.15 * scale**5}
    vehicle = {
        "mass": 139 * scale**3,
        "track": 0.554 * scale,
        "wheelbase": 0.638 * scale,
        "center_of_gravity_height": 0.3 * scale,
        "hitch_height": 0.25 * scale,
        "hitch_overhang": 0.1 * scale,
        "axles": {
            "front": {"mass": 54 * scale**3, "wheels": ["fl", "fr"]},
            "rear": {"mass": 85 * scale**3, "wheels": ["rl", "rr"]},
        },
        "wheel": wheel,
        "tire_rolling_resistance": 0.02,
        "bearing_resistance": 2.0 * scale**3.5,
    }
    return Scenario.from_dict(
        {
            "vehicle": vehicle,
            "robot": {
                "wheel_mass": 5.4 * scale**3,
                "tire_stiffness": 8e4 * scale**2,
                "tire_damping": 600 * scale**2.5,
                "chassis_torsion": 1500 * scale**2,
                "resistance_length": 0.02 * scale,
                "slip_speed": 0.05 * beat,
                "wheel_rest_speed": 0.02 / beat,
                "speed_gain": 20 * scale**4.5,
                "speed_integral": 100 * scale**4,
                "motor_lag": 0.01 * beat,
                "antiwindup_time": 0.1 * beat,
                "torque_limit": 130 * scale**4,
                "power_limit": 1600 * scale**3.5,
                "load_variation": 0.05,
                "load_variation_length": 0.25 * scale,
            },
            "sensors": {"use": "exact", "wheel_force": None},
            "soils": {
                "even": {"curve": {"name": "burckhardt", "c1": 0.6, "c2": 15.0, "c3": 0.1}, "resistance": 0.1, "roughness": 0.001 * scale}
            },
            "route": {"segments": [{"soil": "even", "length": 30 * scale}]},
            "tools": [
                {
                    "mass": 60 * scale**3, "length": 2.0 * scale, "friction": 0.2, "added": [[2 * scale, 0], [3 * scale, 150 * scale**3]],
                    "shear_length": 0.01 * scale, "slack": 0.0, "stiffness": 4e4 * scale**2, "damping": 800 * scale**2.5,
                }
            ],
            "speed": [[0, 0], [1 * beat, 0.5 * beat], [6 * beat, 0.5 * beat], [7 * beat, 0.7 * beat]],
            "duration": 10 * beat,
            "step": 5e-4,
        }
    )  # fmt: skip


def test_each_wheels_load_varies_by_itself_over_the_asked_length():
    scenario = families.scenario(*SOME[1])
    vehicle, robot = scenario.nominal_vehicle(), scenario.robot
    scenario = scenario.model_copy(
        update={
            "robot": robot.model_copy(update={"load_variation_length": 0.3 * robot.load_variation_length})
        }
    )
    fields = [one for seed in range(6) for one in build(scenario, vehicle, seed).load_variation]
    spread = np.array([one.std() for one in fields])
    assert spread.mean() == pytest.approx(robot.load_variation, rel=0.1)
    # Matérn 3/2: correlation (1 + √3) exp(-√3) = .48 at the length itself
    far = round(scenario.robot.load_variation_length / build(scenario, vehicle, 0).spacing)
    alike = np.mean([np.corrcoef(one[far:], one[:-far])[0, 1] for one in fields])
    assert alike == pytest.approx(0.48, abs=0.1)
    across = np.mean([np.corrcoef(a, b)[0, 1] for a, b in zip(fields[::2], fields[1::2], strict=True)])
    assert abs(across) < 0.15


def test_the_split_is_by_kind():
    both = set(families.kinds("development")) | set(families.kinds("held-out"))
    assert both == set(families.kinds())
    assert not set(families.kinds("development")) & set(families.kinds("held-out"))
    for kind in families.kinds("development"):
        assert kind.mass != "compact"
        assert kind.curve != "peaking"
        assert kind.sensors != "coarse"
    listed = [kind for kind, _ in families.machines("development", 12)]
    assert {k.mass for k in listed} == {"light", "robot", "tractor"}
    assert {k.curve for k in listed} == {"saturating", "brixius", "sinkage"}
    assert all(kind.part == "held-out" for kind, _ in families.machines("held-out", 20))


def test_rate_and_faults_leave_machine_and_drive_alone():
    kind, seed = SOME[3]
    one, same = (families.draw(kind, seed, rate=50.0) for _ in range(2))
    pd.testing.assert_frame_equal(one.truth, same.truth)
    np.testing.assert_array_equal(one.recording["ground_speed"], same.recording["ground_speed"])
    slow, faulty = families.draw(kind, seed, rate=10.0), families.draw(kind, seed, rate=50.0, faults=True)
    for other in (slow, faulty):
        assert other.true_parameters == one.true_parameters
        near = np.minimum(np.searchsorted(one.truth.time, other.truth.time), len(one.truth) - 1)
        travelled = one.truth.true_distance.to_numpy()[near] - other.truth.true_distance.to_numpy()
        assert np.abs(travelled).max() < 0.02 * 2 * one.truth.true_ground_speed.max()  # within a row of 20 ms
    assert np.diff(faulty.recording.time[np.isfinite(faulty.recording["ground_speed"])]).max() > 5.5


def test_digging_drives_stop_in_their_soft_spot_and_healthy_ones_do_not():
    inside = 0
    for kind, seed in SOME[:4]:
        result = families.draw(kind, seed, rate=20.0, task="digging")
        t, spot = result.truth, result.scenario.soft_spots[-1]
        assert t.stuck.iloc[-1]
        front = t.true_distance.iloc[-1] + (result.vehicle.wheelbase or 0.0)
        inside += spot.at - spot.length / 2 < front < spot.at + spot.length
        healthy = families.draw(kind, seed, rate=20.0, task="healthy", duration=40.0)
        assert healthy.truth.time.iloc[-1] == pytest.approx(40.0)
        assert healthy.truth.stuck.mean() < 0.2
    assert inside >= 3  # one may fail on a weak patch before it


def test_another_kind_is_refused():
    with pytest.raises(InputError, match="no such kind"):
        families.draw(families.Kind("heavy", "brixius", "even"), 1)


def test_true_gains_undo_the_machines_errors(drawn):
    for result in drawn:
        out = result.true_parameters["calibration"]
        made = Vehicle.from_dict({**result.vehicle.to_dict(), "calibration": out})
        w = next(w for w, driven in zip(made.wheels, made.driven, strict=True) if driven)
        raw = result.recording[f"drive_torque_{w}"]
        rows = np.isfinite(raw)
        corrected = (raw[rows] - out["drive_torque_offset"][w]) / out["drive_torque_gain"][w]
        error = corrected - result.truth[f"true_drive_torque_{w}"][rows]
        sd = result.vehicle.sensors.drive_torque
        assert abs(error.mean()) < 5 * sd / np.sqrt(rows.sum())


def test_a_machine_too_light_for_every_cone_index_gets_a_soil_still():
    """6 kg on eight wheels: 100 kPa is a mobility number above 80 already; the draw never ended."""
    kind = families.Kind("light", "brixius", "uncoupled", "rolling")
    soils = families.scenario(kind, 14).soils
    drawn = [soil.curve["mobility"] for name, soil in soils.items() if name.startswith("soil")]
    assert drawn
    assert all(10 <= mobility <= 80 for mobility in drawn)
