"""Machines, grounds and drives of the second plant, drawn at random. The whole plant is held out (docs/families.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from second_plant.plant import Ground, Run, Waves, Work, pull_over_weight, run, static_loads, tyres
from second_plant.result import result_of
from second_plant.terramechanics import Soil, sinkage_under, soil_for, stresses
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import LOAD_VARIATION, MASSES, WORK, Kind, draw_speeds
from terragrip.simulation.family_machines import Machine, draw_machine
from terragrip.simulation.family_sensors import SENSORS, draw_faults, draw_sensors, uncertainty
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Robot, Scenario
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]

CURVE = "mujoco"
"""What stands for the family of curves in the kinds of this plant."""
TASKS = ("work", "healthy", "digging")
WORKING_SLIP = np.array([0.2])
TIPPED = 0.7
"""rad: a machine that tips over is drawn anew."""
SOFTNESS = (0.4, 0.9)
"""The most that soft ground bears, wheels dug in, over what is asked of it."""


_last: dict[tuple[Kind, int, str, float], Run] = {}  # the drive just made: often wanted at another rate


def kinds() -> tuple[Kind, ...]:
    """Decades of mass and sets of sensors of this plant."""
    return tuple(Kind(mass, CURVE, sensors) for mass in MASSES for sensors in SENSORS)


def machines(count: int, first_seed: int = 0) -> Iterator[tuple[Kind, int]]:
    """``count`` pairs (kind, seed) for :func:`draw`, kinds mixed."""
    listed = kinds()
    order = stream(0, "order second plant").permutation(len(listed))
    for k in range(count):
        yield listed[order[k % len(listed)]], first_seed + k


def draw(
    kind: Kind,
    seed: int,
    *,
    rate: float | None = None,
    faults: bool = False,
    task: str = "work",
    duration: float | None = None,
) -> SimulationResult:
    """One machine on its drive, as terragrip.simulation.families.draw gives it; arguments and errors as `drive`'s."""
    return result_of(*drive(kind, seed, rate=rate, faults=faults, task=task, duration=duration))


def drive(
    kind: Kind,
    seed: int,
    *,
    rate: float | None = None,
    faults: bool = False,
    task: str = "work",
    duration: float | None = None,
) -> tuple[Run, Scenario, Vehicle, int]:
    """What each channel truly was on a drive, the scenario, the vehicle as its user wrote it, and the seed of its sensors.
    Arguments and errors as `plan`'s. One that tips over is drawn anew."""
    planned = plan(kind, seed, rate=rate, faults=faults, task=task, duration=duration)
    which = (kind, seed, task, planned.scenario.duration)  # sensors and rate change nothing of it
    if which not in _last:
        _last.clear()
        _last[which] = run(*planned.drive)
    done = _last[which]
    if _tipped(done):
        return drive(
            kind,
            seed + 1_000_000,
            rate=rate,
            faults=faults,
            task=task,
            duration=planned.scenario.duration if task == "healthy" else None,
        )
    return done, planned.scenario, planned.scenario.nominal_vehicle(), seed


def another_drive(kind: Kind, seed: int, *, rate: float | None = None, duration: float) -> SimulationResult:
    """A healthy drive, on other ground, of the machine that `draw` puts to work on ``seed`` (its result's own: one that tips over has
    another). Ground on which it tips over is drawn anew. Arguments and errors as `plan`'s."""
    machine = _machine(stream(seed, f"second plant {kind} work"), kind.mass)
    for ground in range(1, 100):
        planned = plan(
            kind, seed, rate=rate, task="healthy", duration=duration, machine=machine, ground=ground
        )
        done = run(*planned.drive)
        if not _tipped(done):
            return result_of(done, planned.scenario, planned.scenario.nominal_vehicle(), seed)
    raise ValueError(f"{kind}, seed {seed}: the machine tips over on any ground")


def _tipped(done: Run) -> bool:
    return bool(max(np.abs(done["pitch"]).max(), np.abs(done["roll"]).max()) > TIPPED)


@dataclass(frozen=True)
class Plan:
    """A drive before it is driven: machine, sensors and speeds as a scenario holds them;
    ``vehicle`` that is driven, with its true ``radius``; the ground, the work, the time step [s]."""

    scenario: Scenario
    vehicle: Vehicle
    radius: Floats
    ground: Ground
    work: Work
    step: float

    @property
    def drive(self) -> tuple[Vehicle, Floats, Robot, Ground, Work, float]:
        """As `second_plant.plant.run` takes it."""
        return self.vehicle, self.radius, self.scenario.robot, self.ground, self.work, self.step


