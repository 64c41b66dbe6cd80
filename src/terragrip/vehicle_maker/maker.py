"""A vehicle file from what is known of a machine: what is not known is typical, and its doubt is considered."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.physics.loads import GRAVITY, axle_loads
from terragrip.vehicle import Vehicle
from terragrip.vehicle_maker.classes import MachineClass, class_named
from terragrip.vehicle_maker.fields import SIGNALS, Field, Signals, fields, read_values

RADIUS_BY_TAPE = 0.02
"""Relative SD of a rolling radius by tape or data sheet; `terragrip calibrate` does better. What slip alone counts with, too."""
WORK = 0.15
"""Pull over weight of the work that loads are judged by (R)."""
PUSH = 0.03
"""Acceleration over gravity that loads and inertias are judged by (R)."""

TORQUE_AT = {
    "wheel": "behind the gears, so that it has no part of their losses",
    "motor": "a current or torque of the motor: the gear ratio counts, and the gears' losses are in it",
}
"""Where a log's drive torques are measured."""
_COUNTS = {
    "bus-speed": "of the numbers here none counts, and the log itself gives the zero of slip.",
    "wheel-speeds": "of the numbers here only the radii count, and in turns the track. The rest is typical.",
}


@dataclass(frozen=True)
class Made:
    """A vehicle that was made: ``vehicle``, its ``machine`` class, the ``signals`` of its log, the ``known`` numbers [SI], and the fields
    that are ``assumed``: typical of the class, their spread considered; ``torque_at``: a name of `TORQUE_AT`, "" where it is not known."""

    vehicle: Vehicle
    machine: MachineClass
    signals: Signals
    known: Mapping[str, float]
    assumed: tuple[Field, ...]
    torque_at: str = ""

    def to_yaml(self) -> str:
        """The vehicle file, with a head that says what is assumed and from where."""
        lines = [f"# {self.machine.title}; known by {SIGNALS[self.signals]}."]
        if self.signals != "torque":
            lines.append(f"# Slip alone: {_COUNTS[self.signals]}")
        if self.torque_at == "motor":
            lines.append(
                "# Torques at the motor: the log's profile multiplies them by the gear ratio, 'scale: RATIO'.\n"
                "# What motor and gears take at any speed is not assumed: with the wheels lifted and turning, it is their torque; write\n"
                "# it as 'drive_friction'."
            )
        if self.assumed:
            lines.append(
                "# Not known, typical of the class; the standard deviations are considered under 'uncertainty':"
            )
            lines += [f"#   {one.assumption} ({one.typical.source})" for one in self.assumed if one.typical]
        return "\n".join(lines) + "\n" + self.vehicle.to_yaml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the vehicle file, whole or not at all; raises InputError if it cannot."""
        from terragrip.files import replacing

        with replacing(path) as temporary:
            temporary.write_text(self.to_yaml(), encoding="utf-8")


def make(
    machine: str | MachineClass,
    signals: Signals = "torque",
    known: Mapping[str, object] | None = None,
    *,
    name: str = "",
    torque_at: str = "",
) -> Made:
    """A vehicle of a class from what is known of it.

    ``machine``: the name of a class (`classes`). ``known``: numbers [SI] or texts with a unit by the names of `fields`; None, or a name
    left out, is not known. ``name`` of the vehicle. ``torque_at``: a name of `TORQUE_AT`, "" where it is not known; at the wheel no
    bearing resistance counts. Raises InputError on a class, name or value that there is not.
    """
    chosen = machine if isinstance(machine, MachineClass) else class_named(machine)
    if signals not in SIGNALS:
        raise InputError(f"no signals {signals!r}", place="--signals", hint=f"say {', '.join(SIGNALS)}")
    if torque_at and signals != "torque":
        raise InputError(f"does not count for a log of {signals}", place="--torque-at", hint="leave it out")
    if torque_at and torque_at not in TORQUE_AT:
        hint = f"say {' or '.join(TORQUE_AT)}"
        raise InputError(f"no torque is measured at {torque_at!r}", place="--torque-at", hint=hint)
    values = read_values(chosen, signals, known or {})
    if torque_at == "wheel":
        values.setdefault("bearing_resistance", 0.0)
    asked = fields(chosen, signals, values)
    assumed = tuple(field for field in asked if field.typical and field.name not in values)
    return Made(
        vehicle_of(chosen, signals, values, [f.name for f in assumed], name),
        chosen,
        signals,
        values,
        assumed,
        torque_at,
    )


def vehicle_of(
    machine: MachineClass,
    signals: Signals,
    known: Mapping[str, float],
    doubted: Collection[str],
    name: str = "",
    *,
    is_calibrated: bool = False,
) -> Vehicle:
    """The vehicle of known numbers [SI], the rest typical; the spread of the ``doubted`` fields goes into its uncertainty.

    ``is_calibrated``: a known wheel radius has no error. Raises InputError on impossible values.
    """
    typical = {field.name: field.typical for field in fields(machine, "torque", known) if field.typical}
    values = {field: spec.value for field, spec in typical.items()} | dict(known)
    tree = _tree(machine, values, name)
    if signals == "bus-speed":
        for part in (tree, *tree["axles"].values()):
            for key in ("wheel", "tire_rolling_resistance", "bearing_resistance"):
                part.pop(key, None)
        return Vehicle.from_dict(tree)
    spread = {field: typical[field].spread for field in doubted if field in typical}
    considered = _considered(Vehicle.from_dict(tree), machine, values, spread)
    if not is_calibrated and considered.get("wheel_radius", 0.0) < RADIUS_BY_TAPE:
        scale = considered.get("drive_torque_gain_common", 0.0)
        considered |= {
            "wheel_radius": RADIUS_BY_TAPE,
            "drive_torque_gain_common": float(np.hypot(scale, RADIUS_BY_TAPE)),
        }
    for field in (
        "drive_torque_gain", "drive_torque_offset", "drawbar_offset", "drawbar_force", "slope", "acceleration_bias",
    ):  # fmt: skip
        share = (
            known.get(field, typical[field].value if field in doubted else 0.0) if field in typical else 0.0
        )
        if share:
            considered[field] = float(np.hypot(considered.get(field, 0.0), share))
    if signals == "wheel-speeds":
        considered = {"wheel_radius": considered.get("wheel_radius", 0.0)}
    tree["uncertainty"] = {
        key: _digits(value) for key, value in considered.items() if value or key == "wheel_radius"
    }
    if signals == "torque" and not machine.tows:
        tree["uncertainty"]["drawbar_force"] = 0.0
    return Vehicle.from_dict(tree)


def _digits(value: float) -> float:
    return float(f"{value:.4g}")


def _tree(machine: MachineClass, values: Mapping[str, float], name: str) -> dict[str, Any]:
    """A vehicle file's content."""
    mass, radius = values["mass"], values["wheel_radius"]
    front = values.get("front_mass", mass)
    if front >= mass and len(machine.axles) > 1:
        raise InputError(
            f"{front:g} kg is no part of {mass:g} kg",
            place="front_mass",
            hint="give what the front axle carries at rest",
        )
    masses = [_digits(load) for load in _axle_masses(mass, front, len(machine.axles))]
    axles = {}
    for (key, own), load in zip(machine.axles.items(), masses, strict=True):
        axles[key] = {"mass": load, "wheels": list(own["wheels"])}
        axles[key] |= {name: own[name] for name in ("driven", "steered", "pivots") if name in own}
        if not own.get("driven", True) and values["bearing_resistance"]:
            axles[key]["bearing_resistance"] = 0.0  # it is of the geared drive, which a free wheel has not
    inertia = values["wheel_inertia"]
    tree: dict[str, Any] = {"name": name or machine.title, "mass": _digits(sum(masses))}
    for key in ("wheelbase", "track", "center_of_gravity_height", "hitch_height"):
        if key in values:
            tree[key] = _digits(values[key])
    if "payload_x" in values:
        tree["payload"] = {key: values[f"payload_{key}"] for key in ("x", "z") if f"payload_{key}" in values}
    wheel = {"radius": _digits(radius), "inertia": _digits(inertia)}
    if machine.has_small_front_wheels:
        small = values["front_wheel_radius"]
        own_inertia = inertia * masses[0] / masses[1] * (small / radius) ** 2
        axles["front"]["wheel"] = {"radius": _digits(small), "inertia": _digits(own_inertia)}
    return tree | {
        "axles": axles,
        "wheel": wheel,
        "tire_rolling_resistance": _digits(values["tire_rolling_resistance"]),
        "bearing_resistance": _digits(values["bearing_resistance"]),
    }


