"""``terragrip ground``: one file of results from one or many drives, and every input that is none."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent / "ground"))
from ground_drives import FINE, GRASS, drive
from terragrip.cli import main
from terragrip.estimation import Estimates


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with run1.parquet and run2.parquet, over grass and fine soil, and soils.json, learned from two others."""
    folder = tmp_path_factory.mktemp("made")
    alone = []
    for seed, (name, ground) in enumerate({"grass": GRASS, "fine": FINE}.items()):
        alone.append(str(folder / f"{name}.parquet"))
        drive(50 + seed, [(name, ground, 60)]).write(alone[-1])
    assert main(["soils", *alone, "-q", "-o", str(folder / "soils.json")]) == 0
    for seed in (1, 2):
        drive(seed, [("grass", GRASS, 30), ("fine", FINE, 30)]).write(folder / f"run{seed}.parquet")
    return folder


@pytest.fixture
def files(made: Path, tmp_path: Path) -> list[Path]:
    """The two runs, copied with all beside them into the test's folder."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return [tmp_path / f"run{seed}.parquet" for seed in (1, 2)]


def fails(capsys: pytest.CaptureFixture[str], output: Path, *words: Any) -> str:
    """The one line of a call that exits 2 and writes nothing."""
    capsys.readouterr()
    assert main(["ground", *map(str, words), "-o", str(output)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(lines) == 1, lines
    assert not output.exists()
    return lines[0]


def test_one_drive_with_a_library(files, tmp_path, capsys):
    out, table = tmp_path / "ground.json", tmp_path / "with.parquet"
    words = [
        "ground",
        str(files[0]),
        "--library",
        str(tmp_path / "soils.json"),
        "-o",
        str(out),
        "--table",
        str(table),
    ]
    assert main(words) == 0
    output = capsys.readouterr().out
    assert "run1: 1 change, 2 sections, 0 events; grass, fine" in output
    data = json.loads(out.read_text())
    assert [s["soil"] for s in data["sections"]] == ["grass", "fine"]
    assert data["library"] == "soils.json"
    again = Estimates.read(table)
    assert set(again["soil_estimate"]) <= {"grass", "fine", "unknown"}
    assert again["soil_probability"].max() <= 1
    assert main(words) == 0  # a table with these columns, and results, may be written anew
    assert json.loads(out.read_text()) == data


def test_times_are_by_the_clock_where_the_log_has_one(files, tmp_path, capsys):
    """As in report and studio: seconds since 1970 were printed."""
    run, out = Estimates.read(files[0]), tmp_path / "ground.json"
    run.about["recording"] = {**run.about.get("recording", {}), "time_zero": "2026-07-14T10:00:00+00:00"}
    run.write(tmp_path / "dated.parquet")
    assert main(["ground", str(tmp_path / "dated.parquet"), "-o", str(out)]) == 0
    assert "\n  10:00:00  10:00:" in capsys.readouterr().out
    assert json.loads(out.read_text())["sections"][0]["start"] < 10


def test_many_drives_without_a_library(files, tmp_path, capsys):
    out, folder = tmp_path / "ground.json", tmp_path / "tables"
    assert main(["ground", *map(str, files), "-o", str(out), "--table", str(folder), "--online"]) == 0
    data = json.loads(out.read_text())
    assert {s["soil"] for s in data["sections"]} == {"unknown"}
    assert [c["run"] for c in data["changes"]] == ["run1", "run2"]
    assert all(c["reported"] > c["time"] for c in data["changes"])
    assert sorted(p.name for p in folder.iterdir()) == ["run1.parquet", "run2.parquet"]
    capsys.readouterr()
    assert main(["ground", str(folder / "run1.parquet"), "-q", "-o", str(out)]) == 0
    assert capsys.readouterr().out == ""


def test_signals_may_be_chosen(files, tmp_path):
    out = tmp_path / "ground.json"
    assert (
        main(
            [
                "ground",
                str(files[0]),
                "-q",
                "-o",
                str(out),
                "--signal",
                "soil_resistance",
                "--signal",
                "slip_sd",
            ]
        )
        == 0
    )
    (change,) = json.loads(out.read_text())["changes"]
    assert set(change["shift"]) == {"soil_resistance", "slip_sd"}
    assert change["shift"]["soil_resistance"] > 2


def test_unusable_inputs_are_one_line(files, tmp_path, capsys):
    out, soils = tmp_path / "g.json", tmp_path / "soils.json"
    assert "no such file" in fails(capsys, out, tmp_path / "none.parquet")
    assert "is given twice" in fails(capsys, out, files[0], files[0])
    (tmp_path / "x").mkdir()
    twin = tmp_path / "x" / "run1.parquet"
    twin.write_bytes(files[0].read_bytes())
    assert "has the same name" in fails(capsys, out, files[0], twin)
    assert "--length" in fails(capsys, out, files[0], "--length", "0")
    assert "is not named .json" in fails(capsys, tmp_path / "g.txt", files[0])
    assert "did you mean adhesion_std?" in fails(capsys, out, files[0], "--signal", "adhesion_stt")
    newer = tmp_path / "newer.json"
    newer.write_text(json.dumps({**json.loads(soils.read_text()), "version": 99}))
    assert "newer.json: is of version 99" in fails(capsys, out, files[0], "--library", newer)
    broken = json.loads(soils.read_text())
    broken["soils"]["fine"]["signature"]["level"] = "high"
    newer.write_text(json.dumps(broken))
    line = fails(capsys, out, files[0], "--library", newer)
    assert "soils.fine.signature: is not a signature" in line
    assert "newer.json" in line
    estimates = Estimates.read(files[0])
    del estimates.columns["adhesion_fl"]
    estimates.write(tmp_path / "cut.parquet")
    assert "cut.parquet: column adhesion_fl: is missing" in fails(capsys, out, tmp_path / "cut.parquet")
    drive(1, [("fine", FINE, 0)]).write(tmp_path / "empty.parquet")
    assert "empty.parquet: holds no row" in fails(capsys, out, tmp_path / "empty.parquet")


def test_without_the_extra_it_says_what_to_install(files, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ruptures.detection.pelt", None)
    assert "terragrip[ground]" in fails(capsys, tmp_path / "g.json", files[0])
