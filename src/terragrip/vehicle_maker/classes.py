"""Classes of machine, and what is typical of each: value, spread, source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from terragrip.document import read_yaml
from terragrip.errors import InputError, suggestion
from terragrip.physics.loads import GRAVITY

_LONE = 0.3  # relative SD where one machine alone says what is typical (ours)
_LEAST = 0.05  # relative SD that a handful of machines cannot show a smaller one than (ours)


@dataclass(frozen=True)
class Typical:
    """What is typical of a class: ``value``, its standard deviation ``spread`` (both SI), and the ``source`` of both."""

    value: float
    spread: float
    source: str


@dataclass(frozen=True)
class MachineClass:
    """A class of machine: its ``name`` and ``title``, its axles as a vehicle file has them (without masses), whether it ``tows``, and
    its usual ``speed`` [m/s]."""

    name: str
    title: str
    axles: Mapping[str, Mapping[str, Any]]
    speed: float
    tows: bool
    data: Mapping[str, Any]

    @property
    def has_small_front_wheels(self) -> bool:
        """Whether the front wheels have a radius of their own."""
        return "front_radius_share" in self.data

    @property
    def carries(self) -> bool:
        """Whether it may have a tank or hopper, whose filling is part of its mass."""
        return bool(self.data.get("carries", False))

    def typical_mass(self) -> Typical:
        """Mass [kg] where the user does not know it."""
        return _relative(self.data["mass"])

    def typical(self, name: str, mass: float, radius: float | None = None) -> Typical:
        """What is typical of a field for a machine of a mass [kg]; ``radius`` [m] of its wheels, where the field hangs on it."""
        if name == "front_wheel_radius":
            return _relative(self.data["front_radius_share"], float(radius or 0))
        own = self.data.get(name)
        machines = self.data.get("from", {}).get(name)
        if machines and own is None:
            return self._by_machines(name, machines, mass, radius)
        own = own or _file()["common"][name]
        if "per_cube_root" in own:
            value = own["per_cube_root"] * float(np.cbrt(mass))
            return Typical(value, own["spread"] * value, own["source"])
        wheels = sum(len(axle["wheels"]) for axle in self.axles.values())
        load = mass * GRAVITY / wheels
        if name == "wheel_inertia":
            return _relative(own, mass / wheels * float(radius or 0) ** 2)
        if name == "bearing_resistance":
            return _relative(own, mass / wheels * float(np.cbrt(mass / 139)) ** 0.5)
        if name == "drive_torque_offset":
            return Typical(own["value"] * load * float(radius or 0), 0.0, own["source"])
        if name in ("drawbar_offset", "drawbar_force"):
            return Typical(own["value"] * mass * GRAVITY, 0.0, own["source"])
        return Typical(own["value"], own.get("spread", 0.0), own["source"])

    def _by_machines(self, name: str, machines: list[str], mass: float, radius: float | None) -> Typical:
        """Geometric mean over some machines, made dimensionless, and their scatter."""
        known = [_file()["machines"][machine] for machine in machines]
        if name == "wheel_inertia":
            unit = mass / 4 * float(radius or 0) ** 2
            shares = [m[name] / (m["mass"] / 4 * m["wheel_radius"] ** 2) for m in known]
        else:
            unit = float(np.cbrt(mass))
            shares = [m[name] / np.cbrt(m["mass"]) for m in known]
        logs = np.log(shares)
        scatter = max(float(np.std(logs, ddof=1)), _LEAST) if len(known) > 1 else _LONE
        value = float(np.exp(logs.mean())) * unit
        return Typical(value, scatter * value, "by similarity from " + ", ".join(m["is"] for m in known))


def _relative(own: Mapping[str, Any], unit: float = 1.0) -> Typical:
    value = own["value"] * unit
    return Typical(value, own["spread"] * value, own["source"])


@cache
def _file() -> dict[str, Any]:
    with resources.as_file(resources.files("terragrip.vehicle_maker") / "classes.yaml") as path:
        return dict(read_yaml(path).data)


def classes() -> tuple[MachineClass, ...]:
    """All classes."""
    return tuple(
        MachineClass(name, own["title"], own["axles"], own["speed"], own.get("tows", True), own)
        for name, own in _file()["classes"].items()
    )


def class_named(name: str) -> MachineClass:
    """The class of a name; raises InputError if there is none."""
    known = {one.name: one for one in classes()}
    if name not in known:
        hint = suggestion(name, known, f"classes are {', '.join(known)}")
        raise InputError(f"no class of machine {name!r}", place="--class", hint=hint)
    return known[name]