def _axle_masses(mass: float, front: float, axles: int) -> list[float]:
    """What each axle carries [kg]: the first its own, the others alike what is left."""
    return [mass] if axles == 1 else [front, *[(mass - front) / (axles - 1)] * (axles - 1)]


def _considered(
    vehicle: Vehicle, machine: MachineClass, values: Mapping[str, float], spread: Mapping[str, float]
) -> dict[str, float]:
    """What the doubts about a machine's numbers are to the constants that a vehicle file considers.

    An adhesion is torque over radius and load, so the errors of mass and radius are one of all torques' scale; the errors of lengths
    and of the axles' shares shift load between the axles, as at `WORK` and `PUSH`; the error of the inertia
    is a torque, at `PUSH`, and that of the bearings one of all wheels alike, at the class's speed.
    """
    relative = {name: value / values[name] for name, value in spread.items()}
    found: dict[str, float] = {}

    def widen(key: str, value: float) -> None:
        if value:
            found[key] = float(np.hypot(found.get(key, 0.0), value))

    radius = values["wheel_radius"]
    worst = max(
        relative.get(name, 0.0) for name in ("wheel_radius", "front_wheel_radius")
    )  # one spread for all wheels
    widen("wheel_radius", worst)
    widen("drive_torque_gain_common", worst)
    widen("drive_torque_gain_common", relative.get("mass", 0.0))
    widen("tire_rolling_resistance", spread.get("tire_rolling_resistance", 0.0))
    widen("drive_torque_offset", spread.get("wheel_inertia", 0.0) * PUSH * GRAVITY / radius)
    widen(
        "tire_rolling_resistance",
        spread.get("bearing_resistance", 0.0) * machine.speed * _turning_share(vehicle),
    )
    for name in ("front_mass", "wheelbase", "center_of_gravity_height", "hitch_height"):
        if name in spread:
            widen("vertical_load", _shift(vehicle, values, name, spread[name]))
    return found


