"""Is getting stuck foretold, and how often for nothing? On random machines of both plants, without a drawbar cell.

    python benchmarks/bench_warning.py [--families development held-out second-plant snow] [--stops 40] [--hours 2] [--rates 100 10]
                                       [--workers 2] [--speeds-alone] [--write]

Closing figures: --families held-out second-plant --stops 200 --hours 4 --seed 690000 --write.
development and held-out: terragrip.simulation.families;
second-plant: MuJoCo (benchmarks/second_plant), held out as a whole. A digging drive goes steadily into ground that cannot bear what is
asked. Its stop is when, by the truth, the ground speed first stays under STOPPED of the rim's while wheels turn. A warning counts
from its start, missed: none between the edge of the soft ground and the stop. Lead is also given in vehicle lengths: of way
still made. stuck late: it came later than the stop and half a second. False: a warning on a healthy drive (rough ground, hits,
hills, stops and starts), or on a digging one before its soft ground, where no stop follows within LATER seconds; time after a
machine stopped by itself does not count. snow: the made-up runs of snow_runs.py, for development. Bounds of 95 %: Wilson's for
shares, Poisson's exact for rates, order statistics for medians.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, chi2

import snow_runs
from marked import put
from second_plant import draw as second
from terragrip.errors import InputError
from terragrip.estimation import estimate
from terragrip.ground.events import events
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, families
from terragrip.simulation.families import Kind
from terragrip.vehicle import Vehicle

STOPPED, FREE = 0.05, 0.3  # of the rim's speed
LATER = 8.0  # s
SLOW = 1.0  # m/s
HEALTHY = 600.0  # s a drive
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/families.md"
BEGIN = "<!-- made by benchmarks/bench_warning.py --write -->"
ALONE = "<!-- made by benchmarks/bench_warning.py --speeds-alone --write -->"
SNOW_DOCUMENT, SNOW_BEGIN = (
    DOCUMENT.with_name("events.md"),
    "<!-- made by benchmarks/bench_warning.py --write: snow -->",
)

Flags = NDArray[np.bool_]


@dataclass
class Tally:
    """What the warnings were worth. Leads in seconds (all, and at no more than SLOW) and in vehicle lengths; `late`: stuck that
    came late or never."""

    leads: list[float] = field(default_factory=list)
    slow: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    stops: int = 0
    late: int = 0
    false: int = 0
    seconds: float = 0.0

    def add(self, other: Tally) -> None:
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


@dataclass(frozen=True)
class Course:
    """By the truth [s]: the edge of the soft ground (inf: none), the first stop (NaN: none), the end; the usual rim speed [m/s];
    and the way at any time."""

    edge: float
    stop: float
    end: float
    speed: float
    time: NDArray[np.float64]
    travel: NDArray[np.float64]
    length: float

    def lengths(self, start: float, end: float) -> float:
        """Way from one instant to another, in vehicle lengths."""
        return float(np.diff(np.interp([start, end], self.time, self.travel))[0] / self.length)


def course_of(result: SimulationResult, digging: bool) -> Course:
    """What befell the machine."""
    t, vehicle = result.truth, result.vehicle
    time, travel = t["time"].to_numpy(), t["true_distance"].to_numpy()
    driven = [
        (w, r) for w, r, d in zip(vehicle.wheels, vehicle.wheel_radius, vehicle.driven, strict=True) if d
    ]
    rim = np.mean([np.abs(t[f"true_wheel_speed_{w}"].to_numpy()) * r for w, r in driven], axis=0)
    usual = float(np.median(rim[rim > 0.1 * rim.max()]))
    speed = np.abs(t["true_ground_speed"].to_numpy())
    turning = rim > 0.3 * usual
    low = turning & (speed < STOPPED * rim)
    stop = np.nan
    for k in np.flatnonzero(low & ~np.r_[False, low[:-1]]):
        # a start from rest: it has not moved since the wheels began to turn
        began = time[np.flatnonzero(~turning[:k])[-1]] if (~turning[:k]).any() else 0.0
        moved = (speed[:k] > FREE * rim[:k]) & (time[:k] > began) & turning[:k]
        after = (time > time[k]) & (time < time[k] + 0.5)
        if moved.any() and not (speed[after] > FREE * rim[after]).any():
            stop = float(time[k])
            break
    edge = np.inf
    if digging:
        reached = np.flatnonzero(travel >= soft_from(result))
        edge = float(time[reached[0]]) if len(reached) else np.inf
    length = vehicle.wheelbase or 4 * float(vehicle.wheel_radius.mean())
    return Course(edge, stop, float(time[-1]), usual, time, travel, length)


def soft_from(result: SimulationResult) -> float:
    """Travel [m] at which the first axle reaches the soft ground."""
    front = result.vehicle.wheelbase or 0.0
    if result.scenario.name.split("-")[1] == second.CURVE:
        mixed = result.truth["transition"].to_numpy() | (result.truth["soil"].to_numpy() == "second")
        reached = np.flatnonzero(mixed)
        travel = result.truth["true_distance"].to_numpy()
        return float(travel[reached[0]]) - front if len(reached) else np.inf
    spot = result.scenario.soft_spots[-1]
    return float(spot.at or 0.0) - 0.5 * spot.length - front


def judge(course: Course, warnings: list[float], stuck: list[float]) -> Tally:
    """Warnings and `stuck` by their starts [s]."""
    stopped, edge = not np.isnan(course.stop), course.edge
    healthy_end = min(edge, course.stop - LATER if stopped else course.end)
    tally = Tally(false=sum(w < healthy_end for w in warnings), seconds=max(healthy_end, 0.0))
    if stopped and course.stop > edge:
        tally.stops = 1
        before = [w for w in warnings if edge <= w < course.stop]
        if before:
            tally.leads, tally.lengths = [course.stop - before[0]], [course.lengths(before[0], course.stop)]
            tally.slow = tally.leads * (course.speed <= SLOW)
        tally.late = int(not any(s <= course.stop + 0.5 for s in stuck if s > edge))
    return tally


def score(job: tuple[str, Kind, int, str, float], speeds_alone: bool = False) -> Tally:
    """One drive at one rate, without its drawbar cell; with ``speeds_alone`` without its torques too."""
    part, kind, seed, task, rate = job
    source: Any = second if part == "second-plant" else families
    duration = HEALTHY if task == "healthy" else None
    try:
        result = source.draw(kind, seed, rate=rate, task=task, duration=duration)
    except (InputError, RuntimeError) as error:  # a simulation that diverges
        print(f"left out: {kind} {seed} {task}: {error}", file=sys.stderr)
        return Tally()
    left_out = ("drawbar_force", "drive_torque") if speeds_alone else ("drawbar_force",)
    recording = without(result.recording, left_out)
    return judge(course_of(result, task == "digging"), *starts(recording, result.vehicle))


def without(recording: Recording, left_out: tuple[str, ...] = ("drawbar_force",)) -> Recording:
    """The recording as logged without these channels."""
    channels = {name: x for name, x in recording.channels.items() if not name.startswith(left_out)}
    rows = np.logical_or.reduce([np.isfinite(values) for values in channels.values()])
    return Recording(recording.time, channels, source=recording.source).select(rows)


def starts(recording: Recording, vehicle: Vehicle) -> tuple[list[float], list[float]]:
    """When warnings, and `stuck`, begin [s]."""
    estimates = events(estimate(recording, vehicle))
    warnings, stuck = ([e.start for e in estimates if e.kind == kind] for kind in ("immobilization", "stuck"))
    return warnings, stuck


def score_snow() -> Tally:
    tally, vehicle = Tally(), snow_runs.rover()
    for recording, course in snow_drives():
        tally.add(judge(course, *starts(recording, vehicle)))
    return tally


def snow_drives() -> Iterator[tuple[Recording, Course]]:
    """As many made-up runs as were measured, and two hours of healthy snow."""
    length = float(snow_runs.rover().wheelbase or 0.0)
    made = [snow_runs.snow_run(seed) for seed in range(snow_runs.RUNS)]
    for run in made + [snow_runs.healthy_snow(seed) for seed in range(24)]:
        end = float(run.time[-1])
        yield (
            run.recording,
            Course(run.begun, run.stop, end, run.command, run.time, run.distance, length),
        )


def jobs(
    part: str, stops: int, hours: float, rates: Iterable[float], seed: int
) -> Iterator[tuple[str, Kind, int, str, float]]:
    """Digging and healthy drives of one part, at each rate."""
    for task, count in (("digging", stops), ("healthy", round(3600 * hours / HEALTHY))):
        drawn = (
            second.machines(count, seed) if part == "second-plant" else families.machines(part, count, seed)
        )
        for kind, number in drawn:
            for rate in rates:
                yield part, kind, number, task, rate


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's interval of 95 % of a share."""
    if not count:
        return 0.0, 1.0
    z, p = 1.96, hits / count
    middle, half = p + z * z / (2 * count), z * np.sqrt(p * (1 - p) / count + z * z / (4 * count**2))
    return max(float((middle - half) / (1 + z * z / count)), 0.0), float(
        (middle + half) / (1 + z * z / count)
    )


