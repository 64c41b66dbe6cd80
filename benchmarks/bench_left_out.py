"""Do intervals hold what a measured log itself shows? A channel is left out and predicted from the others: tables of docs/real-logs.md.

    python benchmarks/bench_left_out.py [--data ../shared/data] [--only NAME] [--write]

The ground speed (and positions) for STRETCH of every EVERY seconds, begun at four instants in turn, so that all of the log is left out
once; so the yaw rate, one wheel's speed and one wheel's torque, here and on development machines (simulation); and every second sample of
the ground speed, of a wheel's speed, of a wheel's torque. Where a speed was left out and the machine
does not stand, the measured value should lie within 1.96 SD of the estimate in 95 % of rows, by the estimate's SD and the channel's
noise. A torque is no estimate: there the adhesion with it should lie within 1.96 SD of the one without, of which the variance is the
difference of both. Slips without a yaw rate should lie within 1.96 SD of those with it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench_real_logs import BEGIN, DOCUMENT, EXAMPLES, SHARED, SOURCES, Source, windows_joined
from marked import put
from terragrip.cli import main as terragrip
from terragrip.estimation import Estimates, TractionEstimator, estimate
from terragrip.formats import read
from terragrip.recording import Recording
from terragrip.simulation.families import draw, machines
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

EVERY, STRETCH, FIRST = 20.0, 5.0, 10.0
"""s"""
MACHINES, SEED, RATE = 4, 8999500, 50.0
"""Development machines, simulated, whose channels are left out, too; Hz."""
POSITIONS = ("latitude", "longitude", "altitude")
SLOW = 0.05
"""m/s: rows in which both the measured and the estimated speed are slower show nothing."""
Z = 1.96
LEAST = 30
"""Values of a share that is shown."""
MARK = BEGIN.replace("bench_real_logs", "bench_left_out")


def logs(data: Path, only: str) -> Iterator[tuple[Source, str, Recording, Vehicle]]:
    """The logs of bench_real_logs that are estimated, each with its name."""
    for source in SOURCES:
        if not source.machine or source.name == "Husky" or only not in source.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            for file in sorted(data.glob(source.files)):
                log, where = source.prepare(file, Path(folder)), EXAMPLES / source.machine
                profile = where / source.profile if source.profile else Path(folder) / "proposal.yaml"
                if not source.profile:
                    with contextlib.redirect_stdout(io.StringIO()):
                        terragrip(["inspect", str(log), "--write-profile", str(profile)])
                name = file.name.split(".")[0].split("__")[0]
                yield source, name, read(log, profile), Vehicle.load(where / "vehicle.yaml")


def without(log: Recording, names: tuple[str, ...], rows: Flags) -> Recording:
    """The log with some channels' rows empty."""
    channels = {n: np.where(rows, np.nan, c) if n in names else c for n, c in log.channels.items()}
    return replace(log, channels=channels)


def moves(estimates: Estimates, name: str, measured: Floats, radius: float = 1.0) -> Flags:
    """Rows in which the machine moves by the estimate or by the measured speed, and the speed is estimated."""
    fast = np.maximum(np.abs(estimates[name]), np.nan_to_num(np.abs(measured))) * radius > SLOW
    return fast & (np.asarray(estimates["event"]) != "standstill") & np.isfinite(estimates[name])


def fresh(log: Recording, name: str, held: bool) -> npt.NDArray[np.int_]:
    """Rows of the channel's own samples."""
    rows = np.flatnonzero(np.isfinite(log[name]))
    return rows[np.diff(log[name][rows], prepend=np.nan) != 0] if held else rows


def every_second(log: Recording, name: str, held: bool, first: int) -> tuple[Recording, npt.NDArray[np.int_]]:
    """The log without every second sample of a channel, its repetitions too, and the rows of those samples."""
    own = fresh(log, name, held)
    number = np.searchsorted(own, np.arange(len(log.time)), side="right") - 1
    return without(log, (name,), (number >= 0) & (number % 2 == first)), own[first::2]


def rims(log: Recording, vehicle: Vehicle) -> Floats:
    """Mean speed of the rims (n,) [m/s], on straight lines between samples."""
    radius = {f"wheel_speed_{w}": vehicle.radii[w] for w in vehicle.wheels} | {"wheel_based_speed": 1.0}
    known = [(n, np.isfinite(log[n])) for n in radius if n in log.channels]
    return np.mean([radius[n] * np.interp(log.time, log.time[k], log[n][k]) for n, k in known], axis=0)


