"""Is a vehicle's getting stuck foretold, how early, and how often for nothing? On random machines, and on made-up snow runs.

    python benchmarks/bench_immobilization.py [--part development held-out] [--machines 150] [--seed 0] [--rates 100 10]
                                              [--snow] [--workers 1] [--write]

Machines: terragrip.simulation.families, without a drawbar cell. Each drives into a soft spot (family_stops), and its own rough but healthy
drive with loads, hills, stops and starts; at every rate. --snow: the runs of snow_runs.py instead, which are development too.
A stop, by the truth: ground speed first under 5 % of the commanded speed with turning rims. Missed: no warning between the spot's begin
and the stop. Lead: from the warning's begin to the stop, in seconds and in lengths of the vehicle travelled meanwhile. Late: `stuck` is
flagged later than half a second after the stop. False: every warning that begins on a healthy drive (one that stops by itself counts up
to LATER before that), or before the spot. Bounds are of 95 %: Wilson's of a share, the exact ones of a Poisson rate and of a median.
--write puts the table into docs/events.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binom, chi2

import snow_runs
from marked import put
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.engine import EVENTS
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import Kind, machines
from terragrip.simulation.family_stops import healthy_drive, stop_drive
from terragrip.vehicle import Vehicle

WARNED, STUCK = EVENTS.index("immobilization"), EVENTS.index("stuck")
CREEP, TURNING = 0.05, 0.2  # of the commanded speed: slower is a stop, where the rims are faster
LATER = 8.0  # s
IN_TIME = 0.5  # s
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/events.md"
BEGIN = "<!-- made by benchmarks/bench_immobilization.py --write: {part} -->"


@dataclass
class Tally:
    """What the warnings of one kind of drive were worth: leads [s] and in vehicle lengths, speeds [m/s] before those stops."""

    leads: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    missed: int = 0
    late: int = 0
    false: int = 0
    seconds: float = 0.0

    def add(self, other: Tally) -> None:
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def row(self) -> list[str]:
        stops = len(self.leads) + self.missed
        slow = [lead for lead, speed in zip(self.leads, self.speeds, strict=True) if speed <= 1.0]
        rate = [x / max(self.seconds, 1.0) * 1800 for x in poisson_bounds(self.false)]
        return [
            str(stops),
            f"{self.missed} ({_percent(wilson(self.missed, stops))})",
            _median(self.leads),
            _median(slow),
            f"{np.quantile(self.leads, 0.1):.1f}" if self.leads else "–",
            f"{np.median(self.lengths):.1f}" if self.lengths else "–",
            str(self.late),
            f"{self.seconds / 3600:.1f}",
            f"{self.false}",
            f"{self.false / max(self.seconds, 1.0) * 1800:.2f} ({rate[0]:.2f} to {rate[1]:.2f})",
        ]


HEAD = (
    "stops",
    "missed (%)",
    "lead (s)",
    "lead up to 1 m/s (s)",
    "lead, 10 % (s)",
    "lead (lengths)",
    "`stuck` late",
)
HEAD += ("healthy (h)", "false", "false in 30 min")


def wilson(hits: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's bounds of a share."""
    if of == 0:
        return 0.0, 1.0
    p, scale = hits / of, 1 + z**2 / of
    half = z * np.sqrt(p * (1 - p) / of + z**2 / (4 * of**2)) / scale
    middle = (p + z**2 / (2 * of)) / scale
    return max(float(middle - half), 0.0), float(middle + half)


def poisson_bounds(count: int) -> tuple[float, float]:
    """Exact 95 % bounds of a Poisson mean (Garwood)."""
    low = float(chi2.ppf(0.025, 2 * count)) / 2 if count else 0.0
    return low, float(chi2.ppf(0.975, 2 * count + 2)) / 2


def _percent(share: tuple[float, float]) -> str:
    return f"{100 * share[0]:.1f} to {100 * share[1]:.1f}"


def _median(values: list[float]) -> str:
    """Median and its distribution-free 95 % bounds."""
    if len(values) < 6:
        return "–"
    ranked = np.sort(values)
    low = int(binom.ppf(0.025, len(values), 0.5))
    return f"{np.median(values):.2f} ({ranked[max(low - 1, 0)]:.2f} to {ranked[min(len(values) - low, len(values) - 1)]:.2f})"


@dataclass(frozen=True)
class Course:
    """What befell a vehicle, by the truth: time [s] and travel [m] of its rows, its first stop (NaN: none), where the soft ground
    begins (infinite: never reached), its speed before, its length [m]."""

    time: NDArray[np.float64]
    distance: NDArray[np.float64]
    stop: float
    begun: float
    speed: float
    length: float


def length_of(vehicle: Vehicle) -> float:
    """Wheelbase, of one axle three wheel radii [m]."""
    return float(np.ptp(vehicle.axle_to_rear)) or 3 * float(np.mean(vehicle.wheel_radius))


