"""The quantities of a map: what each row of a run shows about the ground, and where.

A quantity is read as y = value · x. x = 1 where y itself is the value. For adhesion y = mu and x = g(s)/g(reference slip), g the
form of the soil's curve: the value is then the adhesion at the reference slip, whatever the slip was. Both y and x have errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.estimation.rims import DRIVE
from terragrip.physics.adhesion import CURVES
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.maps.places import Places
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle


QUANTITIES: Mapping[str, str] = {
    "adhesion": "adhesion at the reference slip, driven wheels [-]",
    "soil_resistance": "soil's rolling resistance [-]",
    "slip": "slip of the driven wheels [-]",
    "efficiency": "tractive efficiency of the driven wheels [-]",
}
"""Name and meaning of what is mapped."""
COUNTED = ("", "immobilization")
"""Events whose rows count: a wet hole is where the warning is given."""
WIDEST_STD = 0.5
"""A row whose own SD is wider says nothing."""
UNSTATED_RADIUS = 0.02
"""Relative SD of wheel radii where the vehicle file states none and slip alone is estimated (docs/vehicle.md)."""


@dataclass(frozen=True)
class Reading:
    """One quantity read at one place of the vehicle, row by row (n,).

    ``east``, ``north`` [m]; ``x``, ``y`` as in the module's docstring; ``constant``, ``x_constant``: SDs of their errors that all rows
    share; ``random``, ``x_random``: SDs of the rest, as the estimator states them; ``good``: rows that count; ``turns``: x and
    y change sign together where a wheel brakes.
    """

    quantity: str
    east: Floats
    north: Floats
    x: Floats
    y: Floats
    constant: Floats
    random: Floats
    x_constant: Floats
    x_random: Floats
    good: Bools
    turns: bool = False


def readings_of(
    estimates: Estimates, places: Places, reference_slip: float, library: SoilLibrary | None = None
) -> Iterator[Reading]:
    """The readings of one run: adhesion, slip, efficiency of each driven wheel at its place, soil resistance at the wheels' middle."""
    vehicle = estimates.vehicle
    counted = np.isin(estimates["event"].astype(str), COUNTED)
    form = _form(estimates, reference_slip, library)
    radius = vehicle.uncertainty.wheel_radius or (0.0 if estimates.has_adhesion else UNSTATED_RADIUS)
    for i, wheel, forward, left in _driven(estimates, vehicle):
        place = places.of(forward, left)
        slip, slip_std = estimates[f"slip_{wheel}"], estimates[f"slip_{wheel}_std"]
        slip_constant = radius * (1 - np.abs(slip))
        if f"adhesion_{wheel}" in estimates.columns:
            mu, mu_std = estimates[f"adhesion_{wheel}"], estimates[f"adhesion_{wheel}_std"]
            constant = _torque_constant(vehicle, mu, i)
            value, slope = form(slip)
            yield _reading(
                "adhesion",
                place,
                mu,
                constant,
                mu_std,
                counted,
                (value, slope * slip_constant, slope * slip_std),
            )
        if f"efficiency_{wheel}" in estimates.columns:
            eta, eta_std = estimates[f"efficiency_{wheel}"], estimates[f"efficiency_{wheel}_std"]
            yield _reading("efficiency", place, eta, eta_std, eta_std, counted)
        yield _reading("slip", place, slip, slip_constant, slip_std, counted)
    if estimates.has_adhesion and "soil_resistance" in estimates.columns:
        rho = estimates["soil_resistance"]
        centre = places.of(float(np.mean(vehicle.axle_to_rear[vehicle.wheel_axle])), 0.0)
        constant = _resistance_constant(vehicle, estimates)
        yield _reading("soil_resistance", centre, rho, constant, estimates["soil_resistance_std"], counted)


def _driven(estimates: Estimates, vehicle: Vehicle) -> Iterator[tuple[int, str, float, float]]:
    """For each driven wheel with estimates its number, name and place ahead and to the left of the rear axle [m]; for a machine that
    reports its drive train's speed alone, the middle of the driven wheels."""
    driven = np.flatnonzero(vehicle.driven)
    ahead = vehicle.axle_to_rear[vehicle.wheel_axle]
    for i in driven:
        if f"slip_{vehicle.wheels[i]}" in estimates.columns:
            yield int(i), vehicle.wheels[i], float(ahead[i]), float(vehicle.wheel_side[i])
    if f"slip_{DRIVE}" in estimates.columns and len(driven):
        yield int(driven[0]), DRIVE, float(ahead[driven].mean()), 0.0


