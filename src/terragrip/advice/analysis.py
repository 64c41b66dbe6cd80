"""Advice from estimates: soil by soil, the best slip where the data bear one, what to do, and what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from terragrip.advice.actions import Work, actions_for, gained
from terragrip.advice.fuel import burnt
from terragrip.advice.optimum import Best, OverSlip, best_of
from terragrip.advice.result import Advice
from terragrip.advice.samples import GatheredSamples, Samples, driven_wheels
from terragrip.advice.slip_only import advise_slip
from terragrip.advice.soil_curves import SoilCurves, of_drives, of_library
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.estimation.driveline import machine_of
from terragrip.soil.library import Soil
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

LEAST_REACH = 0.02
"""Mean slip that the hardest pulls must reach: below it, slip's own error and the curve cannot be distinguished."""
MOST_LOST = 0.05
"""A best slip that may cost more efficiency than this against the true one (95 %) is not given."""
WIDEST_POWER = 0.24
"""A slip of most pull power whose interval is wider is not given."""
FARTHEST = 2.0
"""A best slip beyond this many times the data's reach rests on what soils are like in general, which is said."""
MENTIONED = 0.05
"""Share of the way without load from which it is said."""
FRONT_POINTS = 21
NO_PULL = (
    "no drawbar_force was in the log: the best slip is that of a machine which tows nothing. The pull of a tool counts here as soil "
    "resistance, and the best slip with it is another: measure the pull for advice on load, ballast and speed"
)
"""Of drives whose pull no sensor measured."""
LEAST_PULL = 0.03
"""Mean pull over weight under which nothing was towed."""
NO_LOAD = (
    "next to nothing was pulled (less than 3 % of the weight): the best slip follows from the ground alone. Drive with the tool at work "
    "for advice on load, ballast and speed"
)
"""Of drives with a drawbar sensor and nothing behind it: transport."""
NO_ROW = "no row moves, unflagged, with its adhesion known and vehicle and tool on one soil"
"""Of drives with nothing to advise on, as those in which a PTO takes an unknown part of the engine's power all along."""
CURVE_END, CURVE_POINTS = 0.4, 41


_ANOTHER = 2.0
"""Times the mass of a vehicle that it has with any ballast; a tank's load is logged as ``mass``."""


def advise(
    tables: Sequence[Estimates], vehicle: Vehicle, soils: Mapping[str, Soil] | None = None
) -> tuple[dict[str, Advice], dict[str, float]]:
    """Advice by soil name ("" where rows have no label), and metres driven by soil.

    ``soils``: known curves (a library), used for soils of the same name (a single one also for rows without a label); others
    are learned from the estimates. Raises InputError where no table is given, or other than a list, or torques are in some tables only.
    """
    if not tables:
        raise InputError("no estimates are given", hint="name at least one file")
    if strange := [one for one in tables if not isinstance(one, Estimates)]:
        raise InputError(
            f"{type(strange[0]).__name__} is no table of estimates", hint="give a list of Estimates"
        )
    if not any(one.has_adhesion for one in tables):
        return {"": advise_slip(tables, vehicle)}, {"": 0.0}
    if not all(one.has_adhesion for one in tables):
        raise InputError(
            "some of the estimates have slip alone, others adhesion too", hint="advise on each kind by itself"
        )
    vehicle = machine_of(tables[0], vehicle)
    for one in tables:
        refuse_other_vehicle(one, vehicle)
    gathered = GatheredSamples(vehicle)
    for one in tables:
        gathered.add(one)
    return advise_samples(gathered.by_soil(), gathered.vehicle, driven_wheels(tables[0], vehicle), soils)


