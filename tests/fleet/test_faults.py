"""What a fleet stands: workers killed, too much memory, a scheduler lost, a store that refuses; real schedulers and workers in processes.

After each fault every healthy log is in the data set once, whole, and every other among the failures with its reason (`whole`).
"""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
import scipy.io

from small_fleet import (
    PATIENCE,
    call,
    environment,
    fleet,
    free_port,
    serve,
    serve_worker,
    start,
    whole,
    write_log,
)
from terragrip.cli import main

LONG = 1000.0
"""Seconds of a log whose estimate takes some of the worker's time: a busy worker is looked for every 20 ms."""


def until(condition: Callable[[], object]) -> None:
    """Wait for something that another process does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.05)  # to look at all processes takes as long


def at_work(place: Path, parent: int) -> list[psutil.Process]:
    """Descendants of a process that are writing estimates in this very moment."""
    if not [*(place / "out/.tmp").glob("terragrip-fleet-*")]:
        return []  # asked each 20 ms, of which to look at 87 processes takes 4
    busy = []
    for child in psutil.Process(parent).children(recursive=True):
        try:
            if any("terragrip-fleet-" in one.path for one in child.open_files()):
                busy.append(child)
        except psutil.Error:
            continue
    return busy


class Fault(threading.Thread):
    """Does something to the processes below this one that are at work, as soon as there are some: unless told otherwise it kills them."""

    def __init__(self, place: Path, cause: Callable[[list[psutil.Process]], None] | None = None) -> None:
        super().__init__(daemon=True)
        self._place, self._cause = place, cause or _kill
        self._over, self._done = threading.Event(), False
        self.start()

    def run(self) -> None:
        while not self._over.wait(0.02):
            if busy := at_work(self._place, os.getpid()):
                self._cause(busy)
                self._done = True
                return

    def end(self) -> bool:
        """The call is over: no worker of another test is looked for. Returns whether the fault has happened."""
        self._over.set()
        self.join()
        return self._done


def _kill(processes: list[psutil.Process]) -> None:
    for one in processes:
        one.kill()


@pytest.fixture
def scratch(place: Path) -> Iterator[None]:
    """The folders of workers that a call in this process starts lie in `place`."""
    import dask

    with dask.config.set({"temporary-directory": str(place / "scratch")}):
        yield


@pytest.mark.long  # test_a_worker_here_that_dask_gives_up_is_started_anew kills one too, and its nanny does not help
@pytest.mark.usefixtures("scratch")
def test_a_worker_that_is_killed_in_mid_task(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_log(place / "logs/a/long.csv", 7, seconds=LONG)
    fault = Fault(place)
    code = main(call(place))
    assert fault.end(), "no task was seen at work"
    said = capsys.readouterr()
    assert (code, said.err) == (0, "")
    assert "0 failed" in said.out
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (7, {})


@pytest.mark.long  # test_cluster.py: a batch that loses its worker twice
@pytest.mark.usefixtures("scratch")
def test_a_log_that_needs_more_memory_than_a_worker_has(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = 12_000_000  # 0.4 GB of numbers in a file of 0.1 MB: steps of time are quickly compressed
    ones = np.ones(rows, dtype=np.uint8)
    channels = dict.fromkeys(("ground_speed", "wheel_speed_l", "wheel_speed_r"), ones)
    time_column = np.repeat(np.arange(rows // 1000, dtype=np.int32), 1000)
    scipy.io.savemat(place / "logs/a/bomb.mat", {"time": time_column, **channels}, do_compression=True)
    code = main(call(place, place / "logs/**/*.*", "--workers", 1, "--memory", "420MB"))
    said = capsys.readouterr()
    assert (code, said.err) == (0, "")
    assert "6 estimated, 0 unchanged, 1 failed" in said.out
    data, reasons = whole(place / "out")
    assert len(data) == 6
    assert list(reasons) == ["bomb.mat"]
    assert "memory" in reasons["bomb.mat"]


@pytest.mark.long  # test_fleet.py: what a killed call leaves
def test_a_call_that_is_killed_goes_on(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_log(place / "logs/a/long.csv", 7, seconds=LONG)
    process = start(place, "--workers", 1)
    notes = place / "out/state/logs"
    until(lambda: notes.is_dir() and len(list(notes.iterdir())) >= 1)
    family = [*psutil.Process(process.pid).children(recursive=True), psutil.Process(process.pid)]
    for one in family:
        one.kill()
    process.communicate()
    psutil.wait_procs(family)
    done = len(list(notes.iterdir()))
    assert main(call(place, "--workers", 1)) == 0
    assert f"{7 - done} estimated, {done} unchanged, 0 failed" in capsys.readouterr().out
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (7, {})


@pytest.mark.long  # test_cluster.py: its results are lost with it
def test_a_scheduler_that_is_lost_and_restarted(
    place: Path, started: list[subprocess.Popen[bytes]], capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(place / "logs/a/long.csv", 7, seconds=LONG)
    port = free_port()
    started += serve(place, port)

    def restart(_: object) -> None:
        for one in started:
            one.kill()
            one.wait()
        started.extend(serve(place, port))

    fault = Fault(place, restart)
    code = main(call(place, "--scheduler", f"tcp://127.0.0.1:{port}"))
    assert fault.end(), "no task was seen at work"
    said = capsys.readouterr()
    assert (code, said.err) == (0, "")
    assert "0 failed" in said.out
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (7, {})


@pytest.mark.long  # test_cluster.py: no worker comes back
def test_a_scheduler_whose_workers_are_all_lost_is_one_line(
    place: Path,
    started: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_log(place / "logs/a/long.csv", 7, seconds=LONG)
    port = free_port()
    started += serve(place, port)
    monkeypatch.setattr("terragrip.fleet.cluster.PATIENCE", 3.0)
    fault = Fault(place)
    words = call(place, "--scheduler", f"tcp://127.0.0.1:{port}", "--quiet")
    code = main(words)
    assert fault.end(), "no task was seen at work"
    assert code == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert f"tcp://127.0.0.1:{port} has had no worker for 3 s" in errors
    assert "long.csv" in errors
    assert "finished logs are kept" in errors
    rows, reasons = whole(place / "out")
    assert "long.csv" in reasons
    assert "memory" in reasons["long.csv"]

    # the next call, with a worker again, tries that log last, and does all
    started.append(serve_worker(place, port))
    assert main(words) == 0
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (7, {})
    notes = sorted((place / "out/state/logs").iterdir(), key=lambda path: path.stat().st_mtime_ns)
    assert json.loads(notes[-1].read_text())["log"] == "long.csv"


@pytest.mark.long  # by a stand-in: test_cluster.py
@pytest.mark.usefixtures("scratch")
def test_a_worker_here_that_dask_gives_up_is_started_anew(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The only worker is killed, and its nanny does not bring it back."""
    import dask
    from distributed import Nanny

    write_log(place / "logs/a/long.csv", 7, seconds=LONG)

    def abandon(busy: list[psutil.Process]) -> None:
        for nanny in Nanny._instances:
            nanny.close_gracefully()
        _kill(busy)

    fault = Fault(place, abandon)
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1 s"}):
        assert main(call(place, "--workers", 1)) == 0
    assert fault.end(), "no task was seen at work"
    said = capsys.readouterr()
    assert said.err == ""
    assert "0 failed" in said.out
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (7, {})


