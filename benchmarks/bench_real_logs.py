"""Every measured log through the whole way, and what held: the tables of docs/real-logs.md.

    python benchmarks/bench_real_logs.py [--data ../shared/data] [--write]

Each file goes through `terragrip inspect`, `estimate` (method bank), `ground`; each machine's logs together through `calibrate`, `soils`
and `report`. A step counts as done, as refused with one line (exit code 2), or as failed. NIS is of each channel, over rows that move
and carry no event, with a 95 % interval by blocks of a tenth of them. --write puts the tables into docs/real-logs.md.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

import joined_windows
import nis_causes
from marked import put
from terragrip.cli import main as terragrip
from terragrip.estimation import Estimates
from terragrip.estimation.channel_nis import PREFIX, estimate_with_channel_nis
from terragrip.formats import read
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

TOP = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("TERRAGRIP_SHARED") or TOP.parent / "shared")
EXAMPLES, DOCUMENT = TOP / "examples", TOP / "docs/real-logs.md"
BEGIN = "<!-- {}, made by benchmarks/bench_real_logs.py --write -->"
GOOD = (0.8, 1.3)
"""Where the NIS of a channel should lie."""
BLOCKS = 10
LONGEST = 120
"""Characters of a refusal that are shown."""

Floats = npt.NDArray[np.float64]


def as_it_is(log: Path, _folder: Path) -> Path:
    """The log itself."""
    return log


def windows_joined(log: Path, folder: Path) -> Path:
    """Windows of 2 s, each with a clock of its own, one after another 10 s apart, as CSV."""
    table = pd.read_csv(log)
    table.insert(0, "time", 10.0 * table["window"] + table["t_s"])
    out = folder / f"{log.name.split('.')[0]}.csv"
    table.to_csv(out, index=False)
    return out


def arrays_joined(log: Path, folder: Path) -> Path:
    """comma2k19's arrays, one a file, as one CSV with the instants of all; no reader of ours takes a folder of arrays."""
    load = {p.stem: p for p in log.parent.glob("*.npy")}
    bus, pose = "processed_log__CAN__wheel_speed__", "global_pose__frame_"
    wheels = pd.DataFrame(np.load(load[bus + "value"]), columns=["fl", "fr", "rl", "rr"])
    wheels.insert(0, "time", np.load(load[bus + "t"]))
    speed = np.linalg.norm(np.load(load[pose + "velocities"]), axis=1)
    ground = pd.DataFrame({"time": np.load(load[pose + "times"]), "speed": speed})
    table = (
        pd.concat([wheels, ground]).sort_values("time", kind="stable").groupby("time").first().reset_index()
    )
    table["time"] -= table["time"].iloc[0]
    out = folder / "comma2k19.csv"
    table.to_csv(out, index=False)
    return out


@dataclass(frozen=True)
class Source:
    """Files of one kind. ``machine``: the folder under examples/ with vehicle and profile; "": nothing but `inspect` is meant for them."""

    name: str
    files: str
    machine: str = ""
    prepare: Callable[[Path, Path], Path] = as_it_is
    profile: str = "profile.yaml"
    calibrates: bool = False


WINDOWS = "drive_warthog/windows/warthog_wheels_"
SOURCES = (
    Source("Alostar", "alostar_4wd/*.txt", "alostar_4wd", calibrates=True),
    Source("Warthog, raw", "drive_warthog/raw20hz/*.csv.gz", "drive_warthog", calibrates=True),
    Source(
        "Warthog, windows, asphalt",
        f"{WINDOWS}asphalt*.csv.gz",
        "drive_warthog",
        windows_joined,
        "windows.yaml",
    ),
    Source(
        "Warthog, windows, grass",
        f"{WINDOWS}grass*.csv.gz",
        "drive_warthog",
        windows_joined,
        "windows_grass.yaml",
    ),
    Source("Pathfinder", "pathfinder_rover/*_odom_gps_10hz.csv.gz", "pathfinder_rover", calibrates=True),
    Source("Tractor T7", "tractor_t7/*.csv.gz", "tractor_t7", profile="", calibrates=True),
    Source(
        "comma2k19",
        "ingest_samples/comma2k19_example/*wheel_speed__value.npy",
        "comma2k19",
        arrays_joined,
        calibrates=True,
    ),
    Source("Husky", "borealtc_husky/pro/*/*.csv", "drive_warthog", profile=""),
    Source("J1939 and NMEA 2000, MF4", "ingest_samples/css_j1939_mf4/*.MF4"),
    Source("John Deere 5055E, CSV of frames", "ingest_samples/tractorhacking_j1939_5055E/*.csv"),
    Source("Force sensor, ROS 1 bags", "ingest_samples/cmu_rosbag1/*.bag"),
    Source("MATLAB's own files", "ingest_samples/matlab/*.mat"),
    Source("Single wheel in sand", "cmu_single_wheel_sand/*.csv"),
    Source("Husky, IMU", "borealtc_husky/imu/*/imu_00.csv.gz"),
    Source("Pathfinder, IMU", "pathfinder_rover/*imu*.csv.gz"),
)


