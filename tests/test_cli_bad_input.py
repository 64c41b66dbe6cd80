"""The issue's list of bad input, through the real command line: exit 2, one line with file and hint, nothing written."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from terragrip.cli import main

VEHICLE = """name: robot
mass: 139 kg
wheelbase: 0.6 m
track: 0.554 m
center_of_gravity_height: 0.30 m
hitch_height: 0.25 m
axles:
  front: {mass: 54 kg, wheels: [fl, fr]}
  rear: {mass: 85 kg, wheels: [rl, rr]}
wheel: {radius: 0.20 m, inertia: 0.15 kg m^2}
"""
WHEELS = ("fl", "fr", "rl", "rr")
Refused = Callable[..., str]


def table() -> pd.DataFrame:
    t = np.arange(0, 3, 0.01)
    columns: dict[str, Any] = {"time": t, "ground_speed": 0.6 + 0 * t, "drawbar_force": 200.0 + 0 * t}
    for wheel in WHEELS:
        columns[f"wheel_speed_{wheel}"] = 3.3 + 0 * t
        columns[f"drive_torque_{wheel}"] = 20.0 + 0 * t
    return pd.DataFrame(columns)


def with_cell(column: str, value: Any, row: int = 100) -> pd.DataFrame:
    data = table().astype({column: object})
    data.loc[row, column] = value
    return data


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a good log and a good vehicle file."""
    table().to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "vehicle.yaml").write_text(VEHICLE)
    (tmp_path / "empty").mkdir()
    return tmp_path


