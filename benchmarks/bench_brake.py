"""What a friction brake does to the estimates: development machines whose motors give no torque below 0.

    python benchmarks/bench_brake.py [--machines 16] [--seed 8100] [--rates 100 10] [--switch 10]

Each machine drives in spurts, and slows down at 1 to 3 m/s² to rest or to a part of its speed. Where its wheels' true torques are
below 0 by 3 % of the weight, a brake gives that part, on every wheel, and the log says 0 with the sensor's noise. Three logs of one
drive: torques that contain the brake, the motors' alone, and these with a switch at ``--switch`` Hz. Intervals of 95 % are counted
while the brake acts, in the 2 s after, and in all other moving rows; means over the machines. Then: how many drives the note on a brake
that no channel tells of names, and how many right ones (brake in the torques; field work; rough ground; digging in).
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import Estimates, estimate
from terragrip.recording import Recording
from terragrip.recording.slowing import slowing_warnings
from terragrip.simulation import SimulationResult, families, simulate
from terragrip.simulation.families import Kind
from terragrip.units import STANDARD_GRAVITY

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LEAST = 0.03  # of the weight: a brake's force
SHORTEST = 0.3  # s that it acts
AFTER = 2.0  # s
MOVING = 0.05  # m/s


@dataclass(frozen=True)
class Score:
    """Of one quantity in some rows: share held by the 95 % interval, mean error, its root mean square, median SD."""

    held: float
    bias: float
    rms: float
    sd: float

    @classmethod
    def of(cls, estimates: Estimates, name: str, truth: Floats, rows: Bools) -> Score | None:
        value, sd = estimates[name], estimates[f"{name}_std"]
        rows = rows & np.isfinite(value) & np.isfinite(truth)
        if rows.sum() < 3:
            return None
        error = (value - truth)[rows]
        held = np.mean(np.abs(error) <= 1.96 * sd[rows])
        return cls(*map(float, (held, np.mean(error), np.sqrt(np.mean(error**2)), np.median(sd[rows]))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=16)
    parser.add_argument("--seed", type=int, default=8100, help="of the first machine")
    parser.add_argument("--rates", type=float, nargs="+", default=[100.0, 10.0])
    parser.add_argument("--switch", type=float, default=10.0, help="Hz of the brake's channel")
    arguments = parser.parse_args()
    print("| rate | log | rows | µ held | bias | SD | ρs held | bias | SD | slip held |")
    print("|---|---|---|---:|---:|---:|---:|---:|---:|---:|")
    for rate in arguments.rates:
        scores: dict[tuple[str, str], list[list[Score]]] = {}
        for kind, seed in families.machines("development", arguments.machines, arguments.seed):
            for place, found in scored(spurts(kind, seed, rate), arguments.switch).items():
                scores.setdefault(place, []).append(found)
        for (log, part), machines in scores.items():
            mu, rho, slip = (np.mean([_four(m[k]) for m in machines], axis=0) for k in range(3))
            cells = [f"{100 * mu[0]:.0f}", f"{mu[1]:+.3f}", f"{mu[3]:.3f}"]
            cells += [f"{100 * rho[0]:.0f}", f"{rho[1]:+.3f}", f"{rho[3]:.3f}", f"{100 * slip[0]:.0f}"]
            print(f"| {rate:g} | {log} | {part} | {' | '.join(cells)} |")
    for rate in arguments.rates:
        found = np.sum(
            [
                named(*one, rate)
                for one in families.machines("development", arguments.machines, arguments.seed)
            ],
            axis=0,
        )
        print(
            f"At {rate:g} Hz named: {found[0]} of {found[1]} drives with two brakings, {found[2]} of {found[3]} right ones."
        )


def named(kind: Kind, seed: int, rate: float) -> tuple[int, int, int, int]:
    """Drives of a machine that brakes unsaid, twice at least, that are named, and all of them; right ones named, and all."""
    result = spurts(kind, seed, rate)
    log, acts = braked(result, 10.0)
    unsaid = replace(log, channels={n: v for n, v in log.channels.items() if n != "brake"})
    often = int(np.sum(np.diff(acts.astype(int), prepend=0) > 0) >= 2)
    right = [result, spurts(kind, seed, rate, brakes=False)]
    right += [
        families.draw(kind, seed, rate=rate, task="healthy"),
        families.draw(kind, seed, rate=rate, task="digging"),
    ]
    wrong = sum(bool(slowing_warnings(one.recording, one.vehicle)) for one in right)
    return often * bool(slowing_warnings(unsaid, result.vehicle)), often, wrong, len(right)


def _four(score: Score) -> tuple[float, ...]:
    return score.held, score.bias, score.rms, score.sd


def spurts(kind: Kind, seed: int, rate: float, *, brakes: bool = True) -> SimulationResult:
    """A machine's drive in spurts with stops, half of the machines without a tool; not ``brakes``: as it is drawn."""
    made = families.scenario(kind, seed, rate=rate)
    if not brakes:
        return simulate(made, seed)
    rng = np.random.default_rng(seed)
    top = 1.5 * max(float(level) for _, level in made.speed if level != "off")
    points, time = [made.speed[0], made.speed[1]], float(made.speed[1][0])
    while time < made.duration:
        time += top / rng.uniform(0.3, 1.0)
        points.append((time, top))
        time += rng.uniform(4, 9)
        points.append((time, top))
        low = 0.0 if rng.uniform() < 0.5 else top * rng.uniform(0.2, 0.5)
        time += (top - low) / rng.uniform(1.0, 3.0)
        points.append((time, low))
        time += rng.uniform(2, 4)
        points.append((time, low))
    without = {"tools": ()} if rng.uniform() < 0.5 else {}
    return simulate(made.model_copy(update={"speed": tuple(points), **without}), seed)