@dataclass
class Outcome:
    """What the steps of a source came to: for each step the exit codes and what was said."""

    steps: dict[str, list[tuple[int, str]]] = field(default_factory=dict)

    def run(self, step: str, *words: object) -> bool:
        """Run a command line in this process; whether it is done."""
        output, wrong = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(wrong):
            code = terragrip([step, *map(str, words)])
        lines = wrong.getvalue().strip().splitlines()
        self.steps.setdefault(step, []).append((code, lines[-1] if lines else ""))
        return code == 0

    def cell(self, step: str) -> str:
        """ "5", or "5 of 6", or "-" where the step was not meant."""
        if step not in self.steps:
            return "-"
        codes = [code for code, _ in self.steps[step]]
        failed = sum(code not in (0, 2) for code in codes)
        done = f"{codes.count(0)} of {len(codes)}" if codes.count(0) < len(codes) else f"{len(codes)}"
        return done + (f", {failed} FAILED" if failed else "")

    def refusals(self) -> list[str]:
        """Each refusal once, with how often, and without the file's name."""
        lines = []
        for step, result in self.steps.items():
            for code, line in result:
                if code:
                    why = line.removeprefix("terragrip: ").split(": ", 1)[-1]
                    lines.append(
                        f"`{step}`: {why if len(why) <= LONGEST else why[:LONGEST].rsplit(' ', 1)[0] + ' ...'}"
                    )
        return [f"{lines.count(line)} x {line}" for line in dict.fromkeys(lines)]


@dataclass(frozen=True)
class Log:
    """One estimated log."""

    source: Source
    name: str
    estimates: Estimates
    recording: Recording
    vehicle: Vehicle


def whole_way(source: Source, data: Path, folder: Path) -> tuple[Outcome, list[Log], int]:
    """All files of a source through all steps that are meant for it: what came of them, the estimates, and how many files there are."""
    outcome, logs, tables = Outcome(), [], []
    files = sorted(data.glob(source.files))
    where = EXAMPLES / source.machine
    prepared = [source.prepare(file, folder) for file in files]
    options: list[object] = []
    for k, log in enumerate(prepared):
        proposal = folder / f"proposal{k}.yaml"
        outcome.run("inspect", log, "--write-profile", proposal)
        if not source.machine:
            continue
        profile = where / source.profile if source.profile else proposal
        options = ["--vehicle", where / "vehicle.yaml", "--profile", profile]
        table = folder / f"estimates{k}.parquet"
        if not outcome.run("estimate", log, *options, "-o", table):
            continue
        outcome.run("ground", table, "-o", folder / f"ground{k}.json")
        tables.append(table)
        vehicle = Vehicle.load(where / "vehicle.yaml")
        recording = read(log, profile)
        estimated = estimate_with_channel_nis(recording, vehicle)
        logs.append(Log(source, files[k].name.split(".")[0].split("__")[0], estimated, recording, vehicle))
    if source.calibrates:
        outcome.run("calibrate", *prepared, *options, "-o", folder / "calibrated.yaml")
    if tables:
        outcome.run("soils", *tables, "-o", folder / "soils.json")
        outcome.run("report", *tables, "-o", folder / "report.html")
    return outcome, logs, len(files)


STEPS = ("inspect", "estimate", "calibrate", "ground", "soils", "report")


