"""Machines drawn at random: layout and dimensions by geometric similarity with the robot of physics.md 8 (R)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from terragrip.units import STANDARD_GRAVITY

Tree = dict[str, Any]

ROBOT_MASS = 139.0  # kg, at length scale 1
TIRE_STIFFNESS, CHASSIS_TORSION = 2300.0, 43.0  # N/m a kg on the wheel, likewise
LAYOUTS: tuple[tuple[float, tuple[int, ...]], ...] = (
    (0.22, (2,)),
    (0.38, (2, 2)),
    (0.10, (2, 2, 2)),
    (0.08, (2, 2, 2, 2)),
    (0.06, (1,)),
    (0.07, (1, 1)),
    (0.09, (1, 2)),
)
"""Share of the machines, and the wheels on each axle, front to rear."""


@dataclass(frozen=True)
class Machine:
    """One machine; lengths [m], masses [kg], times [s]. ``scale`` is its length over the robot's."""

    scale: float
    mass: float
    counts: tuple[int, ...]
    axle_mass: tuple[float, ...]
    axle_radius: tuple[float, ...]
    driven: tuple[bool, ...]
    inertia_share: float
    wheelbase: float
    track: float
    cg_height: float
    hitch_height: float
    hitch_overhang: float
    tool_length: float
    speed: float
    tire_resistance: float
    bearing: float
    stiffness: float
    torsion: float
    control: float
    motor_lag: float
    radius_error: float

    @property
    def radius(self) -> float:
        """Mean wheel radius [m]."""
        return float(np.average(self.axle_radius, weights=self.counts))

    @property
    def corner_mass(self) -> float:
        """Mass over each wheel, in the mean [kg]."""
        return self.mass / sum(self.counts)

    @property
    def deflection(self) -> float:
        """What the static load yields a tyre [m]."""
        return STANDARD_GRAVITY * self.scale / (TIRE_STIFFNESS * self.stiffness)

    @property
    def drawbar_offset(self) -> float:
        """Spread of the drawbar cell's zero [N]: .2 % of the weight, as the robot's 3 N."""
        return 0.0216 * self.mass

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels, front to rear: number of the axle, and the side where there are two."""
        return tuple(name for k, count in enumerate(self.counts) for name in _names(k, count))

    @property
    def step(self) -> float:
        """Time step [s]: what is 1 ms to the robot, in steps that divide its rows."""
        wanted = 1e-3 * np.sqrt(self.scale)
        return next((step for step in (1e-3, 5e-4) if step <= wanted * 1.05), 2.5e-4)

    def vehicle(self) -> Tree:
        """The vehicle file, without sensors and uncertainty."""
        names = (
            ["front", "rear"] if len(self.counts) == 2 else [f"axle{k + 1}" for k in range(len(self.counts))]
        )
        axles = {
            name: {
                "mass": self.axle_mass[k],
                "wheels": list(_names(k, count)),
                "driven": self.driven[k],
                "wheel": {
                    "radius": self.axle_radius[k],
                    "inertia": self.inertia_share * self.axle_mass[k] / count * self.axle_radius[k] ** 2,
                    "width": max(0.5 * self.axle_radius[k], 0.006),
                    "mass": 0.16 * self.axle_mass[k] / count,
                },
            }
            for k, (name, count) in enumerate(zip(names, self.counts, strict=True))
        }
        tree: Tree = {
            "name": f"{self.mass:.0f} kg, {len(self.counts)} axles",
            "mass": self.mass,
            "center_of_gravity_height": self.cg_height,
            "hitch_height": self.hitch_height,
            "hitch_overhang": self.hitch_overhang,
            "tool_length": self.tool_length,
            "axles": axles,
            "tire_rolling_resistance": self.tire_resistance,
            "bearing_resistance": self.bearing,
        }
        if len(self.counts) > 1:
            tree["wheelbase"] = self.wheelbase
        if 2 in self.counts:
            tree["track"] = self.track
        return tree

    def robot(self) -> Tree:
        """What a scenario holds besides the vehicle file: tyres, motors, control, all scaled."""
        corner, scale, beat = self.corner_mass, self.scale, np.sqrt(self.scale)
        return {
            "wheel_mass": 0.16 * corner,
            "tire_stiffness": TIRE_STIFFNESS * corner / scale * self.stiffness,
            "tire_damping": 17.0 * corner / beat * np.sqrt(self.stiffness),
            "chassis_torsion": CHASSIS_TORSION * corner / scale * self.torsion,
            "resistance_length": 0.02 * scale,
            "slip_speed": min(0.05 * beat, 0.2),
            "wheel_rest_speed": 0.02 / beat,
            "speed_gain": 0.58 * corner * scale * beat * self.control,
            "speed_integral": 2.9 * corner * scale * self.control,
            "motor_lag": self.motor_lag,
            "antiwindup_time": 0.1 * beat,
            "torque_limit": 6.0 * corner * 9.8 * self.radius,
            "power_limit": 20.0 * self.mass * self.speed,
            "wheel_radius_sd": self.radius_error,
        }


def draw_machine(rng: np.random.Generator, mass_range: tuple[float, float]) -> Machine:
    """A machine of a mass [kg] uniform in its logarithm from and to, the rest by similarity with spread."""
    low, high = mass_range
    mass = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    scale = float(np.cbrt(mass / ROBOT_MASS))
    shares = np.array([share for share, _ in LAYOUTS])
    counts = LAYOUTS[int(rng.choice(len(LAYOUTS), p=shares / shares.sum()))][1]
    axles = len(counts)

    def near(value: float, spread: float = 0.15) -> float:
        return float(value * np.exp(spread * np.clip(rng.standard_normal(), -2, 2)))

    radius = near(0.2 * scale)
    unequal = axles == 2 and rng.uniform() < 0.45
    radii = (radius * rng.uniform(0.6, 0.85), radius) if unequal else (radius,) * axles
    share = np.array(counts) * np.exp(rng.uniform(-0.25, 0.25, axles))
    share = share / share.sum()
    if axles == 2:  # about a third to a half on the front axle, as tractors and robots have it
        front = rng.uniform(0.33, 0.5)
        share = np.array([front, 1 - front])
    drives = [True] * axles
    if axles == 2 and (counts[0] == 1 or unequal) and rng.uniform() < 0.4:
        drives[0] = False  # steered and free
    wheelbase = near(0.638 * scale) * (1.0 + 0.45 * max(axles - 2, 0)) if axles > 1 else 0.0
    wheelbase = max(wheelbase, 1.1 * sum(radii)) if axles > 1 else 0.0
    cg_height = near(0.3 * scale)
    hitch = near(0.25 * scale)
    if axles > 1:  # pull and hills may take no more than about half of the front axle's load
        cg_height = min(cg_height, 0.5 * wheelbase)
        hitch = min(hitch, 0.9 * float(share[0]) * wheelbase)
    inertia_share = float(np.exp(rng.uniform(np.log(0.03), np.log(0.15))))
    return Machine(
        scale=scale,
        mass=mass,
        counts=counts,
        axle_mass=tuple(float(s) * mass for s in share),
        axle_radius=tuple(float(r) for r in radii),
        driven=tuple(drives),
        inertia_share=inertia_share,
        wheelbase=wheelbase,
        track=max(near(0.554 * scale), 0.03),
        cg_height=cg_height,
        hitch_height=hitch,
        hitch_overhang=near(0.1 * scale),
        tool_length=near(2.0 * scale),
        speed=float(0.5 * np.sqrt(scale) * np.exp(rng.uniform(np.log(0.6), np.log(2.2)))),
        tire_resistance=rng.uniform(0.01, 0.04),
        bearing=near(0.0576 * mass / sum(counts) * np.sqrt(scale), 0.4),
        stiffness=rng.uniform(0.6, 1.6),
        torsion=rng.uniform(0.0, 4.0),
        control=rng.uniform(0.4, 1.5),
        motor_lag=float(0.01 * np.sqrt(scale) * np.exp(rng.uniform(np.log(0.5), np.log(4.0)))),
        radius_error=rng.uniform(0.004, 0.012),
    )


def draw_rigid(rng: np.random.Generator, mass_range: tuple[float, float]) -> Machine:
    """A machine of three wheels or more whose chassis resists warp four times as stiffly as a tyre the ground."""
    machine = draw_machine(rng, mass_range)
    while sum(machine.counts) < 3:
        machine = draw_machine(rng, mass_range)
    return replace(machine, torsion=TIRE_STIFFNESS * machine.stiffness / CHASSIS_TORSION)


def _names(axle: int, count: int) -> tuple[str, ...]:
    return (f"{axle + 1}",) if count == 1 else (f"{axle + 1}l", f"{axle + 1}r")
