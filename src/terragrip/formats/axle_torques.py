"""Columns that name an axle: of its only wheel, or a torque of both, and how a profile gives that to the wheels."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from terragrip.formats.candidates import Column
from terragrip.units import factor_to

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

_NUMBER = re.compile(r"(?:axle|achse|essieu|eje|assale)[\W_]*(\d)", re.IGNORECASE)
_ENDS = {"front": "f", "rear": "r", "middle": "m"}


def of_the_only_wheel(column: Column, vehicle: Vehicle | None) -> Column:
    """The column as one of a wheel, where it names an axle that has a single one in the ``vehicle`` (the front one of a tricycle)."""
    if vehicle is None or column.name.wheel or not column.name.has(*_ENDS):
        return column
    wheels = _wheels_of(column, vehicle, 1)
    return replace(column, name=replace(column.name, wheel=wheels[0])) if len(wheels) == 1 else column


def is_of_an_axle(column: Column) -> bool:
    """Whether a column is, by its name, a torque of both wheels of an axle."""
    name = column.name
    if (
        not name.has("torque")
        or column.kind not in (None, "torque")
        or name.has("other", "command", "statistic")
    ):
        return False
    if name.wheel.isdigit() or not name.wheel:
        return name.has(*_ENDS) or _number(column) is not None
    return False


def _number(column: Column) -> int | None:
    """The number of the axle that a column names."""
    found = _NUMBER.search(column.column)
    return int(found[1]) if found else None


def axle_torque_hints(columns: Iterable[Column], vehicle: Vehicle | None) -> Iterator[str]:
    """For each column that is the torque of an axle, how to give it to its wheels: those of the ``vehicle``, where it is known."""
    of_axles = list(filter(is_of_an_axle, columns))
    first = min((number for number in map(_number, of_axles) if number is not None), default=1)
    for column in of_axles:
        wheels = _wheels_of(column, vehicle, min(first, 1))
        ratio = " times the gear ratio" if column.name.has("motor") else ""
        own = column.unit is None or factor_to(column.unit, "N m") == 1.0
        unit = "" if own else f", unit: {column.unit}"
        plain = column.column if column.column.isidentifier() else f'"{column.column}"'
        share = f"{1 / len(wheels):.3g}"
        entries = f"'drive_torque_{wheels[0]}: {{from: {plain}, scale: {share}{unit}}}'"
        others = f", and so for {', '.join(wheels[1:])}" if len(wheels) > 1 else ""
        yield (
            f"{column.column} is by its name the torque of an axle, which a differential shares evenly: give each wheel its part{ratio} "
            f"in the profile, {entries}{others}. Only their mean adhesion is then known."
            + (
                " If the axle has one wheel, inspect with its vehicle file: --vehicle."
                if vehicle is None
                else ""
            )
        )


def _wheels_of(column: Column, vehicle: Vehicle | None, first: int) -> tuple[str, ...]:
    """The wheels of the axle that a column names: of a vehicle by the axle's name or place, else the usual names. ``first``: 0 or 1, the
    number of the foremost axle."""
    end = next((end for end in _ENDS if column.name.has(end)), "")
    number = (_number(column) or first) - first
    if vehicle is None:
        letter = _ENDS.get(end, str(number + 1))
        return f"{letter}l", f"{letter}r"
    axles = list(vehicle.axles.items())
    place = {"front": 0, "rear": -1, "middle": len(axles) // 2}.get(end)
    if place is None:
        place = min(number, len(axles) - 1)
    named = [axle for name, axle in axles if end and end in name.lower()]
    return tuple((named or [axles[place][1]])[0].wheels)
