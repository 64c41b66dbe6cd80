"""Whether positions agree with their names: latitude and longitude swapped, a sign lost, radians for degrees.

Two other signals of motion judge this: the speed over ground, and turns from the difference of the wheels' speeds.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.errors import InputError
from terragrip.physics.geodesy import metres_of

if TYPE_CHECKING:
    from terragrip.estimation import Estimates


STRETCH = 3.0
"""Metres over which a step of the positions and a turn are compared."""
LEAST = 12
"""Stretches needed to judge by."""
APART = 0.2
"""ln of the ratio of positions' to driven way, in the median of the stretches, that is implausible ..."""
ALIKE = 0.1
"""... where another reading of the columns comes as near as this."""
NEVER = np.log(2.0)
"""... and what no scatter of a receiver's positions explains: on that way there is nothing to map by."""
MIRRORED = -0.6
"""Correlation of the track's turns with those of the wheels below which the track is a mirror image."""


def refuse_impossible(estimates: Estimates, fixes: Ints, file: str | None = None) -> None:
    """Raise InputError if positions contradict the motion, with the likely mistake. ``fixes``: rows with a fresh position."""
    latitude, longitude = estimates["latitude"][fixes], estimates["longitude"][fixes]
    refused = partial(InputError, file=file, place="columns latitude, longitude")
    for name, values, most in (("latitude", latitude, 90), ("longitude", longitude, 360)):
        beyond = np.abs(values) > most + 1e-4
        if not beyond.any():
            continue
        codes = np.unique(values[beyond])
        if np.abs(latitude).max() <= 180 and np.abs(longitude).max() <= 90:
            fix = "they look swapped: correct the profile"
        elif len(codes) == 1 and not beyond.all():
            fix = (
                f"{codes[0]:.6g} looks like a code for 'not measured': leave these cells empty, or write 'invalid: [...]' in the "
                "profile, in the log's own numbers"
            )
        else:
            fix = "they look like metres of a grid: give degrees"
        raise refused(f"{name}s reach {np.abs(values).max():.6g}, beyond {most} degrees", hint=fix)
    way = np.maximum.accumulate(np.nan_to_num(estimates["distance"]))[fixes]
    ends = _stretches(way)
    if len(ends) < LEAST + 1:
        return
    driven = np.diff(way[ends])
    given = _apart(latitude, longitude, ends, driven)
    if np.abs(longitude).max() <= 90 and _only_swapped_fits(latitude, longitude, ends, driven):
        raise refused(
            "positions move too far in one direction and not in the other, against the wheels and the ground speed",
            hint="latitude and longitude look swapped: correct the profile",
        )
    if given > APART:
        degrees = 180 / np.pi
        others = {
            "swapped": (longitude, latitude),
            "in radians": (latitude * degrees, longitude * degrees),
        }
        for what, (north, east) in others.items():
            if np.abs(north).max() <= 90 and _apart(north, east, ends, driven) < ALIKE:
                raise refused(
                    f"positions move {np.exp(given):.3g} times as far as the wheels and the ground speed, or as little",
                    hint=f"latitude and longitude look {what}: correct the profile",
                )
    if given > NEVER:
        raise refused(
            f"positions move {np.exp(given):.3g} times as far as the wheels and the ground speed, or as little",
            hint="check the units of latitude, longitude and ground_speed in the profile, and at the positions' resolution",
        )
    turning = _wheel_turns(estimates, fixes, ends)
    if turning is not None and _mirrored(latitude, longitude, ends, turning):
        raise refused(
            "the track turns left where the wheels turn right",
            hint="a sign of latitude or longitude is lost (west and south are negative), or they are swapped: correct the profile",
        )


def _stretches(way: Floats) -> Ints:
    """Fixes that end stretches of `STRETCH` metres."""
    number = ((way - way[0]) // STRETCH).astype(np.intp)
    return np.flatnonzero(np.r_[True, np.diff(number) > 0])


def _off(latitude: Floats, longitude: Floats, ends: Ints, driven: Floats) -> Floats:
    """Absolute ln(distance by positions / distance driven) of each stretch."""
    north, east = metres_of(latitude, longitude)
    moved = np.hypot(np.diff(north[ends]), np.diff(east[ends]))
    with np.errstate(divide="ignore"):
        return np.asarray(np.abs(np.log(np.maximum(moved, 1e-9) / driven)))


def _apart(latitude: Floats, longitude: Floats, ends: Ints, driven: Floats) -> float:
    """Median of `_off`; a turn's chord is shorter, which the median tolerates."""
    return float(np.median(_off(latitude, longitude, ends, driven)))


def _only_swapped_fits(latitude: Floats, longitude: Floats, ends: Ints, driven: Floats) -> bool:
    """Whether stretches fit the distance driven much better with the columns swapped, and hardly any much worse.

    Lanes along one direction fit either way: then the turns decide, which the median over all stretches does not see. An antenna that
    swings out in them makes both readings worse alike.
    """
    given, swapped = (
        _off(north, east, ends, driven) for north, east in ((latitude, longitude), (longitude, latitude))
    )
    better = int(np.sum(given - swapped > APART))
    return better >= LEAST and better > 5 * int(np.sum(swapped - given > APART))


def _wheel_turns(estimates: Estimates, fixes: Ints, ends: Ints) -> Floats | None:
    """Turn to the left by the wheels over each stretch, in any unit; None where no axle has two wheels."""
    pairs = [
        (axle.wheels[0], axle.wheels[-1]) for axle in estimates.vehicle.axles.values() if len(axle.wheels) > 1
    ]
    names = [pair for pair in pairs if all(f"wheel_speed_{wheel}" in estimates.columns for wheel in pair)]
    if not names:
        return None
    total = np.zeros(len(estimates))
    steps = np.diff(estimates.time, prepend=estimates.time[0])
    for left, right in names:
        total += np.nan_to_num(estimates[f"wheel_speed_{right}"] - estimates[f"wheel_speed_{left}"]) * steps
    return np.diff(np.cumsum(total)[fixes[ends]])


def _mirrored(latitude: Floats, longitude: Floats, ends: Ints, turning: Floats) -> bool:
    """Whether the track's turns have the opposite sign to the wheels'. Both must turn in enough stretches to decide."""
    north, east = metres_of(latitude, longitude)
    course = np.arctan2(np.diff(north[ends]), np.diff(east[ends]))
    bend = np.remainder(np.diff(course) + np.pi, 2 * np.pi) - np.pi
    by_wheels = 0.5 * (turning[1:] + turning[:-1])  # a bend is between two stretches
    clear = np.abs(bend) > 0.15
    if clear.sum() < LEAST or np.ptp(by_wheels[clear]) == 0:
        return False
    strength = np.sum(bend[clear] * by_wheels[clear]) / np.sqrt(
        np.sum(bend[clear] ** 2) * np.sum(by_wheels[clear] ** 2)
    )
    return bool(strength < MIRRORED)
