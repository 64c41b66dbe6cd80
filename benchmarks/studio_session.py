"""A studio process on a folder with a simulated run, and a browser in front of it: shared by the benchmark, the screenshots and tests."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
]


def fill(folder: Path, scenario: str = "multi2", seed: int = 0) -> None:
    """Recording, vehicle, estimates, soil library and ground of one simulated run of the campaign."""
    import terragrip as tg
    from terragrip.soil.estimates import soils_of

    _simulated(folder, scenario, seed).rename(folder / f"{scenario}.parquet")
    tg.estimate(tg.read(folder / f"{scenario}.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")).write(
        folder / f"{scenario}-estimates.parquet"
    )
    soils_of([folder / f"{scenario}-estimates.parquet"]).library().write(folder / "soils.json")


def fill_long(folder: Path, rows: int, scenario: str = "multi2", seed: int = 0) -> str:
    """Recording and estimates of one simulated run driven over and over until there are `rows`; returns the estimates' name."""
    import numpy as np
    import polars as pl

    import terragrip as tg

    recording = _simulated(folder, scenario, seed)
    once = pl.read_parquet(recording)
    recording.unlink()
    times = once["time"].to_numpy()
    lap = times[-1] - times[0] + 0.01
    laps = -(-rows // len(once))
    time = np.concatenate([times + k * lap for k in range(laps)])[:rows]
    long = pl.concat([once] * laps)[:rows].with_columns(pl.Series("time", time))
    long.write_parquet(folder / "long.parquet")
    table = tg.estimate(tg.read(folder / "long.parquet"), tg.Vehicle.load(folder / "vehicle.yaml"))
    table.write(folder / "long-estimates.parquet")
    return "long-estimates.parquet"


def _simulated(folder: Path, scenario: str, seed: int) -> Path:
    """The recording of a simulated run, its vehicle beside it, without the truth."""
    import terragrip as tg
    from terragrip.simulation import Scenario

    tg.simulate(Scenario.load(scenario), seed).save(folder)
    (folder / "truth.parquet").unlink()
    (folder / "true_parameters.json").unlink()
    return folder / "recording.parquet"


@contextlib.contextmanager
def studio(folder: Path) -> Iterator[tuple[str, int]]:
    """Serve the folder; gives the address and the process's number."""
    process = subprocess.Popen(
        [sys.executable, "-m", "terragrip", "studio", str(folder), "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = ""
        while "http://" not in line:
            line = process.stdout.readline()
            if not line:
                raise SystemExit("the studio did not start")
        match = re.search(r"http://\S+", line)
        assert match is not None
        yield match.group(0), process.pid
    finally:
        process.terminate()
        process.wait(60)


def chromium() -> str | None:
    """Debian's chromium, or None; its shell without windows by preference, which takes half of the processor for the same pages."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser")
    return next(filter(None, map(shutil.which, names)), None)


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """Debian's chromium by playwright."""
    from playwright.sync_api import sync_playwright

    path = chromium()
    if path is None:
        raise SystemExit("this needs chromium: apt-get install chromium-headless-shell")
    with sync_playwright() as started:
        running = started.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield running
        running.close()
