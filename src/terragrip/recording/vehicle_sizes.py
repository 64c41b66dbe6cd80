"""Numbers of the vehicle file that no machine of its size has: sentences for the user, never errors.

The file's own limits hold for machines of 1 kg to 200 t. By the machine's mass and wheels a unit that is 1000 times off shows, as
does an angle in degrees; the bounds are factors of 10 and more from any machine of the examples, the classes and the development
families.
"""

from __future__ import annotations

from functools import reduce
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from terragrip.units import STANDARD_GRAVITY, factor_to

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

_BOUNDS = (
    ("mass", "kg", "volume", (0.3, 3000.0), ("t", "g")),
    ("wheel.inertia", "kg m^2", "inertia", (1e-3, 20.0), ()),
    ("bearing_resistance", "N s/rad", "drag", (0.0, 1.0), ()),
    ("power", "W", "mass", (0.05, 1000.0), ("kW",)),
    ("driveline.accessory_power", "W", "mass", (0.01, 100.0), ("kW",)),
    ("driveline.accessory_power_std", "W", "mass", (0.003, 100.0), ("kW",)),
    ("driveline.pto_power", "W", "mass", (0.01, 1000.0), ("kW",)),
    ("driveline.pto_power_std", "W", "mass", (0.003, 1000.0), ("kW",)),
    ("driveline.engine_torque_std", "N m", "engine", (1e-4, 1.0), ("kN m",)),
    ("sensors.wheel_speed", "rad/s", "spin", (1e-5, 0.2), ("deg/s",)),
    ("sensors.ground_speed", "m/s", "pace", (1e-5, 0.5), ("mm/s", "cm/s")),
    ("sensors.drive_torque", "N m", "torque", (2e-5, 1.0), ("kN m",)),
    ("sensors.drawbar_force", "N", "weight", (1e-5, 0.3), ("kN",)),
    ("sensors.vertical_load", "N", "weight", (1e-5, 0.3), ("kN",)),
    ("sensors.hitch_load", "N", "weight", (1e-5, 0.3), ("kN",)),
    ("sensors.mass", "kg", "whole", (1e-5, 0.3), ("t", "g")),
    ("sensors.acceleration", "m/s^2", "", (1e-5, 5.0), ("mm/s^2",)),
    ("sensors.pitch", "rad", "", (1e-6, 0.15), ("deg",)),
    ("uncertainty.slope", "rad", "", (0.0, 0.2), ("deg",)),
    ("uncertainty.acceleration_bias", "m/s^2", "", (0.0, 2.0), ("mm/s^2",)),
    ("uncertainty.wheel_radius", "1", "", (0.0, 0.3), ("%",)),
    ("uncertainty.drive_torque_gain", "1", "", (0.0, 0.7), ("%",)),
    ("uncertainty.vertical_load", "1", "", (0.0, 0.7), ("%",)),
    ("uncertainty.mass", "1", "", (0.0, 0.7), ("%",)),
    ("uncertainty.drive_torque_offset", "N m", "torque", (1e-5, 1.0), ("kN m",)),
    ("uncertainty.drawbar_offset", "N", "weight", (1e-5, 0.5), ("kN",)),
    ("uncertainty.drawbar_force", "N", "weight", (1e-3, 3.0), ("kN",)),
    ("uncertainty.hitch_load_offset", "N", "weight", (1e-5, 0.5), ("kN",)),
    ("calibration.drawbar_offset", "N", "weight", (0.0, 0.5), ()),
    ("calibration.acceleration_bias_x", "m/s^2", "", (0.0, 3.0), ()),
    ("calibration.pitch_offset", "rad", "", (0.0, 0.3), ("deg",)),
)
"""Key, unit, what its size is counted in, its bounds in that (0 says none, and is right), units that are probably meant."""


def size_warnings(vehicle: Vehicle | None) -> list[str]:
    """A sentence on each number of the vehicle file that no machine of its mass and wheels has."""
    if vehicle is None:
        return []
    sizes, notes = _sizes(vehicle), []
    for key, unit, size, (low, high), likely in _BOUNDS:
        value = reduce(lambda part, name: getattr(part, name, None), key.split("."), vehicle)  # type: ignore[arg-type, return-value]
        if not value or size not in sizes or low <= abs(value) / sizes[size] <= high:  # type: ignore[arg-type]
            continue
        number, suffix = float(value), "" if unit == "1" else f" {unit}"  # type: ignore[arg-type]
        within = (low * sizes[size], high * sizes[size])
        meant = [u for u in likely if within[0] <= abs(number) * factor_to(u, unit) <= within[1]]
        fix = f"is it {number:g} {meant[0]}? Write the unit" if meant else "check its unit"
        bounds = f"at most {within[1]:.2g}" if not low else f"{within[0]:.2g} to {within[1]:.2g}"
        notes.append(
            f"The vehicle file's {key} is {number:g}{suffix}, where a machine of its mass and wheels has {bounds}: {fix}."
        )
    return notes


def _sizes(vehicle: Vehicle) -> dict[str, float]:
    """What numbers of this machine are counted in, by name [SI]."""
    mass, weight = vehicle.mass, STANDARD_GRAVITY * vehicle.mass
    sizes = {"": 1.0, "mass": mass, "whole": mass, "weight": weight}
    if vehicle.driveline is not None and vehicle.driveline.reference_torque:
        sizes["engine"] = vehicle.driveline.reference_torque
    if vehicle.knows_wheels:
        radius, count = float(np.mean(vehicle.wheel_radius)), len(vehicle.wheels)
        pace = sqrt(STANDARD_GRAVITY * radius)
        sizes |= {
            "volume": 1000 * radius**3,
            "inertia": mass / count * radius**2,
            "torque": weight / count * radius,
        }
        sizes |= {"pace": pace, "spin": pace / radius, "drag": weight / count * radius / pace}
    return sizes