def _reading(
    quantity: str,
    place: tuple[Floats, Floats],
    y: Floats,
    constant: Floats,
    std: Floats,
    counted: Bools,
    x: tuple[Floats, Floats, Floats] | None = None,
) -> Reading:
    """`std` and the third of `x` (value, constant SD, SD) are whole SDs; the constant part is subtracted from them."""
    turns = x is not None
    if x is None:
        x = np.ones(len(y)), np.zeros(len(y)), np.zeros(len(y))
    constant, x_constant = np.minimum(constant, std), np.minimum(x[1], x[2])
    random, x_random = (
        np.sqrt(np.maximum(w**2 - c**2, 0.0)) for w, c in ((std, constant), (x[2], x_constant))
    )
    good = counted & np.isfinite(place[0]) & np.isfinite(x[0]) & np.isfinite(y) & (std < WIDEST_STD)
    return Reading(quantity, *place, x[0], y, constant, random, x_constant, x_random, good, turns)


def _torque_constant(vehicle: Vehicle, mu: Floats, wheel: int) -> Floats:
    """SD of adhesion's error from the constants that are uncertain in the vehicle file: mu = T/(r F_z)."""
    known = vehicle.uncertainty
    share = np.hypot.reduce([
        known.drive_torque_gain or 0.0, known.drive_torque_gain_common or 0.0,
        known.vertical_load or 0.0, known.mass or 0.0, known.wheel_radius or 0.0,
    ])  # fmt: skip
    load = vehicle.axle_mass[vehicle.wheel_axle[wheel]] / np.sum(
        vehicle.wheel_axle == vehicle.wheel_axle[wheel]
    )
    offset = (known.drive_torque_offset or 0.0) / (vehicle.wheel_radius[wheel] * load * STANDARD_GRAVITY)
    return np.asarray(np.hypot(share * mu, offset))


def _resistance_constant(vehicle: Vehicle, estimates: Estimates) -> Floats:
    """SD of rho_s's error from the same constants: rho_s = mean mu - (drawbar + m a)/(m g) - slope."""
    known, count = vehicle.uncertainty, len(vehicle.wheels)
    mean = np.mean([np.abs(estimates[f"adhesion_{wheel}"]) for wheel in estimates.wheels], axis=0)
    weight = vehicle.mass * STANDARD_GRAVITY
    share = np.hypot((known.drive_torque_gain or 0.0) / np.sqrt(count), known.drive_torque_gain_common or 0.0)
    offset = (
        (known.drive_torque_offset or 0.0) * np.sqrt(count) / (float(vehicle.wheel_radius.mean()) * weight)
    )
    force = (known.drawbar_offset or 0.0) / weight
    slope = known.slope or 0.0
    if known.acceleration_bias is not None:  # an accelerometer measures slope and acceleration together
        slope = min(slope or np.inf, known.acceleration_bias / STANDARD_GRAVITY)
    return np.asarray(np.sqrt((share * mean) ** 2 + offset**2 + force**2 + slope**2))


def _form(
    estimates: Estimates, reference: float, library: SoilLibrary | None
) -> Callable[[Floats], tuple[Floats, Floats]]:
    """The function of slip (n,) that gives x and dx/ds (n,): each row's soil by its curve in the library, else the paper's prototype."""
    prototype = CURVES["exponential"]

    def form(slip: Floats) -> tuple[Floats, Floats]:
        level = float(prototype.value(reference, {}))
        x, slope = prototype.value(slip, {}) / level, prototype.slope(slip, {}) / level
        if library is not None and "soil" in estimates.labels:
            labels = estimates.labels["soil"]
            for name in set(labels) & set(library):
                rows, soil = labels == name, library[name]
                level = float(soil.value(reference))
                x[rows] = soil.value(slip[rows]) / level
                slope[rows] = (
                    CURVES[soil.model].slope(
                        slip[rows], {k: v for k, v in soil.parameters.items() if k != "intercept"}
                    )
                    / level
                )
        return x, slope

    return form
