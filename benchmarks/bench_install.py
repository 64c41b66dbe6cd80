"""What an installation costs: import, a bare interpreter to the estimate of 60 s, the wheel's size, the site's build.

    python benchmarks/bench_install.py [--write]

The wheel is the one in dist (make wheel). Times are the best of seven fresh processes that run before all others where the system
allows it (priority.py), as other work only adds to them: by the clock, and of the processor. Beside them stands the import of pandas alone.
`--write` puts the table into docs/install.md.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from marked import put
from priority import prefer

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "install.md"
BEGIN = "<!-- made by benchmarks/bench_install.py --write -->"
ROUNDS = 7
PREPARE = """
import terragrip as tg
result = tg.simulate("accuracy-clean", seed=1)
result.save(".")
table = result.recording.to_pandas()
table[table["time"] <= 60].to_csv("log.csv", index=False)
"""
ESTIMATE = """
import terragrip as tg
estimates = tg.estimate(tg.read("log.csv"), tg.Vehicle.load("vehicle.yaml"))
assert estimates["slip_rr"].size > 5000
"""


def seconds(code: str, folder: Path) -> tuple[float, float]:
    """Best wall and processor time of a fresh interpreter that runs `code`."""
    return _best([sys.executable, "-c", code], folder, ROUNDS)


def _best(command: list[str], folder: Path, rounds: int) -> tuple[float, float]:
    walls, processors = [], []
    for _ in range(rounds):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        walls.append(time.perf_counter() - start)
        processors.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(walls), min(processors)


def rows() -> list[tuple[str, str, str, str]]:
    """What, by the clock or in size, processor time, bound."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-c", PREPARE], cwd=folder, check=True)
        times = {
            "a bare interpreter": (seconds("", folder), ""),
            "`import terragrip`": (seconds("import terragrip", folder), "0.25 s"),
            "`import pandas`, for comparison": (seconds("import pandas", folder), ""),
            "bare interpreter to the estimate of a 60 s CSV, 100 Hz": (seconds(ESTIMATE, folder), "1.5 s"),
        }
        site = [sys.executable, str(ROOT / "docs/site/make.py"), "-o", str(folder / "site")]
        times["`make docs`"] = (_best(site, folder, 1), "60 s")
    wheels = list((ROOT / "dist").glob("*.whl"))
    size = f"{wheels[0].stat().st_size / 1e6:.1f} MB" if wheels else "no wheel in dist: make wheel"
    found = [(what, f"{wall:.2f} s", f"{own:.2f} s", bound) for what, ((wall, own), bound) in times.items()]
    return [*found, ("wheel with the studio's pages", size, "", "6 MB")]


def main() -> None:
    prefer()
    lines = ["| | seen | of the processor | bound |", "|---|---:|---:|---:|"]
    lines += [f"| {' | '.join(row)} |" for row in rows()]
    load = f"{os.getloadavg()[0]:.0f} other processes on {os.cpu_count()} cores"
    print("\n".join(lines))
    if "--write" in sys.argv:
        source = f"by `python benchmarks/bench_install.py --write`, run before {load}."
        put(PAGE, BEGIN, "\n".join([*lines, "", source]))


if __name__ == "__main__":
    main()
