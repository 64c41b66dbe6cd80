"""A machine of the families of which some numbers are known, not drawn."""

from __future__ import annotations

from terragrip.simulation import families


def test_what_is_known_of_a_machine_is_driven_and_the_rest_stays_as_drawn():
    kind = families.Kind("tractor", "brixius", "even")
    drawn = families.scenario(kind, 5)
    known = families.scenario(kind, 5, known={"mass": 5400.0, "counts": (2, 2), "axle_mass": (2000.0, 3400.0),
                                              "axle_radius": (0.6, 0.85), "driven": (True, True)})  # fmt: skip
    vehicle = known.nominal_vehicle()
    assert vehicle.mass == 5400.0
    assert list(vehicle.wheel_radius) == [0.6, 0.6, 0.85, 0.85]
    assert list(vehicle.axle_mass) == [2000.0, 3400.0]
    assert vehicle.tire_rolling_resistance == drawn.nominal_vehicle().tire_rolling_resistance