def poisson(count: int) -> tuple[float, float]:
    """The exact interval of 95 % of a Poisson mean of which ``count`` were seen."""
    return float(chi2.ppf(0.025, 2 * count) / 2) if count else 0.0, float(chi2.ppf(0.975, 2 * count + 2) / 2)


def _median(values: list[float]) -> str:
    """Median and its distribution-free 95 % bounds."""
    if len(values) < 6:
        return "–"
    ranked, n = np.sort(values), len(values)
    low = max(int(binom.ppf(0.025, n, 0.5)) - 1, 0)
    return f"{np.median(values):.1f} ({ranked[low]:.1f}–{ranked[n - 1 - low]:.1f})"


def table(tallies: dict[tuple[str, float], Tally]) -> str:
    head = [
        "machines", "Hz", "stops", "missed", "missed, 95 % (%)", "lead, median (s)", "up to 1 m/s (s)", "lead, 10 % (s)",
        "lead (lengths)", "stuck late", "healthy (h)", "false", "false in 30 min, 95 %",
    ]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for (part, rate), t in tallies.items():
        missed = t.stops - len(t.leads)
        low, high = wilson(missed, t.stops)
        scale = 1800 / max(t.seconds, 1.0)
        few, many = poisson(t.false)
        leads = (
            [
                _median(t.leads),
                _median(t.slow),
                f"{np.quantile(t.leads, 0.1):.1f}",
                f"{np.median(t.lengths):.1f}",
            ]
            if t.leads
            else ["–"] * 4
        )
        cells = [
            part,
            f"{rate:g}",
            str(t.stops),
            str(missed),
            f"{100 * low:.1f}–{100 * high:.1f}",
            *leads,
            str(t.late),
        ]
        cells += [
            f"{t.seconds / 3600:.1f}",
            str(t.false),
            f"{t.false * scale:.2f} ({few * scale:.2f}–{many * scale:.2f})",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    known = ["development", "held-out", "second-plant", "snow"]
    parser.add_argument("--families", nargs="+", default=["development"], choices=known)
    parser.add_argument("--stops", type=int, default=40)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--rates", type=float, nargs="+", default=[100.0, 10.0])
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--speeds-alone", action="store_true", help="without the torques: slip alone")
    parser.add_argument(
        "--write",
        action="store_true",
        help="put the table into docs/families.md; of snow alone into events.md",
    )
    arguments = parser.parse_args()
    tallies: dict[tuple[str, float], Tally] = {}
    with ProcessPoolExecutor(arguments.workers) as pool:
        for part in arguments.families:
            if part == "snow":
                tallies[part, snow_runs.RATE] = score_snow()
                continue
            listed = list(jobs(part, arguments.stops, arguments.hours, arguments.rates, arguments.seed))
            one = partial(score, speeds_alone=arguments.speeds_alone)
            scored = pool.map(one, listed, chunksize=len(arguments.rates))  # a machine's rates in one process
            for k, (job, tally) in enumerate(zip(listed, scored, strict=True)):
                tallies.setdefault((part, job[-1]), Tally()).add(tally)
                if k % 100 == 99:
                    print(f"{part}: {k + 1} of {len(listed)}\n{table(tallies)}", file=sys.stderr, flush=True)
    text = table(tallies)
    print(text)
    if arguments.write and arguments.families == ["snow"]:
        put(SNOW_DOCUMENT, SNOW_BEGIN, text)
    elif arguments.write:
        asked = f"Machines from seed {arguments.seed}, `--stops {arguments.stops} --hours {arguments.hours:g}` a part."
        put(DOCUMENT, ALONE if arguments.speeds_alone else BEGIN, f"{asked}\n\n{text}")


if __name__ == "__main__":
    main()
