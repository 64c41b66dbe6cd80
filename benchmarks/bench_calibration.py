"""What `terragrip calibrate` tells of simulated machines: errors, standard errors, and whether intervals hold.

Each seed is another machine; seeds 2000 to 2007 are those that nothing was tuned on. Two logs a machine: one without a
tool, one with loads that come and go over five soils (see calibration_drive.py). --write puts the table into docs/calibrate.md, which
holds one of these seeds and one of 1000 to 1059.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from calibration_drive import calibrate_machine
from marked import put
from terragrip.estimation import Calibration
from terragrip.simulation import simulate

SCENARIOS = {"clean": "accuracy-clean", "multirate": "accuracy-faults"}
KEYS = {
    "drive_torque_gain": "relative torque gain",
    "drive_torque_offset": "torque zero [N m]",
    "drawbar_offset": "drawbar zero [N]",
    "acceleration_bias_x": "accelerometer bias [m/s²]",
    "pitch_offset": "pitch zero [rad]",
    "wheel_radius": "rolling radius [m], of 0.2 m",
}
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/calibrate.md"
BEGIN = "<!-- made by benchmarks/bench_calibration.py --write: {first} to {last} -->"
HEAD = """| {count} machines | all channels at 100 Hz | | | 25 to 100 Hz, delays, dropouts | | |
|---|---|---|---|---|---|---|
| | error | std | held | error | std | held |
"""


def main() -> None:
    """Print the table: a line for each quantity, three columns for each sensor set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(2000, 2008), metavar=("FIRST", "END"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into docs/calibrate.md")
    arguments = parser.parse_args()
    first, end = arguments.seeds
    cells: dict[str, list[str]] = {key: [] for key in KEYS}
    with ProcessPoolExecutor(arguments.workers) as pool:
        for sensors in SCENARIOS:
            machines = list(pool.map(machine, [(seed, sensors) for seed in range(first, end)]))
            for key in KEYS:
                cells[key].append(line(machines, key))
    rows = [f"| {name} | {' | '.join(cells[key])} |" for key, name in KEYS.items()]
    text = HEAD.format(count=end - first) + "\n".join(rows)
    print(text)
    if arguments.write:
        put(DOCUMENT, BEGIN.format(first=first, last=end - 1), text)
        print(f"written to {DOCUMENT}")


def machine(job: tuple[int, str]) -> tuple[Calibration, dict[str, Any]]:
    """The calibration of a machine with a sensor set, and its truth."""
    seed, sensors = job
    return calibrate_machine(seed, sensors), truth_of(SCENARIOS[sensors], seed)


def truth_of(scenario: str, seed: int) -> dict[str, Any]:
    """The calibration block that would undo the machine's errors."""
    return simulate(scenario, seed).true_parameters["calibration"]


def line(machines: list[tuple[Calibration, dict[str, Any]]], key: str) -> str:
    """RMS error, RMS standard error, number of intervals that hold the truth: three cells."""
    errors, spreads, inside = [], [], []
    for result, truth in machines:
        wanted = truth[key]
        if key == "drive_torque_gain":
            mean = np.exp(np.mean(np.log(list(wanted.values()))))
            wanted = {wheel: value / mean for wheel, value in wanted.items()}
        for quantity in result.quantities:
            if quantity.key == key:
                true = wanted if quantity.wheel is None else wanted[quantity.wheel]
                errors.append(quantity.value - true)
                spreads.append(quantity.std)
                inside.append(quantity.interval[0] <= true <= quantity.interval[1])
    if not errors:
        return "not determined | | "
    error, std = (float(np.sqrt(np.mean(np.square(values)))) for values in (errors, spreads))
    size = (lambda x: f"{100 * x:.2f} %") if key == "drive_torque_gain" else (lambda x: f"{x:.2g}")
    return f"{size(error)} | {size(std)} | {int(np.sum(inside))}/{len(inside)}"


if __name__ == "__main__":
    main()