def course_of(truth: pd.DataFrame, vehicle: Vehicle, spot: float) -> Course:
    """``spot`` [m]: where the ground becomes soft; infinite on a healthy drive."""
    rims = [
        radius * truth[f"true_wheel_speed_{wheel}"].abs()
        for wheel, radius, driven in zip(vehicle.wheels, vehicle.wheel_radius, vehicle.driven, strict=True)
        if driven
    ]
    rim, speed = np.mean(rims, axis=0), truth["true_ground_speed"].abs().to_numpy()
    time, distance = truth["time"].to_numpy(), truth["true_distance"].to_numpy()
    level, length = float(np.quantile(rim, 0.9)), length_of(vehicle)
    held = (speed < CREEP * level) & (rim > TURNING * level) & (distance > length)
    reached = distance > spot - length
    return Course(
        time=time,
        distance=distance,
        stop=float(time[np.argmax(held)]) if held.any() else np.nan,
        begun=float(time[np.argmax(reached)]) if reached.any() else np.inf,
        speed=level,
        length=length,
    )


def begins(estimates: Estimates, code: int) -> list[float]:
    """When each spell of an event begins [s]."""
    there = estimates.event_codes == code
    return [float(t) for t in estimates.time[there & ~np.concatenate([[False], there[:-1]])]]


def judge(course: Course, estimates: Estimates) -> Tally:
    """A drive into soft ground, or (``begun`` infinite) a healthy one."""
    warned = begins(estimates, WARNED)
    end = min(course.begun, float(course.time[-1]) if np.isnan(course.stop) else course.stop - LATER)
    tally = Tally(false=sum(t < end for t in warned), seconds=max(end, 0.0))
    if np.isinf(course.begun) or not course.stop > course.begun:
        return tally
    on = bool(estimates.event_codes[np.searchsorted(estimates.time, course.begun) - 1] == WARNED)
    before = [course.begun] * on + [t for t in warned if course.begun <= t < course.stop]
    tally.false = sum(t < course.begun for t in warned)
    tally.seconds = course.begun
    tally.late = int(not any(course.begun < t <= course.stop + IN_TIME for t in begins(estimates, STUCK)))
    if not before:
        tally.missed = 1
        return tally
    way = np.interp([before[0], course.stop], course.time, course.distance)
    tally.leads, tally.lengths = [course.stop - before[0]], [float(way[1] - way[0]) / course.length]
    tally.speeds = [course.speed]
    return tally


def score(job: tuple[Kind, int, float, bool]) -> Tally:
    """One machine at one rate, into soft ground or on its healthy drive."""
    kind, seed, rate, soft = job
    result: SimulationResult = (stop_drive if soft else healthy_drive)(kind, seed, rate)
    spot = result.scenario.soft_spots[-1] if soft else None
    at = np.inf if spot is None or spot.at is None else spot.at - 0.5 * spot.length
    return judge(course_of(result.truth, result.vehicle, at), estimate(result.recording, result.vehicle))


def score_snow(job: tuple[int, bool]) -> Tally:
    """One made-up snow run, or 5 minutes of healthy snow; the truth is the run's own."""
    seed, soft = job
    run = snow_runs.snow_run(seed) if soft else snow_runs.healthy_snow(seed)
    course = Course(
        run.time,
        run.distance,
        run.stop,
        run.begun if soft else np.inf,
        run.command,
        length_of(snow_runs.rover()),
    )
    return judge(course, estimate(run.recording, snow_runs.rover()))


def table(tallies: dict[str, Tally]) -> str:
    lines = ["| drives | " + " | ".join(HEAD) + " |", "|" + "---|" * (len(HEAD) + 1)]
    total = Tally()
    for name, tally in tallies.items():
        total.add(tally)
        lines.append(f"| {name} | " + " | ".join(tally.row()) + " |")
    lines.append("| **all** | " + " | ".join(total.row()) + " |")
    return "\n".join(lines)


def run(names: Iterable[str], jobs: list[tuple[Kind, int, float, bool]], workers: int) -> dict[str, Tally]:
    tallies: dict[str, Tally] = {}
    with ProcessPoolExecutor(workers) as pool:
        for name, tally in zip(names, pool.map(score, jobs, chunksize=4), strict=True):
            tallies.setdefault(name, Tally()).add(tally)
    return dict(sorted(tallies.items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--part", default="development", choices=["development", "held-out"])
    parser.add_argument("--machines", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--rates", type=float, nargs="+", default=[100.0, 10.0])
    parser.add_argument("--by", default="rate", choices=["rate", "mass", "curve", "sensors"])
    parser.add_argument("--snow", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into docs/events.md")
    arguments = parser.parse_args()
    if arguments.snow:
        snow = Tally()
        for soft, count in ((True, snow_runs.RUNS), (False, 24)):
            for seed in range(count):
                snow.add(score_snow((seed, soft)))
        part, text = "snow", table({"snow, 10 Hz": snow})
    else:
        drawn = list(machines(arguments.part, arguments.machines, arguments.seed))
        jobs = [
            (kind, seed, rate, soft)
            for kind, seed in drawn
            for rate in arguments.rates
            for soft in (True, False)
        ]
        names = [
            f"{rate:g} Hz" if arguments.by == "rate" else str(getattr(kind, arguments.by))
            for kind, _, rate, _ in jobs
        ]
        last = arguments.seed + arguments.machines - 1
        part = arguments.part
        text = f"Machines {arguments.seed} to {last}.\n\n{table(run(names, jobs, arguments.workers))}"
    print(text)
    if arguments.write:
        put(DOCUMENT, BEGIN.format(part=part), text)


if __name__ == "__main__":
    main()
