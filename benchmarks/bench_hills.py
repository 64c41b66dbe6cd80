"""Hills: intervals with a pitch sensor, with an accelerometer alone, and with neither, on development machines.

    python benchmarks/bench_hills.py [--machines 8] [--seed 0] [--rate 50] [--grades 0 2 5 10] [--slope 0.5] [--workers 2] [--write]

Machines of terragrip.simulation.families that have every channel, for four minutes on ground whose grade has a standard deviation
of --grades per cent, in hills of 20 to 200 m; on the steep ones their tools pull a third. Each log is seen whole, without pitch,
and without pitch and acceleration. The vehicle file says a slope of --slope degrees throughout, as of a user who did not think of
hills. --write puts the table into docs/families.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench_families import SHORT, driven_wheels, moving_rows, pooled_r2, without
from family_intervals import COVERED, SCORED, Intervals, intervals
from marked import put
from terragrip.estimation import estimate
from terragrip.simulation import SimulationResult, families, simulate
from terragrip.simulation.families import Kind
from terragrip.simulation.fields import stream
from terragrip.vehicle import Vehicle

VIEWS: dict[str, tuple[str, ...]] = {
    "pitch": (),
    "accelerometer": ("pitch",),
    "neither": ("pitch", "acceleration"),
}
WITH_ALL = ("even", "multirate")
DURATION = 240.0  # s
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/families.md"
BEGIN = "<!-- made by benchmarks/bench_hills.py --write -->"


@dataclass(frozen=True)
class Seen:
    """One machine on hills of a grade in a view: R² of adhesion and intervals, of moving rows."""

    kind: Kind
    seed: int
    grade: float
    view: str
    r2: float
    held: Intervals


Job = tuple[Kind, int, float, float, float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument(
        "--grades", type=float, nargs="+", default=[0.0, 2.0, 5.0, 10.0], help="SD in per cent"
    )
    parser.add_argument("--slope", type=float, default=0.5, help="that the vehicle file states, in degrees")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="put the table into docs/families.md")
    arguments = parser.parse_args()
    jobs = [
        (kind, seed, grade, arguments.rate, arguments.slope)
        for kind, seed in machines(arguments.machines, arguments.seed)
        for grade in arguments.grades
    ]
    found: list[Seen] = []
    with ProcessPoolExecutor(arguments.workers) as pool:
        for seen in pool.map(score, jobs):
            found += seen
            print("\n".join(_line(s) for s in seen), flush=True)
    text = table(found)
    print("\n" + text)
    if arguments.write:
        put(DOCUMENT, BEGIN, text)


def machines(count: int, first: int) -> list[tuple[Kind, int]]:
    """The first development machines that have every channel."""
    drawn = families.machines("development", 4 * count, first)
    return [(kind, seed) for kind, seed in drawn if kind.sensors in WITH_ALL][:count]


def draw(kind: Kind, seed: int, grade: float, rate: float) -> SimulationResult:
    """A machine's drive over hills of this SD of the grade."""
    scenario = families.scenario(kind, seed, rate=rate, duration=DURATION)
    wave = np.exp(stream(seed, "hills").uniform(np.log(20.0), np.log(200.0)))
    hills = scenario.route.slope.model_copy(
        update={"sd": grade, "length": wave / 4.44}
    )  # most slope at a length of 2 pi/sqrt(2)
    less = 1.0 if grade <= 0.02 else 1 / 3
    tools = tuple(
        tool.model_copy(
            update={
                "friction": {soil: less * share for soil, share in dict(tool.friction).items()},  # type: ignore[arg-type]
                "added": tuple((x, less * force) for x, force in tool.added),
            }
        )
        for tool in scenario.tools
    )
    route = scenario.route.model_copy(update={"slope": hills})
    return simulate(scenario.model_copy(update={"route": route, "tools": tools}), seed)


def score(job: Job) -> list[Seen]:
    """One machine on one grade in every view."""
    kind, seed, grade, rate, slope = job
    result = draw(kind, seed, grade / 100, rate)
    data = result.vehicle.to_dict()
    data["uncertainty"]["slope"] = float(np.radians(slope))
    vehicle, out = Vehicle.from_dict(data), []
    for view, dropped in VIEWS.items():
        recording = result.recording
        for start in dropped:
            recording = without(recording, start)
        rows = np.isin(result.recording.time, recording.time)
        seen = replace(result, recording=recording, truth=result.truth[rows].reset_index(drop=True))
        estimates = estimate(recording, vehicle)
        driven, moving = driven_wheels(seen), moving_rows(seen)
        truth = np.stack([seen.truth[f"true_adhesion_{w}"] for w in driven], axis=1)
        estimated = np.stack([estimates[f"adhesion_{w}"] for w in driven], axis=1)
        out.append(
            Seen(
                kind,
                seed,
                grade,
                view,
                pooled_r2(truth, estimated, moving),
                intervals(seen, estimates, driven, moving),
            )
        )
    return out


def _line(s: Seen) -> str:
    held = " ".join(f"{SHORT[c]} {100 * s.held.covered[c]:.0f}" for c in COVERED)
    scores = " ".join(f"{SHORT[c]} {s.held.score[c]:.3f}" for c in SCORED)
    return f"{s.kind!s} {s.seed} {s.grade:g} % {s.view}: R² {s.r2:.3f}; held {held}; score {scores}"


def table(found: Sequence[Seen]) -> str:
    """Markdown: a line a grade and view, means over the machines (of R² and scores medians)."""
    head = [
        "grade, SD (%)",
        "seen with",
        "R² µ",
        *(f"95 % {SHORT[c]}" for c in COVERED),
        *(f"score {SHORT[c]}" for c in SCORED),
    ]
    lines = ["| " + " | ".join(head) + " |", "|---:|---|" + "---:|" * (len(head) - 2)]
    for grade in dict.fromkeys(s.grade for s in found):
        for view in VIEWS:
            some = [s for s in found if (s.grade, s.view) == (grade, view)]
            cells = [f"{grade:g}", view, f"{np.median([s.r2 for s in some]):.3f}"]
            cells += [f"{100 * np.nanmean([s.held.covered[c] for s in some]):.0f}" for c in COVERED]
            cells += [f"{np.median([s.held.score[c] for s in some]):.3f}" for c in SCORED]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
