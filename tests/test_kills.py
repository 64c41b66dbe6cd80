"""`kill -9` in the midst of a write: every file is whole or absent, and the next run succeeds.

`make kills`, a part of `make test-long`, sets TERRAGRIP_KILLS: how often in each of the four ways of writing.
`test_files.py` shows the same of one write.
"""

from __future__ import annotations

import os
import random
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx2
import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.estimation import Estimates
from terragrip.files import UNFINISHED
from terragrip.simulation import Scenario
from terragrip.soil.library import SoilLibrary

pytest.importorskip("fastapi", reason="the studio needs terragrip[studio]")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(os.name != "posix", reason="kill -9 is of POSIX systems"),
]

KILLS = int(os.environ.get("TERRAGRIP_KILLS", "2"))
FEW = 10
"""So many kills may all come too late by chance."""
SOIL = {"model": "exponential", "parameters": {"a": 0.6}}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording, its vehicle, and what `estimate` and `soils` write of it when nobody kills them."""
    folder = tmp_path_factory.mktemp("kills")
    tg.simulate(Scenario.load("grass-05"), 7).save(folder)
    for words in COMMANDS.values():
        assert _started(folder, *words).wait() == 0
    return folder


COMMANDS = {
    "estimates.parquet": [
        "estimate",
        "recording.parquet",
        "--vehicle",
        "vehicle.yaml",
        "-q",
        "-o",
        "estimates.parquet",
    ],
    "soils.json": ["soils", "estimates.parquet", "-q", "-o", "soils.json"],
}
READERS: dict[str, Callable[[Path], object]] = {
    "estimates.parquet": Estimates.read,
    "soils.json": SoilLibrary.load,
}


def _started(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "terragrip", *words], cwd=folder)


def _unfinished(folder: Path) -> set[str]:
    return {name for name in os.listdir(folder) if name.startswith(UNFINISHED)}


def _shown(folder: Path) -> set[str]:
    return {name for name in os.listdir(folder) if not name.startswith(".")}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_leaves_its_file_whole(made: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "project"
    shutil.copytree(made, folder)
    new, old, draws = (made / name).read_bytes(), b"what was there before", random.Random(1)
    span, midst = 0.05, 0  # how long the write takes [s], learned from runs that were done before the kill
    for kill in range(KILLS):
        before = old if kill % 2 else None
        (folder / name).unlink(missing_ok=True)
        if before is not None:
            (folder / name).write_bytes(before)
        left = _unfinished(folder)
        process = _started(folder, *COMMANDS[name])
        while process.poll() is None and not _unfinished(folder) - left:
            time.sleep(0.0005)
        began = time.perf_counter()
        moment = began + (draws.uniform(0, span) if kill else 0.0)
        while process.poll() is None and time.perf_counter() < moment:
            if not _unfinished(folder) - left:
                span = min(span, 2 * (time.perf_counter() - began))
            time.sleep(0.0005)
        process.kill()
        process.wait()
        midst += bool(_unfinished(folder) - left)
        assert _shown(folder) <= _shown(made)
        content = (folder / name).read_bytes() if (folder / name).exists() else None
        assert content in (before, new)
        if before is None and content is not None:
            READERS[name](folder / name)
    print(f"{name}: {midst} of {KILLS} kills came between the begin of the write and its end")
    assert midst > 0 or KILLS < FEW
    assert _started(folder, *COMMANDS[name]).wait() == 0
    assert (folder / name).read_bytes() == new
    assert _unfinished(folder) == set()  # of the killed ones too


class Studio:
    """A studio in a process of its own, to be killed."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.api = f"http://127.0.0.1:{port}/api"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "terragrip", "studio", str(folder), "--port", str(port)],
            stdout=subprocess.DEVNULL,
        )
        end = time.monotonic() + 60
        while time.monotonic() < end and self.process.poll() is None:
            try:
                httpx2.get(f"{self.api}/folder")
                return
            except httpx2.TransportError:
                time.sleep(0.05)
        raise AssertionError("the studio does not answer")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


def _work_and_kill(
    folder: Path, work: Callable[[Studio], None], after: Callable[[], bool], delay: float
) -> None:
    """Let a thread send requests to a studio, which is killed ``delay`` seconds after something is so."""
    studio, refused = Studio(folder), list[AssertionError]()

    def send() -> None:
        try:
            while True:
                work(studio)
        except httpx2.TransportError:  # it was killed
            pass
        except AssertionError as error:
            refused.append(error)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        end = time.monotonic() + 60
        while not after() and not refused and time.monotonic() < end:
            time.sleep(0.0005)
        time.sleep(delay)
    finally:
        studio.kill()
        thread.join()
    assert not refused, refused[0]


def test_a_studio_killed_while_it_saves_fits_keeps_each_that_it_confirmed(tmp_path: Path) -> None:
    draws, confirmed, sent = random.Random(2), [], 0
    library = tmp_path / "soils.json"

    def save(studio: Studio) -> None:
        nonlocal sent
        sent += 1
        wanted = {"library": "soils.json", "name": f"soil {sent}", **SOIL}
        assert httpx2.post(f"{studio.api}/soils/save", json=wanted).status_code == 201
        confirmed.append(f"soil {sent}")

    for _ in range(KILLS):
        known = len(confirmed)
        _work_and_kill(tmp_path, save, lambda known=known: len(confirmed) > known, draws.uniform(0, 0.2))
        kept = list(SoilLibrary.load(library))
        assert set(confirmed) <= set(kept) <= {f"soil {n}" for n in range(1, sent + 1)}
        assert _shown(tmp_path) == {"soils.json"}
    print(f"a fit saved: {KILLS} kills, {len(confirmed)} of {sent} fits confirmed")


def test_a_studio_killed_during_an_upload_has_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    rows = np.arange(4000.0)
    versions = [
        pd.DataFrame({"time": rows / 50, "ground_speed": speed + 0 * rows}).to_csv(index=False).encode()
        for speed in (1, 2)
    ]
    draws, sent, midst = random.Random(3), 0, 0

    def in_pieces(content: bytes) -> Iterator[bytes]:
        for at in range(0, len(content), 8192):
            yield content[at : at + 8192]
            time.sleep(0.002)

    def upload(studio: Studio) -> None:
        nonlocal sent
        sent += 1
        answer = httpx2.put(
            f"{studio.api}/file",
            params={"path": "log.csv", "replace": "true"},
            content=in_pieces(versions[sent % 2]),
            timeout=30,
        )
        assert answer.status_code == 201, answer.text

    for _ in range(KILLS):
        left = _unfinished(tmp_path)
        _work_and_kill(
            tmp_path, upload, lambda left=left: bool(_unfinished(tmp_path) - left), draws.uniform(0, 0.1)
        )
        midst += bool(_unfinished(tmp_path) - left)
        assert _shown(tmp_path) <= {"log.csv"}
        if (tmp_path / "log.csv").exists():
            assert (tmp_path / "log.csv").read_bytes() in versions
    print(f"an upload: {midst} of {KILLS} kills came between its begin and its end")
    assert midst > 0 or KILLS < FEW
    studio = Studio(tmp_path)
    try:
        upload(studio)
        assert _unfinished(tmp_path) == set()
    finally:
        studio.kill()
    assert (tmp_path / "log.csv").read_bytes() == versions[sent % 2]
