"""The plant in C, called from Python: a scenario's machine and ground in, a trace out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.loads import load_levers
from terragrip.simulation.chassis import warp_stiffness
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.terrain import CURVE_INTERVALS, Terrain
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle


@dataclass(frozen=True)
class Plant:
    """A machine on its ground, as C structures. ``kept`` holds the arrays that C only points to."""

    machine: Any
    ground: Any
    kept: tuple[Any, ...]


MAX_AXLES = 4


def check_layout(vehicle: Vehicle) -> None:
    """Raise InputError unless the plant knows the vehicle: up to four axles of one wheel, or of a left and a right one."""
    counts = {len(axle.wheels) for axle in vehicle.axles.values()}
    if len(vehicle.axles) > MAX_AXLES or not counts <= {1, 2} or (2 in counts and not vehicle.track):
        raise InputError(
            "only a vehicle of one to four axles, each with one wheel or with a left and a right one, can be simulated",
            place="vehicle",
            hint="give axles with one or two wheels each, and 'track:' where there are two",
        )


def _check_step(scenario: Scenario, vehicle: Vehicle) -> None:
    """Raise InputError where a spring or damper is too stiff for the explicit part of a step."""
    robot = scenario.robot
    corner = float(
        (vehicle.axle_mass[vehicle.wheel_axle] / np.bincount(vehicle.wheel_axle)[vehicle.wheel_axle]).min()
    )
    parts = [
        ("robot.tire_stiffness", robot.tire_stiffness + 4 * robot.chassis_torsion, robot.tire_damping, corner)
    ]
    for k, tool in enumerate(scenario.tools):
        parts.append((f"tools.{k}.stiffness", tool.stiffness, tool.damping, min(tool.mass, vehicle.mass)))
    for place, stiffness, damping, mass in parts:
        if scenario.step * max(np.sqrt(stiffness / mass), damping / mass) > 0.5:
            raise InputError(
                f"{stiffness:g} N/m with {damping:g} N s/m on {mass:g} kg is too stiff for steps of {scenario.step:g} s",
                file=scenario.name or None,
                place=place,
                hint="use a smaller 'step:', a softer spring or less damping",
            )


def make_plant(scenario: Scenario, vehicle: Vehicle, radius: Floats, terrain: Terrain) -> Plant:
    """The C structures of a scenario; ``radius`` (n,) [m] is the true one. Raises InputError on an unfit vehicle."""
    from terragrip.simulation._plant import ffi, lib

    check_layout(vehicle)
    _check_step(scenario, vehicle)
    kept: list[Any] = []

    def pointer(values: Any, kind: str = "double") -> Any:
        array = np.ascontiguousarray(values, dtype=np.float64 if kind == "double" else np.int32)
        handle = ffi.from_buffer(f"{kind}[]", array)
        kept.extend((array, handle))
        return ffi.cast(f"{kind} *", handle)

    ground = _ground(ffi, terrain, pointer)
    machine = _machine(ffi, lib, scenario, vehicle, radius)
    _tools(machine, scenario, terrain, pointer)
    _spots_and_driver(machine, scenario, len(vehicle.axles))
    speeds = np.array([np.nan if speed == "off" else float(speed) for _, speed in scenario.speed])
    machine.commands = len(speeds)
    machine.command_time = pointer([time for time, _ in scenario.speed])
    machine.command = pointer(speeds / float(vehicle.wheel_radius[0]))
    return Plant(machine, ground, tuple(kept))


def run(plant: Plant, duration: float, step: float, stride: int) -> Floats:
    """Integrate from rest at position 0; the trace (rows, columns of plant.h), a row every ``stride`` steps.

    Ends early where the path ends. Raises InputError where the motion diverges (springs too stiff for the step).
    """
    from terragrip.simulation._plant import ffi, lib

    steps = round(duration / step)
    trace = np.empty((steps // stride + 1, lib.plant_columns(plant.machine)))
    rows = ffi.new("int32_t *")
    status = lib.plant_run(
        plant.machine,
        plant.ground,
        0.0,
        step,
        steps,
        stride,
        ffi.cast("double *", ffi.from_buffer("double[]", trace)),
        rows,
    )
    if status == lib.PLANT_NOT_FINITE:
        raise InputError(
            f"the motion diverges after {rows[0] * stride * step:.3g} s",
            place="step",
            hint="use a smaller step or softer springs",
        )
    if status != lib.PLANT_OK:
        raise RuntimeError(f"the plant refused its arguments (status {status})")
    return trace[: rows[0]]


def _ground(ffi: Any, terrain: Terrain, pointer: Any) -> Any:
    ground = ffi.new("plant_ground *")
    ground.count = len(terrain.path.x)
    ground.start = float(terrain.path.x[0])
    ground.spacing = terrain.spacing
    ground.soils = len(terrain.names)
    ground.curve_intervals = CURVE_INTERVALS
    ground.curve = pointer(terrain.curve)
    for k, track in enumerate(terrain.tracks):
        ground.soil_from[k] = pointer(track.soils.start, "int32_t")
        ground.soil_to[k] = pointer(track.soils.end, "int32_t")
        ground.blend[k] = pointer(track.soils.blend)
        for name in ("adhesion_scale", "resistance", "slip_resistance", "elevation", "gradient"):
            getattr(ground, name)[k] = pointer(getattr(track, name))
    for i, variation in enumerate(terrain.load_variation):
        ground.load_variation[i] = pointer(variation)
    ground.slope = pointer(terrain.slope)
    ground.curvature = pointer(terrain.path.curvature)
    return ground


def _machine(ffi: Any, lib: Any, scenario: Scenario, vehicle: Vehicle, radius: Floats) -> Any:
    machine = ffi.new("plant_machine *")
    machine.mass = vehicle.mass
    machine.gravity = STANDARD_GRAVITY
    machine.rear_to_cg = vehicle.center_of_gravity_to_rear
    machine.cg_height = vehicle.center_of_gravity_height
    machine.hitch_height = vehicle.hitch_height
    machine.hitch_overhang = vehicle.hitch_overhang
    machine.tire_resistance = vehicle.tire_rolling_resistance
    machine.axles, machine.wheels = len(vehicle.axles), len(vehicle.wheels)
    levers = load_levers(vehicle.axle_to_rear)
    for a, share in enumerate(vehicle.axle_mass / vehicle.axle_mass.sum()):
        machine.axle_position[a], machine.axle_share[a] = float(vehicle.axle_to_rear[a]), float(share)
        machine.axle_lever[a] = float(levers[a])
    sides = vehicle.wheel_side
    level, leaning = vehicle.wheel_shares
    machine.steers = int(scenario.robot.steers)
    for i, row in enumerate(warp_stiffness(vehicle, scenario.robot.chassis_torsion)):
        for j, value in enumerate(row):
            machine.warp[lib.PLANT_WHEELS * i + j] = float(value)
    for i in range(len(vehicle.wheels)):
        machine.wheel_axle[i], machine.side[i] = int(vehicle.wheel_axle[i]), float(sides[i])
        machine.wheel_track[i] = int(sides[i] < 0)
        machine.wheel_share[i], machine.lateral_share[i] = float(level[i]), float(leaning[i])
        machine.command_ratio[i] = float(vehicle.wheel_radius[0] / vehicle.wheel_radius[i])
        machine.radius[i] = float(radius[i])
        machine.inertia[i] = float(vehicle.wheel_inertia[i])
        machine.bearing[i] = vehicle.wheel_bearing[i]
        machine.driven[i] = int(vehicle.driven[i])
    for name in (
        "tire_stiffness", "tire_damping", "resistance_length", "load_softening", "slip_speed", "wheel_rest_speed", "speed_gain",
        "speed_integral", "motor_lag", "antiwindup_time", "torque_limit", "power_limit",
    ):  # fmt: skip
        setattr(machine, name, getattr(scenario.robot, name))
    return machine


def _tools(machine: Any, scenario: Scenario, terrain: Terrain, pointer: Any) -> None:
    machine.tools = len(scenario.tools)
    for k, tool in enumerate(scenario.tools):
        out = machine.tool[k]
        out.mass, out.length, out.bar_slack = tool.mass, tool.length, tool.slack
        out.bar_stiffness, out.bar_damping = tool.stiffness, tool.damping
        out.draught_speed, out.shear_length = tool.draught_speed, tool.shear_length
        out.friction, out.dig_in = pointer(terrain.friction[k]), pointer(terrain.dig_in[k])


def _spots_and_driver(machine: Any, scenario: Scenario, axles: int) -> None:
    machine.spots = len(scenario.soft_spots)
    for k, spot in enumerate(scenario.soft_spots):
        out = machine.spot[k]
        out.position = np.nan if spot.at is None else spot.at
        out.time = 0.0 if spot.at_time is None else spot.at_time
        out.ahead, out.length, out.adhesion_loss = spot.ahead, spot.length, spot.adhesion_loss
        out.wear = spot.wear or 0.0
        out.edge = 0.5 if spot.edge is None else spot.edge / spot.length
        for name in ("sinkage", "sinkage_length", "loosening", "adhesion_fall"):
            setattr(out, name, getattr(spot, name))
        for a in range(axles):
            out.resistance[a] = spot.front if a == 0 else spot.rear
    driver, out = scenario.driver, machine.driver
    out.enabled = int(driver.acts)
    for name in (
        "stuck_ratio", "patience", "boost", "boost_time", "ease", "ease_time", "free_ratio", "free_time",
    ):  # fmt: skip
        setattr(out, name, getattr(driver, name))
    out.assist_rate, out.assist_limit = driver.push_rate, driver.push_limit
