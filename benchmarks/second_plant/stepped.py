"""A drive of the second plant in pieces, so that a controller can set the wheels' speed between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from second_plant.draw import Plan
from second_plant.native import native
from second_plant.plant import PER_WHEEL, SCALARS, Run, stood

Floats = NDArray[np.float64]
SAME = {"drawbar": "pull", "position": "travel"}
"""Columns of a trace of terragrip.simulation by the names that this plant has for them."""


@dataclass(frozen=True)
class Piece(Run):
    """Rows of one piece, by the names of a trace of terragrip.simulation too."""

    def __getitem__(self, name: str) -> Floats:
        return super().__getitem__(SAME.get(name, name))


class SteppedDrive:
    """A plan's machine at rest at the start of its way, as `terragrip.simulation.stepped.SteppedDrive`; its own speed commands and
    curves do not count. ``vehicle``: as its user wrote it."""

    ended = False

    def __init__(self, plan: Plan) -> None:
        self.vehicle = plan.scenario.nominal_vehicle()
        still = replace(plan.work, time=np.zeros(1), speed=np.zeros(1), curvature=np.zeros(1))
        self._ffi, self._lib = native()
        self._step, self._radius, self._ground = plan.step, plan.radius, plan.ground
        self._there = stood(plan.vehicle, plan.radius, plan.scenario.robot, plan.ground, still, plan.step)
        self._memory = self._ffi.new("sp_memory *")
        there = self._there
        if self._lib.sp_begin(there.model, there.state, there.machine, there.settle, self._memory) < 0:
            raise RuntimeError("the motion diverges while the machine settles")

    def limit_torque(self, torque: float) -> None:
        """Each wheel's torque is at most this from now on [N m]."""
        self._there.machine.torque_limit = torque

    def advance(self, seconds: float, rim_speed: float) -> Piece:
        """Drive on with a commanded rim speed [m/s]; a row each time step. Raises RuntimeError where the motion diverges."""
        self._there.machine.command[0] = rim_speed
        steps = max(round(seconds / self._step), 1)
        rows = np.empty((steps, len(SCALARS) + len(self.vehicle.wheels) * len(PER_WHEEL)))
        out = self._ffi.cast("double *", self._ffi.from_buffer("double[]", rows))
        there = self._there
        count = self._lib.sp_continue(there.model, there.state, there.machine, self._memory, steps, 1, out)
        if count < 0:
            raise RuntimeError("the motion diverges")
        return Piece(rows[:count], self._radius, self._ground)
