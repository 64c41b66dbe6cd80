"""What `terragrip calibrate` tells of simulated machines: errors, standard errors, and whether intervals hold.

Each seed is another machine; seeds 2000 to 2007 are those that nothing was tuned on. Two logs a machine: one without a
tool, one with loads that come and go over five soils (see calibration_drive.py).
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from calibration_drive import calibrate_machine
from terragrip.estimation import Calibration
from terragrip.simulation import simulate

SCENARIOS = {"clean": "accuracy-clean", "multirate": "accuracy-faults"}
KEYS = (
    "drive_torque_gain",
    "drive_torque_offset",
    "drawbar_offset",
    "acceleration_bias_x",
    "pitch_offset",
    "wheel_radius",
)


def main() -> None:
    """Print a line for each sensor set and quantity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(2000, 2008), metavar=("FIRST", "END"))
    first, end = parser.parse_args().seeds
    print(f"{'sensors':10} {'quantity':20} {'rms error':>10} {'std error':>10} {'own std':>10} {'held':>8}")
    for sensors, scenario in SCENARIOS.items():
        machines = [
            (calibrate_machine(seed, sensors), truth_of(scenario, seed)) for seed in range(first, end)
        ]
        for key in KEYS:
            print(f"{sensors:10} {key:20} {line(machines, key)}")


def truth_of(scenario: str, seed: int) -> dict[str, Any]:
    """The calibration block that would undo the machine's errors."""
    return simulate(scenario, seed).true_parameters["calibration"]


def line(machines: list[tuple[Calibration, dict[str, Any]]], key: str) -> str:
    """RMS error, RMS standard error, RMS of its own part, share of intervals that hold the truth."""
    errors, spreads, own, inside = [], [], [], []
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
                own.append(quantity.std if quantity.own_std is None else quantity.own_std)
                inside.append(quantity.interval[0] <= true <= quantity.interval[1])
    if not errors:
        return "not determined"
    rms = [float(np.sqrt(np.mean(np.square(values)))) for values in (errors, spreads, own)]
    held = f"{int(np.sum(inside))}/{len(inside)}"
    return f"{rms[0]:10.4g} {rms[1]:10.4g} {rms[2]:10.4g} {held:>8}"


if __name__ == "__main__":
    main()
