"""A machine's driven wheels as one and its free ones as another: what mechanics keeps is kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terragrip.estimation.driveline import DRIVEN, UNDRIVEN, lumped, machine_of
from terragrip.estimation.estimates import Estimates
from terragrip.vehicle import Vehicle

SMALL, LARGE = {"radius": 0.6, "inertia": 12.0}, {"radius": 0.8, "inertia": 50.0}


def machine(*driven: bool, **changes: Any) -> Vehicle:
    """Axles of 2000, 2500, 3000 kg ... from the front, the first with small wheels; which are driven is said."""
    axles = {
        f"axle{k}": {
            "mass": 2000.0 + 500 * k,
            "wheels": [f"l{k}", f"r{k}"],
            "wheel": LARGE if k else SMALL,
            "driven": on,
        }
        for k, on in enumerate(driven)
    }
    data = {
        "mass": sum(axle["mass"] for axle in axles.values()),
        "wheelbase": 3.0,
        "track": 1.8,
        "center_of_gravity_height": 0.9,
        "hitch_height": 0.5,
        "hitch_overhang": 0.7,
        "bearing_resistance": 3.0,
        "axles": axles,
        "antenna": {"x": 1.2, "y": 0.1, "z": 2.5},
        "driveline": {"efficiency": 0.8, "efficiency_std": 0.04, "accessory_power": 5000.0},
        "calibration": {
            "drive_torque_gain": {"l1": 1.1},
            "wheel_radius": {"l1": 0.79},
            "drawbar_offset": 40.0,
        },
        "sensors": {"drive_torque": 5.0, "ground_speed": 0.02},
        "uncertainty": {"drive_torque_gain": 0.02, "drive_torque_gain_common": 0.03, "drawbar_gain": 0.01},
    }
    return Vehicle.from_dict({**data, **changes})


@pytest.mark.parametrize("driven", [(False, True), (True, False), (False, True, True), (True, False, False)])
def test_mass_balance_energy_and_friction_are_those_of_all_wheels(driven: tuple[bool, ...]) -> None:
    whole = machine(*driven, calibration={})
    one = Vehicle.from_dict(lumped(whole, None))
    assert set(one.wheels) == {DRIVEN, UNDRIVEN}
    assert one.wheels[0] == (DRIVEN if driven[0] else UNDRIVEN)  # listed front to rear
    # the rearmost of both stands for what was `rear` metres in front of the rearmost axle
    groups = {
        name: [k for k, on in enumerate(driven) if on == chosen]
        for name, chosen in ((DRIVEN, True), (UNDRIVEN, False))
    }
    rear = min(
        np.average(whole.axle_to_rear[axles], weights=whole.axle_mass[axles]) for axles in groups.values()
    )
    assert one.mass == whole.mass
    moment = float(one.axle_mass @ (one.axle_to_rear + rear))
    assert moment == pytest.approx(float(whole.axle_mass @ whole.axle_to_rear))
    assert one.antenna is not None
    assert one.antenna.x + rear == pytest.approx(1.2)
    assert (one.antenna.y, one.antenna.z) == (0.1, 2.5)
    assert one.hitch_overhang - rear == pytest.approx(0.7)
    assert (one.hitch_height, one.center_of_gravity_height) == (0.5, 0.9)
    for name, axles in groups.items():
        wheels = np.isin(whole.wheel_axle, axles)
        k = one.wheels.index(name)
        assert one.axle_mass[k] == whole.axle_mass[axles].sum()
        assert one.wheel_radius[k] == pytest.approx(whole.wheel_radius[wheels].mean())
        # at 1 m/s of all rims
        energy = np.sum(whole.wheel_inertia[wheels] / whole.wheel_radius[wheels] ** 2)
        assert one.wheel_inertia[k] / one.wheel_radius[k] ** 2 == pytest.approx(energy)
        assert bool(one.driven[k]) == (name == DRIVEN)
        assert one.wheel_bearing[k] == pytest.approx(3.0 * wheels.sum())


def test_what_speaks_of_single_torques_is_left_out_and_the_driveline_is_in_the_common_gain() -> None:
    data = lumped(machine(False, True), (0.78, 0.02))
    assert data["calibration"] == {"drawbar_offset": 40.0}
    assert data["sensors"] == {"ground_speed": 0.02}
    assert "driveline" not in data
    assert "track" not in data
    assert data["uncertainty"] == pytest.approx(
        {"drive_torque_gain_common": np.hypot(0.03, 0.04 / 0.8), "drawbar_gain": 0.01, "wheel_radius": 0.02}
    )
    axle = data["axles"][DRIVEN]
    assert axle["wheel"]["radius"] == 0.78
    assert axle["wheel"]["inertia"] == pytest.approx(50.0 * ((0.78 / 0.79) ** 2 + (0.78 / 0.8) ** 2))
    free = data["axles"][UNDRIVEN]["wheel"]
    assert free == pytest.approx({"radius": 0.6, "inertia": 24.0})
    unknown = lumped(machine(False, True, uncertainty={}), (0.78, 5.0))["uncertainty"]
    assert unknown == pytest.approx({"drive_torque_gain_common": 0.05, "wheel_radius": 1.0})


def test_a_machine_all_of_whose_wheels_are_driven_is_one_wheel() -> None:
    whole = machine(True, True, calibration={})
    data = lumped(whole, None)
    one = Vehicle.from_dict(data)
    assert one.wheels == (DRIVEN,)
    assert "wheelbase" not in data
    middle = 3.0 * 2000 / 4500
    assert data["hitch_overhang"] == pytest.approx(0.7 + middle)
    assert data["antenna"]["x"] == pytest.approx(1.2 - middle)
    inertia = 0.7**2 * (2 * 12.0 / 0.6**2 + 2 * 50.0 / 0.8**2)
    assert one.wheel_inertia[0] == pytest.approx(inertia)


def test_groups_that_stand_in_one_place_shift_no_load() -> None:
    """Outer axles driven, the middle one free: both means lie in the middle."""
    even = machine(True, False, True, calibration={}).to_dict()
    even["axles"]["axle0"]["mass"] = even["axles"]["axle2"]["mass"] = 2500.0
    data = lumped(Vehicle.from_dict({**even, "mass": 7500.0}), None)
    assert (data["wheelbase"], data["center_of_gravity_height"], data["hitch_height"]) == (1.0, 0.0, 0.0)
    apart = lumped(machine(False, True, calibration={}), None)
    assert (apart["wheelbase"], apart["center_of_gravity_height"]) == (pytest.approx(3.0), 0.9)


def test_the_machine_of_estimates_has_the_radius_that_they_were_made_with() -> None:
    whole = machine(False, True, calibration={})
    made = lumped(whole, (0.78, 0.02))
    estimates = Estimates(
        np.arange(3.0), {}, np.zeros(3, dtype=np.uint8), {}, {"vehicle": made, "driveline": {}}
    )
    again = machine_of(estimates, whole)
    assert again.to_dict() == Vehicle.from_dict(made).to_dict()
    plain = Estimates(np.arange(3.0), {}, np.zeros(3, dtype=np.uint8), {}, {"vehicle": whole.to_dict()})
    assert machine_of(plain, whole) is whole
