"""Numbers that are likely not in SI, each by itself, of the log and of the vehicle file: sentences for the user, never errors.

The file's own limits hold for machines of 1 kg to 200 t. By the machine's mass and wheels a unit that is 1000 times off shows, as
does an angle in degrees; the bounds are factors of 10 and more from any machine of the examples, the classes and the development
families.
"""

from __future__ import annotations

from functools import reduce
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.ranks import median, quantile
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY, factor_to

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_EMPTY = 0.5  # of the vehicle file's mass: few machines are so much lighter without their load
_ENOUGH = 4000  # rows that show how far rows are apart
_HOUR, _ON_TIME = 3600.0, 3.0  # s, and times the usual distance of rows: no pause lasts for just an hour
_YEAR = 31_556_952.0  # s: no drives of one log are so far apart
_SPARSE, _DENSE = 5.0, 1e-4  # s between samples: no log of a drive has more, or less
_BOUNDS = (
    ("mass", "kg", "volume", (0.3, 3000.0), ("t", "g")),
    ("wheel.inertia", "kg m^2", "inertia", (1e-3, 20.0), ()),
    ("bearing_resistance", "N s/rad", "drag", (0.0, 1.0), ()),
    ("drive_friction", "N m", "torque", (0.0, 0.5), ("kN m",)),
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
    ("uncertainty.pitch_offset", "rad", "", (0.0, 0.2), ("deg",)),
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


def angle_warnings(recording: Recording) -> list[str]:
    """Angles of the body that are in degrees, positions that are not."""
    notes = []
    for name in ("pitch", "roll"):
        size = _typical_size(recording, name)
        if size is not None and size > 1.6:
            notes.append(f"{name} reaches {size:.3g} rad: it may be in degrees.")
    for name in ("latitude", "longitude"):
        values = recording.channels.get(name)
        if values is not None and np.nanmax(np.abs(values), initial=0.0) > 180:
            notes.append(f"{name} exceeds 180: it must be in degrees.")
    return notes


def gravity_warnings(recording: Recording) -> list[str]:
    """A vertical acceleration that rests at another value than gravity."""
    values = recording.channels.get("acceleration_z")
    if values is None or not np.isfinite(values).any():
        return []
    rest = float(np.nanmedian(values))
    if 0.9 < abs(rest) < 1.1:
        return ["acceleration_z rests at 1: the accelerations may be in g."]
    if rest < -8:
        sentence = "acceleration_z rests at -g: the axes point the other way (z up, specific force); y and the turns may, too."
        channels = [n for n in ("acceleration_z", "acceleration_y") if n in recording.channels]
        return [
            WrongSign(
                sentence,
                channels,
                "z rests at -g, as with z down and y to the right: 'sign: -1'?",
                sure=False,
            )
        ]
    return []


def mass_warnings(recording: Recording, vehicle: Vehicle | None) -> list[str]:
    """A mass that never comes near the vehicle file's: that of the load alone, as a tank's level gives it. And a load that the file
    places, of which neither log nor file says how much it is or may be."""
    size = _typical_size(recording, "mass")
    if vehicle is None:
        return []
    pulls = any(name.startswith(("drive_torque_", "engine_torque")) for name in recording.channels)
    if vehicle.payload is not None and vehicle.uncertainty.mass is None and size is None and pulls:
        return [
            "The vehicle file places a payload, but the log has no mass: the file's counts throughout, and by what it is off adhesion and "
            "resistance are, beyond their intervals. Log the mass, or write 'uncertainty: {mass: 25 %}' (0 if the load does not change)."
        ]
    if size is None or size > _EMPTY * vehicle.mass:
        return []
    return [
        f"mass reads up to {size:.4g} kg, under half of the vehicle file's {vehicle.mass:.4g} kg: if it is of the load alone, add the "
        "empty machine by 'offset:' in the profile; else correct the vehicle file."
    ]


def leapt(time: Floats) -> float:
    """Seconds of ``time`` (n,) [s] in leaps of over a year, of a clock that was set there: nobody drove so long."""
    steps = np.diff(time)
    return float(steps[steps > _YEAR].sum())


def spacing_warnings(recording: Recording) -> list[str]:
    """Rows that are further apart, or closer, than those of a drive, a time written as hhmmss, and a clock set in the log."""
    if len(recording) < 10:
        return []
    step = np.diff(recording.time)
    spacing = median(step[:: max(1, len(step) // _ENOUGH)])
    if _is_written_as_hhmmss(recording.time, spacing):
        return [
            "time is a time of day written as hhmmss: 59 is followed by 100. Write it as 10:00:00.5, or as seconds; "
            "every time, distance and gap is wrong now."
        ]
    hour = np.flatnonzero((step > _HOUR) & (step <= _HOUR + _ON_TIME * spacing))
    if len(hour) == 1 and spacing < _SPARSE and _goes_on(recording, int(hour[0])):
        return [
            f"time leaps by an hour from {recording.time[hour[0]]:.10g} s to the next row: was the clock set to summer time? Write times "
            "in UTC, or subtract 3600 s from there on; now nothing is known for an hour."
        ]
    last = int(np.argmax(step))
    if step[last] > _YEAR and spacing < _SPARSE:
        return [
            f"time leaps by {step[last] / _YEAR:.3g} years from {recording.time[last]:.10g} s to the next row: was the clock set there, "
            "as by a receiver's first fix? Subtract the leap from there on; now nothing is known for so long."
        ]
    # Instants of two clocks may be close by chance.
    mean = float(recording.time[-1] - recording.time[0]) / len(step)
    if spacing < _SPARSE and mean > _DENSE:
        return []
    return [f"The samples are {max(spacing, mean):.3g} s apart: time may not be in seconds."]


def _goes_on(recording: Recording, row: int) -> bool:
    """Whether no channel changes more from a row to the next than from any other one."""
    changes = [np.abs(np.diff(values)) for values in recording.channels.values()]
    return not any(own[row] > np.nanmax(np.delete(own, row), initial=0.0) for own in changes)


def _is_written_as_hhmmss(time: Floats, spacing: float) -> bool:
    """Whether the last two digits before the point never reach 60, but go on from 59 to the next hundred."""
    if not (time[0] >= 0 and time[-1] < 240000):
        return False
    hundreds = np.floor(time / 100)
    digits = time - 100 * hundreds
    change = np.flatnonzero(np.diff(hundreds))
    near = max(3 * spacing, 1.0)
    goes_on = (digits[change] >= 60 - near) & (digits[change + 1] < near)
    return len(change) > 0 and bool((digits < 60).all() and (hundreds % 100 < 60).all() and goes_on.all())


def _typical_size(recording: Recording, name: str) -> float | None:
    values = recording.channels.get(name)
    known = None if values is None else np.abs(values[np.isfinite(values)])
    return None if known is None or not len(known) else quantile(known, 0.95)


def size_warnings(vehicle: Vehicle | None) -> list[str]:
    """A sentence on each number of the vehicle file that no machine of its mass and wheels has, and on an axle that may be a trailer's."""
    if vehicle is None:
        return []
    sizes, notes = _sizes(vehicle), _trailer_warnings(vehicle)
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


def _trailer_warnings(vehicle: Vehicle) -> list[str]:
    """A sentence on a last axle of three or more that only rolls along behind a steered one."""
    last, axles = vehicle.axle_names[-1], tuple(vehicle.axles.values())
    if len(axles) < 3 or not any(axle.steered for axle in axles) or axles[-1].driven or axles[-1].steered:
        return []
    return [
        f"The vehicle file's axle {last} neither drives nor steers: if it is a trailer's, leave it out, and its wheels' columns too. "
        "As a part of the vehicle it turns and carries load with it as one rigid body, and the steered wheels' slip in turns and all "
        "adhesion are wrong."
    ]


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
