"""What the plant did, at any instant: the C trace with names, and the quantities that follow from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.simulation.terrain import Terrain
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

SCALARS = (
    "time", "position", "speed", "acceleration", "drawbar", "slope", "gradient_force", "assist", "body_pitch",
    "body_pitch_rate", "heave_acceleration", "curvature", "driver_mode", "command", "tool1_position", "tool1_speed",
    "tool1_draught", "tool2_position", "tool2_speed", "tool2_draught", "bar2", "spot1", "spot2", "spot3",
)  # fmt: skip
PER_AXLE = ("axle_load", "resistance")
PER_WHEEL = (
    "wheel_speed", "torque", "slip", "adhesion", "load", "hub_speed", "gradient", "height", "wheel_acceleration",
)  # fmt: skip
"""Columns of the trace in the order of plant.h: single ones, then one an axle, then one a wheel."""


@dataclass(frozen=True)
class Trace:
    """A run: ``rows`` (n, columns) at equal time steps, on a vehicle (true radius ``radius`` (wheels,)) and a ground."""

    rows: Floats
    vehicle: Vehicle
    radius: Floats
    terrain: Terrain
    wheel_mass: float
    tool_count: int

    def __getitem__(self, name: str) -> Floats:
        """A single column (n,), an axle column (n, axles) or a wheel column (n, wheels)."""
        axles, wheels = len(self.vehicle.axles), len(self.vehicle.wheels)
        if name in SCALARS:
            return self.rows[:, SCALARS.index(name)]
        if name in PER_AXLE:
            first = len(SCALARS) + axles * PER_AXLE.index(name)
            return self.rows[:, first : first + axles]
        first = len(SCALARS) + axles * len(PER_AXLE) + wheels * PER_WHEEL.index(name)
        return self.rows[:, first : first + wheels]

    def of_axles(self, name: str) -> Floats:
        """The sum of a wheel column over each axle's wheels (n, axles)."""
        members = np.eye(len(self.vehicle.axles))[self.vehicle.wheel_axle]
        return np.asarray(self[name] @ members)

    def at(self, times: Floats) -> Trace:
        """The trace at other instants (k,), linear between its rows, held beyond its ends."""
        step = self.rows[1, 0] - self.rows[0, 0]
        u = np.clip((times - self.rows[0, 0]) / step, 0.0, len(self.rows) - 1.0)
        low = np.minimum(u.astype(np.intp), len(self.rows) - 2)
        share = u - low
        near = np.rint(u).astype(np.intp)
        exact = np.abs(u - near) < 1e-6  # an instant of the trace itself: no arithmetic on NaN, no rounding
        rows = self.rows[low] * (1 - share)[:, None] + self.rows[low + 1] * share[:, None]
        rows[exact] = self.rows[near[exact]]
        rows[:, 0] = times
        return Trace(rows, self.vehicle, self.radius, self.terrain, self.wheel_mass, self.tool_count)

    @cached_property
    def rolling_force(self) -> Floats:
        """Rolling resistance force of each axle [N], signed against forward (n, axles)."""
        return self["resistance"] * self["axle_load"]

    @cached_property
    def specific_force(self) -> tuple[Floats, Floats]:
        """Specific force along and normal to the large-scale slope [m/s²], without the body's own pitch."""
        along = self["acceleration"] + STANDARD_GRAVITY * np.sin(self["slope"])
        return along, STANDARD_GRAVITY * np.cos(self["slope"]) + self["heave_acceleration"]

    @cached_property
    def wheel_force_x(self) -> Floats:
        """What a force sensor in each wheel's axle reads forward (n, wheels) [N]: F_h - F_s - m_w (dv/dt + g sinθ) (paper
        eq. 1), the ground's local gradient counted with the load."""
        inertial = self.wheel_mass * self.specific_force[0]
        axle = self.vehicle.wheel_axle
        rolling = (self.rolling_force / np.bincount(axle))[:, axle]
        climbing = self["gradient"] * self["load"]
        return self["adhesion"] * self["load"] - rolling - climbing - inertial[:, None]

    @cached_property
    def wheel_force_z(self) -> Floats:
        """What that sensor reads upward (n, wheels) [N]: the load without the wheel's own weight."""
        return self["load"] - (self.wheel_mass * self.specific_force[1])[:, None]

    @cached_property
    def points(self) -> dict[str, Floats]:
        """Positions along the path [m] of the axles, the centre of gravity and the tools (n,)."""
        x, vehicle = self["position"], self.vehicle
        ahead = zip(vehicle.axle_names, vehicle.axle_to_rear, strict=True)
        places = {axle: x + distance for axle, distance in ahead}
        places["center"] = x + vehicle.center_of_gravity_to_rear
        return places | {f"tool{k + 1}": self[f"tool{k + 1}_position"] for k in range(self.tool_count)}

    def cell(self, position: Floats) -> Ints:
        """Nearest grid point of the ground (n,)."""
        path = self.terrain.path
        return np.clip(np.rint((position - path.x[0]) / path.spacing), 0, len(path.x) - 1).astype(np.intp)

    @cached_property
    def location(self) -> tuple[Floats, Floats, Floats]:
        """East, north, altitude of the centre of gravity [m] (n,)."""
        path, x = self.terrain.path, self.points["center"]
        return (
            np.interp(x, path.x, path.east),
            np.interp(x, path.x, path.north),
            np.interp(x, path.x, self.terrain.altitude),
        )
