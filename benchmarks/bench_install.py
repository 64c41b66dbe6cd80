"""What an installation costs: import, a bare interpreter to the estimate of 60 s, the wheel's size, the site's build.

    python benchmarks/bench_install.py [--write]

The wheel is the one in dist (make wheel). Times are the median of seven fresh processes, beside the import of pandas alone, which
every user of such a library pays anyway. `--write` puts the table into docs/install.md.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from marked import put

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


def seconds(code: str, folder: Path) -> float:
    """Median wall time of a fresh interpreter that runs `code`."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def rows() -> list[tuple[str, str, str]]:
    """What, figure, bound."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-c", PREPARE], cwd=folder, check=True)
        empty, peer = seconds("", folder), seconds("import pandas", folder)
        own, whole = seconds("import terragrip", folder), seconds(ESTIMATE, folder)
        start = time.perf_counter()
        subprocess.run(
            [sys.executable, ROOT / "docs/site/make.py", "-o", folder / "site"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        site = time.perf_counter() - start
    wheels = list((ROOT / "dist").glob("*.whl"))
    size = f"{wheels[0].stat().st_size / 1e6:.1f} MB" if wheels else "no wheel in dist: make wheel"
    return [
        ("`import terragrip`", f"{own - empty:.3f} s", "0.25 s"),
        ("`import pandas`, for comparison", f"{peer - empty:.2f} s", ""),
        ("bare interpreter to the estimate of a 60 s CSV, 100 Hz", f"{whole:.2f} s", "1.5 s"),
        ("wheel with the studio's pages", size, "6 MB"),
        ("`make docs`", f"{site:.0f} s", "60 s"),
    ]


def main() -> None:
    lines = ["| | seen | bound |", "|---|---:|---:|"]
    lines += [f"| {what} | {figure} | {bound} |" for what, figure, bound in rows()]
    print("\n".join(lines))
    if "--write" in sys.argv:
        source = "by `python benchmarks/bench_install.py --write`; the machine is that of [benchmarks.md](benchmarks.md)."
        put(PAGE, BEGIN, "\n".join([*lines, "", source]))


if __name__ == "__main__":
    main()
