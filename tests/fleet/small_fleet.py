"""Logs of small fleets, and the command in a process of its own, as a user starts it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

PATIENCE = 600.0
"""How long [s] a busy machine may need; no test passes or fails by what it waits less."""

VEHICLE = """\
name: {name}
mass: 100 kg
axles: {{only: {{mass: 100 kg, wheels: [l, r]}}}}
wheel: {{radius: 0.2 m, inertia: 0.1 kg m^2}}
tire_rolling_resistance: 0.02
sensors: {{wheel_speed: 0.02, ground_speed: 0.01, drive_torque: 0.3, drawbar_force: 2.0}}
"""


def write_log(path: Path, seed: int, day: str = "2026-05-01", seconds: float = 20.0) -> Path:
    """Write `drive_of` to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(drive_of(seed, day, seconds))
    return path


@cache
def drive_of(seed: int, day: str, seconds: float) -> str:
    """A drive on one ground whose pull rises by steps, in closed form (physics.md 1), with noise; a CSV at 50 Hz with clock times."""
    draws = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.02)
    weight, radius, soil, tire = 100.0 * 9.80665, 0.2, 0.08, 0.02
    slip = np.interp(time, np.linspace(0, seconds, 9), np.repeat([0.06, 0.12, 0.2], 3))
    adhesion = 0.5 * (1 - np.exp(-12 * slip))
    table = {
        "time": pd.Timestamp(f"{day}T08:00:00Z") + pd.to_timedelta(time, unit="s"),
        "ground_speed": 1.0 + 0.01 * draws.standard_normal(time.size),
        "drawbar_force": (adhesion - soil) * weight + 2.0 * draws.standard_normal(time.size),
        "soil": "clay" if seed % 2 else "sand",
    }
    for wheel in "lr":
        turning = 1.0 / (radius * (1 - slip))
        table[f"wheel_speed_{wheel}"] = turning + 0.02 * draws.standard_normal(time.size)
        table[f"drive_torque_{wheel}"] = (
            adhesion + tire
        ) * radius * weight / 2 + 0.3 * draws.standard_normal(time.size)
    return str(pd.DataFrame(table).to_csv(index=False))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """`furnished`, for one test."""
    return furnished(tmp_path)


def furnished(place: Path) -> Path:
    """Two vehicle files and six logs of three days in two folders."""
    for name in ("Heros", "Thorvald"):
        (place / f"{name}.yaml").write_text(VEHICLE.format(name=name))
    for number in range(6):
        folder = place / "logs" / ("a" if number < 3 else "b")
        write_log(folder / f"drive{number}.csv", number, f"2026-05-0{1 + number // 2}")
    return place


QUIET = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500 ms",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "10 s",
}
"""Dask's own overhead, which `terragrip fleet` takes off its own workers (decision 0140): an idle scheduler with a worker took 4 % of a
processor."""


def environment(place: Path) -> dict[str, str]:
    """The workers' folders lie where the test can see them."""
    return {**os.environ, "DASK_TEMPORARY_DIRECTORY": str(place / "scratch"), "PYTHONWARNINGS": "ignore"}


def call(place: Path, *words: object) -> list[str]:
    """The command line of `terragrip fleet`: of the logs, with the first vehicle, into `out`, unless words say otherwise.

    A pattern stands first among the words.
    """
    given = [str(word) for word in words]
    given = given if given and not given[0].startswith("-") else [str(place / "logs/**/*.csv"), *given]
    given += [] if {"--vehicle", "--index"} & set(given) else ["--vehicle", str(place / "Heros.yaml")]
    given += [] if "-o" in given else ["-o", str(place / "out")]
    given += [] if {"--scheduler", "--workers"} & set(given) else ["--workers", "2"]
    return ["fleet", *given]


def start(place: Path, *words: object, env: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """The command in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "terragrip", *call(place, *words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=env or environment(place),
    )


def fleet(place: Path, *words: object, env: dict[str, str] | None = None) -> tuple[int, str, str]:
    """Exit code, output and errors."""
    process = start(place, *words, env=env)
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def serve(place: Path, port: int, **variables: str) -> list[subprocess.Popen[bytes]]:
    """A scheduler of Dask and a worker, each in a process of its own, once they are there; ``variables`` are of their environment."""
    scheduler = _dask(place, variables, "scheduler", "--host", "127.0.0.1", "--port", str(port))
    return [scheduler, serve_worker(place, port, **variables)]


def serve_worker(place: Path, port: int, **variables: str) -> subprocess.Popen[bytes]:
    """A worker that nobody restarts, once it is there: a busy machine needs more than the ten seconds for which a call looks for it."""
    from distributed import Client

    address = f"tcp://127.0.0.1:{port}"
    worker = _dask(place, variables, "worker", address, "--nthreads", "1", "--no-nanny")
    with Client(address, timeout=PATIENCE, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=PATIENCE)
    return worker


def _dask(place: Path, variables: dict[str, str], *words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words, "--no-dashboard"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment(place) | QUIET | variables,
    )


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes that end with the test."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a scheduler with a worker, for tests that look at what a call does and not at where it works."""
    port = free_port()
    processes = serve(tmp_path_factory.mktemp("fleet"), port)
    yield f"tcp://127.0.0.1:{port}"
    for process in processes:
        process.kill()
        process.wait()


def whole(out: Path) -> tuple[dict[str, int], dict[str, str]]:
    """Rows of each log in the data set, and the reasons of those that failed; checks what must hold after any fault."""
    import pyarrow.parquet as pq

    summary = pd.read_parquet(out / "summary.parquet")
    failures = pd.read_parquet(out / "failures.parquet")
    assert not set(summary["log"]) & set(failures["log"])
    assert summary["log"].is_unique
    files = sorted(str(path.relative_to(out)) for path in (out / "estimates").rglob("*") if path.is_file())
    assert files == sorted(summary["file"])
    rows = {}
    for log, file, count in zip(summary["log"], summary["file"], summary["rows"], strict=True):
        table = pq.ParquetFile(out / file).read(["log", "time"])
        assert set(table["log"].to_pylist()) == {log}
        assert table.num_rows == count
        rows[log] = count
    assert not (out / ".tmp").exists()
    return rows, dict(zip(failures["log"], failures["reason"], strict=True))