def plan(
    kind: Kind,
    seed: int,
    *,
    rate: float | None = None,
    faults: bool = False,
    task: str = "work",
    duration: float | None = None,
    machine: Machine | None = None,
    ground: int = 0,
) -> Plan:
    """One machine, its ground and its work.

    ``task``: work (speeds, pulls, curves, stops and starts), healthy (the same, rougher, for warnings) or digging (a steady command
    into soft ground, in which slip digs the wheels in). ``duration`` [s] and ``machine``, where not drawn; ``ground``: which of the
    seed's grounds and drives. Its scenario holds machine, sensors and drive; the ground is this plant's own.
    Raises ValueError on a kind or task that there is not.
    """
    if kind not in kinds() or task not in TASKS:
        raise ValueError(f"no such kind or task: {kind}, {task}")
    rng = stream(seed, f"second plant {kind} {task}" + (f" {ground}" if ground else ""))
    drawn = _machine(rng, kind.mass)
    machine = drawn if machine is None else machine
    tree, vehicle = _machine_tree(machine, seed, kind, rate)
    beat = np.sqrt(machine.scale)
    if task == "digging":
        duration = 60.0 * beat
    elif duration is None:
        duration = float(np.clip(90.0 * beat, 50.0, 150.0))
    towing = kind.sensors != "uncoupled" or task != "work"
    firm, asked, hills = _firm(rng, vehicle, machine, towing)
    if task == "digging":
        asked *= rng.uniform(0.4, 0.9)
    soils, digging = [firm], [machine.radius]
    if task == "digging":
        soils.append(_soft(rng, vehicle, asked))
        digging.append(machine.radius * rng.uniform(0.5, 2.0))
    elif towing:
        soils.append(_firm(rng, vehicle, machine, towing, least=asked + hills)[0])
        digging.append(machine.radius)
    if task == "digging":
        time, speed = np.array([0.0, 2.0, 3.0]) * beat, machine.speed * rng.uniform(0.6, 1.2)
        points = [[time[0], "off"], [time[1], 0.0], [time[2], speed], [duration, speed]]
    else:
        points = draw_speeds(rng, machine, duration)
    mix_at, mix = _mix(rng, machine, task, len(soils), speed_of=points)
    driven_over = Ground(
        soils=tuple(soils),
        mix_at=mix_at,
        mix=mix,
        digging=tuple(digging),
        roughness=_roughness(rng, vehicle, machine, firm, 1.5 if task == "healthy" else 1.0),
        hills=_hills(rng, hills / 2.5, rng.uniform(8.0, 20.0) * machine.scale),
        stiffness=_waves(rng, rng.uniform(0.03, 0.12), 2 * machine.radius, 15 * machine.radius, 12),
        strength=_waves(rng, rng.uniform(0.02, 0.08), 2 * machine.radius, 15 * machine.radius, 12),
    )
    turning = kind.sensors != "plain" and task != "digging" and rng.uniform() < 0.6
    work = _work(rng, machine, vehicle, points, asked if towing else 0.0, duration, turning, task)
    if "pitch" not in tree["sensors"]:  # how hilly the ground is, its user knows
        tree["vehicle"]["uncertainty"]["slope"] = max(0.0087, hills / 2.5)
    tree |= {
        "speed": points,
        "duration": duration,
        "faults": draw_faults(duration, machine, kind.sensors) if faults else [],
    }
    scenario = Scenario.from_dict(tree, file=tree["name"])
    error = scenario.robot.wheel_radius_sd * stream(seed, "wheel radius").standard_normal()
    radius = vehicle.wheel_radius * (1.0 + error)
    step = 1.0 / (200.0 * np.ceil(0.005 / (0.002 * beat)))
    return Plan(scenario, vehicle, radius, driven_over, work, float(step))


def _machine(rng: np.random.Generator, mass: str) -> Machine:
    """A machine that stands by itself: three wheels or more, not in line.

    Its axles' masses are what scales would show: with more than two axles, what a rigid body on even ground puts on each.
    """
    while True:
        machine = draw_machine(rng, MASSES[mass])
        if len(machine.wheels) >= 3 and 2 in machine.counts:
            break
    axles = len(machine.counts)
    if axles == 2:
        return machine
    at = np.linspace(1.0, 0.0, axles)
    centre = at @ np.array(machine.axle_mass) / machine.mass
    share = 1 / axles + (at - at.mean()) * (centre - at.mean()) / np.sum((at - at.mean()) ** 2)
    return replace(machine, axle_mass=tuple(float(s) * machine.mass for s in share))


