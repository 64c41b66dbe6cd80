"""The plant's loads in motion against physics.loads, which gives it shares and levers: on every layout, pulling, uphill, in a curve."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.loads import axle_loads, lateral_shares
from terragrip.simulation.family_machines import LAYOUTS
from terragrip.simulation.fields import Field, stream
from terragrip.simulation.terrain import build
from terragrip.units import STANDARD_GRAVITY


@pytest.mark.parametrize("counts", [counts for _, counts in LAYOUTS], ids=str)
def test_axle_loads_in_motion_are_the_formulas(counts, quiet, drive):
    trace = drive(moving(counts, quiet), stride=20)
    vehicle = trace.vehicle
    wanted = axle_loads(
        vehicle.axle_mass,
        vehicle.axle_to_rear,
        center_of_gravity_height=vehicle.center_of_gravity_height,
        hitch_height=vehicle.hitch_height,
        drawbar=trace["drawbar"] - trace["assist"],
        acceleration=trace["acceleration"],
        slope=trace["slope"],
        spin_torque=trace["wheel_acceleration"] @ vehicle.wheel_inertia,
    )
    assert np.ptp(trace["drawbar"]) > 100
    assert np.ptp(trace["acceleration"]) > 0.5
    np.testing.assert_allclose(trace["axle_load"], wanted, rtol=1e-10)


@pytest.mark.parametrize("counts", [c for _, c in LAYOUTS if max(c) > 1], ids=str)
def test_wheel_loads_in_a_steady_curve_are_the_formulas(counts, quiet, drive):
    bend = {"path": [[0, 0], [8, 0], [8, 8]], "turn_radius": 6.0, "around": "even"}
    trace = drive(moving(counts, quiet, route=bend, duration=14), stride=20)
    vehicle = trace.vehicle
    bending = trace["curvature"] > 0.16
    settled = bending & (trace["time"] > trace["time"][bending][0] + 1)
    lateral = trace["speed"] ** 2 * trace["curvature"]
    assert settled.sum() > 100
    assert lateral[settled].min() > 0.05
    sides = vehicle.axle_mass[np.array(counts) > 1].sum() / vehicle.mass  # an axle of one wheel holds no roll
    height = vehicle.center_of_gravity_height / sides
    for axle, count in enumerate(counts):
        shares = lateral_shares(count, lateral, center_of_gravity_height=height, track=vehicle.track)
        wanted = trace["axle_load"][:, [axle]] * shares
        got = trace["load"][:, vehicle.wheel_axle == axle]
        np.testing.assert_allclose(
            got[settled], wanted[settled], rtol=5e-4
        )  # a curve moves 9e-3; the chassis twists


CLIMB = {"segments": [{"soil": "even", "length": 60}], "slope": {"mean": 0.05}}


def moving(counts, quiet, *, route=CLIMB, duration=8):
    """A machine of that layout that starts and pulls."""
    share = np.linspace(1.0, 1.4, len(counts))
    names = [f"axle{k}" for k in range(len(counts))]
    return quiet(
        vehicle={
            "mass": 139.0,
            "track": 0.5,
            "center_of_gravity_height": 0.3,
            "hitch_height": 0.25,
            "wheelbase": 0.9,
            "axles": {
                name: {
                    "mass": float(139.0 * s / share.sum()),
                    "wheels": [f"{name}{side}" for side in "lr"[:count]],
                }
                for name, s, count in zip(names, share, counts, strict=True)
            },
            "wheel": {"radius": 0.2, "inertia": 0.15},
        },
        route=route,
        duration=duration,
        sensors={"use": "exact", "wheel_force": None},
    )


@pytest.mark.parametrize("counts", [counts for _, counts in LAYOUTS if sum(counts) > 2], ids=str)
def test_hills_shift_loads_as_a_stiff_plate_on_springs_has_them(counts, quiet):
    """Sum and both moments stay; of the heights' part that is no plane each spring has its share; three wheels find a plane."""
    hilly = {
        "segments": [{"soil": "even", "length": 60}],
        "slope": {"sd": 0.05, "length": 4.0, "twists": True},
    }
    scenario = moving(counts, quiet, route=hilly)
    scenario = scenario.model_copy(
        update={"robot": scenario.robot.model_copy(update={"chassis_torsion": 1e6, "tire_stiffness": 4e3})}
    )
    vehicle = scenario.nominal_vehicle()
    ground = build(scenario, vehicle, seed=3)
    x, axle, sides = ground.path.x, vehicle.wheel_axle, vehicle.wheel_side
    ahead = vehicle.axle_to_rear[axle]
    middle = len(x) // 2
    places = [np.interp(x[middle] + a, x, np.arange(len(x))) for a in ahead]
    at_rest = STANDARD_GRAVITY * (vehicle.axle_mass / np.bincount(axle))[axle]
    relative = [
        np.interp(p, np.arange(len(x)), one) for p, one in zip(places, ground.load_variation, strict=True)
    ]
    force = np.array(relative) * at_rest
    plane = np.stack([np.ones(len(ahead)), ahead, sides], axis=1)
    np.testing.assert_allclose(force @ plane, 0, atol=1e-6 * at_rest.sum())
    hills = Field(stream(3, "slope"), 4.0, smooth=True)
    height = [
        0.05 * 4.0 * hills.at(*(np.interp([p], np.arange(len(x)), e) for e in ground.path.beside(y)))[0]
        for p, y in zip(places, sides, strict=True)
    ]
    fit = plane @ np.linalg.lstsq(plane, height, rcond=None)[0]
    np.testing.assert_allclose(force, 4e3 * (height - fit), rtol=2e-2, atol=1e-2)
    assert (np.abs(force).max() > 1) == (len(ahead) > 3)
