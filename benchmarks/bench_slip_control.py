"""The slip set-point in the loop with the simulated plant: energy a metre, ground covered, time stuck, against fixed speed and torque.

    python benchmarks/bench_slip_control.py [--part development|held-out|second-plant|tractor|campaign] [--seeds 20] [--first 0] [--write]

Each seed is a machine of terragrip.simulation.families, of the second plant, a mid-size tractor or the paper's robot on the fields of its
campaign (control_machines.py) on two tasks: work (several soils, hills, draught that comes and goes; of the campaign its towing runs, its
only task) and digging (into a soft spot that bears less than is asked, where slip digs
the wheels in). The same machine and ground three times, with the same wanted ground speed: wheels at a fixed speed; wheels at a fixed
torque (1.3 of the fixed speed's mean, rim speed up to 1.5 of it); `SlipSetpoint` on estimates at 50 Hz from white sensor noise of the
vehicle file's size. Its slip is what `advise` gives for a work drive of that machine before, else 11.5 %. A drive lasts as its scenario
says or to the end of its way. Intervals: 95 %, bootstrap over seeds. --write puts the table into docs/advice.md and the figures into
the file that reports show it from.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from control_machines import PARTS, Piece, Run, Stepped, Subject, log_of, machines, subject, tasks
from marked import put
from terragrip.advice.analysis import advise
from terragrip.advice.setpoint import SlipSetpoint
from terragrip.advice.slip_only import BAND
from terragrip.estimation import TractionEstimator, estimate
from terragrip.simulation.families import Kind
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]
PERIOD = 0.02  # s between samples
RAMP = 3.0  # s in which the fixed ways come to speed
STUCK = 0.1  # of the rim speed
SPARE = 1.3  # fixed torque over the mean of the fixed speed: less stalls at every harder pull
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/advice.md"
KEPT = Path(__file__).resolve().parents[1] / "src/terragrip/report/slip_control.json"
BEGIN = "<!-- made by benchmarks/bench_slip_control.py --write: {part} -->"
WAYS = ("fixed speed", "fixed torque", "slip set-point")


@dataclass(frozen=True)
class Drive:
    """One drive: energy at the wheels [J], metres, share of time in which wheels turn and the machine does not, mean torque [N m]."""

    energy: float
    metres: float
    stuck: float
    torque: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--part", default="development", choices=PARTS)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--write", action="store_true", help="put the table into docs/advice.md")
    arguments = parser.parse_args()
    found: dict[str, list[dict[str, Drive]]] = {task: [] for task in tasks(arguments.part)}
    for kind, seed in machines(arguments.part, arguments.seeds, arguments.first):
        slip = advised_slip(arguments.part, kind, seed)
        for task in found:
            found[task].append(three_ways(subject(arguments.part, kind, seed, task), seed, slip))
            print(f"{kind} {seed} {task} at {slip:.3f}: {found[task][-1]}", flush=True)
    text = table(found, arguments)
    print(f"\n{text}\n")
    if arguments.write:
        put(DOCUMENT, BEGIN.format(part=arguments.part), text)
        keep(figures(found), arguments)


def advised_slip(part: str, kind: Kind | Run, seed: int) -> float:
    """The best slip of the soil with the most way on a work drive of the machine; the usual band's middle where none is given."""
    result = log_of(part, kind, seed, 1 / PERIOD)
    advice, way = advise([estimate(result.recording, result.vehicle)], result.vehicle)
    best = advice[max(advice, key=lambda name: way[name])].best_efficiency
    return float(np.mean(BAND)) if best is None else best.slip


def three_ways(one: Subject, seed: int, slip: float) -> dict[str, Drive]:
    """The same machine on the same ground each way."""
    points, duration = one.scenario.speed, one.scenario.duration
    wanted = float(np.median([float(v) for _, v in points if v != "off" and float(v) > 0]))
    rim = wanted / (1 - slip)

    def fixed(time: float, _: Piece | None) -> float:
        return rim * min(time / RAMP, 1.0)

    drives = {"fixed speed": drive(one.begin(), fixed, duration)}
    limited = one.begin()
    limited.limit_torque(SPARE * drives["fixed speed"].torque)
    drives["fixed torque"] = drive(limited, lambda t, _: 1.5 * rim * min(t / RAMP, 1.0), duration)
    led = one.begin()
    drives["slip set-point"] = drive(led, _controller(led.vehicle, slip, wanted, seed), duration)
    return drives


