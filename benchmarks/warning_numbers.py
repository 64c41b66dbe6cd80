"""What each number of the warning does when it is halved and doubled: missed stops, lead and false warnings.

    python benchmarks/warning_numbers.py [--stops 60] [--hours 2] [--seed 0] [--workers 2] [--write]

Development drives of bench_warning.py at 10 Hz, as drawn and with the coarse sensors of warning_bounds.py, and the made-up snow. The
kernel estimates each drive anew with each number of tg_watch_settings changed. --write puts the table into docs/warning.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import snow_runs
from bench_constants import changed_settings
from bench_warning import HEALTHY, Course, Tally, course_of, jobs, judge, snow_drives, starts, without
from marked import put
from terragrip.recording import Recording
from terragrip.simulation import families
from terragrip.simulation.families import Kind
from terragrip.vehicle import Vehicle

NUMBERS = (
    "pace", "memory", "usual", "soon", "ahead", "beyond", "warn", "most", "change", "high_slip", "resistance", "command",
)  # fmt: skip
Variation = tuple[str, float]
VARIATIONS: tuple[Variation, ...] = (
    ("", 1.0),
    *((name, factor) for name in NUMBERS for factor in (0.5, 2.0)),
)
GROUNDS = ("as drawn", "coarse sensors", "snow")
Job = tuple[str, Kind, int, str, float]
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/warning.md"
BEGIN = "<!-- made by benchmarks/warning_numbers.py --write -->"


def tallies_of(recording: Recording, vehicle: Vehicle, course: Course) -> dict[Variation, Tally]:
    """One drive under every variation."""
    result = {}
    for name, factor in VARIATIONS:

        def change(settings: Any, name: str = name, factor: float = factor) -> None:
            if name:
                setattr(settings.watch, name, factor * getattr(settings.watch, name))

        with changed_settings(change):
            result[name, factor] = judge(course, *starts(recording, vehicle))
    return result


def family_drive(job: Job) -> dict[Variation, Tally]:
    """A development drive without its drawbar cell; of the part "coarse sensors" with those."""
    part, kind, seed, task, rate = job
    chosen = Kind(kind.mass, kind.curve, "coarse") if part == "coarse sensors" else kind
    result = (
        families.draw(chosen, seed, rate=rate, task="digging")
        if task == "digging"
        else families.draw(chosen, seed, rate=rate, task="healthy", duration=HEALTHY)
    )
    return tallies_of(without(result.recording), result.vehicle, course_of(result, task == "digging"))


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
    total = {(ground, key): Tally() for ground in GROUNDS for key in VARIATIONS}

    def add(ground: str, results: Iterable[dict[Variation, Tally]]) -> None:
        for result in results:
            for key, tally in result.items():
                total[ground, key].add(tally)

    listed = list(jobs("development", arguments.stops, arguments.hours, [10.0], arguments.seed))
    with ProcessPoolExecutor(arguments.workers) as pool:
        for ground in GROUNDS[:2]:
            add(ground, pool.map(family_drive, [(ground, *job[1:]) for job in listed]))
    rover = snow_runs.rover()
    add("snow", (tallies_of(recording, rover, course) for recording, course in snow_drives()))
    head = ["", *(f"{ground}: missed | lead (s) | false in 30 min" for ground in GROUNDS)]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * 3 * len(GROUNDS)]
    for key in VARIATIONS:
        name = f"`{key[0]}` {'halved' if key[1] < 1 else 'doubled'}" if key[0] else "as it is"
        figures = [cell for ground in GROUNDS for cell in cells(total[ground, key])]
        lines.append("| " + " | ".join([name, *figures]) + " |")
    text = "\n".join(lines)
    print(text)
    if arguments.write:
        put(DOCUMENT, BEGIN, f"Machines from seed {arguments.seed}.\n\n{text}")


if __name__ == "__main__":
    main()