def _turning_share(vehicle: Vehicle) -> float:
    """What a torque of 1 N m on each wheel is of its load times its radius: mean over the wheels [1/(N m)]."""
    loads = GRAVITY * vehicle.axle_mass / np.bincount(vehicle.wheel_axle)
    return float(np.mean(1 / (loads[list(vehicle.wheel_axle)] * np.array(vehicle.wheel_radius))))


def _shift(vehicle: Vehicle, values: Mapping[str, float], name: str, error: float) -> float:
    """Load that an error of a field moves between the axles, over the mean axle load, root of the mean square over some states."""
    axles = len(vehicle.axles)
    drawbar = np.array([0.0, WORK, WORK, 2 * WORK]) * vehicle.mass * GRAVITY
    acceleration = np.array([0.0, 0.0, PUSH, -PUSH]) * GRAVITY

    def front(changed: Mapping[str, float]) -> np.ndarray:
        loads = axle_loads(
            _axle_masses(vehicle.mass, changed["front_mass"], axles),
            np.linspace(changed["wheelbase"], 0.0, axles),
            center_of_gravity_height=changed["center_of_gravity_height"],
            hitch_height=changed.get("hitch_height", 0.0),
            drawbar=drawbar,
            acceleration=acceleration,
        )
        return loads[:, 0]

    moved = front({**values, name: values[name] + error}) - front(values)
    return float(np.sqrt(np.mean(moved**2))) / (vehicle.mass * GRAVITY / axles)
