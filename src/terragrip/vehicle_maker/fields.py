"""The numbers asked of a machine, by class and by what its log measures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from terragrip.errors import InputError, suggestion
from terragrip.tire_size import is_tire_size, tire_size
from terragrip.units import UnitError, quantity
from terragrip.vehicle_maker.classes import MachineClass, Typical

Signals = Literal["torque", "wheel-speeds", "bus-speed"]
SIGNALS: dict[str, str] = {
    "torque": "wheel speeds and drive torques (with or without a drawbar force)",
    "wheel-speeds": "a speed of each wheel, no torque: slip alone",
    "bus-speed": "the bus's one wheel-based speed, no torque: slip alone",
}
"""What a log of the machine measures beside the ground speed."""


NOTHING = "none"
"""The text in place of a number for which nothing is assumed."""


@dataclass(frozen=True)
class Field:
    """A number about the machine.

    ``typical`` is what its class has; None: nothing is assumed where no answer is given, and the vehicle file leaves it out. ``needed``:
    without it the result says little. A field that ``is_spread`` is itself a standard deviation, of a sensor or of the ground. ``unit`` is
    SI, as `terragrip.units` reads it.
    """

    name: str
    title: str
    unit: str
    typical: Typical | None
    needed: bool = False
    is_spread: bool = False

    def is_far(self, known: Mapping[str, float]) -> bool:
        """Whether its number [SI] among those ``known`` is a tenth of what is typical, or ten times that: 6.200 kg of a tractor."""
        typical = 0.0 if self.typical is None or self.is_spread else self.typical.value
        return typical > 0 and not typical / 10 < known.get(self.name, typical) < 10 * typical

    @property
    def assumption(self) -> str:
        """What is assumed where it is not known: ``wheelbase: 2.68 ± 0.395 m``, or of a spread ``slope: ± 0.0175 rad``."""
        if self.typical is None:
            return f"{self.name}: {NOTHING}"
        value, spread = (f"{float(f'{x:.3g}'):g}" for x in (self.typical.value, self.typical.spread))
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name}: ± {value}{unit}" if self.is_spread else f"{self.name}: {value} ± {spread}{unit}"


_FIELDS: tuple[tuple[str, str, str], ...] = (
    ("mass", "mass, ready to work", "kg"),
    (
        "front_mass",
        "mass on the front axle, at rest (of three axles, the other two share the rest equally)",
        "kg",
    ),
    ("wheelbase", "wheelbase", "m"),
    ("track", "track, between the wheel centres", "m"),
    ("center_of_gravity_height", "height of the centre of gravity", "m"),
    ("hitch_height", "height of the hitch", "m"),
    ("wheel_radius", "rolling radius of the wheels (of the rear ones, if the front ones are smaller)", "m"),
    ("front_wheel_radius", "rolling radius of the front wheels", "m"),
    ("wheel_inertia", "moment of inertia of a wheel with its geared drive", "kg m^2"),
    ("tire_rolling_resistance", "rolling resistance of the tyres on hard ground, share of the load", "1"),
    ("bearing_resistance", "bearing resistance", "N s/rad"),
)
_PAYLOAD: tuple[tuple[str, str, str], ...] = (
    (
        "payload_x",
        "tank or hopper, where the log has the machine's mass: its centre of gravity ahead of the rear axle (behind: -)",
        "m",
    ),
    ("payload_z", "its centre of gravity above the ground", "m"),
)
_SPREADS: tuple[tuple[str, str, str], ...] = (
    ("drive_torque_gain", "error of the torques' scale, standard deviation", "1"),
    ("drive_torque_offset", "error of the torques' zero, standard deviation", "N m"),
    ("drawbar_offset", "error of the drawbar force's zero, standard deviation", "N"),
    ("drawbar_force", "pull of a tool where no drawbar force is measured, standard deviation", "N"),
    ("slope", "slope of the ground where no pitch is measured, standard deviation", "rad"),
    ("acceleration_bias", "error of an accelerometer's zero, mounting included, standard deviation", "m/s^2"),
)


def fields(
    machine: MachineClass, signals: Signals, known: Mapping[str, float] | None = None
) -> tuple[Field, ...]:
    """What is asked of a machine of a class whose log has these signals, in the order to ask in.

    ``known``: numbers that are known already [SI], by name: what is typical scales with the mass and hangs on the radius.
    """
    if signals == "bus-speed":
        return ()
    given = dict(known or {})
    mass = given.get("mass", machine.typical_mass().value)
    radius = given.get("wheel_radius", machine.typical("wheel_radius", mass).value)
    chosen = ["track", "wheel_radius"] if signals == "wheel-speeds" else [name for name, _, _ in _FIELDS]
    if machine.has_small_front_wheels and signals == "wheel-speeds":
        chosen.append("front_wheel_radius")
    found = []
    for name, title, unit in _FIELDS:
        if name not in chosen or not _has(machine, name):
            continue
        found.append(
            Field(name, title, unit, _typical(machine, name, mass, radius), needed=_is_needed(name, signals))
        )
    if signals == "torque":
        if machine.carries:
            found += [Field(name, title, unit, None) for name, title, unit in _PAYLOAD]
        for name, title, unit in _SPREADS:
            if name in ("drawbar_offset", "drawbar_force") and not machine.tows:
                continue
            found.append(Field(name, title, unit, machine.typical(name, mass, radius), is_spread=True))
    return tuple(found)


def _has(machine: MachineClass, name: str) -> bool:
    if name in ("front_mass", "wheelbase"):
        return len(machine.axles) > 1
    if name == "front_wheel_radius":
        return machine.has_small_front_wheels
    if name == "track":
        return any(len(axle["wheels"]) > 1 for axle in machine.axles.values())
    if name == "hitch_height":
        return machine.tows and len(machine.axles) > 1
    return name != "center_of_gravity_height" or len(machine.axles) > 1


def _is_needed(name: str, signals: Signals) -> bool:
    return name == "wheel_radius" or (name == "mass" and signals == "torque")


def _typical(machine: MachineClass, name: str, mass: float, radius: float) -> Typical:
    if name == "mass":
        return machine.typical_mass()
    if name == "front_mass":
        share = machine.typical("front_share", mass)
        return Typical(share.value * mass, share.spread * mass, share.source)
    return machine.typical(name, mass, radius)


def read_values(machine: MachineClass, signals: Signals, given: Mapping[str, object]) -> dict[str, float]:
    """Numbers [SI] from what a user wrote (a number, or a text with a unit), None left out.

    Raises InputError on a name that is not asked for, or a value that is none.
    """
    asked = {field.name: field for field in fields(machine, signals)}
    values = {}
    for name, value in given.items():
        if value is None:
            continue
        if name not in asked:
            hint = suggestion(name, asked, f"it uses {', '.join(asked) or 'no number'}")
            raise InputError(
                f"a {machine.name} known by its {signals} has no use for it", place=name, hint=hint
            )
        try:
            values[name] = quantity(value, asked[name].unit)
        except UnitError as error:
            if name in ("wheel_radius", "front_wheel_radius") and is_tire_size(str(value)):
                size = tire_size(str(value))
                radius = "measure it" if size is None else f"that tyre's is some {size.rolling_radius:.3g} m"
                raise InputError(
                    f"{value!r} is a tyre's size", place=name, hint=f"give the rolling radius: {radius}"
                ) from error
            raise InputError(error.problem, place=name, hint=error.hint) from error
        if (values[name] < 0 and name != "payload_x") or (
            values[name] == 0 and not (asked[name].is_spread or name == "payload_x")
        ):
            raise InputError(f"{value} is impossible", place=name, hint="give a positive number")
    if "payload_z" in values and "payload_x" not in values:
        raise InputError("is of no use alone", place="payload_z", hint="give payload_x too")
    return values