def way_table(result: list[tuple[Source, Outcome, int]]) -> str:
    """How many files each step took, and what was refused."""
    lines = ["| data | files | " + " | ".join(STEPS) + " |", "|---" * (2 + len(STEPS)) + "|"]
    output = []
    for source, outcome, files in result:
        lines.append(f"| {source.name} | {files} | " + " | ".join(map(outcome.cell, STEPS)) + " |")
        output += [f"- {source.name}, {line}" for line in outcome.refusals()]
    return "\n".join([*lines, "", "Refused, with exit code 2 and these lines:", "", *output])


def middle(values: Floats) -> float:
    """Median of the finite values, NaN without any."""
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else float("nan")


def slips(estimates: Estimates, rows: npt.NDArray[np.bool_], kind: str = "") -> Floats:
    """Slip of all wheels in the rows, together; ``kind`` "_std": its spread."""
    return np.concatenate([estimates[f"slip_{wheel}{kind}"][rows] for wheel in estimates.wheels])


def slip_table(logs: list[Log]) -> str:
    """Slip over the rows that move and carry no event, and the events."""
    lines = [
        "| data | log | s | moving | slip | 5 to 95 % | ± | outlier | gap | warned | stuck |",
        "|---" * 11 + "|",
    ]
    for log in logs:
        e, events = log.estimates, np.asarray(log.estimates["event"])
        rows = events == ""
        low, high = np.nanquantile(slips(e, rows), [0.05, 0.95])
        starts = {
            kind: int(np.sum((events == kind) & (np.roll(events, 1) != kind)))
            for kind in ("immobilization", "stuck")
        }
        moving = max(int(np.sum(events != "standstill")), 1)
        lines.append(
            f"| {log.source.name} | {log.name} | {e.time[-1] - e.time[0]:.0f} | {rows.mean():.0%} | {middle(slips(e, rows)):.3f} | "
            f"{low:.2f} to {high:.2f} | {middle(slips(e, rows, '_std')):.3f} | {np.sum(events == 'outlier') / moving:.1%} | "
            f"{np.sum(events == 'gap') / moving:.1%} | {starts['immobilization']} | {starts['stuck']} |"
        )
    return "\n".join(lines)


def findings(logs: list[Log], data: Path) -> str:
    """Slip of the tractor by what it was doing (rims above 0.5 m/s), and the median of the null test."""
    by_name = {log.source.name: log.estimates for log in logs}
    field, road = by_name["Tractor T7"], by_name["comma2k19"]
    table = pd.read_csv(next((data / "tractor_t7").glob("*.csv.gz")))
    state, rim = table["STATE"].to_numpy(), table["CAN1.CCVS1.WheelBasedVehicleSpeed"].to_numpy() / 3.6
    lines = ["| measured | rows | slip | ± |", "|---" * 4 + "|"]
    for letter, meaning in {"W": "working", "T": "turning on the headland", "M": "moving"}.items():
        rows = (state == letter) & (rim > 0.5)
        values = f"{middle(slips(field, rows)):.3f} | {middle(slips(field, rows, '_std')):.3f}"
        lines.append(f"| Tractor T7, {meaning} | {rows.sum()} | {values} |")
    rows = road.event_codes == 0
    lines.append(
        f"| comma2k19 | {rows.sum()} | {middle(slips(road, rows)):.3f} | {middle(slips(road, rows, '_std')):.3f} |"
    )
    return "\n".join(lines)


def ways(estimates: Estimates) -> list[tuple[str, npt.NDArray[np.bool_]]]:
    """Rows that move and carry no event; where left and right wheels are distinguished, also those straight ahead (sides alike to 10 %)
    and those that turn."""
    moving = estimates.event_codes == 0
    sides = [[w for w in estimates.wheels if w == word or w[1:] == word[0]] for word in ("left", "right")]
    if not all(sides):
        return [("all", moving)]
    left, right = (np.mean([estimates[f"wheel_speed_{w}"] for w in side], axis=0) for side in sides)
    turns = np.abs(left - right) >= 0.1 * np.abs(left + right)
    return [("all", moving), ("straight", moving & ~turns), ("turning", moving & turns)]