def _machine_tree(
    machine: Machine, seed: int, kind: Kind, rate: float | None
) -> tuple[dict[str, Any], Vehicle]:
    """A scenario without its drive, and the vehicle."""
    tree: dict[str, Any] = {
        "name": f"{kind}-{seed}",
        "seed": seed,
        "vehicle": machine.vehicle(),
        "robot": machine.robot(),
        "soils": {
            "ground": {"curve": {"name": "exponential"}, "resistance": 0.0}
        },  # unused: this plant has its own
        "route": {"segments": [{"soil": "ground", "length": 1000.0}]},
    }
    tree["sensors"], tree["vehicle"]["sensors"] = draw_sensors(
        stream(seed, f"sensors {kind}"), kind.sensors, machine, rate
    )
    tree["vehicle"]["uncertainty"] = uncertainty(tree["sensors"], machine, 0.0087)
    return tree, Vehicle.from_dict(tree["vehicle"])


def _firm(
    rng: np.random.Generator, vehicle: Vehicle, machine: Machine, towing: bool, least: float = 0.12
) -> tuple[Soil, float, float]:
    """Ground that bears the work: the soil, pull over weight that tools may ask, and what hills may."""
    wheel, load = tyres(vehicle, vehicle.wheel_radius)[-1], float(static_loads(vehicle)[-1])
    pressure = load / (wheel.width * wheel.radius)
    wanted = least + 0.03
    while True:
        soil = soil_for(
            wheel,
            load,
            wheel.radius * float(np.exp(rng.uniform(np.log(0.003), np.log(0.02)))),
            exponent=rng.uniform(0.6, 1.1),
            exponent_slip=rng.uniform(0.0, 0.4),
            cohesion=pressure * rng.uniform(0.05, 0.8),
            friction=rng.uniform(0.45, 0.7),
            shear=wheel.radius * rng.uniform(0.02, 0.08),
        )
        bears = float(pull_over_weight(vehicle, soil, WORKING_SLIP)[0])
        if bears > wanted:
            break
        wanted *= 0.9  # a machine most of whose weight is on free wheels pulls little on any ground
    work = rng.uniform(*WORK) * bears
    hills = work * (rng.uniform(0.0, 0.3) if towing else rng.uniform(0.4, 0.8))
    return soil, work - hills, hills


def _soft(rng: np.random.Generator, vehicle: Vehicle, asked: float) -> Soil:
    """Loose ground (dry sand, snow) that cannot bear what is asked once the wheels have dug themselves in."""
    wheel, load = tyres(vehicle, vehicle.wheel_radius)[-1], float(static_loads(vehicle)[-1])
    pressure, slips = load / (wheel.width * wheel.radius), np.linspace(0.05, 0.7, 8)
    depth = rng.uniform(0.04, 0.12)
    constants = {
        "exponent": rng.uniform(0.8, 1.3),
        "exponent_slip": rng.uniform(0.4, 1.0),
        "cohesion": pressure * rng.uniform(0.0, 0.05),
        "friction": rng.uniform(0.4, 0.55),
        "shear": wheel.radius * rng.uniform(0.06, 0.15),
    }
    enough = asked * rng.uniform(*SOFTNESS)
    while True:
        soil = soil_for(wheel, load, depth * wheel.radius, **constants)
        if float(pull_over_weight(vehicle, soil, slips).max()) < enough or depth > 0.5:
            return soil
        depth *= 1.3


def _mix(
    rng: np.random.Generator, machine: Machine, task: str, soils: int, speed_of: list[list[Any]]
) -> tuple[Floats, Floats]:
    """Shares of the soils along the travel: a soft end behind a ramp, or firm soils that take turns over ramps."""
    if soils == 1:
        return np.array([0.0]), np.ones((1, 1))
    if task == "digging":
        start, ramp = (
            machine.speed * np.sqrt(machine.scale) * rng.uniform(8, 16),
            rng.uniform(0.6, 4.0) * machine.scale,
        )
        return np.array([0.0, start, start + ramp]), np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    at, shares, soil = [0.0], [[1.0, 0.0]], 0
    reach = 2 * machine.speed * float(speed_of[-1][0])
    while at[-1] < reach:
        stretch, ramp = rng.uniform(6, 15) * machine.scale, rng.uniform(0.3, 2.0) * machine.scale
        shares += [[1.0 - soil, float(soil)], [float(soil), 1.0 - soil]]
        at += [at[-1] + stretch, at[-1] + stretch + ramp]
        soil = 1 - soil
    return np.array(at), np.array(shares)


