"""Families of machines, grounds and sensors, and their split into development and held-out (docs/families.md) (R).

A kind says which decade of mass, which family of adhesion curves and which set of sensors; a seed draws the rest: layout,
dimensions, ground, work and drive. Everything follows the 139 kg robot of physics.md 8 by geometric similarity: with the length
scale L = (mass/139 kg)^(1/3), forces grow as L³, torques as L⁴, inertia as L⁵, speeds (Froude) and times as L^(1/2), each with spread.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any, Literal

import numpy as np

from terragrip.errors import InputError
from terragrip.simulation.family_machines import Machine, draw_machine, draw_rigid
from terragrip.simulation.family_sensors import SENSORS, draw_faults, draw_sensors, uncertainty
from terragrip.simulation.family_soils import SOILS_OF, NoSinkage, capacity, draw_soils
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.simulate import SimulationResult, simulate
from terragrip.units import STANDARD_GRAVITY

Tree = dict[str, Any]
Part = Literal["development", "held-out"]
Task = Literal["work", "healthy", "digging"]
Chassis = Literal["sprung", "rigid", "rolling"]
"""rigid: three to eight wheels on a chassis that hardly warps, over ground so uneven that much of a wheel's load goes to the others.
rolling: the same over hills that twist and bend under the wheels, which shifts loads for as long as a hill is (docs/decisions/0144)."""

MASSES: dict[str, tuple[float, float]] = {
    "light": (5.0, 50.0),
    "robot": (50.0, 500.0),
    "compact": (500.0, 5000.0),
    "tractor": (5000.0, 12000.0),
}
"""Mass [kg] from and to, by name."""
CURVES = tuple(SOILS_OF)
"""Families of adhesion curves: see :mod:`terragrip.simulation.family_soils`."""
HELD_OUT: dict[str, str] = {"mass": "compact", "curve": "peaking", "sensors": "coarse"}
"""The split, by kind (docs/families.md): a machine with any of these is held out, and so is the whole second plant
(benchmarks/second_plant). Nothing is tuned on held-out machines."""

LOAD_VARIATION = (0.02, 0.08)
"""Relative standard deviation of a wheel's load, from and to, over about 1.25 wheel radii."""
UNEVEN = (0.15, 0.75)
"""Of a rigid machine's ground: standard deviation of its height over what the static load yields the tyre, from and to."""
SOFTENING = (0.0, 0.3)
"""Power of the load by which adhesion at a slip falls, from and to: Brixius' at mobility numbers from 80 down to 20."""
WORK = (0.45, 0.8)
"""Share of what the ground bears at 20 % of slip that tools and hills together ask for at most, from and to."""
SOFTNESS = (0.9, 1.4)
"""What a soft spot asks for over what it bears, before wheels sink in by slip."""


@dataclass(frozen=True, order=True)
class Kind:
    """What kind of machine, ground and sensors: a name of ``MASSES``, of ``CURVES``, of ``SENSORS`` and of ``CHASSIS``."""

    mass: str
    curve: str
    sensors: str
    chassis: Chassis = "sprung"

    @property
    def part(self) -> Part:
        """The part of the split that the kind belongs to."""
        return (
            "held-out"
            if any(getattr(self, key) == value for key, value in HELD_OUT.items())
            else "development"
        )

    def __str__(self) -> str:
        return f"{self.mass}-{self.curve}-{self.sensors}" + (
            "" if self.chassis == "sprung" else f"-{self.chassis}"
        )


def kinds(part: Part | None = None, chassis: Chassis = "sprung") -> tuple[Kind, ...]:
    """All kinds on a chassis, or those of one part of the split."""
    every = (Kind(*names, chassis) for names in product(MASSES, CURVES, SENSORS))
    return tuple(kind for kind in every if part in (None, kind.part))


