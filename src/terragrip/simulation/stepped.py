"""A simulated drive in pieces, so that a controller can set the wheels' speed between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.simulation import plant, terrain
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.simulate import true_radius
from terragrip.simulation.trace import Trace


class SteppedDrive:
    """A scenario's machine at rest at the start of its way; its own speed commands do not count.

    ``vehicle``: as its user wrote it. Raises InputError as `simulate` does.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        from terragrip.simulation._plant import ffi, lib

        self.vehicle = scenario.nominal_vehicle()
        plant.check_layout(self.vehicle)
        self._scenario, self._ffi, self._lib = scenario, ffi, lib
        self._radius = true_radius(scenario, self.vehicle, seed)
        self._ground = terrain.build(scenario, self.vehicle, seed)
        self._plant = plant.make_plant(scenario, self.vehicle, self._radius, self._ground)
        self._time, self._command = np.zeros(1), np.zeros(1)
        self._held: list[Any] = [ffi.from_buffer("double[]", x) for x in (self._time, self._command)]
        machine = self._plant.machine
        machine.commands = 1
        machine.command_time, machine.command = (ffi.cast("double *", one) for one in self._held)
        self._memory = ffi.new("plant_memory *")
        if lib.plant_begin(machine, self._plant.ground, 0.0, self._memory) != lib.PLANT_OK:
            raise RuntimeError("the plant refused its arguments")

    @property
    def ended(self) -> bool:
        """Whether the way is at its end."""
        return bool(self._memory.ended)

    def limit_torque(self, torque: float) -> None:
        """Each wheel's torque is at most this from now on [N m]."""
        self._plant.machine.torque_limit = torque

    def advance(self, seconds: float, rim_speed: float) -> Trace:
        """Drive on with a commanded rim speed [m/s], by the vehicle file's radius; a trace row each time step (steps,).

        Raises InputError where the motion diverges.
        """
        self._command[0] = rim_speed / float(self.vehicle.wheel_radius[0])
        step = self._scenario.step
        steps = max(round(seconds / step), 1)
        rows = np.empty((steps, self._lib.plant_columns(self._plant.machine)))
        count = self._ffi.new("int32_t *")
        out = self._ffi.cast("double *", self._ffi.from_buffer("double[]", rows))
        status = self._lib.plant_continue(
            self._plant.machine, self._plant.ground, self._memory, step, steps, 1, out, count
        )
        if status != self._lib.PLANT_OK:
            raise InputError("the motion diverges", place="step", hint="use a smaller step or softer springs")
        tools, mass = len(self._scenario.tools), self._scenario.robot.wheel_mass
        return Trace(rows[: count[0]], self.vehicle, self._radius, self._ground, mass, tools)