STORE = '''
"""A store whose every first write of a file is refused; each refusal leaves a mark."""
import os
from pathlib import Path

import fsspec
from fsspec.implementations.local import LocalFileSystem


class Moody(LocalFileSystem):
    protocol = "moody"

    @classmethod
    def _strip_protocol(cls, path):
        return super()._strip_protocol(str(path).removeprefix("moody://"))

    def put_file(self, lpath, rpath, **kwargs):
        marks = Path(os.environ["MOODY"])
        mark = marks / Path(lpath).name
        if not mark.exists():
            mark.touch()
            raise ConnectionError("the store is busy")
        super().put_file(lpath, rpath, **kwargs)


fsspec.register_implementation("moody", Moody, clobber=True)
'''


@pytest.mark.long  # test_cluster.py: the store alone
def test_a_store_that_refuses_for_a_while(place: Path) -> None:
    (place / "site").mkdir()
    (place / "marks").mkdir()
    (place / "site/sitecustomize.py").write_text(STORE)
    env = environment(place) | {
        "MOODY": str(place / "marks"),
        "PYTHONPATH": os.pathsep.join([str(place / "site"), os.environ.get("PYTHONPATH", "")]),
    }
    source, target = f"moody://{place}/logs/**/*.csv", f"moody://{place}/out"
    for estimated in (6, 0):
        code, output, errors = fleet(
            place, source, "--vehicle", place / "Heros.yaml", "-o", target, "--workers", 2, env=env
        )
        assert (code, errors) == (0, "")
        assert f"{estimated} estimated, {6 - estimated} unchanged, 0 failed" in output
    assert len(list((place / "marks").iterdir())) >= 3
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (6, {})
