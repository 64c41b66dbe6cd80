"""Numbers of a vehicle file that its machine cannot have are named, with the unit that is probably meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from terragrip.recording.plain_units import size_warnings
from terragrip.vehicle import Vehicle
from terragrip.vehicle_maker import make

EXAMPLES = Path(__file__).parents[2] / "examples"
TRACTOR = {
    "mass": 6000,
    "axles": {
        "front": {"mass": 2500, "wheels": ["fl", "fr"]},
        "rear": {"mass": 3500, "wheels": ["rl", "rr"]},
    },
    "wheelbase": 2.7,
    "center_of_gravity_height": 1.0,
    "wheel": {"radius": 0.8, "inertia": 80},
}
DRIVELINE = {"efficiency": 0.85, "reference_torque": 750}


@pytest.mark.parametrize(
    ("given", "asked"),
    [
        (
            {"driveline": {**DRIVELINE, "accessory_power": 15}},
            "driveline.accessory_power is 15 W.*is it 15 kW",
        ),
        ({"power": 90}, "power is 90 W.*is it 90 kW"),
        ({"uncertainty": {"drawbar_force": 8}}, "drawbar_force is 8 N.*is it 8 kN"),
        ({"uncertainty": {"slope": 1}}, "slope is 1 rad.*is it 1 deg"),
        ({"uncertainty": {"wheel_radius": 1}}, "wheel_radius is 1,.*is it 1 %"),
        ({"sensors": {"pitch": 0.3}}, "pitch is 0.3 rad.*is it 0.3 deg"),
        ({"bearing_resistance": 6000}, "bearing_resistance is 6000 N s/rad.*check its unit"),
        ({"wheel": {"radius": 0.8, "inertia": 0.08}}, "inertia is 0.08 kg m.*check its unit"),
    ],
)
def test_a_unit_that_is_a_thousand_times_off_is_named(given: dict[str, object], asked: str) -> None:
    (note,) = size_warnings(Vehicle.from_dict({**TRACTOR, **given}))
    assert asked.split(".*")[0] in note
    assert asked.split(".*")[1] in note


def test_no_right_machine_is_accused() -> None:
    vehicles = [Vehicle.load(file) for file in sorted(EXAMPLES.glob("*/vehicle.yaml"))]
    for name in ("tractor-2wd", "tractor-4wd", "field-robot", "rover", "six-wheel", "skid-steer", "crawler"):
        vehicles += [make(name, "torque", {"mass": mass}).vehicle for mass in (2.0, 140.0, 20_000.0)]
    assert len(vehicles) > 20
    assert not [note for vehicle in vehicles for note in size_warnings(vehicle)]


def test_a_trailer_among_the_axles_is_named() -> None:
    """As a third axle it moved what the tractor turns about: the front wheels' slip was -.24 for 0 in turns of 6 m radius, silently."""
    trailer = {"mass": 4000, "wheels": ["tl", "tr"], "driven": False}
    front = {**TRACTOR["axles"]["front"], "steered": True}
    axles = {"front": front, "rear": TRACTOR["axles"]["rear"], "trailer": trailer}
    (note,) = size_warnings(Vehicle.from_dict({**TRACTOR, "mass": 10_000, "wheelbase": 8.0, "axles": axles}))
    assert note.startswith(
        "The vehicle file's axle trailer neither drives nor steers: if it is a trailer's, leave it out"
    )
    rigid = {**axles, "front": TRACTOR["axles"]["front"]}
    six = {**axles, "trailer": {**trailer, "driven": True}}
    for right in (rigid, six):
        assert not size_warnings(
            Vehicle.from_dict({**TRACTOR, "mass": 10_000, "wheelbase": 8.0, "axles": right})
        )
