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
SHARES = ("slip", "efficiency")
"""Those that readers get in per cent; files have ratios."""
COUNTED = ("", "immobilization")
"""Events whose rows count: a wet hole is where the warning is given."""
WIDEST_STD = 0.5
"""A row whose own SD is wider says nothing."""
UNSTATED_RADIUS = 0.02
"""Relative SD of wheel radii where the vehicle file states none and slip alone is estimated (docs/vehicle.md)."""
REFERENCE_SLIPS = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
"""Slips that adhesion is mapped at where the user names none: the one next to the drive's own. A curve's form carries a value
from a few per cent of slip to 20 % no better than by a third."""
FORMS = ("exponential", "burckhardt", "pacejka", "brixius", "wismer_luth")
"""Curves whose usual forms differ as those of soils do that nobody has fitted (docs/physics.md 5)."""


@dataclass(frozen=True)
class Reading:
    """One quantity read at one place of the vehicle, row by row (n,).

    ``east``, ``north`` [m]; ``x``, ``y`` as in the module's docstring; ``constant``, ``x_constant``: SDs of their errors that all rows
    share; ``local``: of y's that rows nearby share; ``random``, ``x_random``: SDs of the rest, as the estimator states them; ``good``:
    rows that count; ``turns``: x and y change sign together where a wheel brakes.
    """

    quantity: str
    east: Floats
    north: Floats
    x: Floats
    y: Floats
    constant: Floats
    local: Floats
    random: Floats
    x_constant: Floats
    x_random: Floats
    good: Bools
    turns: bool = False


def usual_slip(estimates: Estimates) -> float:
    """The one of `REFERENCE_SLIPS` next to the slip at which the driven wheels worked, in the median of their way."""
    counted = np.isin(estimates["event"].astype(str), COUNTED)
    step = np.diff(np.maximum.accumulate(np.nan_to_num(estimates["distance"])), prepend=0.0)
    wheels = [estimates[f"slip_{wheel}"] for _, wheel, _, _ in _driven(estimates, estimates.vehicle)]
    slip, metres = np.concatenate([[], *wheels]), np.tile(np.where(counted, step, 0.0), len(wheels))
    known = np.isfinite(slip) & (metres > 0)
    order = np.argsort(slip[known])
    way = np.cumsum(metres[known][order])
    if not len(way):
        return REFERENCE_SLIPS[-1]
    middle = slip[known][order][np.searchsorted(way, 0.5 * way[-1])]
    apart = np.abs(np.log(np.array(REFERENCE_SLIPS) / max(float(middle), 1e-3)))
    return REFERENCE_SLIPS[int(apart.argmin())]


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
            value, slope, doubt = form(slip)
            x = value, np.hypot(slope * slip_constant, doubt), np.hypot(slope * slip_std, doubt)
            yield _reading("adhesion", place, mu, constant, mu_std, counted, x)
        if f"efficiency_{wheel}" in estimates.columns:
            eta, eta_std = estimates[f"efficiency_{wheel}"], estimates[f"efficiency_{wheel}_std"]
            yield _reading("efficiency", place, eta, eta_std, eta_std, counted)
        yield _reading("slip", place, slip, slip_constant, slip_std, counted)
    if estimates.has_adhesion and "soil_resistance" in estimates.columns:
        rho = estimates["soil_resistance"]
        centre = places.of(float(np.mean(vehicle.axle_to_rear[vehicle.wheel_axle])), 0.0)
        constant, local = _resistance_constant(vehicle, estimates)
        std = estimates["soil_resistance_std"]
        yield _reading("soil_resistance", centre, rho, constant, std, counted, local=local)


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
    local: float = 0.0,
) -> Reading:
    """`std` and the third of `x` (value, constant SD, SD) are whole SDs; the constant and local parts are subtracted from them."""
    turns = x is not None
    if x is None:
        x = np.ones(len(y)), np.zeros(len(y)), np.zeros(len(y))
    constant, x_constant = np.minimum(constant, std), np.minimum(x[1], x[2])
    rest, x_random = (np.sqrt(np.maximum(w**2 - c**2, 0.0)) for w, c in ((std, constant), (x[2], x_constant)))
    near = np.minimum(local, rest)
    random = np.sqrt(rest**2 - near**2)
    good = counted & np.isfinite(place[0]) & np.isfinite(x[0]) & np.isfinite(y) & (std < WIDEST_STD)
    return Reading(quantity, *place, x[0], y, constant, near, random, x_constant, x_random, good, turns)


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


def _resistance_constant(vehicle: Vehicle, estimates: Estimates) -> tuple[Floats, float]:
    """SD of rho_s's error from the same constants: rho_s = mean mu - (drawbar + m a)/(m g) - slope, and that from a slope which
    nothing measures: the same over a hill's length, and of the other sign on the way back."""
    known, count = vehicle.uncertainty, len(vehicle.wheels)
    mean = np.mean([np.abs(estimates[f"adhesion_{wheel}"]) for wheel in estimates.wheels], axis=0)
    weight = vehicle.mass * STANDARD_GRAVITY
    share = np.hypot.reduce([
        (known.drive_torque_gain or 0.0) / np.sqrt(count), known.drive_torque_gain_common or 0.0,
        known.mass or 0.0, known.wheel_radius or 0.0,
    ])  # fmt: skip
    offset = (
        (known.drive_torque_offset or 0.0) * np.sqrt(count) / (float(vehicle.wheel_radius.mean()) * weight)
    )
    force = (known.drawbar_offset or 0.0) / weight
    slope, local = known.slope or 0.0, 0.0
    channels = estimates.about.get("settings", {}).get("channels", ("acceleration_x",))
    if (
        "acceleration_x" in channels and known.acceleration_bias is not None
    ):  # it measures slope and acceleration together
        slope = min(slope or np.inf, known.acceleration_bias / STANDARD_GRAVITY)
    elif "pitch" not in channels:
        slope, local = 0.0, slope
    return np.asarray(np.sqrt((share * mean) ** 2 + offset**2 + force**2 + slope**2)), local


def _form(
    estimates: Estimates, reference: float, library: SoilLibrary | None
) -> Callable[[Floats], tuple[Floats, Floats, Floats]]:
    """The function of slip (n,) that gives x, dx/ds and the SD of x for want of the soil's form: each row's soil by its curve in the
    library, else the paper's prototype, which is as far from the soil's as the usual `FORMS` are from each other."""

    def usual(name: str, slip: Floats) -> Floats:
        return np.asarray(CURVES[name].value(slip, {}) / CURVES[name].value(reference, {}))

    def form(slip: Floats) -> tuple[Floats, Floats, Floats]:
        prototype = CURVES["exponential"]
        x, slope = usual("exponential", slip), prototype.slope(slip, {}) / prototype.value(reference, {})
        doubt = np.std([usual(name, slip) for name in FORMS], axis=0)
        if library is not None and "soil" in estimates.labels:
            labels = estimates.labels["soil"]
            for name in set(labels) & set(library):
                rows, soil = labels == name, library[name]
                level = float(soil.value(reference))
                own = {k: v for k, v in soil.parameters.items() if k != "intercept"}
                x[rows] = soil.value(slip[rows]) / level
                slope[rows] = CURVES[soil.model].slope(slip[rows], own) / level
                doubt[rows] = 0.0
        return x, slope, doubt

    return form
