"""A fleet against the bare work: logs of 60 s at 100 Hz by `run_fleet` with two workers, and by `estimate_file` alone.

    python benchmarks/bench_fleet.py [--logs 2000] [--write]

The pure work is `estimate_file` as a user calls it, on some of the logs, in as many processes at once as there are workers: what else the
machine has to do, and that processes share its memory and disk, weighs on both alike. Prints 2 x wall time over it, where the time of
the processors goes, bytes a log, and the memory of a worker over the run. With --write the tables go into docs/fleet.md.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from fleet_logs import write_logs

PAGE = Path(__file__).parents[1] / "docs" / "fleet.md"
BEGIN, END = "<!-- made by benchmarks/bench_fleet.py --write -->", "<!-- end -->"
WORKERS = 2


def pure_work(logs: list[Path], vehicle: Path, folder: Path) -> tuple[float, float]:
    """Mean seconds of `estimate_file` a log, by the clock and of the processor, in `WORKERS` processes at once."""
    shares = [logs[first::WORKERS] for first in range(WORKERS)]
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        seen = list(pool.map(_alone, shares, [vehicle] * WORKERS, [folder] * WORKERS))
    wall, busy = (sum(one) / len(seen) for one in zip(*seen, strict=True))
    return wall, busy


def _alone(logs: list[Path], vehicle: Path, folder: Path) -> tuple[float, float]:
    """As `pure_work`, in this process, after a first log that imports."""
    import terragrip as tg
    from terragrip.from_log import estimate_file

    machine, out = tg.Vehicle.load(vehicle), folder / f"alone-{os.getpid()}.parquet"
    estimate_file(logs[0], machine, out)
    begin, busy = time.perf_counter(), time.process_time()
    for log in logs:
        estimate_file(log, machine, out)
    return (time.perf_counter() - begin) / len(logs), (time.process_time() - busy) / len(logs)


class Memory(threading.Thread):
    """Resident bytes of the largest worker, looked at every three seconds, with the time by the clock."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.seen: list[tuple[float, int]] = []
        self.ended = threading.Event()

    def run(self) -> None:
        import psutil

        while not self.ended.wait(3.0):
            sizes = []
            for one in psutil.Process().children(recursive=True):
                try:
                    sizes.append(one.memory_info().rss)
                except psutil.Error:
                    continue
            if sizes:
                self.seen.append((time.perf_counter(), max(sizes)))


@dataclass
class Spent:
    """Seconds of a whole call: by the clock, and of the processor by the workers, by the caller until the last log, and after it."""

    wall: float
    workers: float
    caller: float
    after: float

    @property
    def busy(self) -> float:
        return self.workers + self.caller + self.after


def fleet_seconds(logs: list[Path], vehicle: Path, out: Path) -> tuple[Spent, list[int]]:
    """A whole call, from start of the workers to the report, and the memory of a worker from the first log done to the last."""
    from terragrip.fleet.logs import fleet_logs, on_disk
    from terragrip.fleet.run import run_fleet

    memory, looks = Memory(), [(time.perf_counter(), time.process_time())]
    memory.start()
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = run_fleet(
        fleet_logs(on_disk(logs, str(out)), vehicle),
        str(out),
        workers=WORKERS,
        progress=lambda *_: looks.append((time.perf_counter(), time.process_time())),
    )
    wall, end = time.perf_counter() - begin, time.process_time()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    memory.ended.set()
    assert done.estimated == len(logs), done
    workers = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (_, start), (first, _), (last, called) = looks[0], looks[1], looks[-1]
    return Spent(wall, workers, called - start, end - called), [
        n for at, n in memory.seen if first < at < last
    ]


def table(count: int) -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        vehicle = write_logs(folder / "logs", count)
        logs = sorted((folder / "logs").iterdir())
        some = logs[:: max(1, len(logs) // 120)]
        before = pure_work(some, vehicle, folder)
        spent, seen = fleet_seconds(logs, vehicle, folder / "out")
        after = pure_work(some, vehicle, folder)
        pure, own = ((one + other) / 2 for one, other in zip(before, after, strict=True))
        size = sum(one.stat().st_size for one in (folder / "out").rglob("*") if one.is_file())
        read = sum(one.stat().st_size for one in logs)
    third = max(1, len(seen) // 3)
    early, late = (sum(part) / len(part) / 1e6 for part in (seen[:third], seen[-third:]))
    rows = [
        (f"{WORKERS} x wall time over the pure work", f"{WORKERS * spent.wall / (pure * count):.2f}", "1.3"),
        ("processor time of all processes over that of the pure work", f"{spent.busy / (own * count):.2f}", ""),
        ("wall time", f"{spent.wall:.0f} s", ""),
        ("core-hours of a machine's year (2 000 h at 100 Hz)", f"{spent.busy / count * 120_000 / 3600:.1f}", ""),
        ("memory of a worker, first third of the run, last", f"{early:.0f} MB, {late:.0f} MB", "flat"),
        ("bytes a log, read and written", f"{read / count / 1e6:.2f} MB, {size / count / 1e6:.2f} MB", ""),
    ]  # fmt: skip
    lines = ["| | seen | bound |", "|---|---:|---:|", *(f"| {' | '.join(row)} |" for row in rows)]
    parts = {
        "pure work: `estimate_file` with its summary's text": own * count,
        "workers: their start, `estimate_file` without that text, column `log`, note, rows for the curves, putting": spent.workers,
        "caller and scheduler while they work": spent.caller,
        "caller afterwards, on one core: end of the workers, curves, tables, report": spent.after,
    }
    lines += ["", "| processor time | ms a log |", "|---|---:|"]
    lines += [f"| {what} | {1e3 * seconds / count:.1f} |" for what, seconds in parts.items()]
    lines += _scale(count, spent, read, size)
    load = os.getloadavg()[0]
    said = (
        f"{count} logs of 60 s at 100 Hz, {WORKERS} workers, {os.cpu_count()} cores, a load of {load:.1f} at the end, by "
        f"`python benchmarks/bench_fleet.py --logs {count} --write`. The pure work is measured on {len(some)} of the logs, before and "
        f"after, in {WORKERS} processes at once: {1e3 * before[0]:.0f} ms and {1e3 * after[0]:.0f} ms a log by the clock, "
        f"{1e3 * before[1]:.0f} ms and {1e3 * after[1]:.0f} ms of a processor."
    )
    return "\n".join([*lines, "", said])


def _scale(count: int, spent: Spent, read: int, size: int) -> list[str]:
    """What these figures come to for many logs of a minute."""
    year, cores = 2000 * 60, 64
    hours = spent.busy / count * year / 3600
    rows = {
        "a machine's year: 2 000 h in logs of a minute": f"{year} logs, {hours:.1f} core-hours",
        "it reads and writes": f"{read / count * year / 1e9:.0f} GB, {size / count * year / 1e9:.0f} GB",
        f"100 such years on {cores} cores": f"{100 * (spent.workers / count * year / 3600) / cores:.1f} h",
        "workers that one caller with its scheduler keeps at such logs": f"{spent.workers / spent.caller:.0f}",
        "the caller alone at the end of such a year, at most": f"{spent.after / count * year / 60:.0f} min",
    }
    return ["", "| many logs | |", "|---|---:|", *(f"| {what} | {said} |" for what, said in rows.items())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--logs", type=int, default=2000)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    made = table(given.logs)
    print(made)
    if given.write:
        text = PAGE.read_text(encoding="utf-8")
        head, _, rest = text.partition(BEGIN)
        PAGE.write_text(f"{head}{BEGIN}\n\n{made}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
