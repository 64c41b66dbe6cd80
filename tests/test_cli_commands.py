"""The commands when all is well: what they write and what they say."""

from __future__ import annotations

import gzip
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from terragrip import Vehicle
from terragrip.cli import main
from terragrip.estimation import Estimates

WHEELS = ("fl", "fr", "rl", "rr")


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recording.parquet, truth.parquet, vehicle.yaml, log.csv: 40 s of work."""
    folder = tmp_path_factory.mktemp("drive")
    assert main(["simulate", "constant", "--seed", "7", "-o", str(folder), "--quiet"]) == 0
    pd.read_parquet(folder / "recording.parquet").to_csv(folder / "log.csv", index=False)
    return folder


def run(*words: Any) -> None:
    assert main([str(word) for word in words]) == 0


def test_simulate_writes_a_drive_that_its_seed_makes_again(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"recording.parquet", "truth.parquet", "vehicle.yaml", "true_parameters.json", "log.csv"}
    assert {path.name for path in drive.iterdir()} == names
    run("simulate", "constant", "--seed", 7, "-o", tmp_path / "again")
    assert "1 run written" in capsys.readouterr().out
    first, again = (pd.read_parquet(folder / "recording.parquet") for folder in (drive, tmp_path / "again"))
    pd.testing.assert_frame_equal(first, again)


def test_simulate_names_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    run("simulate", "--list")
    output = capsys.readouterr().out
    assert "campaign" in output
    assert "accuracy-clean" in output


def test_estimate_of_numbers_imports_no_more_than_it_uses(drive: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from terragrip.cli import main; code = main(sys.argv[1:]);"
        "sys.exit(code or sorted({'pandas', 'pyarrow.compute', 'numpy.random', 'terragrip.formats.inspection', 'terragrip.cli.studio'}"
        " & set(sys.modules)) or 0)"
    )
    log = tmp_path / "numbers.csv"
    pd.read_csv(drive / "log.csv").drop(columns="soil").to_csv(log, index=False)
    words = ("estimate", log, "--vehicle", drive / "vehicle.yaml", "-o", tmp_path / "e.parquet", "--quiet")
    done = subprocess.run([sys.executable, "-c", code, *words], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_estimate_writes_the_table_and_says_what_it_found(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "estimates.parquet"
    run("estimate", drive / "log.csv", "--vehicle", drive / "vehicle.yaml", "-o", out)
    streams = capsys.readouterr()
    assert streams.err == ""
    assert "adhesion" in streams.out
    assert f"Next: 'terragrip soils {out}" in streams.out
    assert str(out) in streams.out
    estimates, truth = Estimates.read(out), pd.read_parquet(drive / "truth.parquet")
    assert estimates.method == "bank"
    assert estimates.vehicle.wheels == WHEELS
    late = estimates.time > 10
    miss = estimates["adhesion_rr"][late] - truth["true_adhesion_rr"].to_numpy()[late]
    assert np.abs(miss).max() < 0.05


def test_options_of_estimate(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["estimate", drive / "log.csv", "--vehicle", drive / "vehicle.yaml", "--quiet"]
    run(*words, "--method", "kalman", "-o", tmp_path / "plain.parquet")
    run(*words, "--method", "kalman", "--smooth", "-o", tmp_path / "smooth.parquet")
    assert capsys.readouterr() == ("", "")
    plain, smooth = (Estimates.read(tmp_path / f"{name}.parquet") for name in ("plain", "smooth"))
    assert plain.method == smooth.method == "kalman"
    middle = len(plain) // 2
    assert smooth["adhesion_rr_std"][middle] < plain["adhesion_rr_std"][middle]


def test_a_profile_renames_and_scales(drive: Path, tmp_path: Path) -> None:
    log = pd.read_csv(drive / "log.csv")
    log["ground_speed"] *= 3.6
    log.rename(columns={"ground_speed": "V"}).to_csv(tmp_path / "foreign.csv", index=False)
    same = [n for n in log.columns if n not in ("time", "ground_speed", "soil") and "true" not in n]
    (tmp_path / "profile.yaml").write_text(
        "time: {from: time, unit: s}\nchannels:\n  ground_speed: {from: V, unit: km/h}\n"
        + "".join(f"  {name}: {name}\n" for name in same)
    )
    out = tmp_path / "out.parquet"
    words = ["--vehicle", drive / "vehicle.yaml", "--profile", tmp_path / "profile.yaml", "-o", out, "-q"]
    run("estimate", tmp_path / "foreign.csv", *words)
    assert np.nanmedian(Estimates.read(out)["ground_speed"]) == pytest.approx(
        log["ground_speed"].median() / 3.6, rel=0.02
    )


def test_several_logs_go_into_a_folder(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with gzip.open(tmp_path / "second.csv.gz", "wb") as stream:
        stream.write((drive / "log.csv").read_bytes())
    out = tmp_path / "out"
    logs = [drive / "log.csv", tmp_path / "second.csv.gz"]
    run("estimate", *logs, "--vehicle", drive / "vehicle.yaml", "-o", out)
    assert sorted(path.name for path in out.iterdir()) == ["log.parquet", "second.parquet"]
    assert capsys.readouterr().out.count("rows") == 2
    first, second = (Estimates.read(out / name) for name in ("log.parquet", "second.parquet"))
    assert np.array_equal(first["adhesion_rr"], second["adhesion_rr"])


def test_a_long_file_in_blocks_gives_the_same_table(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["estimate", drive / "recording.parquet", "--vehicle", drive / "vehicle.yaml", "-q", "-o"]
    run(*words, tmp_path / "whole.parquet")
    monkeypatch.setattr("terragrip.formats.parquet._LONG", 0)
    run(*words, tmp_path / "blocks.parquet")
    whole, blocks = (Estimates.read(tmp_path / f"{name}.parquet") for name in ("whole", "blocks"))
    assert np.array_equal(whole["adhesion_rr"], blocks["adhesion_rr"], equal_nan=True)
    assert np.array_equal(whole["event"], blocks["event"])


def test_inspect_reports_and_proposes(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = tmp_path / "profile.yaml"
    run("inspect", drive / "log.csv", "--vehicle", drive / "vehicle.yaml", "--write-profile", profile)
    output = capsys.readouterr().out
    assert "wheel_speed_fl" in output
    assert str(profile) in output
    out = tmp_path / "out.parquet"
    run(
        "estimate",
        drive / "log.csv",
        "--vehicle",
        drive / "vehicle.yaml",
        "--profile",
        profile,
        "-o",
        out,
        "-q",
    )
    assert len(Estimates.read(out)) == len(pd.read_csv(drive / "log.csv"))


def test_calibrate_writes_a_vehicle_that_estimates(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = pd.read_csv(drive / "log.csv")
    standing = log.iloc[:500].copy()
    standing["time"] = np.arange(500) * 0.01
    for name in standing.columns:
        if name.startswith(("wheel_speed", "ground_speed")):
            standing[name] = 0.0
        elif name.startswith("drive_torque"):
            standing[name] = 0.4 + 0.01 * np.sin(np.arange(500))
    log["drive_torque_fl"] = log["drive_torque_fl"] * 1.03
    log["time"] += 5.0
    torques = [name for name in log.columns if name.startswith("drive_torque")]
    log[torques] += 0.4
    pd.concat([standing, log]).to_csv(tmp_path / "work.csv", index=False)
    out = tmp_path / "calibrated.yaml"
    run("calibrate", tmp_path / "work.csv", "--vehicle", drive / "vehicle.yaml", "-o", out)
    output = capsys.readouterr().out
    assert "95 % interval" in output
    assert "Not determined by the data" in output
    calibrated = Vehicle.load(out)
    assert calibrated.calibration.drive_torque_offset["fl"] == pytest.approx(0.4, abs=0.05)
    assert calibrated.name == Vehicle.load(drive / "vehicle.yaml").name
    run("estimate", tmp_path / "work.csv", "--vehicle", out, "-o", tmp_path / "e.parquet", "-q")


@pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")
def test_a_bar_is_drawn_on_a_terminal_only(drive: Path) -> None:
    import pty

    code = (
        "import sys, time; from terragrip.cli.progress import progress\n"
        "with progress('work') as step:\n"
        "    for k in range(4): time.sleep(0.2); step(k + 1, 4, 'a run')\n"
    )
    quiet = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert quiet.stderr == b""
    reader, writer = pty.openpty()
    subprocess.run(
        [sys.executable, "-c", code], stderr=writer, check=True, env={**os.environ, "TERM": "xterm"}
    )
    os.close(writer)
    drawn = b""
    while True:
        try:
            piece = os.read(reader, 4096)
        except OSError:  # the other end is closed and all is read
            break
        if not piece:
            break
        drawn += piece
    os.close(reader)
    assert b"work" in drawn
    assert b"a run" in drawn
    assert b"%" in drawn
