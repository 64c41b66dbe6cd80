"""The rigid bodies: a MuJoCo model of a machine whose wheels turn on hinges, nothing else; forces come from drive.c."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A compiled model, and where things are from the chassis' centre of mass [m]: wheels (n, 3) and the hitch (3,)."""

    model: Any
    wheels: Floats
    hitch: Floats
    height: float


def wheel_masses(vehicle: Vehicle) -> Floats:
    """Mass of each wheel [kg], as heavy as its inertia lets a disc of its radius be, at most a tenth of its load."""
    axle = vehicle.wheel_axle
    carried = (vehicle.axle_mass / np.bincount(axle))[axle]
    return np.minimum(2 * vehicle.wheel_inertia / vehicle.wheel_radius**2, 0.1 * carried)


def make_body(vehicle: Vehicle, radius: Floats, step: float) -> Body:
    """The model of a vehicle with true wheel radii (n,) [m], integrated in steps of ``step`` [s]. All six degrees of the chassis
    are free, so it must stand on three wheels at least that are not in line."""
    import mujoco

    masses, n = wheel_masses(vehicle), len(vehicle.wheels)
    at = np.stack([vehicle.axle_to_rear[vehicle.wheel_axle], vehicle.wheel_side, radius], axis=1)
    whole = np.array([vehicle.center_of_gravity_to_rear, 0.0, vehicle.center_of_gravity_height])
    chassis = vehicle.mass - masses.sum()
    centre = (vehicle.mass * whole - masses @ at) / chassis
    length, width = (
        (vehicle.wheelbase or 0.0) + 2 * radius.mean(),
        (vehicle.track or 0.0) + 0.5 * radius.mean(),
    )
    height = 1.2 * vehicle.center_of_gravity_height
    box = chassis / 12 * np.array([width**2 + height**2, length**2 + height**2, length**2 + width**2])
    joints = "".join(
        f'<joint name="{name}" type="{kind}" axis="{axis}"/>'
        for name, kind, axis in (
            ("x", "slide", "1 0 0"), ("y", "slide", "0 1 0"), ("z", "slide", "0 0 1"),
            ("heading", "hinge", "0 0 1"), ("nod", "hinge", "0 1 0"), ("roll", "hinge", "1 0 0"),
        )
    )  # fmt: skip
    turning = vehicle.wheel_radius * vehicle.bearing_resistance
    parts = []
    for i in range(n):
        place = " ".join(f"{v:.12g}" for v in at[i] - centre)
        across = 0.5 * vehicle.wheel_inertia[i] + masses[i] * radius[i] ** 2 / 30
        parts.append(
            f'<body name="wheel{i}" pos="{place}"><joint type="hinge" axis="0 1 0" damping="{turning[i]:.12g}"/>'
            f'<inertial pos="0 0 0" mass="{masses[i]:.12g}" diaginertia="{across:.12g} {vehicle.wheel_inertia[i]:.12g} {across:.12g}"/>'
            "</body>"
        )
    text = (
        f'<mujoco><option timestep="{step:.12g}" gravity="0 0 {-STANDARD_GRAVITY}"><flag contact="disable" constraint="disable"/>'
        f'</option><compiler balanceinertia="false" boundmass="0"/><worldbody><body name="chassis">{joints}'
        f'<inertial pos="0 0 0" mass="{chassis:.12g}" diaginertia="{box[0]:.12g} {box[1]:.12g} {box[2]:.12g}"/>'
        f"{''.join(parts)}</body></worldbody></mujoco>"
    )
    hitch = np.array([-vehicle.hitch_overhang, 0.0, vehicle.hitch_height]) - centre
    return Body(mujoco.MjModel.from_xml_string(text), at - centre, hitch, float(centre[2]))