def machines(
    part: Part, count: int, first_seed: int = 0, chassis: Chassis = "sprung"
) -> Iterator[tuple[Kind, int]]:
    """``count`` pairs (kind, seed) for :func:`draw`: the kinds of a part in an order that mixes them, a seed each.

    The order is the same whatever ``first_seed`` is; masses, curves and sensors are each spread evenly over any first few.
    """
    listed = kinds(part, chassis)
    order = stream(0, f"order {part}").permutation(len(listed))
    spread = sorted(range(len(listed)), key=lambda k: (_seen_before(listed, order, k), k))
    for k in range(count):
        yield listed[order[spread[k % len(listed)]]], first_seed + k


def _seen_before(listed: tuple[Kind, ...], order: Any, k: int) -> int:
    """How often the mass and the curve of the k-th of the shuffled kinds came before it, the larger of the two."""
    kind = listed[order[k]]
    before = [listed[j] for j in order[:k]]
    return max(sum(b.mass == kind.mass for b in before), sum(b.curve == kind.curve for b in before))


def draw(
    kind: Kind,
    seed: int,
    *,
    rate: float | None = None,
    faults: bool = False,
    task: Task = "work",
    duration: float | None = None,
    known: Mapping[str, Any] | None = None,
) -> SimulationResult:
    """One machine of a kind on its drive: the recording, the truth, and the vehicle as its user wrote it.

    ``rate`` [1/s] (of the wheel speeds; default: drawn) and ``faults`` (gaps, spikes, jitter, held values and an outage of the
    ground speed, all in one log) change what is recorded, not the machine, its ground and its drive. ``task``: work (speeds,
    pulls, curves, stops and starts), healthy (the same, rougher and with hits, for warnings) or digging (a steady command
    into a soft spot that bears less than is asked, in which slip digs the wheels in). ``duration`` [s] of work and healthy drives,
    where not drawn. ``known``: fields of the `Machine` that are not drawn, as those of a certain tractor. Raises InputError on a kind
    that there is not.
    """
    made = scenario(kind, seed, rate=rate, faults=faults, task=task, duration=duration, known=known)
    return simulate(made, seed)


def scenario(
    kind: Kind,
    seed: int,
    *,
    rate: float | None = None,
    faults: bool = False,
    task: Task = "work",
    duration: float | None = None,
    known: Mapping[str, Any] | None = None,
) -> Scenario:
    """The scenario that :func:`draw` simulates. Raises as it does."""
    if kind not in kinds(chassis=kind.chassis):
        raise InputError(f"no such kind {kind}", hint="choose one of families.kinds()")
    rng = stream(seed, f"family {kind}")
    rigid = kind.chassis != "sprung"
    drawn = draw_rigid(rng, MASSES[kind.mass]) if rigid else draw_machine(rng, MASSES[kind.mass])
    machine = replace(drawn, **(known or {}))
    soils, spots = draw_soils(rng, kind.curve, machine)
    towing = kind.sensors != "uncoupled" or task != "work"
    turning = kind.sensors != "plain" and rng.uniform() < 0.5 and task != "digging"
    beat = float(np.sqrt(machine.scale))  # what a second is to the robot
    work = rng.uniform(*WORK)
    bears = {name: work * capacity(soil, spots) for name, soil in soils.items()}
    hills = min(bears.values()) * (rng.uniform(0.0, 0.35) if towing else rng.uniform(0.5, 1.0))
    soft: list[Tree] = []
    if task == "digging":
        soils = {"soil1": soils["soil1"]}
        hills *= 0.3
        asked = rng.uniform(0.1, 0.6) * capacity(soils["soil1"], spots)
        soft = [draw_soft_spot(rng, machine, soils["soil1"], spots, asked)]
        level = machine.speed * rng.uniform(0.6, 1.3)
        duration = 13.0 * beat + 15.0 * machine.scale / level
        speed: list[list[Any]] = [[0.0, "off"], [2 * beat, 0.0], [3 * beat, level], [duration, level]]
    else:
        duration = duration or float(np.clip(90.0 * beat, 50.0, 150.0))
        speed = draw_speeds(rng, machine, duration)
    length = 1.1 * sum(0.5 * (b[1] + a[1]) * (b[0] - a[0]) for a, b in pairwise(speed[1:]))
    length += 5 * machine.wheelbase + machine.scale
    if rigid:
        for soil in soils.values():
            soil["roughness"] = rng.uniform(*UNEVEN) * machine.deflection
    if task == "healthy":
        for soil in soils.values():
            soil["roughness"] *= 2.0
    tools: list[Tree] = []
    if task == "digging":
        pull = asked * machine.mass / (0.4 * machine.mass)
        tools = [_tool_body(machine, 0.4 * machine.mass) | {"friction": {"soil1": pull}}]
    elif towing:
        tools = [_tool(rng, machine, bears, length, hills, hits=task == "healthy")]
    name = f"{kind}-{seed}" if task == "work" else f"{kind}-{task}-{seed}"
    tree: Tree = {
        "name": name,
        "seed": seed,
        "vehicle": machine.vehicle(),
        "robot": {
            **machine.robot(),
            **({"load_softening": rng.uniform(*SOFTENING)} if rigid else _load_variation(rng, machine)),
            "steers": True,
        },
        "soils": soils,
        "soft_spots": spots(length) + soft,
        "route": {
            **_route(rng, machine, list(soils), length, turning),
            "slope": {
                "sd": hills / 2.5,
                "length": rng.uniform(8.0, 20.0) * machine.scale,
                "twists": kind.chassis == "rolling",
            },
        },
        "tools": tools,
        "speed": speed,
        "duration": duration,
        "driver": {"acts": False},
        "step": machine.step,
    }
    noise = stream(seed, f"family sensors {kind}")
    tree["sensors"], tree["vehicle"]["sensors"] = draw_sensors(noise, kind.sensors, machine, rate)
    slope = (
        0.0087 if "pitch" in tree["sensors"] else max(0.0087, hills / 2.5)
    )  # how hilly it is, a user knows
    tree["vehicle"]["uncertainty"] = uncertainty(tree["sensors"], machine, slope)
    tree["faults"] = draw_faults(duration, machine, kind.sensors) if faults else []
    return Scenario.from_dict(tree, file=name)


