"""A drive of the second plant: machine, ground and work in, what every channel truly was out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from second_plant.body import make_body
from second_plant.native import native
from second_plant.terramechanics import Soil, Wheel, sinkage_under, steady, stresses, table
from terragrip.simulation.scenario import Robot
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]

LOG_RATE = 200.0
SCALARS = (
    "time", "x", "y", "speed", "acceleration", "pull", "specific_x", "specific_y", "specific_z", "rate_x", "rate_y", "rate_z",
    "pitch", "roll", "heading", "travel", "last_soil", "load_sum", "resistance_sum", "forward_normal", "off", "aside",
)  # fmt: skip
PER_WHEEL = (
    "wheel_speed",
    "torque",
    "adhesion",
    "load",
    "resistance",
    "hub_speed",
    "sinkage",
    "felt_slip",
    "dug_slip",
)


@dataclass(frozen=True)
class Waves:
    """A field in the plane as a sum of cosines: amplitude, wave vector [1/m] and phase, (k,) each."""

    amplitude: Floats
    wave_x: Floats
    wave_y: Floats
    phase: Floats


@dataclass(frozen=True)
class Ground:
    """Soils, their shares at points of the travel [m] (points, soils), and fields: heights [m], relative stiffness and strength.

    ``digging`` [m] by soil: the rim's travel over which a wheel digs itself in.
    """

    soils: tuple[Soil, ...]
    mix_at: Floats
    mix: Floats
    digging: tuple[float, ...]
    roughness: Waves
    hills: Waves
    stiffness: Waves
    strength: Waves


@dataclass(frozen=True)
class Work:
    """Speed command of the rims [m/s] (NaN: motors off until the next point) and curvature [1/m] by time [s]; draught [N] by
    travel [m], its growth with speed [s/m]; whether the front axle steers (else sides differ in speed); duration [s]."""

    time: Floats
    speed: Floats
    curvature: Floats
    draught_at: Floats
    draught: Floats
    draught_speed: float
    steers: bool
    duration: float


@dataclass(frozen=True)
class Run:
    """A drive's rows at LOG_RATE; ``radius`` (wheels,) [m] is the true one; ``ground``: what it drove on."""

    rows: Floats
    radius: Floats
    ground: Ground

    def __getitem__(self, name: str) -> Floats:
        """A single column (n,) or one a wheel (n, wheels), by the names of SCALARS and PER_WHEEL."""
        if name in SCALARS:
            return self.rows[:, SCALARS.index(name)]
        return self.rows[:, len(SCALARS) + PER_WHEEL.index(name) :: len(PER_WHEEL)]


def static_loads(vehicle: Vehicle) -> Floats:
    """Load of each wheel at rest on level ground (n,) [N]."""
    axle = vehicle.wheel_axle
    return (vehicle.axle_mass / np.bincount(axle))[axle] * STANDARD_GRAVITY


def tyres(vehicle: Vehicle, radius: Floats) -> tuple[Wheel, ...]:
    """Each wheel's radius and width."""
    return tuple(
        Wheel(float(r), w.width or 0.5 * float(r)) for r, w in zip(radius, vehicle.wheel_data, strict=True)
    )


def pull_over_weight(vehicle: Vehicle, soil: Soil, slip: Floats) -> Floats:
    """What the whole machine can pull on level ground at a slip (n,), over its weight; free wheels only resist."""
    adhesion, resistance, driven = curves(vehicle, soil, slip)
    return driven * adhesion - (1 - driven) * vehicle.tire_rolling_resistance - resistance