def advise_samples(
    samples: Mapping[str, Samples],
    vehicle: Vehicle,
    wheels: Sequence[str],
    soils: Mapping[str, Soil] | None = None,
) -> tuple[dict[str, Advice], dict[str, float]]:
    """As `advise`, of rows gathered by soil; ``wheels``: the driven ones of the tables, in the order of ``Samples.wheel_adhesion``."""
    found = {name: _of_soil(name, part, vehicle, wheels, soils or {}) for name, part in samples.items()}
    if not found:
        return {"": Advice("", missing=(f"{NO_ROW}: drive some tens of metres",))}, {"": 0.0}
    return found, {name: part.way for name, part in samples.items()}


def refuse_other_vehicle(estimates: Estimates, vehicle: Vehicle) -> None:
    """InputError unless the table has the vehicle's driven wheels, axles and about its mass, and one of them is driven."""
    columns = [f"adhesion_{w}" for w in vehicle.driven_wheels] + [
        f"vertical_load_{a}" for a in vehicle.axle_names
    ]
    lacking = next((name for name in columns if name not in estimates.names), None)
    if lacking or not vehicle.driven.any():
        problem = f"the estimates have no {lacking}" if lacking else "the vehicle drives no wheel"
        raise InputError(problem, hint="give the vehicle file that the log was estimated with")
    own = (estimates.about.get("vehicle") or {}).get("mass", vehicle.mass)
    if not own / _ANOTHER < vehicle.mass < own * _ANOTHER:
        problem = f"the vehicle has {vehicle.mass:.4g} kg, that of the estimates {own:.4g} kg"
        raise InputError(problem, hint="give the vehicle file that the log was estimated with")


def _of_soil(
    name: str, samples: Samples, vehicle: Vehicle, wheels: Sequence[str], soils: Mapping[str, Soil]
) -> Advice:
    known = soils.get(name) or (next(iter(soils.values())) if not name and len(soils) == 1 else None)
    loaded = samples.under_load()
    drive = _drive(loaded)
    refuted = known is not None and known.fit.get("follows") is False
    own = of_drives(samples, vehicle) if known is None or refuted else None
    curves = of_library(known, samples, vehicle) if known is not None and own is None else own
    if curves is None or curves.reach < LEAST_REACH:
        return Advice(name, drive=drive, missing=(_too_little(curves, samples.way),))
    over = curves.over
    best, power = best_of(over, over.efficiency), best_of(over, over.productivity)
    fuel = _burnt(loaded, vehicle)
    works = samples.towed and drive["net_traction"] >= LEAST_PULL
    beyond = own is None and power.slip > curves.reach
    missing: tuple[str, ...] = () if works else (NO_LOAD if samples.towed else NO_PULL,)
    missing += _pushed(drive["soil_resistance"])
    whose = "the drive" if own is not None else "the library"
    missing += _missing(best, power, curves, vehicle, whose, measured="litres_per_hour" in fuel)
    if beyond:
        missing += (_beyond(curves.reach),)
    if soils and own is not None:
        missing += (_not_of_library(name, known),)
    if not _known(best, over):
        return Advice(name, missing=missing, drive=drive, reserve=_reserve(loaded, curves, wheels))
    slip, pull = loaded.levels()
    work = Work(over, best, slip, pull, drive["ground_speed"], drive["soil_resistance"])
    advice = Advice(
        name, best,
        power if power.interval[1] - power.interval[0] <= WIDEST_POWER and not beyond else None,
        _front(over, best, power),
        tuple(actions_for(work, vehicle)), missing, {**drive, "efficiency": float(work.efficiency[0])},
        _reserve(loaded, curves, wheels), {**_field_work(work, vehicle), **fuel},
        (*_limits(work, drive), *_left_out(samples.way - loaded.way, samples.way)), _curve(over),
    )  # fmt: skip
    return advice if works else replace(advice, actions=(), drive=drive, field_work=fuel, limits=())


def _too_little(curves: SoilCurves | None, way: float) -> str:
    """Why a drive bears no advice."""
    if curves is None:
        return f"{way:.0f} m of usable way are too short for a curve: drive 50 wheel radii or more on it"
    return (
        f"the hardest pulls slip by {curves.reach:.1%} on average, too little for a curve: pull until slip is 5 to 10 %, "
        "on level ground and at several loads"
    )