def _load_variation(rng: np.random.Generator, machine: Machine) -> Tree:
    return {"load_variation": rng.uniform(*LOAD_VARIATION), "load_variation_length": 1.25 * machine.radius}


def draw_soft_spot(
    rng: np.random.Generator, machine: Machine, soil: Tree, spots: NoSinkage, asked: float
) -> Tree:
    """A soft spot 7 m ahead (for the robot, as all lengths here) that bears less than ``asked`` (pull over weight) of a soil."""
    bears, scale = capacity(soil, spots), machine.scale
    resistance = float(soil["resistance"])
    loss, softness, share = rng.uniform(0.05, 0.35), rng.uniform(*SOFTNESS), rng.uniform(0.3, 0.7)
    added = max(softness * (bears + resistance) * (1 - loss) - resistance - asked, 0.0)
    length = rng.uniform(3.0, 8.0) * scale
    alone = len(machine.counts) == 1
    return {
        "at": 7.0 * scale + 0.5 * length,
        "length": length,
        "edge": rng.uniform(0.2, 0.5) * length,
        "front": added if alone else 2 * share * added,
        "rear": added if alone else 2 * (1 - share) * added,
        "sinkage": rng.uniform(0.2, 1.0),
        "sinkage_length": rng.uniform(0.4, 1.5) * scale,
        "loosening": rng.uniform(1.0, 3.0),
        "adhesion_loss": loss,
        "adhesion_fall": rng.uniform(0.1, 0.5),
    }


def draw_speeds(rng: np.random.Generator, machine: Machine, duration: float) -> list[list[Any]]:
    """Commanded rim speeds: motors off, levels held with ramps between, at times a stop, a rest and a start."""
    beat = np.sqrt(machine.scale)
    points: list[list[Any]] = [[0.0, "off"], [2.0 * beat, 0.0]]
    time = 2.0 * beat
    while time < duration:
        ramp, hold = rng.uniform(0.4, 2.0) * beat, rng.uniform(5, 14) * beat
        level = machine.speed * rng.uniform(0.5, 1.3)
        points += [[time + ramp, level], [time + ramp + hold, level]]
        time += ramp + hold
        if rng.uniform() < 0.25:
            stop, rest = rng.uniform(0.4, 1.5) * beat, rng.uniform(1, 3) * beat
            points += [[time + stop, 0.0], [time + stop + rest, 0.0]]
            time += stop + rest
    return points


