"""Machines that benchmarks/bench_slip_control.py drives: families by part, the second plant, a tractor, the paper's robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from second_plant import draw as second
from second_plant.result import result_of
from second_plant.stepped import SteppedDrive as SecondDrive
from terragrip.simulation import SimulationResult, families, simulate
from terragrip.simulation.families import Kind
from terragrip.simulation.family_machines import ROBOT_MASS
from terragrip.simulation.family_sensors import SENSORS
from terragrip.simulation.library import set_runs
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.stepped import SteppedDrive
from terragrip.vehicle import Vehicle

PARTS = ("development", "held-out", "second-plant", "tractor", "campaign")
MASS, FRONT, INCH = 5400.0, 0.375, 0.0254
TRACTOR: Mapping[str, Any] = {
    "mass": MASS,
    "scale": float(np.cbrt(MASS / ROBOT_MASS)),
    "counts": (2, 2),
    "axle_mass": (FRONT * MASS, (1 - FRONT) * MASS),
    "axle_radius": (0.5 * (24 * INCH + 2 * 0.70 * 0.420), 0.5 * (38 * INCH + 2 * 0.70 * 0.520)),
    "driven": (True, True),
    "wheelbase": 1.89 * float(np.cbrt(MASS / 1844.0)),
}
"""John Deere 6900: 5.4 t (southernstar.ie, 7 July 2021), tyres 420/70R24 and 520/70R38 (John Deere manual OMAL161979), the radii as the
sizes say; 35 to 40 % on the front axle (manual OMAR178078, University of Wisconsin Extension). The wheelbase is that of a Massey Ferguson
20B by similarity; what is not here is drawn as for any tractor of the families."""


class Stepped(Protocol):
    """What both plants' drives in pieces have."""

    vehicle: Vehicle

    @property
    def ended(self) -> bool: ...
    def limit_torque(self, torque: float) -> None: ...
    def advance(self, seconds: float, rim_speed: float) -> Piece: ...


class Piece(Protocol):
    """What they give: columns by the names of terragrip.simulation's trace."""

    rows: NDArray[np.float64]
    radius: NDArray[np.float64]

    def __getitem__(self, name: str) -> NDArray[np.float64]: ...


@dataclass(frozen=True, order=True)
class Run:
    """A run of the paper's campaign, in the place of a kind."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Subject:
    """A machine on a task: its scenario, a fresh drive as often as it is called, and how a log of its work is made."""

    scenario: Scenario
    begin: Callable[[], Stepped]


def tasks(part: str) -> tuple[str, ...]:
    """What the machines of a part do: the campaign's fields have no ground that bears less than is asked."""
    return ("work",) if part == "campaign" else ("work", "digging")


def machines(part: str, count: int, first: int) -> Iterator[tuple[Kind | Run, int]]:
    """Kinds and seeds of a part; of the tractor one kind for each set of sensors in turn, soils by Brixius' cone index; of the campaign
    runs that tow, spread over all of them."""
    if part == "campaign":
        towing = [name for name in set_runs("campaign") if Scenario.load(name).tools]
        for k in range(count):
            yield Run(towing[k * len(towing) // count]), first + k
    elif part == "second-plant":
        yield from second.machines(count, first)
    elif part == "tractor":
        for k in range(count):
            yield Kind("tractor", "brixius", SENSORS[k % len(SENSORS)]), first + k
    else:
        yield from families.machines(part, count, first)  # type: ignore[arg-type]


def log_of(part: str, kind: Kind | Run, seed: int, rate: float) -> SimulationResult:
    """A work drive before; of the campaign the same run with another seed's ground and noise, as its scenario records it."""
    if isinstance(kind, Run):
        return simulate(Scenario.load(kind.name), seed + 1_000_000, machine_seed=seed)
    if part == "second-plant":
        run, scenario, vehicle, seed = second.drive(kind, seed, rate=rate)
        return result_of(run, scenario, vehicle, seed)
    return families.draw(kind, seed, rate=rate, known=TRACTOR if part == "tractor" else None)


def subject(part: str, kind: Kind | Run, seed: int, task: str) -> Subject:
    """The machine on its ground."""
    if isinstance(kind, Run):
        run = Scenario.load(kind.name)
        return Subject(run, lambda: SteppedDrive(run, seed))
    if part == "second-plant":
        plan = second.plan(kind, seed, task=task)
        return Subject(plan.scenario, lambda: SecondDrive(plan))
    known = TRACTOR if part == "tractor" else None
    scenario = families.scenario(kind, seed, task=task, known=known)  # type: ignore[arg-type]
    return Subject(scenario, lambda: SteppedDrive(scenario, seed))
