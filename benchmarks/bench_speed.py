"""How fast: the kernel, whole estimates, single samples, start-up and long logs, beside filterpy in one run.

    python benchmarks/bench_speed.py [--rows 10000000] [--write]

Times are the best of a few passes on this machine; `x` is how many times faster than filterpy's UKF a step.
The targets are ratios; in seconds they are the plan's, for a machine where filterpy needs 850 us. `--write` puts what is printed into
docs/benchmarks.md, with the machine's load.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

import numpy as np
import pandas as pd

import kernel_step
import peer
import pull
from terragrip.estimation import TractionEstimator, estimate
from terragrip.estimation.methods import METHODS
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

PEER_STEPS = 1500
ROUNDS = 5  # a virtual machine's pace wanders within seconds
ENOUGH = 0.5  # s
PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
BEGIN, END = "<!-- made by benchmarks/bench_speed.py --write -->", "<!-- end of speed -->"
KERNEL_TARGETS = {"kalman": 2800, "ukf": 425, "bank": 567}  # 0.3, 2.0 and 1.5 us where filterpy needs 850
WHOLE_TARGETS = {"kalman": 500, "ukf": 200, "aukf-fs": 60}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rows", type=int, default=10_000_000, help="rows of the long log; 0 leaves it out")
    parser.add_argument("--write", action="store_true", help="put the figures into docs/benchmarks.md")
    given = parser.parse_args()
    printed = io.StringIO()
    with contextlib.redirect_stdout(_Both(sys.stdout, printed)):  # type: ignore[type-var]
        print(f"load of the machine at the start: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        measure(given.rows)
    if given.write:
        text = PAGE.read_text(encoding="utf-8")
        head, _, rest = text.partition(BEGIN)
        tail = rest.partition(END)[2]
        PAGE.write_text(f"{head}{BEGIN}\n\n```\n{printed.getvalue()}```\n\n{END}{tail}", encoding="utf-8")


class _Both:
    """Writes to the terminal and keeps what was written."""

    def __init__(self, *files: TextIO) -> None:
        self._files = files

    def write(self, text: str) -> None:
        for file in self._files:
            file.write(text)

    def flush(self) -> None:
        for file in self._files:
            file.flush()


def measure(rows: int) -> None:
    """Print all figures; ``rows`` of the long log, 0 leaves it out."""
    with tempfile.TemporaryDirectory(prefix="terragrip-bench-") as name:
        folder = Path(name)
        vehicle, vehicle_file = pull.vehicle(folder)
        log, load = pull.recording(vehicle, 600.0)
        peer_step = bench_kernel(vehicle, log, load, folder)
        peer_step = bench_whole(vehicle, log, load, peer_step)
        bench_single(vehicle, log, peer_step)
        bench_start(log, vehicle_file, folder)
        if rows:
            bench_long(log, vehicle_file, folder, rows, peer_step)


def best(function: Callable[[], object], passes: int) -> float:
    """Seconds of the fastest of at least `passes` calls, of short ones as many as `ENOUGH` holds."""
    times: list[float] = []
    while len(times) < passes or sum(times) < ENOUGH:
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def bench_kernel(vehicle: Vehicle, log: pd.DataFrame, load: np.ndarray, folder: Path) -> float:
    """Steps inside C against steps of filterpy, and that both compute the same; filterpy's seconds a step."""
    whole = pull.problem(vehicle, log, load)
    first = pull.problem(vehicle, log.iloc[: PEER_STEPS + 1], load[: PEER_STEPS + 1])
    passes = [peer.run(first, PEER_STEPS) for _ in range(3)]
    peer_state, peer_step = passes[0][0], min(step for _, step in passes)
    ours = kernel_step.run(first, folder)
    timed = kernel_step.run(whole, folder)
    print(f"filterpy UKF: {1e6 * peer_step:.0f} us a step ({PEER_STEPS} steps, 10 states, 5 channels)\n")
    print("kernel, one step inside C        us        x    target x   apart from filterpy")
    for name, (state, _) in ours.items():
        step = timed[name][1]
        target = str(KERNEL_TARGETS.get(name, ""))
        same = name in ("kalman", "ukf")
        apart = f"{np.max(np.abs(state - peer_state) / np.abs(peer_state)):.0e}" if same else "other noise"
        print(f"  {name:<26}{1e6 * step:>9.3f}{peer_step / step:>9.0f}{target:>10}     {apart}")
    return peer_step