def curves(vehicle: Vehicle, soil: Soil, slip: Floats) -> tuple[Floats, Floats, float]:
    """In steady motion at a slip (n,) on level ground: the driven wheels' adhesion by load (n,), what the soil holds all wheels back with
    over the weight (n,), free wheels rolling without slip, and the driven wheels' share of the weight. Loads are those at rest."""
    pulling, resisting, carried = np.zeros(len(slip)), np.zeros(len(slip)), 0.0
    same = Counter(
        zip(
            tyres(vehicle, vehicle.wheel_radius),
            static_loads(vehicle).tolist(),
            vehicle.driven.tolist(),
            strict=True,
        )
    )
    for (wheel, load, driven), count in same.items():
        adhesion, resistance, _ = steady(soil, wheel, load, slip if driven else np.zeros(len(slip)))
        resisting += count * load * resistance
        if driven:
            pulling += count * load * adhesion
            carried += count * load
    weight = vehicle.mass * STANDARD_GRAVITY
    return pulling / carried, resisting / weight, carried / weight


def run(vehicle: Vehicle, radius: Floats, robot: Robot, ground: Ground, work: Work, step: float) -> Run:
    """Drive it. ``radius`` (n,) [m] is the true one; ``robot`` holds motors and control. Raises RuntimeError where the motion
    diverges."""
    ffi, lib = native()
    there = stood(vehicle, radius, robot, ground, work, step)
    stride = round(1.0 / (LOG_RATE * step))
    steps = round(work.duration / step)
    rows = np.empty((steps // stride + 1, len(SCALARS) + len(vehicle.wheels) * len(PER_WHEEL)))
    count = lib.sp_run(
        there.model, there.state, there.machine, there.settle, steps, stride,
        ffi.cast("double *", ffi.from_buffer("double[]", rows)),
    )  # fmt: skip
    if count < 0:
        raise RuntimeError(f"the motion diverges after {(-count - 1) / LOG_RATE:.2f} s")
    return Run(rows[:count], radius, ground)


@dataclass(frozen=True)
class Stood:
    """A machine put on its ground, as drive.h takes it: C pointers, seconds to ``settle``, and ``kept``, what must live as long."""

    model: Any
    state: Any
    machine: Any
    settle: float
    kept: list[Any]


def stood(vehicle: Vehicle, radius: Floats, robot: Robot, ground: Ground, work: Work, step: float) -> Stood:
    """The machine at the start of its way; arguments as `run` has them."""
    import mujoco

    ffi, lib = native()
    body = make_body(vehicle, radius, step)
    data = mujoco.MjData(body.model)
    kept: list[Any] = [body, data]
    machine = ffi.new("sp_machine *")
    _fill(ffi, machine, vehicle, radius, robot, body, kept)
    _lay(ffi, machine, vehicle, radius, ground, kept)
    _work(ffi, machine, work, vehicle, kept)
    out = ffi.new("double[3]")
    heights = []
    for i, place in enumerate(body.wheels):
        lib.sp_ground(machine, place[0], place[1], out)
        wheel = tyres(vehicle, radius)[i]
        heights.append(
            out[0]
            - float(sinkage_under(ground.soils[0], wheel, float(static_loads(vehicle)[i]), np.zeros(1))[0])
        )
    data.qpos[2] = body.height + float(np.mean(heights))
    settle = 3.0 * np.sqrt(radius.mean() / 0.2)
    model, state = (ffi.cast("void *", one._address) for one in (body.model, data))
    return Stood(model, state, machine, float(settle), kept)


def _pointer(ffi: Any, kept: list[Any], values: Any) -> Any:
    array = np.ascontiguousarray(values, dtype=np.float64)
    handle = ffi.from_buffer("double[]", array)
    kept.extend((array, handle))
    return ffi.cast("double *", handle)


def _fill(
    ffi: Any, machine: Any, vehicle: Vehicle, radius: Floats, robot: Robot, body: Any, kept: list[Any]
) -> None:
    n, sides = len(vehicle.wheels), vehicle.wheel_side
    machine.wheels, machine.base_dofs, machine.chassis_body = n, 6, 1
    for i in range(n):
        machine.wheel_body[i], machine.radius[i] = 2 + i, radius[i]
        machine.inertia[i], machine.side[i] = vehicle.wheel_inertia[i], sides[i]
        machine.ahead[i] = vehicle.axle_to_rear[vehicle.wheel_axle[i]]
        machine.driven[i] = int(vehicle.driven[i])
    machine.tire_resistance = vehicle.tire_rolling_resistance
    machine.rest_speed = robot.wheel_rest_speed * float(radius.mean())
    machine.wheelbase, machine.mass = vehicle.wheelbase or 0.0, vehicle.mass
    for name in (
        "speed_gain",
        "speed_integral",
        "motor_lag",
        "antiwindup_time",
        "torque_limit",
        "power_limit",
    ):
        setattr(machine, name, getattr(robot, name))
    for k in range(3):
        machine.hitch[k] = body.hitch[k]


def _lay(ffi: Any, machine: Any, vehicle: Vehicle, radius: Floats, ground: Ground, kept: list[Any]) -> None:
    wheels, loads = tyres(vehicle, radius), static_loads(vehicle)
    machine.soils, machine.mixes = len(ground.soils), len(ground.mix_at)
    machine.mix_at, machine.mix = _pointer(ffi, kept, ground.mix_at), _pointer(ffi, kept, ground.mix)
    for k, soil in enumerate(ground.soils):
        out = machine.soil[k]
        made = {wheel: table(soil, wheel) for wheel in set(wheels)}
        pointers = {wheel: _pointer(ffi, kept, values) for wheel, (values, _) in made.items()}
        out.sinkages, out.slips, out.depths = next(iter(made.values()))[0].shape[:3]
        for i, wheel in enumerate(wheels):
            out.deepest[i], out.table[i] = made[wheel][1], pointers[wheel]
        out.lateral = 0.8 * float(np.tan(soil.friction)) + 0.1
        out.digging_length = ground.digging[k]
    for i, (wheel, load) in enumerate(zip(wheels, loads, strict=True)):
        z = float(sinkage_under(ground.soils[0], wheel, float(load), np.zeros(1))[0])
        near = stresses(ground.soils[0], wheel, np.array([0.95 * z, 1.05 * z]), 0.0, 0.0)[:, :2].sum(axis=1)
        stiffness = float(near[1] - near[0]) / (0.1 * z)
        machine.relaxation[i] = wheel.radius * float(np.arccos(1 - z / wheel.radius))
        machine.normal_damping[i] = 0.6 * np.sqrt(stiffness * load / STANDARD_GRAVITY)
        shear = 3.0 * load / machine.relaxation[i]
        machine.shear_damping[i] = 0.4 * np.sqrt(shear * vehicle.wheel_inertia[i]) / wheel.radius
    machine.lateral_length = machine.relaxation[0]
    for name in ("roughness", "hills", "stiffness", "strength"):
        waves, out = getattr(ground, name), getattr(machine, name)
        out.count = len(waves.amplitude)
        for key in ("amplitude", "wave_x", "wave_y", "phase"):
            setattr(out, key, _pointer(ffi, kept, getattr(waves, key)))


def _work(ffi: Any, machine: Any, work: Work, vehicle: Vehicle, kept: list[Any]) -> None:
    for i in range(len(vehicle.wheels)):
        machine.steered[i] = int(work.steers and vehicle.wheel_axle[i] == 0)
    machine.commands = len(work.time)
    machine.command_time, machine.command = _pointer(ffi, kept, work.time), _pointer(ffi, kept, work.speed)
    machine.curvature = _pointer(ffi, kept, work.curvature)
    machine.draughts = len(work.draught_at)
    machine.draught_at, machine.draught = (
        _pointer(ffi, kept, work.draught_at),
        _pointer(ffi, kept, work.draught),
    )
    beat = np.sqrt(vehicle.wheel_radius.mean() / 0.2)
    machine.draught_speed, machine.draught_lag, machine.draught_floor = (
        work.draught_speed,
        0.1 * beat,
        0.03 * beat,
    )