def _pushed(resistance: float) -> tuple[str, ...]:
    """That the ground pushes, where it seems to."""
    if resistance >= 0:
        return ()
    return (
        f"soil resistance is {resistance:.3f} in the mean, and no ground pushes: the torques' scale, the drawbar's "
        "zero or a slope is off, and every efficiency here is too high; calibrate, and drive the same way back too",
    )


def _beyond(reach: float) -> str:
    return (
        f"the library's curve was learned at slips up to {reach:.0%}: a slip of most pull power beyond them depends on the "
        "form of the curve alone; learn it from drives with harder pulls"
    )


def _not_of_library(name: str, known: Soil | None) -> str:
    """Why the library's soil is not used; ``known``: the one of that name."""
    if known is not None:
        why = f"the library's {known.model} form cannot follow the drives that it was learned from"
    elif name:
        why = f"the library has no soil named {name!r}"
    else:
        why = "the rows name no soil, and the library has several"
    return f"{why}: the curve is learned from these estimates"


def _known(best: Best, over: OverSlip) -> bool:
    """Whether the slip of best efficiency is known well enough to drive by it."""
    return best.net_traction > 0 and over.loss(best.slip) <= MOST_LOST


def _missing(
    best: Best, power: Best, curves: SoilCurves, vehicle: Vehicle, whose: str, *, measured: bool
) -> tuple[str, ...]:
    """What is not known and what would show it; ``whose`` slips the curves' data are; ``measured``: the fuel was."""
    missing = []
    low, high = best.interval
    if not _known(best, curves.over):
        missing.append(
            f"the best slip is only known to be {low:.0%} to {high:.0%}: drive longer, at pulls that slip up to 15 %, "
            "and calibrate the wheel radius"
        )
    elif best.slip > FARTHEST * curves.reach:
        missing.append(
            f"the slips of {whose} reach {curves.reach:.0%}; the best slip of {best.slip:.0%} follows from how soils behave in "
            "general: pull harder to see it"
        )
    if power.interval[1] - power.interval[0] > WIDEST_POWER:
        beyond = power.slip > curves.reach
        pulls = (
            f"up to about {power.slip:.0%} of slip"
            if beyond
            else f"beyond the {curves.reach:.0%} of slip that were reached"
        )
        missing.append(
            f"the slip of most pull power is only known to be {power.interval[0]:.0%} to {power.interval[1]:.0%}: a drive with pulls "
            f"{pulls} would show it"
        )
    for key, unit in (
        ("working_width", "ha/h"),
        ("fuel", "l/ha, or a log with the fuel rate"),
        ("power", "the speed that the power allows"),
    ):
        if getattr(vehicle, key) is None and not (key == "fuel" and measured):
            missing.append(f"{key} in the vehicle file, for {unit}")
    return tuple(missing)


def _drive(samples: Samples) -> dict[str, float]:
    """What was driven, means by way."""
    names = {"slip": samples.slip, "adhesion": samples.adhesion, "soil_resistance": samples.resistance, "net_traction": samples.pull,
             "ground_speed": np.abs(samples.speed)}  # fmt: skip
    means = {name: float(np.average(values, weights=samples.metres)) for name, values in names.items()}
    return {"metres": samples.way, **means}


def _reserve(
    samples: Samples, curves: SoilCurves, wheels: Sequence[str]
) -> dict[str, tuple[float, float, float]]:
    """Of each wheel: 1 - its mean adhesion over the curve's top up to 60 % of slip, with its 95 % interval."""
    top = curves.adhesion.max(axis=1)
    out = {}
    for k, wheel in enumerate(wheels):
        used = float(np.average(samples.wheel_adhesion[:, k], weights=samples.metres))
        left = 1 - used / np.maximum(top, 1e-6)
        low, high = np.percentile(left, [2.5, 97.5])
        out[wheel] = (float(left[0]), float(low), float(high))
    return out