def braked(result: SimulationResult, switch: float) -> tuple[Recording, Bools]:
    """The log of a machine that brakes by friction, its switch sampled at ``switch`` Hz, and the rows (n,) in which the brake acts."""
    log, vehicle, time = result.recording, result.vehicle, result.recording.time
    wheels = [w for w in vehicle.wheels if f"drive_torque_{w}" in log.channels]
    force = np.sum(
        [result.truth[f"true_drive_torque_{w}"].to_numpy() / vehicle.radii[w] for w in wheels], axis=0
    )
    width = max(round(0.1 * len(time) / (time[-1] - time[0])), 1)
    acts = np.convolve(force, np.ones(width) / width, "same") < -LEAST * vehicle.mass * STANDARD_GRAVITY
    edges = np.flatnonzero(np.diff(np.r_[0, acts.astype(int), 0]))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if time[min(end, len(time) - 1)] - time[first] < SHORTEST:
            acts[first:end] = False
    rng, channels = np.random.default_rng(1), dict(log.channels)
    for wheel in wheels:
        torque = channels[f"drive_torque_{wheel}"]
        noise = (vehicle.sensors.drive_torque or 0.0) * rng.standard_normal(len(time))
        channels[f"drive_torque_{wheel}"] = np.where(acts & (torque < 0), noise, torque)
    sent = np.diff(np.floor(time * switch), prepend=-1) > 0
    channels["brake"] = np.where(sent, acts, np.nan)
    return replace(log, channels=channels), acts


def scored(result: SimulationResult, switch: float) -> dict[tuple[str, str], list[Score]]:
    """Scores of adhesion (mean over the wheels), soil resistance and slip, by log and rows; of rows that there are."""
    log, acts = braked(result, switch)
    unsaid = replace(log, channels={n: v for n, v in log.channels.items() if n != "brake"})
    truth, time = result.truth, log.time
    moving = np.abs(truth["true_ground_speed"].to_numpy()) > MOVING
    since = time - np.maximum.accumulate(np.where(acts, time, -np.inf))
    parts = {"braked": moving & acts, "after": moving & ~acts & (since < AFTER)}
    parts["other"] = moving & ~acts & ~parts["after"]
    wheels = [w for w in result.vehicle.wheels if f"drive_torque_{w}" in log.channels]
    found: dict[tuple[str, str], list[Score]] = {}
    for name, one in (("brake in the torques", result.recording), ("no brake", unsaid), ("switch", log)):
        estimates = estimate(one, result.vehicle)

        def mean(quantity: str, rows: Bools, estimates: Estimates = estimates) -> Score | None:
            each = [
                Score.of(estimates, f"{quantity}_{w}", truth[f"true_{quantity}_{w}"].to_numpy(), rows)
                for w in wheels
            ]
            known = [_four(score) for score in each if score is not None]
            return Score(*map(float, np.mean(known, axis=0))) if known else None

        for part, rows in parts.items():
            resistance = Score.of(
                estimates, "soil_resistance", truth["true_soil_resistance"].to_numpy(), rows
            )
            three = [mean("adhesion", rows), resistance, mean("slip", rows)]
            if scores := [score for score in three if score is not None]:
                found[name, part] = scores
    return found


if __name__ == "__main__":
    main()