def silences(log: Recording) -> list[Flags]:
    """Rows left out, for each of the instants at which a stretch begins."""
    time = log.time - log.time[0]
    return [((time - k) % EVERY < STRETCH) & (time >= FIRST) for k in np.arange(0, EVERY, STRETCH)]


def gone(
    log: Recording, vehicle: Vehicle, left: str, column: str, with_all: Estimates, noise: float
) -> Floats:
    """Rows (k, 2) in which a channel was left out for a stretch: error of a column and its SD, of the measured channel if it is that, else
    of the estimates with all channels. SD NaN: not estimated, which is said there."""
    parts = [np.empty((0, 2))]
    for out in silences(log):
        less = estimate(without(log, (left,), out), vehicle)
        if column not in less:
            continue
        spread = less[f"{column}_std"]
        variance, true = spread**2 + noise**2, log[left]
        if column != left:
            own = with_all[f"{column}_std"] ** 2 if column.startswith("adhesion") else 0.0
            variance, true = spread**2 - own, with_all[column]
        rows = out & moves(less, "ground_speed", log["ground_speed"]) & np.isfinite(true) & ~(variance <= 0)
        parts.append(np.stack([(true - less[column])[rows], np.sqrt(variance[rows])], axis=1))
    return np.concatenate(parts)


def others(log: Recording, vehicle: Vehicle) -> str:
    """Cells: slips without the yaw rate, wheels' speeds, the share of rows that have none, adhesions without a torque."""
    noise = TractionEstimator.for_recording(log, vehicle).noise
    with_all, wheels = estimate(log, vehicle), vehicle.wheels
    pairs = (
        [("angular_velocity_z", f"slip_{w}") for w in wheels],
        [(f"wheel_speed_{w}", f"wheel_speed_{w}") for w in wheels],
        [(f"drive_torque_{w}", f"adhesion_{w}") for w in wheels],
    )
    cells = []
    for k, group in enumerate(pairs):
        parts = [
            gone(log, vehicle, left, column, with_all, noise[left])
            for left, column in group
            if left in log.channels and column in with_all
        ]
        values = np.concatenate([np.empty((0, 2)), *parts])
        known = np.isfinite(values).all(axis=1)
        cells.append(share(values[known]))
        if k == 1:
            cells.append(f"{1 - known.mean():.0%}" if len(known) else "-")
    return " | ".join(cells)


def stretches(log: Recording, vehicle: Vehicle, noise: float) -> Floats:
    """Of rows whose ground speed was left out (k, 4): error of the estimate, its SD with the noise, errors of the last measured speed and
    of the rims."""
    measured, by_rims = log["ground_speed"], rims(log, vehicle)
    parts = [np.empty((0, 4))]
    for out in silences(log):
        estimates = estimate(without(log, ("ground_speed", *POSITIONS), out), vehicle)
        rows = out & np.isfinite(measured) & moves(estimates, "ground_speed", measured)
        kept = np.flatnonzero(np.isfinite(measured) & ~out)
        last = measured[kept[np.maximum(np.searchsorted(kept, np.flatnonzero(rows)) - 1, 0)]]
        now, sd = measured[rows], np.hypot(estimates["ground_speed_std"][rows], noise)
        parts.append(
            np.stack([now - estimates["ground_speed"][rows], sd, now - last, now - by_rims[rows]], axis=1)
        )
    return np.concatenate(parts)


def seconds(log: Recording, vehicle: Vehicle, name: str, noise: dict[str, float], held: bool) -> Floats:
    """Errors of a speed's left-out samples and their SDs (k, 2)."""
    parts = [np.empty((0, 2))]
    for first in (0, 1):
        less, rows = every_second(log, name, held, first)
        estimates = estimate(less, vehicle)
        if name not in estimates:
            continue
        radius = 1.0 if name == "ground_speed" else float(np.mean(list(vehicle.radii.values())))
        rows = rows[moves(estimates, name, log[name], radius)[rows]]
        sd = np.hypot(estimates[f"{name}_std"][rows], noise[name])
        parts.append(np.stack([log[name][rows] - estimates[name][rows], sd], axis=1))
    return np.concatenate(parts)