def _front(over: OverSlip, best: Best, power: Best) -> tuple[Mapping[str, float], ...]:
    """From the slip of best efficiency to that of most pull power: more pull for less efficiency."""
    slips = np.linspace(best.slip, max(power.slip, best.slip), FRONT_POINTS)
    rows = {
        "efficiency": over.efficiency[0],
        "net_traction": over.net_traction[0],
        "productivity": over.productivity[0],
    }
    return tuple(
        {"slip": float(s), **{name: float(np.interp(s, over.slip, row)) for name, row in rows.items()}}
        for s in (slips if slips[-1] > slips[0] else slips[:1])
    )


def _curve(over: OverSlip) -> tuple[Mapping[str, float], ...]:
    """Efficiency and pull over slip with their 95 % bands, for a picture."""
    shown = np.linspace(0, CURVE_END, CURVE_POINTS)
    rows = {}
    for name, values in (("efficiency", over.efficiency), ("net_traction", over.net_traction)):
        low, high = np.percentile(values[1:], [2.5, 97.5], axis=0)
        for key, row in ((name, values[0]), (f"{name}_low", low), (f"{name}_high", high)):
            rows[key] = np.interp(shown, over.slip, row)
    return tuple(
        {"slip": float(s), **{key: float(row[i]) for key, row in rows.items()}} for i, s in enumerate(shown)
    )


def _limits(work: Work, drive: Mapping[str, float]) -> tuple[str, ...]:
    """What holds this drive back: which of the two losses is the larger; with what becomes pull they are all of the wheels' power."""
    slipping = max(drive["slip"], 0.0)
    rolling, (low, high) = gained(1 - slipping - work.efficiency)
    larger, cure = (
        ("rolling resistance", "more load or less weight")
        if rolling > slipping
        else ("slip", "less load, more weight or better grip")
    )
    shares = f"of the wheels' power {slipping:.0%} is lost in slip and {rolling:.0%} ({low:.0%} to {high:.0%}) in rolling"
    return (f"{shares}; {larger} is the larger: {cure} helps.",)


def _left_out(light: float, way: float) -> tuple[str, ...]:
    """That ``light`` of ``way`` metres had no load to advise on, where it is worth a word."""
    if light < MENTIONED * way:
        return ()
    words = f"{light:.0f} of {way:.0f} m were driven without load, or nearly so: they tell of the curve, and all figures of the drive "
    return (words + "are those of the rest",)


def _burnt(samples: Samples, vehicle: Vehicle) -> dict[str, float]:
    """Litres per hour and per hectare as measured."""
    seconds = samples.metres / np.maximum(np.abs(samples.speed), 1e-3)
    return burnt(samples.fuel, seconds, samples.metres, vehicle.working_width)


def _field_work(work: Work, vehicle: Vehicle) -> dict[str, float]:
    """ha/h now and at the best slip at the same wheel speed; l/ha for the drive's pull at either efficiency."""
    if vehicle.working_width is None:
        return {}
    slip = float(np.mean(work.slip))
    best_speed = work.speed * (1 - work.best.slip) / max(1 - slip, 0.05)
    out = {
        "hectares_per_hour": work.speed * vehicle.working_width * 0.36,
        "hectares_per_hour_at_best": best_speed * vehicle.working_width * 0.36,
    }
    if vehicle.fuel is not None:
        force = max(float(np.mean(work.pull)), 0.0) * vehicle.mass * STANDARD_GRAVITY
        for name, eta in (
            ("litres_per_hectare", float(work.efficiency[0])),
            ("litres_per_hectare_same_pull_at_best", work.best.efficiency),
        ):
            energy = force * 1e4 / vehicle.working_width / max(eta, 1e-3)
            out[name] = energy * vehicle.fuel * 1e3
    return out