def bench_whole(vehicle: Vehicle, log: pd.DataFrame, load: np.ndarray, peer_step: float) -> float:
    """`estimate` from recording to table, a sample, every method, in turns with filterpy; its least seconds a step."""
    recording = Recording.from_frame(log)
    problem = pull.problem(vehicle, log.iloc[: PEER_STEPS + 1], load[: PEER_STEPS + 1])
    steps = dict.fromkeys(METHODS, np.inf)
    for _ in range(ROUNDS):
        peer_step = min(peer_step, peer.run(problem, PEER_STEPS)[1])
        for name in METHODS:
            spent = best(lambda name=name: estimate(recording, vehicle, method=name).to_pandas(), 1)  # type: ignore[misc]
            steps[name] = min(steps[name], spent / len(log))
    print(f"\nfilterpy UKF, in turns with the next ones: {1e6 * peer_step:.0f} us a step at best")
    print(f"tg.estimate, whole ({len(log)} rows)  us        x    target x")
    for name, step in steps.items():
        target = str(WHOLE_TARGETS.get(name, ""))
        print(f"  {name:<26}{1e6 * step:>9.3f}{peer_step / step:>9.0f}{target:>10}")
    return peer_step


def bench_single(vehicle: Vehicle, log: pd.DataFrame, peer_step: float) -> None:
    """`update(sample)`, one call from Python, the default method."""
    samples = log.iloc[:5000].to_dict("records")

    def run() -> None:
        estimator = TractionEstimator(vehicle)
        for sample in samples:
            estimator.update(sample)

    step = best(run, 3) / len(samples)
    print(f"\nupdate(sample), default method: {1e6 * step:.1f} us, x {peer_step / step:.0f} (target 57)")


def bench_start(log: pd.DataFrame, vehicle_file: Path, folder: Path) -> None:
    """Seconds to import, and for the command on a 60 s log, each in a fresh process."""
    nothing = best(lambda: _run(sys.executable, "-c", "pass"), 5)
    imported = best(lambda: _run(sys.executable, "-c", "import terragrip"), 5)
    print(
        f"\nimport terragrip: {imported - nothing:.3f} s (target 0.25; the bare interpreter takes {nothing:.3f})"
    )
    csv = folder / "log.csv"
    log.iloc[:6000].to_csv(csv, index=False)
    command = [
        *_command(),
        "estimate",
        str(csv),
        "--vehicle",
        str(vehicle_file),
        "-o",
        str(folder / "e.parquet"),
    ]
    peer_import = best(lambda: _run(sys.executable, "-c", "import filterpy.kalman, pandas"), 3)
    spent = best(lambda: _run(*command), 3)
    print(f"terragrip estimate, 60 s log, fresh process: {spent:.2f} s (target 1.5)")
    print(f"  filterpy and pandas need {peer_import:.2f} s to import alone")


def bench_long(log: pd.DataFrame, vehicle_file: Path, folder: Path, rows: int, peer_step: float) -> None:
    """`terragrip estimate` on a long Parquet log: seconds and peak memory of the process."""
    path = folder / "long.parquet"
    _write_long(log, path, rows)
    arguments = ["estimate", str(path), "--vehicle", str(vehicle_file), "-o", str(folder / "long-e.parquet")]
    # the child measures itself, so that the memory of this process is not in the figure
    watch = (
        "import json, resource, subprocess, sys, time\n"
        "begin = time.perf_counter()\n"
        "code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(json.dumps([code, time.perf_counter() - begin, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024]))"
    )
    printed = subprocess.run(
        [sys.executable, "-c", watch, *_command(), *arguments], check=True, capture_output=True, text=True
    )
    code, seconds, processor, peak = json.loads(printed.stdout)
    if code:
        raise SystemExit(f"terragrip estimate on the long log: exit {code}\n{printed.stderr}")
    print(
        f"\n{rows} samples from Parquet to Parquet: {seconds:.0f} s, x {peer_step * rows / seconds:.0f} (target 189), "
        f"{processor:.0f} s of the processor, peak {peak / 1e9:.2f} GB (target 3)"
    )


def _write_long(log: pd.DataFrame, path: Path, rows: int) -> None:
    """The log end to end until there are `rows`, with time running on."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    length = float(log["time"].iloc[-1]) + 1.0 / pull.RATE
    writer = None
    for k, start in enumerate(range(0, rows, len(log))):
        part = log.iloc[: min(len(log), rows - start)].copy()
        part["time"] += k * length
        table = pa.Table.from_pandas(part, preserve_index=False)
        if writer is None:
            writer = pq.ParquetWriter(path, table.schema)
        writer.write_table(table)
    if writer is not None:
        writer.close()


def _run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def _command() -> list[str]:
    """The installed command beside this interpreter, else what it calls."""
    beside = Path(sys.executable).with_name("terragrip")
    if os.access(beside, os.X_OK):
        return [str(beside)]
    return [sys.executable, "-c", "from terragrip.cli import main; main()"]


if __name__ == "__main__":
    main()