def nis_cell(estimates: Estimates, names: list[str], rows: npt.NDArray[np.bool_]) -> tuple[str, float]:
    """Mean NIS of some channels over some rows and half its 95 % interval, by the spread of means over blocks in the order of time, as
    text; and the mean, NaN where too few rows tell. In bold where the mean misses GOOD."""
    parts: list[list[float]] = [[] for _ in range(BLOCKS)]
    for name in names:
        values = estimates[name][rows & np.isfinite(estimates[name])]
        if len(values) < 2 * BLOCKS:
            return "-", float("nan")
        for k, block in enumerate(np.array_split(values, BLOCKS)):
            parts[k].append(float(block.mean()))
    if not names:
        return "-", float("nan")
    blocks = [float(np.mean(part)) for part in parts]
    mean, half = (
        float(np.mean(blocks)),
        2.26 * float(np.std(blocks, ddof=1)) / BLOCKS**0.5,
    )  # Student's t, 9 degrees
    text = f"{mean:.2f} ± {half:.2f}"
    return (text if GOOD[0] <= mean <= GOOD[1] else f"**{text}**"), mean


def nis_table(logs: list[Log]) -> str:
    """NIS of each kind of channel in each log."""
    lines = ["| data | log | rows | wheel speeds | ground speed | accelerometer |", "|---" * 6 + "|"]
    means = []
    for log in logs:
        names = [name for name in log.estimates if name.startswith(PREFIX)]
        kinds = [[n for n in names if word in n] for word in ("_wheel_", "_ground_", "_acceleration_")]
        for which, rows in ways(log.estimates):
            cells = [nis_cell(log.estimates, kind, rows) for kind in kinds]
            if which == "all":
                means += [mean for _, mean in cells if np.isfinite(mean)]
            lines.append(
                f"| {log.source.name} | {log.name} | {which} | "
                + " | ".join(text for text, _ in cells)
                + " |"
            )
    good = sum(GOOD[0] <= mean <= GOOD[1] for mean in means)
    return "\n".join(
        [*lines, "", f"Of {len(means)} means over all moving rows {good} lie in {GOOD[0]} to {GOOD[1]}."]
    )


def causes(logs: list[Log]) -> str:
    """What experiments show of each mean outside GOOD."""
    rows = []
    for log in logs:
        for kind in nis_causes.KINDS:
            known = nis_causes.values(log.estimates, kind)
            if len(known) >= 2 * BLOCKS and not GOOD[0] <= known.mean() <= GOOD[1]:
                rows.append((log.source.name, log.name, log.recording, log.vehicle, log.estimates, kind))
    return nis_causes.table(rows, lambda value: "-" if np.isnan(value) else f"{value:.2f}")


def windows_table(logs: list[Log]) -> str:
    """What windows laid one after another show."""
    joined = [log for log in logs if log.source.prepare is windows_joined]
    return joined_windows.table(
        [
            (g.source.name, g.name, joined_windows.windows_of(g.recording, g.vehicle, g.estimates))
            for g in joined
        ]
    )


def main() -> None:
    """Print or write the tables."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--data", type=Path, default=SHARED / "data")
    arguments.add_argument("--write", action="store_true", help="into docs/real-logs.md")
    arguments.add_argument("--only", help="sources whose name holds this")
    given = arguments.parse_args()
    if not given.data.is_dir():
        print(f"bench_real_logs: NOT RUN: {given.data} is absent; give the folder of measured data as --data")
        raise SystemExit(2 if given.write else 0)
    result, logs = [], []
    for source in SOURCES:
        if given.only and given.only not in source.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            outcome, estimated, files = whole_way(source, given.data, Path(folder))
        if not files:
            raise SystemExit(
                f"bench_real_logs: {given.data / source.files}: no file; give the folder of measured data as --data"
            )
        print(source.name, outcome.steps if given.only else "", flush=True)
        result.append((source, outcome, files))
        logs += estimated
    if not given.only:
        sys.path.insert(0, str(EXAMPLES))
        import real_logs
    tables = {"the way": way_table(result), "slip and events": slip_table(logs), "NIS": nis_table(logs)}
    tables["windows"] = windows_table(logs)
    if not given.only:
        tables |= {
            m.name: real_logs.table(real_logs.verdicts(m, given.data, "kalman")) for m in real_logs.MACHINES
        }
        tables |= {"findings": findings(logs, given.data), "causes": causes(logs)}
    for name, text in tables.items():
        if given.write:
            put(DOCUMENT, BEGIN.format(name), text)
        else:
            print(f"\n{name}\n\n{text}")


if __name__ == "__main__":
    main()
