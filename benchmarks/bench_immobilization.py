"""Is a vehicle's getting stuck foretold, and how often for nothing? On simulated drives that nothing was tuned on.

    python benchmarks/bench_immobilization.py [--seeds 3000 3019] [--write]

Drives into soft spots and rough but healthy ones (terragrip.simulation.soft_spots), for each seed on the paper's prototype
curve and on one that peaks and falls, as seen by four sets of sensors. A full stop: ground speed first under 0.03 m/s with
turning wheels, by the truth. A warning counts from its start; missed: none before the full stop, once the spot has begun;
a vehicle that never gets that far says nothing about spots.
False: a warning on a healthy drive, where the machine did not stop within LATER seconds; of a drive on which it got stuck
by itself, only what is earlier than that counts, as time too. --write puts the table into docs/events.md.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from marked import put
from terragrip.estimation import estimate
from terragrip.ground.events import events
from terragrip.simulation import SimulationResult, simulate
from terragrip.simulation.soft_spots import CURVES, healthy_drive, soft_spot_drive

KINDS = ("spot", "healthy")
SENSORS: dict[str, dict[str, Any]] = {
    "100 Hz, drawbar cell": {},
    "100 Hz": {"drawbar": False},
    "10 Hz": {"rate": 10.0, "drawbar": False},
    "50 Hz, ground speed 2 Hz": {"rate": 50.0, "drawbar": False, "ground_rate": 2.0},
}
STOPPED, TURNING = 0.03, 0.15  # m/s of ground and rim
SPOT = 6.0  # m: here the spot may begin
LATER = 8.0  # s
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/events.md"
BEGIN = "<!-- made by benchmarks/bench_immobilization.py --write -->"


@dataclass
class Tally:
    """What the warnings of one set of sensors on one curve were worth."""

    leads: list[float] = field(default_factory=list)
    missed: int = 0
    passed: int = 0
    passed_warned: int = 0
    false: int = 0
    seconds: float = 0.0

    def add(self, other: Tally) -> None:
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def row(self) -> list[str]:
        leads = np.array(self.leads)
        return [
            str(len(leads) + self.missed),
            str(self.missed),
            f"{np.median(leads):.1f}" if len(leads) else "–",
            f"{np.quantile(leads, 0.1):.1f}" if len(leads) else "–",
            f"{self.passed_warned} of {self.passed}",
            f"{self.seconds / 60:.0f}",
            str(self.false),
            f"{self.false / max(self.seconds, 1.0) * 1800:.1f}",
        ]


@dataclass(frozen=True)
class Course:
    """What befell a vehicle, by the truth [s]: its first full stop (NaN: none), where the spot may begin (infinite: never
    reached) and the end."""

    stop: float
    begun: float
    end: float


def course_of(truth: pd.DataFrame) -> Course:
    """A full stop: it first stands with turning wheels."""
    wheels = [c for c in truth if c.startswith("true_wheel_speed_")]
    time, distance = truth["time"].to_numpy(), truth["true_distance"].to_numpy()
    rim = 0.2 * truth[wheels].abs().mean(axis=1).to_numpy()
    held = (truth["true_ground_speed"].to_numpy() < STOPPED) & (rim > TURNING) & (distance > 2.0)
    reached = distance > SPOT
    return Course(
        stop=float(time[np.argmax(held)]) if held.any() else np.nan,
        begun=float(time[np.argmax(reached)]) if reached.any() else np.inf,
        end=float(time[-1]),
    )


def judge(kind: str, course: Course, starts: list[float]) -> Tally:
    """Warnings that start at ``starts`` [s], on a drive into a spot or a healthy one."""
    if kind == "healthy":
        end = course.end if np.isnan(course.stop) else course.stop - LATER
        return Tally(false=sum(t < end for t in starts), seconds=max(end, 0.0))
    starts = [t for t in starts if t > course.begun]
    if np.isinf(course.begun) or course.stop < course.begun:
        return Tally()  # it never got there
    if np.isnan(course.stop):
        return Tally(passed=1, passed_warned=int(bool(starts)))
    before = [t for t in starts if t < course.stop]
    return Tally(leads=[course.stop - before[0]]) if before else Tally(missed=1)


def simulated(kind: str, seed: int, curve: str, sensors: dict[str, Any]) -> SimulationResult:
    """A drive into a soft spot, or a healthy one; healthy ones of even seeds with faults."""
    scenario = (
        soft_spot_drive(seed, curve, **sensors)
        if kind == "spot"
        else healthy_drive(seed, curve, faults=seed % 2 == 0, **sensors)
    )
    return simulate(scenario, seed)


def score(job: tuple[int, str, str]) -> Tally:
    """One seed, curve and set of sensors."""
    seed, curve, name = job
    tally = Tally()
    for kind in KINDS:
        result = simulated(kind, seed, curve, SENSORS[name])
        found = events(estimate(result.recording, result.vehicle))
        starts = [event.start for event in found if event.kind == "immobilization"]
        tally.add(judge(kind, course_of(result.truth), starts))
    return tally


def table(tallies: dict[tuple[str, str], Tally]) -> str:
    head = [
        "sensors",
        "curve",
        "stops",
        "missed",
        "lead, median (s)",
        "lead, 10 % (s)",
        "warned of the passed",
    ]
    head += ["healthy (min)", "false", "false in 30 min"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    total = Tally()
    for (name, curve), tally in tallies.items():
        total.add(tally)
        lines.append("| " + " | ".join([name, curve, *tally.row()]) + " |")
    lines.append("| " + " | ".join(["**all**", "", *total.row()]) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=(3000, 3019), metavar=("FIRST", "LAST"))
    parser.add_argument("--sensors", nargs="*", default=list(SENSORS), choices=list(SENSORS))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into docs/events.md")
    arguments = parser.parse_args()
    seeds = range(arguments.seeds[0], arguments.seeds[1] + 1)
    jobs = [(seed, curve, name) for name in arguments.sensors for curve in CURVES for seed in seeds]
    tallies: dict[tuple[str, str], Tally] = {}
    with ProcessPoolExecutor(arguments.workers) as pool:
        for (_, curve, name), tally in zip(jobs, pool.map(score, jobs), strict=True):
            tallies.setdefault((name, curve), Tally()).add(tally)
    text = table(tallies)
    print(text)
    if arguments.write:
        put(DOCUMENT, BEGIN, f"Seeds {arguments.seeds[0]} to {arguments.seeds[1]}.\n\n{text}")


if __name__ == "__main__":
    main()
