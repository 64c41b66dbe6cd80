"""Long work: done, failed with one line, cancelled without a trace."""

from __future__ import annotations

import asyncio
import errno
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fastapi.testclient import TestClient

from terragrip.errors import InputError
from terragrip.studio.app import create_app

NOTICES = "ws://127.0.0.1:8750/api/notices"


def wait(
    client: TestClient, identity: str, until: tuple[str, ...] = ("done", "failed", "cancelled")
) -> dict[str, Any]:
    end = time.monotonic() + 300
    while time.monotonic() < end:
        job: dict[str, Any] = client.get(f"/api/jobs/{identity}").json()
        if job["state"] in until:
            return job
        time.sleep(0.1)  # each look costs this process some milliseconds
    raise AssertionError(f"the job did not end: {job}")


def ask(client: TestClient, **changes: Any) -> Any:
    wanted = {"recording": "recording.parquet", "vehicle": "vehicle.yaml", "output": "new.parquet", **changes}
    return client.post("/api/jobs/estimate", json=wanted)


def test_an_estimate_equals_the_one_of_the_command_line(client: TestClient, folder: Path) -> None:
    job = wait(client, ask(client).json()["id"])
    assert job["state"] == "done"
    pd.testing.assert_frame_equal(
        pd.read_parquet(folder / "new.parquet"), pd.read_parquet(folder / "estimates.parquet")
    )


def test_progress_is_told(client: TestClient) -> None:
    with client.websocket_connect(NOTICES) as notices:
        ask(client)
        states = []
        while not states or states[-1] not in ("done", "failed"):
            notice = notices.receive_json()
            if notice["kind"] == "job":
                states.append(notice["job"]["state"])
    assert states[0] == "queued"
    assert "running" in states
    assert states[-1] == "done"


@pytest.mark.parametrize(
    ("error", "hint"),
    [
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "free memory"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory"), "still there?"),
    ],
)
def test_a_job_that_cannot_be_started_fails_and_the_next_one_runs(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, error: OSError, hint: str
) -> None:
    """It ran for ever in the list: its process could not be made, and nobody said so."""

    async def none_left(*_: Any, **__: Any) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(asyncio, "create_subprocess_exec", none_left)
        job = wait(client, ask(client).json()["id"])
    assert job["state"] == "failed"
    assert str(error.strerror) in job["text"]
    assert hint in job["text"]
    assert wait(client, ask(client).json()["id"])["state"] == "done"


def test_a_log_that_does_not_fit_fails_with_one_line(client: TestClient, folder: Path) -> None:
    pd.DataFrame({"time": np.arange(20.0), "wheel_speed_xx": 1.0, "ground_speed": 1.0}).to_csv(
        folder / "odd.csv", index=False
    )
    job = wait(client, ask(client, recording="odd.csv").json()["id"])
    assert job["state"] == "failed"
    assert job["text"].startswith("odd.csv")
    assert "\n" not in job["text"]
    assert not (folder / "new.parquet").exists()


def test_two_jobs_do_not_write_one_file(client: TestClient) -> None:
    """The second replaced what the first had made, without a word, though it was told not to replace."""
    first = ask(client).json()["id"]
    again = ask(client, output="./new.parquet", method="ukf")
    assert again.status_code == 422
    assert "will be written by another job" in again.json()["detail"]
    client.delete(f"/api/jobs/{first}")
    assert ask(client).status_code == 202


def test_a_cancelled_job_leaves_nothing(client: TestClient, folder: Path) -> None:
    table = pd.read_parquet(folder / "recording.parquet")
    span = float(table["time"].iloc[-1] - table["time"].iloc[0]) + 0.01
    long = pd.concat([table.assign(time=table["time"] + i * span) for i in range(150)])
    long.to_parquet(folder / "long.parquet")
    before = sorted(folder.glob("[!.]*"))
    first = ask(client, recording="long.parquet").json()["id"]
    second = ask(client, output="second.parquet").json()["id"]
    wait(client, first, ("running",))
    assert client.delete(f"/api/jobs/{second}").json()["state"] == "cancelled"
    assert client.delete(f"/api/jobs/{first}").json()["state"] == "cancelled"
    assert wait(client, ask(client).json()["id"])["state"] == "done"
    # One job at a time: this one began when nothing was left of the other two. `.terragrip` keeps the jobs themselves.
    assert sorted(folder.iterdir()) == sorted([folder / ".terragrip", *before, folder / "new.parquet"])


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"recording": "nothing.csv"}, "no such file"),
        ({"method": "magic"}, "no method"),
        ({"method": "algebraic", "smooth": True}, "cannot smooth"),
        ({"output": "estimates.parquet"}, "exists already"),
        ({"output": "recording.parquet", "replace": True}, "is an input of this job"),
        ({"output": "new.csv"}, "has another suffix"),
        ({"output": "../new.parquet"}, "not a path in the studio's folder"),
    ],
)
def test_unusable_requests_are_refused_before_work_begins(
    client: TestClient, changes: dict[str, Any], why: str
) -> None:
    answer = ask(client, **changes)
    assert answer.status_code == 422
    assert why in answer.json()["detail"]
    assert client.get("/api/jobs").json() == []


