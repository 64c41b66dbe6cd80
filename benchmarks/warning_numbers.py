"""What each number of the warning does when it is halved and doubled: missed stops, lead and false warnings.

    python benchmarks/warning_numbers.py [--stops 60] [--hours 2] [--seed 0] [--workers 2] [--write]

Development drives of bench_warning.py at 10 Hz and the made-up snow are estimated once; then the warning's twin
(tests/estimation/kernel_twin) goes over the estimates with each number of tg_watch_settings changed.
--write puts the table into docs/warning.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import snow_runs
from bench_warning import HEALTHY, Course, Tally, course_of, jobs, judge
from marked import put
from terragrip.estimation import estimate
from terragrip.estimation.settings import watch_limits
from terragrip.recording import Recording
from terragrip.simulation import families
from terragrip.simulation.families import Kind
from terragrip.vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/estimation"))
from kernel_twin.immobilization import Row, Watch, pace, rows_of, undisputed

NUMBERS = (
    "pace", "memory", "usual", "sure", "ahead", "warn", "most", "rise", "high_slip", "leading", "resistance", "command",
)  # fmt: skip
Variation = tuple[str, float]
VARIATIONS: tuple[Variation, ...] = (
    ("", 1.0),
    *((name, factor) for name in NUMBERS for factor in (0.5, 2.0)),
)
Job = tuple[str, Kind, int, str, float]
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/warning.md"
BEGIN = "<!-- made by benchmarks/warning_numbers.py --write -->"


def tallies_of(recording: Recording, vehicle: Vehicle, course: Course) -> dict[Variation, Tally]:
    """One drive under every variation."""
    with undisputed():
        estimates = estimate(recording, vehicle)
    rows = rows_of(estimates, np.isfinite(recording.channels["ground_speed"]))
    result = {}
    for name, factor in VARIATIONS:
        limits = watch_limits(float(np.mean(vehicle.wheel_radius)))
        if name:
            limits[name] *= factor
        watch = Watch(limits, pace(vehicle, limits), float(np.mean(vehicle.wheel_radius)))
        result[name, factor] = judge(course, *starts(rows, watch))
    return result


def starts(rows: list[Row], watch: Watch) -> tuple[list[float], list[float]]:
    """When warnings, and `stuck`, begin [s]."""
    begun: dict[str, list[float]] = {"immobilization": [], "stuck": []}
    before = ""
    for row in rows:
        now = watch.update(row)
        if now and now != before:
            begun[now].append(row.time)
        before = now
    return begun["immobilization"], begun["stuck"]


def family_drive(job: Job) -> dict[Variation, Tally]:
    """A development drive without its drawbar cell."""
    _, kind, seed, task, rate = job
    duration = HEALTHY if task == "healthy" else None
    result = families.draw(
        kind, seed, rate=rate, task="digging" if duration is None else "healthy", duration=duration
    )
    recording = result.recording
    channels = {name: values for name, values in recording.channels.items() if name != "drawbar_force"}
    rows = np.logical_or.reduce([np.isfinite(values) for values in channels.values()])
    seen = Recording(recording.time, channels).select(rows)
    return tallies_of(seen, result.vehicle, course_of(result, task == "digging"))


def snow_drives() -> Iterator[dict[Variation, Tally]]:
    """The made-up runs, and two hours of healthy snow."""
    vehicle = snow_runs.rover()
    made = [snow_runs.snow_run(seed) for seed in range(snow_runs.RUNS)]
    for run in made + [snow_runs.healthy_snow(seed) for seed in range(24)]:
        length = float(vehicle.wheelbase or 0.0)
        course = Course(run.begun, run.stop, float(run.time[-1]), run.command, run.time, run.distance, length)
        yield tallies_of(run.recording, vehicle, course)


def cells(tally: Tally) -> list[str]:
    lead = f"{np.median(tally.leads):.2f}" if tally.leads else "–"
    return [
        f"{tally.stops - len(tally.leads)} of {tally.stops}",
        lead,
        f"{tally.false / max(tally.seconds, 1.0) * 1800:.2f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--stops", type=int, default=60)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into docs/warning.md")
    arguments = parser.parse_args()
    family, snow = ({key: Tally() for key in VARIATIONS} for _ in range(2))
    listed = list(jobs("development", arguments.stops, arguments.hours, [10.0], arguments.seed))
    with ProcessPoolExecutor(arguments.workers) as pool:
        for result in pool.map(family_drive, listed):
            for key, tally in result.items():
                family[key].add(tally)
    for result in snow_drives():
        for key, tally in result.items():
            snow[key].add(tally)
    head = ["", "missed", "lead (s)", "false in 30 min", "snow: missed", "lead (s)", "false in 30 min"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for key in VARIATIONS:
        name = f"`{key[0]}` {'halved' if key[1] < 1 else 'doubled'}" if key[0] else "as it is"
        lines.append("| " + " | ".join([name, *cells(family[key]), *cells(snow[key])]) + " |")
    text = "\n".join(lines)
    print(text)
    if arguments.write:
        put(DOCUMENT, BEGIN, text)


if __name__ == "__main__":
    main()
