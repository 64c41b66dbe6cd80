"""The slip set-point in the loop with the simulated plant: energy a metre, ground covered, time stuck, against fixed speed and torque.

    python benchmarks/bench_slip_control.py [--part development|held-out] [--seeds 20] [--first 0] [--write]

Each seed is a machine of terragrip.simulation.families on two tasks: work (several soils, hills, draught that comes and goes) and
digging (into a soft spot that bears less than is asked, where slip digs the wheels in). The same machine and ground three times, with
the same wanted ground speed: wheels at a fixed speed; wheels at a fixed torque (1.3 of the fixed speed's mean, rim speed up to 1.5 of
it); `SlipSetpoint` on estimates at 50 Hz from white sensor noise of the vehicle file's size. Its slip is what `advise` gives for a
work drive of that machine before, else 11.5 %. A drive lasts as its scenario says or to the end of its way. Intervals: 95 %,
bootstrap over seeds. --write puts the table into docs/advice.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marked import put
from terragrip.advice.analysis import advise
from terragrip.advice.setpoint import SlipSetpoint
from terragrip.advice.slip_only import BAND
from terragrip.estimation import TractionEstimator, estimate
from terragrip.simulation import families
from terragrip.simulation.families import Kind
from terragrip.simulation.stepped import SteppedDrive
from terragrip.simulation.trace import Trace
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]
PERIOD = 0.02  # s between samples
RAMP = 3.0  # s in which the fixed ways come to speed
STUCK = 0.1  # of the rim speed
SPARE = 1.3  # fixed torque over the mean of the fixed speed: less stalls at every harder pull
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/advice.md"
BEGIN = "<!-- made by benchmarks/bench_slip_control.py --write: {part} -->"
TASKS = ("work", "digging")
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
    parser.add_argument("--part", default="development", choices=["development", "held-out"])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--write", action="store_true", help="put the table into docs/advice.md")
    arguments = parser.parse_args()
    found: dict[str, list[dict[str, Drive]]] = {task: [] for task in TASKS}
    for kind, seed in families.machines(arguments.part, arguments.seeds, arguments.first):
        slip = advised_slip(kind, seed)
        for task in TASKS:
            found[task].append(three_ways(kind, seed, task, slip))
            print(f"{kind} {seed} {task} at {slip:.3f}: {found[task][-1]}", flush=True)
    text = table(found, arguments)
    print(f"\n{text}\n")
    if arguments.write:
        put(DOCUMENT, BEGIN.format(part=arguments.part), text)


def advised_slip(kind: Kind, seed: int) -> float:
    """The best slip of the soil with the most way on a work drive of the machine; the usual band's middle where none is given."""
    result = families.draw(kind, seed, rate=1 / PERIOD)
    advice, way = advise([estimate(result.recording, result.vehicle)], result.vehicle)
    best = advice[max(advice, key=lambda name: way[name])].best_efficiency
    return float(np.mean(BAND)) if best is None else best.slip


def three_ways(kind: Kind, seed: int, task: str, slip: float) -> dict[str, Drive]:
    """The same machine on the same ground each way."""
    scenario = families.scenario(kind, seed, task=task)  # type: ignore[arg-type]
    wanted = float(np.median([float(v) for _, v in scenario.speed if v != "off" and float(v) > 0]))
    rim = wanted / (1 - slip)

    def begin() -> SteppedDrive:
        return SteppedDrive(scenario, seed)

    def fixed(time: float, _: Trace | None) -> float:
        return rim * min(time / RAMP, 1.0)

    drives = {"fixed speed": drive(begin(), fixed, scenario.duration)}
    limited = begin()
    limited.limit_torque(SPARE * drives["fixed speed"].torque)
    drives["fixed torque"] = drive(limited, lambda t, _: 1.5 * rim * min(t / RAMP, 1.0), scenario.duration)
    led = begin()
    drives["slip set-point"] = drive(led, _controller(led.vehicle, slip, wanted, seed), scenario.duration)
    return drives


def _controller(
    vehicle: Vehicle, slip: float, wanted: float, seed: int
) -> Callable[[float, Trace | None], float]:
    """Rim speed from the set-point on estimates of noisy samples."""
    estimator, setpoint = TractionEstimator(vehicle), SlipSetpoint(vehicle, slip, wanted)
    rng, sensors = np.random.default_rng(seed), vehicle.sensors
    led = next(k for k, drives in enumerate(vehicle.driven) if drives)

    def command(time: float, seen: Trace | None) -> float:
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


def drive(machine: SteppedDrive, command: Callable[[float, Trace | None], float], duration: float) -> Drive:
    """One drive under a command of rim speed by time and what was seen last."""
    seen: Trace | None = None
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
            figures = [_said(energy, np.median), _said(metres, np.median), _said(100 * stuck, np.mean, " %")]
            lines.append(f"| {task} | {way} | {' | '.join(figures)} |")
    return "\n".join(lines)


def _said(values: Floats, middle: Callable[[Floats], float], unit: str = "") -> str:
    """A figure with its 95 % interval by drawing machines."""
    rng = np.random.default_rng(0)
    draws = [middle(rng.choice(values, values.size)) for _ in range(2000)]
    low, high = np.percentile(draws, [2.5, 97.5])
    return f"{middle(values):.2f}{unit} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main()