@pytest.fixture
def refused(place: Path, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Return a function that estimates what must be refused, and gives back the line."""

    def run(
        log: Any = "log.csv", vehicle: str = "vehicle.yaml", output: str = "out.parquet", *more: str
    ) -> str:
        if isinstance(log, pd.DataFrame):
            log.to_csv(place / "bad.csv", index=False)
            log = "bad.csv"
        before = sorted(place.rglob("*"))
        code = main(
            [
                "estimate",
                str(place / log),
                "--vehicle",
                str(place / vehicle),
                "-o",
                str(place / output),
                *more,
            ]
        )
        streams = capsys.readouterr()
        lines = [line for line in streams.err.splitlines() if line.strip()]
        assert code == 2, streams.err
        assert len(lines) == 1, lines
        assert streams.out == ""
        assert sorted(place.rglob("*")) == before
        assert ";" in lines[0], "no hint"
        return lines[0]

    return run


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ("logg.csv", ["logg.csv", "no such file", "log.csv"]),
        ("empty", ["holds no log"]),
        ("*.mat", ["no file matches"]),
        (table().iloc[:0], ["bad.csv", "empty"]),
        (table().drop(columns="ground_speed"), ["ground_speed"]),
        (table().rename(columns={"ground_speed": "groundspeed"}), ["ground_speed", "'groundspeed'"]),
        (table().drop(columns="time"), ["column time"]),
        (table().assign(ground_speed="fast"), ["ground_speed", "row 1", "'fast'"]),
        (with_cell("drive_torque_rl", "n/k"), ["drive_torque_rl", "row 101", "'n/k'"]),
        (table().assign(time=table()["time"].to_numpy()[::-1]), ["time goes back", "row 2"]),
        (with_cell("time", 0.99).assign(mass=range(len(table()))), ["time repeats", "row 101"]),
        (with_cell("time", np.nan), ["column time", "row 101"]),
        (table().assign(ground_speed=np.nan), ["ground_speed", "no value"]),
        (with_cell("drawbar_force", np.inf), ["drawbar_force", "row 101", "infinite"]),
        (table().rename(columns={"wheel_speed_fl": "wheel_speed_xx"}), ["xx", "fl"]),
        (table().drop(columns="wheel_speed_rr"), ["wheel_speed_rr", "missing"]),
        (table().drop(columns="drive_torque_rr"), ["drive_torque_rr", "driven"]),
    ],
    ids=lambda value: None if isinstance(value, pd.DataFrame) else str(value)[:40],
)
def test_logs(refused: Refused, log: Any, words: list[str]) -> None:
    line = refused(log)
    for word in words:
        assert word in line


def test_files_that_are_no_tables(refused: Refused, place: Path) -> None:
    (place / "empty.csv").write_bytes(b"")
    (place / "noise.csv").write_bytes(np.random.default_rng(0).bytes(4000))
    (place / "noise.parquet").write_bytes(b"PAR1" + np.random.default_rng(0).bytes(4000) + b"PAR1")
    (place / "half.parquet").write_bytes(b"PAR1")
    (place / "text.csv").write_text("Dear reader,\nthis is a letter.\n")
    for name in ("empty.csv", "noise.csv", "noise.parquet", "half.parquet", "text.csv"):
        assert name in refused(name)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass: 139 kg", "mass: -139 kg", ["mass", "-139", "line 2"]),
        ("mass: 85 kg", "mass: 75 kg", ["129 kg", "139 kg"]),
        ("track:", "trak:", ["trak", "track", "line 4"]),
        ("0.20 m,", "0.20 volts,", ["wheel.radius", "volt"]),
        ("0.20 m,", "20 kg,", ["wheel.radius"]),
        ("0.20 m,", "200,", ["wheel.radius", "200 mm"]),
        ("wheelbase: 0.6 m\n", "", ["wheelbase"]),
        ("[fl, fr]", "[fl, rr]", ["rr"]),
        ("mass: 139 kg", "mass: [1, 2", ["vehicle.yaml"]),
        (VEHICLE, "", ["empty"]),
        (VEHICLE, "- a\n- b\n", ["mapping"]),
    ],
)
def test_vehicle_files(refused: Refused, place: Path, old: str, new: str, words: list[str]) -> None:
    (place / "vehicle.yaml").write_text(VEHICLE.replace(old, new, 1))
    line = refused()
    for word in ["vehicle.yaml", *words]:
        assert word in line


def test_a_missing_vehicle_a_missing_profile_and_an_unknown_method(refused: Refused, place: Path) -> None:
    assert "vehicle.yaml" in refused(vehicle="vehicel.yaml")
    assert "none.yaml" in refused(
        "log.csv", "vehicle.yaml", "out.parquet", "--profile", str(place / "none.yaml")
    )
    assert "aukf-fs" in refused("log.csv", "vehicle.yaml", "out.parquet", "--method", "aukffs")
    smooth = refused("log.csv", "vehicle.yaml", "out.parquet", "--method", "algebraic", "--smooth")
    assert "smooth" in smooth


@pytest.mark.parametrize("output", ["log.csv", "vehicle.yaml", "no/out.parquet", "out.doc", "."])
def test_outputs(refused: Refused, output: str) -> None:
    assert "--output" in refused(output=output)


def test_several_logs_stop_at_the_first_bad_one_before_any_work(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(place / "log.csv"), str(place / "gone.csv"), "--vehicle", str(place / "vehicle.yaml")]
    assert main(["estimate", *words, "-o", str(place / "out")]) == 2
    assert "gone.csv" in capsys.readouterr().err
    assert not (place / "out").exists()
    shutil.copy(place / "log.csv", place / "log.csv.gz")
    words[1] = str(place / "log.csv.gz")
    assert main(["estimate", *words, "-o", str(place / "out")]) == 2
    assert "same name" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["calibrate", "inspect"])
def test_the_other_readers_refuse_alike(
    command: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ["-o", str(place / "v2.yaml")] if command == "calibrate" else []
    words = [command, str(place / "gone.csv"), "--vehicle", str(place / "vehicle.yaml"), *more]
    assert main(words) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "gone.csv" in line
    assert not (place / "v2.yaml").exists()


@pytest.mark.parametrize("command", ["estimate", "calibrate", "inspect"])
def test_a_file_of_estimates_is_no_log(command: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its ``wheel_speed_fl_std`` was a wheel fl_std that the vehicle lacks, and a profile was proposed for it."""
    of = ["--vehicle", str(place / "vehicle.yaml")]
    assert main(["estimate", str(place / "log.csv"), *of, "-o", str(place / "e.parquet"), "-q"]) == 0
    capsys.readouterr()
    more = {"estimate": ["-o", str(place / "f.parquet")], "calibrate": ["-o", str(place / "f.yaml")]}
    assert main([command, str(place / "e.parquet"), *of, *more.get(command, [])]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "e.parquet: holds estimates, not a log; give the log that they were made from" in line


def test_nothing_to_calibrate_is_said_with_every_reason(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        "calibrate",
        str(place / "log.csv"),
        "--vehicle",
        str(place / "vehicle.yaml"),
        "-o",
        str(place / "v2.yaml"),
    ]
    assert main(words) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "no standstill" in line
    assert not (place / "v2.yaml").exists()


def test_scenarios(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "bad.yaml").write_text("duration: -3\n")
    for scenario, word in (("acuracy-clean", "accuracy-clean"), (str(place / "bad.yaml"), "bad.yaml")):
        assert main(["simulate", scenario, "-o", str(place / "out")]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert word in line
        assert not (place / "out").exists()


def test_a_profile_is_never_overwritten(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = place / "mine.yaml"
    mine.write_text("# hours of work\n")
    assert main(["inspect", str(place / "log.csv"), "--write-profile", str(mine)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert mine.read_text() == "# hours of work\n"
