"""The quantities of a map: what each row of a run shows about the ground, and where.

A quantity is read as y = value · x. x = 1 where y itself is the value. For adhesion y = mu and x = g(s)/g(reference slip), g the
form of the soil's curve: the value is then the adhesion at the reference slip, whatever the slip was. Both y and x have errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Bools, Floats
from terragrip.estimation.rims import DRIVE
from terragrip.physics.adhesion import CURVES
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.maps.places import Places
    from terragrip.soil.library import Soil, SoilLibrary
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
REFERENCE_SLIPS = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
"""Slips that adhesion is mapped at where the user names none: the one next to the drive's own. A curve's form carries a value
from a few per cent of slip to 20 % no better than by a third."""
FORMS = ("exponential", "burckhardt", "pacejka", "brixius", "wismer_luth")
"""Curves whose usual forms differ as those of soils do that nobody has fitted (docs/physics.md 5)."""


@dataclass(frozen=True)
class Reading:
    """One quantity read at one place of the vehicle, row by row (n,).

    ``east``, ``north`` [m]; ``x``, ``y`` as in the module's docstring; ``constants``, ``x_constants`` (n, K): by how much each of K
    constants that all rows share changes them, with sign, if it is off by one SD; ``local`` (n, 2): by how much one SD of a slope up
    to the east, and up to the north, changes y where nothing measures it; ``random``, ``x_random``: SDs of the rest, as the estimator
    states them; ``good``: rows that count; ``turns``: x and y change sign together where a wheel brakes.
    """

    quantity: str
    east: Floats
    north: Floats
    x: Floats
    y: Floats
    constants: Floats
    x_constants: Floats
    local: Floats
    random: Floats
    x_random: Floats
    good: Bools
    turns: bool = False


def usual_slip(estimates: Estimates) -> float:
    """The one of `REFERENCE_SLIPS` next to `driven_slip`, the last where that is not known."""
    middle = driven_slip(estimates)
    if np.isnan(middle):
        return REFERENCE_SLIPS[-1]
    apart = np.abs(np.log(np.array(REFERENCE_SLIPS) / max(middle, 1e-3)))
    return REFERENCE_SLIPS[int(apart.argmin())]


def driven_slip(estimates: Estimates) -> float:
    """The slip [-] at which the driven wheels worked, in the median of their way; NaN where no row shows it."""
    counted = estimates.during(*COUNTED)
    step = np.diff(np.maximum.accumulate(np.nan_to_num(estimates["distance"])), prepend=0.0)
    wheels = [estimates[f"slip_{wheel}"] for _, wheel, _, _ in _driven(estimates, estimates.vehicle)]
    slip, metres = np.concatenate([[], *wheels]), np.tile(np.where(counted, step, 0.0), len(wheels))
    known = np.isfinite(slip) & (metres > 0)
    order = np.argsort(slip[known])
    way = np.cumsum(metres[known][order])
    return float(slip[known][order][np.searchsorted(way, 0.5 * way[-1])]) if len(way) else np.nan


def readings_of(
    estimates: Estimates, places: Places, reference_slip: float, library: SoilLibrary | None = None
) -> Iterator[Reading]:
    """The readings of one run: adhesion, slip, efficiency of each driven wheel at its place, soil resistance at the wheels' middle."""
    vehicle = estimates.vehicle
    counted = estimates.during(*COUNTED)
    form = _form(estimates, reference_slip, library)
    stated = vehicle.uncertainty
    radius = (stated.wheel_radius or 0.0) if estimates.has_adhesion else stated.assumed("wheel_radius")
    for i, wheel, forward, left in _driven(estimates, vehicle):
        place = places.of(forward, left)
        slip, slip_std = estimates[f"slip_{wheel}"], estimates[f"slip_{wheel}_std"]
        by_radius = np.minimum(radius * (1 - np.abs(slip)), slip_std)
        if f"adhesion_{wheel}" in estimates.columns:
            mu, mu_std = estimates[f"adhesion_{wheel}"], estimates[f"adhesion_{wheel}_std"]
            value, slope, doubt = form(slip)
            none = np.zeros(len(slip))
            x_constants = np.column_stack([none, none, slope * by_radius, doubt])
            x_random = slope * np.sqrt(slip_std**2 - by_radius**2)
            constants = _adhesion_constants(vehicle, mu, i)
            yield _reading(
                "adhesion", place, mu, constants, mu_std, counted, x=(value, x_constants, x_random)
            )
        if f"efficiency_{wheel}" in estimates.columns:
            eta, eta_std = estimates[f"efficiency_{wheel}"], estimates[f"efficiency_{wheel}_std"]
            yield _reading("efficiency", place, eta, eta_std[:, None], eta_std, counted)
        yield _reading("slip", place, slip, by_radius[:, None], slip_std, counted)
    if estimates.has_adhesion and "soil_resistance" in estimates.columns:
        rho, std = estimates["soil_resistance"], estimates["soil_resistance_std"]
        centre = places.of(float(np.mean(vehicle.axle_to_rear[vehicle.wheel_axle])), 0.0)
        constants, unmeasured = _resistance_constants(vehicle, estimates)
        uphill = unmeasured, places.heading
        yield _reading("soil_resistance", centre, rho, constants, std, counted, slope=uphill)


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
    constants: Floats,
    std: Floats,
    counted: Bools,
    x: tuple[Floats, Floats, Floats] | None = None,
    slope: tuple[float, Floats] | None = None,
) -> Reading:
    """`std` is y's whole SD; the constant and local parts, no more than it, are subtracted. `x`: value, constants, random SD. `slope`:
    SD of one that nothing measures, and the heading (n,)."""
    turns = x is not None
    if x is None:
        x = np.ones(len(y)), np.zeros_like(constants), np.zeros(len(y))
    together = np.linalg.norm(constants, axis=1)
    constant = np.minimum(together, std)
    constants = constants * np.divide(constant, together, out=np.zeros(len(y)), where=together > 0)[:, None]
    rest = np.sqrt(np.maximum(std**2 - constant**2, 0.0))
    sd, heading = slope or (0.0, np.zeros(len(y)))
    near = np.minimum(sd, rest)
    local = near[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    random = np.sqrt(rest**2 - near**2)
    good = counted & np.isfinite(place[0]) & np.isfinite(x[0]) & np.isfinite(y) & (std < WIDEST_STD)
    return Reading(quantity, *place, x[0], y, constants, x[1], local, random, x[2], good, turns)


def _adhesion_constants(vehicle: Vehicle, mu: Floats, wheel: int) -> Floats:
    """What one SD of the vehicle file's constants changes in adhesion, mu = T/(r F_z) - rho_t (n, 4): shares of the thrust, zeros (of the
    torque, and the tyre's resistance), the radius, and the curve's form, which is an error of x alone."""
    known = vehicle.uncertainty
    share = np.hypot.reduce([
        known.drive_torque_gain or 0.0, known.drive_torque_gain_common or 0.0, known.vertical_load or 0.0, known.mass or 0.0,
    ])  # fmt: skip
    axle = vehicle.wheel_axle[wheel]
    load = vehicle.axle_mass[axle] / np.sum(vehicle.wheel_axle == axle)
    offset = (known.drive_torque_offset or 0.0) / (vehicle.wheel_radius[wheel] * load * STANDARD_GRAVITY)
    zero = float(np.hypot(offset, known.tire_rolling_resistance or 0.0))
    thrust = mu + vehicle.tire_rolling_resistance
    radius = -(known.wheel_radius or 0.0) * thrust
    return np.column_stack([share * thrust, np.full(len(mu), zero), radius, 0 * mu])


def _resistance_constants(vehicle: Vehicle, estimates: Estimates) -> tuple[Floats, float]:
    """What one SD of the same constants changes in rho_s = sum T/(r m g) - rho_t - (drawbar + m a)/(m g) - slope (n, 4): shares of the
    thrust, of the pull and of the mass, and zeros; and the SD of a slope which nothing measures, all that the estimates leave open where
    the vehicle file does not state it."""
    known, driven = vehicle.uncertainty, max(int(np.sum(vehicle.driven)), 1)
    adhesion = np.mean([estimates[f"adhesion_{wheel}"] for wheel in estimates.wheels], axis=0)
    thrust, rolling = (
        rho + vehicle.tire_rolling_resistance for rho in (adhesion, estimates["soil_resistance"])
    )
    weight = vehicle.mass * STANDARD_GRAVITY
    share = np.hypot.reduce([
        (known.drive_torque_gain or 0.0) / np.sqrt(driven), known.drive_torque_gain_common or 0.0, known.wheel_radius or 0.0,
    ])  # fmt: skip
    offset = (
        (known.drive_torque_offset or 0.0) * np.sqrt(driven) / (float(vehicle.wheel_radius.mean()) * weight)
    )
    slope, unmeasured = known.slope or 0.0, 0.0
    channels = estimates.about.get("settings", {}).get("channels", ("acceleration_x", "drawbar_force"))
    force = known.of_pull(channels) / weight
    if (
        "acceleration_x" in channels and known.acceleration_bias is not None
    ):  # it measures slope and acceleration together
        slope = min(slope or np.inf, known.acceleration_bias / STANDARD_GRAVITY)
    elif "pitch" not in channels:
        slope, unmeasured = 0.0, slope or np.inf
    zeros = float(np.hypot.reduce([offset, known.tire_rolling_resistance or 0.0, force, slope]))
    pull = (known.drawbar_gain or 0.0) * (thrust - rolling)
    constants = [share * thrust, pull, (known.mass or 0.0) * rolling, np.full(len(rolling), zeros)]
    return np.column_stack(constants), unmeasured


def _form(
    estimates: Estimates, reference: float, library: SoilLibrary | None
) -> Callable[[Floats], tuple[Floats, Floats, Floats]]:
    """The function of slip (n,) that gives x, dx/ds and the SD of x for want of the soil's form: each row's soil by its curve in the
    library (beyond its data as sure as its band), else the paper's prototype, which is as far from the soil's as the usual `FORMS` are
    from each other. A soil that bends
    otherwise is wrong to one side above the reference and to the other below it: so is that SD's sign."""

    def usual(name: str, slip: Floats) -> Floats:
        return np.asarray(CURVES[name].value(slip, {}) / CURVES[name].value(reference, {}))

    def form(slip: Floats) -> tuple[Floats, Floats, Floats]:
        prototype = CURVES["exponential"]
        x, slope = usual("exponential", slip), prototype.slope(slip, {}) / prototype.value(reference, {})
        apart = np.std([usual(name, slip) for name in FORMS], axis=0)
        side = np.sign(slip) * np.where(np.abs(slip) < reference, -1.0, 1.0)
        doubt = apart * side
        if library is not None and "soil" in estimates.labels:
            labels = estimates.labels["soil"]
            for name in set(labels) & set(library):
                rows, soil = labels == name, library[name]
                level = float(soil.value(reference))
                own = {k: v for k, v in soil.parameters.items() if k != "intercept"}
                x[rows] = soil.value(slip[rows]) / level
                slope[rows] = CURVES[soil.model].slope(slip[rows], own) / level
                doubt[rows] = (
                    x[rows] * side[rows] * np.abs(beyond(soil, slip[rows]) - beyond(soil, reference))
                )
        return x, slope, doubt

    def beyond(soil: Soil, slip: ArrayLike) -> Floats:
        """Relative SD of a curve beyond its data, by the farther end of its band."""
        low, high = soil.band(slip)
        value = soil.value(slip)
        known = (np.abs(slip) <= soil.reach) | (value == 0)
        return np.where(
            known, 0.0, np.maximum(high - value, value - low) / (1.96 * np.abs(np.where(known, 1.0, value)))
        )

    return form