def _roughness(
    rng: np.random.Generator, vehicle: Vehicle, machine: Machine, soil: Soil, rough: float
) -> Waves:
    """Bumps of 1.5 to 12 radii whose warp of the machine moves 2 to 8 % of a wheel's load (``rough`` times that)."""
    wheel, load = tyres(vehicle, vehicle.wheel_radius)[-1], float(static_loads(vehicle)[-1])
    z = float(sinkage_under(soil, wheel, load, np.zeros(1))[0])
    near = stresses(soil, wheel, np.array([0.95 * z, 1.05 * z]), 0.0, 0.0)[:, :2].sum(axis=1)
    share = (
        0.5 if len(vehicle.wheels) > 3 else 1.0
    )  # three wheels stand on any ground: only shaking moves load
    height = rough * rng.uniform(*LOAD_VARIATION) * load * 0.1 * z / float(near[1] - near[0]) / share
    return _waves(rng, height, 1.5 * machine.radius, 12 * machine.radius, 28)


def _hills(rng: np.random.Generator, slope: float, length: float) -> Waves:
    """Hills of a slope's standard deviation [rad] along any heading, wavelengths about 2 pi ``length`` [m]."""
    waves = _waves(rng, 1.0, 4 * length, 9 * length, 10)
    size = np.hypot(waves.wave_x, waves.wave_y)
    return Waves(2 * slope / (size * np.sqrt(len(size))), waves.wave_x, waves.wave_y, waves.phase)


def _waves(rng: np.random.Generator, sd: float, shortest: float, longest: float, count: int) -> Waves:
    """A field of standard deviation ``sd``, wavelengths [m] spread evenly in their logarithm, heights as their root (ISO 8608)."""
    wavelength = np.exp(rng.uniform(np.log(shortest), np.log(longest), count))
    heading, phase = rng.uniform(0, np.pi, count), rng.uniform(0, 2 * np.pi, count)
    weight = np.sqrt(wavelength)
    amplitude = sd * np.sqrt(2.0) * weight / np.sqrt(np.sum(weight**2))
    wave = 2 * np.pi / wavelength
    return Waves(amplitude, wave * np.cos(heading), wave * np.sin(heading), phase)


def _work(
    rng: np.random.Generator, machine: Machine, vehicle: Vehicle, points: list[list[Any]], asked: float, duration: float,
    turning: bool, task: str,
) -> Work:  # fmt: skip
    time = np.array([float(point[0]) for point in points])
    speed = np.array([np.nan if point[1] == "off" else float(point[1]) for point in points])
    tightest = 1.0 / (rng.uniform(2.0, 6.0) * max(machine.track, machine.wheelbase))
    curvature = np.zeros(len(time))
    if turning:
        curvature = tightest * rng.choice([0.0, 0.0, 1.0, -1.0], len(time)) * rng.uniform(0.4, 1.0, len(time))
    weight, scale = vehicle.mass * STANDARD_GRAVITY, machine.scale
    usual = 1.0 if task == "digging" else rng.uniform(0.2, 0.6)
    at, force, x = [0.0], [usual * asked * weight], rng.uniform(2, 5) * scale
    reach = 2 * machine.speed * duration
    while x < reach and asked > 0 and task != "digging":
        ramp, stay, size = (
            rng.uniform(0.3, 2) * scale,
            rng.uniform(2, 6) * scale,
            (1 - usual) * rng.uniform(0.2, 1.0),
        )
        level = (usual + size) * asked * weight
        at += [x, x + ramp, x + ramp + stay, x + 2 * ramp + stay]
        force += [force[0], level, level, force[0]]
        x += 2 * ramp + stay + rng.uniform(1, 5) * scale
    draught_speed = 0.0 if task == "digging" else 0.2 / np.sqrt(scale)
    steers = len(set(machine.axle_radius)) > 1 or machine.counts[0] == 1 or rng.uniform() < 0.5
    return Work(time, speed, curvature, np.array(at), np.array(force), draught_speed, bool(steers), duration)
