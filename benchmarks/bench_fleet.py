"""A fleet against the bare work: logs of 60 s at 100 Hz by `run_fleet` with two workers, and one after another by `estimate_file`.

    python benchmarks/bench_fleet.py [--logs 2000] [--write]

Prints 2 x wall time over the pure work, which is measured on some of the logs in one process of its own, bytes a log, and the memory of a
worker over the run. With --write the table goes into docs/fleet.md.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import threading
import time
from pathlib import Path

from fleet_logs import write_logs

PAGE = Path(__file__).parents[1] / "docs" / "fleet.md"
BEGIN, END = "<!-- made by benchmarks/bench_fleet.py --write -->", "<!-- end -->"
WORKERS = 2


def pure_work(logs: list[Path], vehicle: Path, folder: Path) -> tuple[float, float]:
    """Mean seconds of `estimate_file` a log, by the clock and of the processor, in this process, after a first one that imports."""
    import terragrip as tg
    from terragrip.from_log import estimate_file

    machine, out = tg.Vehicle.load(vehicle), folder / "one.parquet"
    estimate_file(logs[0], machine, out)
    begin, busy = time.perf_counter(), time.process_time()
    for log in logs:
        estimate_file(log, machine, out)
    return (time.perf_counter() - begin) / len(logs), (time.process_time() - busy) / len(logs)


def processor() -> float:
    """Processor seconds of this process and of all that it started and saw end."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


class Memory(threading.Thread):
    """Resident bytes of the largest worker, looked at every half second."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.seen: list[int] = []
        self.ended = threading.Event()

    def run(self) -> None:
        import psutil

        while not self.ended.wait(0.5):
            sizes = []
            for one in psutil.Process().children(recursive=True):
                try:
                    sizes.append(one.memory_info().rss)
                except psutil.Error:
                    continue
            if sizes:
                self.seen.append(max(sizes))


def fleet_seconds(logs: list[Path], vehicle: Path, out: Path) -> tuple[float, float, list[int]]:
    """Wall and processor time of a whole call, from start of the workers to the report, and the memory over it."""
    from terragrip.fleet.logs import fleet_logs, on_disk
    from terragrip.fleet.run import run_fleet

    memory = Memory()
    memory.start()
    begin, busy = time.perf_counter(), processor()
    done = run_fleet(fleet_logs(on_disk(logs, str(out)), vehicle), str(out), workers=WORKERS)
    wall, busy = time.perf_counter() - begin, processor() - busy
    memory.ended.set()
    assert done.estimated == len(logs), done
    return wall, busy, memory.seen


def table(count: int) -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        vehicle = write_logs(folder / "logs", count)
        logs = sorted((folder / "logs").iterdir())
        some = logs[:: max(1, len(logs) // 60)]
        before = pure_work(some, vehicle, folder)
        wall, busy, seen = fleet_seconds(logs, vehicle, folder / "out")
        after = pure_work(some, vehicle, folder)
        pure, own = ((one + other) / 2 for one, other in zip(before, after, strict=True))
        size = sum(one.stat().st_size for one in (folder / "out").rglob("*") if one.is_file())
        read = sum(one.stat().st_size for one in logs)
    # workers import at first and end at last: the run between
    inner = seen[len(seen) // 5 : -max(1, len(seen) // 20)]
    third = max(1, len(inner) // 3)
    early, late = (sum(part) / len(part) / 1e6 for part in (inner[:third], inner[-third:]))
    rows = [
        (f"{WORKERS} x wall time over the pure work", f"{WORKERS * wall / (pure * count):.2f}", "1.3"),
        ("processor time of all processes over that of the pure work", f"{busy / (own * count):.2f}", ""),
        ("pure work a log", f"{1e3 * pure:.0f} ms", ""),
        ("wall time", f"{wall:.0f} s", ""),
        ("core-hours of a machine's year (2 000 h at 100 Hz)", f"{busy / count * 120_000 / 3600:.1f}", ""),
        ("memory of a worker, first third of the run, last", f"{early:.0f} MB, {late:.0f} MB", "flat"),
        ("bytes a log, read and written", f"{read / count / 1e6:.2f} MB, {size / count / 1e6:.2f} MB", ""),
    ]  # fmt: skip
    lines = ["| | seen | bound |", "|---|---:|---:|", *(f"| {' | '.join(row)} |" for row in rows)]
    load = os.getloadavg()[0]
    said = (
        f"{count} logs of 60 s at 100 Hz, {WORKERS} workers, {os.cpu_count()} cores, a load of {load:.1f} at the end, by "
        "`python benchmarks/bench_fleet.py --write`. The pure work is measured on some of the logs, before and after."
    )
    return "\n".join([*lines, "", said])


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