def test_soils_are_learnt(client: TestClient, folder: Path) -> None:
    from terragrip.soil.library import SoilLibrary

    answer = client.post(
        "/api/jobs/soils", json={"estimates": ["estimates.parquet"], "output": "learnt.json"}
    )
    assert wait(client, answer.json()["id"])["state"] == "done"
    assert dict(SoilLibrary.load(folder / "learnt.json")) == dict(SoilLibrary.load(folder / "soils.json"))


def slip_alone(folder: Path) -> None:
    """slip.csv and slip.parquet: the recording without its torques, and its estimates."""
    import terragrip as tg

    recording = tg.read(folder / "recording.parquet")
    bare = {
        n: c for n, c in recording.channels.items() if n == "ground_speed" or n.startswith("wheel_speed_")
    }
    log = tg.Recording.from_frame({"time": recording.time, **bare})
    tg.estimate(log, tg.Vehicle.load(folder / "vehicle.yaml")).write(folder / "slip.parquet")


def test_soils_are_learned_beside_a_run_of_slip_alone(client: TestClient, folder: Path) -> None:
    slip_alone(folder)
    both = {"estimates": ["slip.parquet", "estimates.parquet"], "output": "all.json"}
    job = wait(client, client.post("/api/jobs/soils", json=both).json()["id"])
    assert job["state"] == "done", job["text"]
    assert "slip.parquet: left out" in job["text"]
    assert (folder / "all.json").exists()
    job = wait(
        client,
        client.post("/api/jobs/soils", json={"estimates": ["slip.parquet"], "output": "none.json"}).json()[
            "id"
        ],
    )
    assert job["state"] == "failed"
    assert "no adhesion" in job["text"]


def test_fit_says_that_slip_alone_has_no_curve(client: TestClient, folder: Path) -> None:
    slip_alone(folder)
    soils = client.get("/api/soils", params={"path": "slip.parquet"})
    assert soils.status_code == 200
    assert all("no adhesion" in soil["note"] for soil in soils.json())
    answer = client.post("/api/fit", json={"model": "exponential", "path": "slip.parquet", "soil": ""})
    assert answer.status_code == 422
    assert "no adhesion" in answer.json()["detail"]


def test_ready_means_that_the_estimate_will_run(client: TestClient, folder: Path) -> None:
    """A log that is whole but that no estimate takes: the machine has no such wheel, or does not go with the method."""
    time_ = np.arange(0.0, 60.0, 0.1)
    pd.DataFrame({"time": time_, "wheel_speed_xx": 1.0, "ground_speed": 1.0}).to_csv(
        folder / "odd.csv", index=False
    )
    for log in ("odd.csv", "recording.parquet"):
        result = client.get("/api/inspect", params={"path": log, "vehicle": "vehicle.yaml"}).json()
        job = wait(client, ask(client, recording=log, output="try.parquet", replace=True).json()["id"])
        assert result["ready"] == (job["state"] == "done")
        if not result["ready"]:
            assert result["problem"] == job["text"]


def test_jobs_outlive_the_studio(client: TestClient, folder: Path) -> None:
    done = wait(client, ask(client).json()["id"])
    failed = wait(client, ask(client, recording="soils.json", output="other.parquet").json()["id"])
    with TestClient(create_app(folder), base_url="http://127.0.0.1:8750") as later:
        assert later.get("/api/jobs").json() == [{**one, "done": 0, "total": 0} for one in (done, failed)]
        assert all(not item["path"].startswith(".") for item in later.get("/api/folder").json()["items"])
    with closing(sqlite3.connect(folder / ".terragrip/jobs.sqlite")) as base:
        assert base.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_a_job_whose_studio_was_killed_is_interrupted(folder: Path) -> None:
    script = """
import sys
from pathlib import Path
from terragrip.studio.job_store import Job, JobStore
from terragrip.studio.own_folder import OwnFolder
store = JobStore(OwnFolder(Path(sys.argv[1])))
store.save(Job("a", "estimate", "long.csv", "out.parquet", "running", words=("estimate", "long.csv")))
print(1, flush=True)
sys.stdin.read()
"""
    words = [sys.executable, "-c", script, str(folder)]
    other = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert other.stdout is not None
    assert other.stdout.readline() == b"1\n"
    with TestClient(create_app(folder), base_url="http://127.0.0.1:8750") as beside:
        assert beside.get("/api/jobs").json() == []  # it runs in another studio, and is not taken for ended
    other.kill()
    other.communicate()
    with TestClient(create_app(folder), base_url="http://127.0.0.1:8750") as later:
        (job,) = later.get("/api/jobs").json()
    assert (job["state"], job["command"]) == ("interrupted", "terragrip estimate long.csv")
    assert "run the command line again" in job["text"]


def test_a_list_of_jobs_of_a_newer_version_or_damaged_is_refused(folder: Path) -> None:
    (folder / ".terragrip").mkdir()
    path = folder / ".terragrip/jobs.sqlite"
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA user_version = 2")
    with pytest.raises(InputError, match=r"jobs\.sqlite: has version 2; update terragrip"):
        create_app(folder)
    path.write_bytes(b"nonsense" * 1000)
    with pytest.raises(
        InputError, match=r"jobs\.sqlite: cannot be read or written .*; make it writable, or remove it"
    ):
        create_app(folder)