def _controller(
    vehicle: Vehicle, slip: float, wanted: float, seed: int
) -> Callable[[float, Piece | None], float]:
    """Rim speed from the set-point on estimates of noisy samples."""
    estimator, setpoint = TractionEstimator(vehicle), SlipSetpoint(vehicle, slip, wanted)
    rng, sensors = np.random.default_rng(seed), vehicle.sensors
    led = next(k for k, drives in enumerate(vehicle.driven) if drives)

    def command(time: float, seen: Piece | None) -> float:
        if seen is None:
            return 0.0
        last = {name: seen[name][-1] for name in ("speed", "drawbar", "wheel_speed", "torque")}
        sample = {
            "time": time,
            "ground_speed": last["speed"] + (sensors.ground_speed or 0.02) * rng.standard_normal(),
            "drawbar_force": last["drawbar"] + (sensors.drawbar_force or 0.0) * rng.standard_normal(),
        }
        for i, wheel in enumerate(vehicle.wheels):
            sample[f"wheel_speed_{wheel}"] = (
                last["wheel_speed"][i] + (sensors.wheel_speed or 0.0) * rng.standard_normal()
            )
            if vehicle.driven[i]:
                sample[f"drive_torque_{wheel}"] = (
                    last["torque"][i] + (sensors.drive_torque or 0.0) * rng.standard_normal()
                )
        speeds = setpoint.update(estimator.update(sample))
        return float(speeds[vehicle.wheels[led]] * vehicle.wheel_radius[led])

    return command


def drive(machine: Stepped, command: Callable[[float, Piece | None], float], duration: float) -> Drive:
    """One drive under a command of rim speed by time and what was seen last."""
    seen: Piece | None = None
    energy = stuck = torque = 0.0
    steps = round(duration / PERIOD)
    start = end = 0.0
    for k in range(steps):
        seen = machine.advance(PERIOD, command(k * PERIOD, seen))
        if machine.ended or not len(seen.rows):
            break
        power = np.maximum(seen["torque"] * seen["wheel_speed"], 0.0).sum(axis=1)
        energy += float(power.mean()) * PERIOD
        rim = float((seen["wheel_speed"] * seen.radius)[-1].mean())
        end = float(seen["position"][-1])
        stuck += PERIOD * (rim > 0.1 and abs(float(seen["speed"][-1])) < STUCK * rim and k * PERIOD > RAMP)
        torque += float(np.abs(seen["torque"][:, machine.vehicle.driven]).mean())
    return Drive(energy, end - start, stuck / duration, torque / (k + 1))


def table(found: dict[str, list[dict[str, Drive]]], arguments: argparse.Namespace) -> str:
    """A row a task and way; energy a metre and metres as medians of the ratios to fixed speed, by machine."""
    lines = [
        f"{arguments.seeds} machines, {arguments.part}, seeds from {arguments.first}. Medians of the ratios to fixed speed, by machine.",
        "",
        "| task | way | energy a metre | ground covered | time stuck, mean |",
        "|---|---|---|---|---|",
    ]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in figures(found))])


def figures(found: dict[str, list[dict[str, Drive]]]) -> list[list[str]]:
    """The table's rows."""
    rows = []
    for task, drives in found.items():
        for way in WAYS:
            moved = [one for one in drives if min(one[way].metres, one["fixed speed"].metres) > 0.5]
            energy = np.array(
                [
                    one[way].energy
                    / one[way].metres
                    / (one["fixed speed"].energy / one["fixed speed"].metres)
                    for one in moved
                ]
            )
            metres = np.array([one[way].metres / max(one["fixed speed"].metres, 0.1) for one in drives])
            stuck = np.array([one[way].stuck for one in drives])
            said = [_said(energy, np.median), _said(metres, np.median), _said(100 * stuck, np.mean, " %")]
            rows.append([task, way, *said])
    return rows


def keep(rows: list[list[str]], arguments: argparse.Namespace) -> None:
    """Put a part's rows into the file that reports show them from."""
    every = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    every[arguments.part] = {"machines": arguments.seeds, "first": arguments.first, "rows": rows}
    KEPT.write_text(json.dumps(every, indent=1) + "\n", encoding="utf-8")


def _said(values: Floats, middle: Callable[[Floats], float], unit: str = "") -> str:
    """A figure with its 95 % interval by drawing machines."""
    rng = np.random.default_rng(0)
    draws = [middle(rng.choice(values, values.size)) for _ in range(2000)]
    low, high = np.percentile(draws, [2.5, 97.5])
    return f"{middle(values):.2f}{unit} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main()
