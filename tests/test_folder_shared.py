"""One folder for the studio and two command lines at once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import terragrip as tg
from terragrip.estimation import Estimates
from terragrip.files import UNFINISHED
from terragrip.simulation import Scenario

pytest.importorskip("fastapi", reason="the studio needs terragrip[studio]")


@pytest.mark.long  # the old file stands until the new one is whole: test_files.py
def test_a_studio_lists_and_reads_while_two_command_lines_write_one_file(tmp_path: Path) -> None:
    from fastapi.testclient import TestClient

    from terragrip.studio.app import create_app

    tg.simulate(Scenario.load("grass-05"), 7).save(tmp_path)
    recording, vehicle = tg.read(tmp_path / "recording.parquet"), tg.Vehicle.load(tmp_path / "vehicle.yaml")
    target = tmp_path / "estimates.parquet"
    tg.estimate(recording, vehicle).write(target)
    words = ["estimate", "recording.parquet", "--vehicle", "vehicle.yaml", "-q", "-o", target.name]
    writers = [
        subprocess.Popen([sys.executable, "-m", "terragrip", *words, "--method", method], cwd=tmp_path)
        for method in ("kalman", "ekf")
    ]
    seen = set()
    with TestClient(create_app(tmp_path), base_url="http://127.0.0.1:8750") as studio:
        while any(writer.poll() is None for writer in writers):
            items = {item["path"]: item["kind"] for item in studio.get("/api/folder").json()["items"]}
            assert items["estimates.parquet"] == "estimates"
            assert not any(Path(name).name.startswith(".") for name in items)
            assert studio.get("/api/drive", params={"path": target.name}).status_code == 200
            seen.add(Estimates.read(target).about["method"])
    assert [writer.wait() for writer in writers] == [0, 0]
    last = Estimates.read(target)
    seen.add(last.about["method"])
    assert len(last) == len(recording)
    assert last.about["method"] in ("kalman", "ekf")
    assert seen <= {"bank", "kalman", "ekf"}
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_what_a_killed_process_left_is_no_log(tmp_path: Path) -> None:
    from terragrip.cli.drives import logs_in

    for name in ("run.csv", f"{UNFINISHED}00000000-1-abcdef01.csv"):
        (tmp_path / name).write_text("time,ground_speed\n0,1\n")
    assert logs_in([tmp_path]) == [tmp_path / "run.csv"]