def _route(
    rng: np.random.Generator, machine: Machine, names: list[str], length: float, turning: bool
) -> Tree:
    """The way over the soils: straight, or in legs whose headings swing about east, over strips of soil across it."""
    border = 2.0 * machine.radius
    stretch = max(rng.uniform(8, 16) * machine.scale, 3 * border)
    count = max(int(np.ceil(length / stretch)), len(names))
    order = [names[k % len(names)] for k in range(count)]
    if not turning:
        segments = [{"soil": soil, "length": stretch} for soil in order]
        return {"segments": segments, "border": border, "skew": 0.5 * machine.radius}
    points, heading = [[0.0, 0.0]], 0.0
    travelled = 0.0
    while travelled < length:
        leg = rng.uniform(8, 20) * machine.scale
        heading = float(np.clip(heading + rng.uniform(-1.4, 1.4), -1.1, 1.1))
        points.append([points[-1][0] + leg * np.cos(heading), points[-1][1] + leg * np.sin(heading)])
        travelled += leg
    wide = travelled + 10.0 * machine.scale
    strips = [
        {
            "soil": soil,
            "corners": [
                [k * stretch, -wide], [(k + 1) * stretch, -wide], [(k + 1) * stretch, wide], [k * stretch, wide],
            ],
        }
        for k, soil in enumerate(order)
    ]  # fmt: skip
    turn_radius = rng.uniform(1.5, 4.0) * max(machine.track, machine.wheelbase, 2 * machine.radius)
    return {
        "path": points,
        "around": names[0],
        "plots": strips,
        "border": border,
        "turn_radius": float(turn_radius),
    }


def _tool(
    rng: np.random.Generator,
    machine: Machine,
    bears: dict[str, float],
    length: float,
    hills: float,
    hits: bool,
) -> Tree:
    """A towed tool: friction that leaves each soil room for hills, and draught that comes and goes along the way.

    ``bears``: pull over weight that may be asked of each soil. ``hits``: short ones on roots and stones besides.
    """
    spare = {name: max(pull - hills, 0.02) for name, pull in bears.items()}
    usual, mass = rng.uniform(0.15, 0.5), machine.mass * rng.uniform(0.25, 0.6)
    weight, scale = machine.mass * STANDARD_GRAVITY, machine.scale
    most = (1 - usual) * min(spare.values()) * weight
    points, x = [[0.0, 0.0]], rng.uniform(2, 5) * scale
    while x < length:
        ramp, stay, size = (
            rng.uniform(0.3, 2) * scale,
            rng.uniform(2, 6) * scale,
            most * rng.uniform(0.2, 1.0),
        )
        if hits and rng.uniform() < 0.4:
            ramp, stay, size = (
                rng.uniform(0.02, 0.08) * scale,
                rng.uniform(0.01, 0.04) * scale,
                weight * rng.uniform(0.06, 0.2),
            )
        points += [[x, 0.0], [x + ramp, size], [x + ramp + stay, size], [x + 2 * ramp + stay, 0.0]]
        x += 2 * ramp + stay + rng.uniform(1, 5) * scale
    slack = rng.uniform(0.0, 0.04) * scale
    return _tool_body(machine, mass) | {
        "friction": {name: usual * share * machine.mass / mass for name, share in spare.items()},
        "added": points,
        "draught_speed": 0.2 / np.sqrt(scale),
        "slack": slack,
    }


def _tool_body(machine: Machine, mass: float) -> Tree:
    scale = machine.scale
    return {
        "mass": mass,
        "length": machine.tool_length,
        "shear_length": 0.01 * scale,
        "slack": 0.0,
        "stiffness": 600.0 * mass / scale,
        "damping": 13.0 * mass / np.sqrt(scale),
    }