def torques(log: Recording, vehicle: Vehicle, wheel: str, held: bool, with_all: Estimates) -> Floats:
    """Differences of the adhesion with a torque and without, at its left-out samples, and their SDs (k, 2)."""
    parts = [np.empty((0, 2))]
    name = f"adhesion_{wheel}"
    for first in (0, 1):
        less, rows = every_second(log, f"drive_torque_{wheel}", held, first)
        estimates = estimate(less, vehicle)
        variance = estimates[f"{name}_std"] ** 2 - with_all[f"{name}_std"] ** 2
        known = (
            moves(estimates, "ground_speed", log["ground_speed"])
            & np.isfinite(with_all[name])
            & (variance > 0)
        )
        rows = rows[known[rows]]
        parts.append(np.stack([(with_all[name] - estimates[name])[rows], np.sqrt(variance[rows])], axis=1))
    return np.concatenate(parts)


def share(values: Floats) -> str:
    """The share of errors (k, 2) within Z SDs, as a cell: the mean of (error / SD)² behind it."""
    if len(values) < LEAST:
        return "-"
    ratio = values[:, 0] / values[:, 1]
    held = np.mean(np.abs(ratio) <= Z)
    text = f"{held:.1%}"
    return f"{text if 0.92 <= held <= 0.98 else f'**{text}**'} ({np.mean(ratio**2):.2g})"


def tables(data: Path, only: str) -> dict[str, str]:
    """The tables by name."""
    head = ("data", "log", "rows", "held", "half the interval (m/s)", "RMS: estimate", "last speed", "rims")
    one = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    head = ("data", "log", "ground speed", "one wheel's speed", "one wheel's torque")
    two = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for source, name, log, vehicle in logs(data, only):
        known = TractionEstimator.for_recording(log, vehicle)
        if source.prepare is not windows_joined:  # windows are shorter than a stretch
            rows = stretches(log, vehicle, known.noise["ground_speed"])
            sizes = " | ".join(f"{np.sqrt(np.mean(rows[:, k] ** 2)):.3f}" for k in (0, 2, 3))
            wide = Z * float(np.median(rows[:, 1])) if len(rows) else float("nan")
            one.append(f"| {source.name} | {name} | {len(rows)} | {share(rows)} | {wide:.2f} | {sizes} |")
            print(one[-1], flush=True)
        groups = [["ground_speed"], [f"wheel_speed_{w}" for w in vehicle.wheels]]
        parts = [
            [seconds(log, vehicle, n, known.noise, n in known.held) for n in g if n in log.channels]
            for g in groups
        ]
        pulls = [w for w in vehicle.wheels if f"drive_torque_{w}" in log.channels]
        with_all = estimate(log, vehicle)
        parts.append([torques(log, vehicle, w, f"drive_torque_{w}" in known.held, with_all) for w in pulls])
        cells = [share(np.concatenate([np.empty((0, 2)), *part])) for part in parts]
        two.append(f"| {source.name} | {name} | {' | '.join(cells)} |")
        print(two[-1], flush=True)
    return {"stretches left out": "\n".join(one), "samples left out": "\n".join(two)} | others_table(
        data, only
    )


def others_table(data: Path, only: str) -> dict[str, str]:
    """The table of the other channels left out for a stretch, by name; development machines first."""
    head = ("data", "log", "yaw rate: slips", "one wheel's speed", "not estimated", "one wheel's torque")
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for kind, seed in machines("development", MACHINES, SEED):
        run = draw(kind, seed, rate=RATE)
        lines.append(f"| simulation | {kind}, {seed} | {others(run.recording, run.vehicle)} |")
        print(lines[-1], flush=True)
    for source, name, log, vehicle in logs(data, only):
        if source.prepare is not windows_joined:
            lines.append(f"| {source.name} | {name} | {others(log, vehicle)} |")
            print(lines[-1], flush=True)
    return {"other stretches left out": "\n".join(lines)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", type=Path, default=SHARED / "data")
    parser.add_argument("--only", default="", help="sources whose name holds this")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/real-logs.md")
    given = parser.parse_args()
    if not given.data.is_dir():
        print(f"bench_left_out: NOT RUN: {given.data} is absent; give the folder of measured data as --data")
        raise SystemExit(2 if given.write else 0)
    for name, text in tables(given.data, given.only).items():
        if given.write:
            put(DOCUMENT, MARK.format(name), text)
        else:
            print(f"\n{name}\n\n{text}")


if __name__ == "__main__":
    main()
