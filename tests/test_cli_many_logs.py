"""Many logs at once: folders, patterns, a profile each, drives of several files; one that cannot be read does not stop the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.from_log import follows

VEHICLE = """\
mass: 20 kg
axles: {only: {mass: 20 kg, wheels: [l, r]}}
wheel: {radius: 0.1 m, inertia: 0.01 kg m^2}
"""
PROFILE = "time: {from: t}\nchannels:\n  ground_speed: {from: v}\n  wheel_speed_l: {from: L}\n  wheel_speed_r: {from: R}\n"


def log_of(slip: float, seed: int = 0) -> pd.DataFrame:
    draws = np.random.default_rng(seed)
    time = np.arange(0, 30, 0.1)
    speed = np.clip(np.minimum(time - 2, 1.0), 0, None)
    wheel = speed / (1 - slip) / 0.1
    return pd.DataFrame(
        {
            "time": time,
            "ground_speed": speed + 0.01 * draws.standard_normal(len(time)),
            "wheel_speed_l": wheel + 0.05 * draws.standard_normal(len(time)),
            "wheel_speed_r": wheel + 0.05 * draws.standard_normal(len(time)),
        }
    )


OTHERS = {"time": "t", "ground_speed": "v", "wheel_speed_l": "L", "wheel_speed_r": "R"}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Two folders of logs with other names for the columns in each."""
    (tmp_path / "vehicle.yaml").write_text(VEHICLE)
    (tmp_path / "short.yaml").write_text(PROFILE)
    own = PROFILE
    for short, long in (
        ("from: t}", "from: time}"),
        ("from: v", "from: ground_speed"),
        ("from: L", "from: wheel_speed_l"),
    ):
        own = own.replace(short, long)
    (tmp_path / "long.yaml").write_text(own.replace("from: R", "from: wheel_speed_r"))
    for folder in ("ours", "theirs"):
        (tmp_path / folder).mkdir()
    for number, slip in enumerate((0.1, 0.2, 0.3)):
        log_of(slip, number).to_csv(tmp_path / "ours" / f"a{number}.csv", index=False)
        log_of(slip, number).rename(columns=OTHERS).to_csv(
            tmp_path / "theirs" / f"b{number}.csv", index=False
        )
    return tmp_path


def slips(folder: Path) -> dict[str, float]:
    return {
        path.stem: round(float(np.nanmedian(tg.Estimates.read(path)["slip_l"])), 1)
        for path in sorted(folder.iterdir())
    }


def estimate(place: Path, *words: object) -> int:
    return main(
        ["estimate", *map(str, words), "--vehicle", str(place / "vehicle.yaml"), "-o", str(place / "out")]
    )


@pytest.mark.parametrize("logs", ["ours", "ours/*.csv", "**/a?.csv"])
def test_a_folder_or_a_pattern(place: Path, logs: str) -> None:
    assert estimate(place, place / logs) == 0
    assert slips(place / "out") == {"a0": 0.1, "a1": 0.2, "a2": 0.3}


def test_a_folder_with_one_log_goes_into_a_folder_too(place: Path) -> None:
    for name in ("a1.csv", "a2.csv"):
        (place / "ours" / name).unlink()
    assert estimate(place, place / "ours") == 0
    assert slips(place / "out") == {"a0": 0.1}
    words = ["--vehicle", str(place / "vehicle.yaml"), "-o", str(place / "one.parquet")]
    assert main(["estimate", str(place / "ours"), *words]) == 0
    assert tg.Estimates.read(place / "one.parquet").wheels == ("l", "r")


def test_logs_below_a_folder_are_not_left_out_without_a_word(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "ours" / "day2").mkdir()
    (place / "ours" / "a2.csv").rename(place / "ours" / "day2" / "a2.csv")
    assert estimate(place, place / "ours") == 0
    assert slips(place / "out") == {"a0": 0.1, "a1": 0.2}
    assert f"ours: its subfolders are not searched; '{place}/ours/**/*.csv' names" in capsys.readouterr().err
    assert estimate(place, place) == 2
    assert "holds no log, its subfolders do; name them" in capsys.readouterr().err


def test_a_profile_each(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profiles = ["--profile", place / "long.yaml", "--profile", place / "short.yaml"]
    assert estimate(place, place / "ours", place / "theirs/b[01].csv", *profiles) == 0
    assert slips(place / "out") == {"a0": 0.1, "a1": 0.2, "a2": 0.3, "b0": 0.1, "b1": 0.2}
    capsys.readouterr()
    assert estimate(place, place / "ours", *profiles) == 2
    assert "there are 2 profiles for 1; give one, or one for each LOG" in capsys.readouterr().err


def test_one_that_cannot_be_read_is_named_and_the_others_go_on(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "ours" / "a1.csv").write_bytes(b"\x00\xff\x13" * 400)
    log_of(0.1).drop(columns="ground_speed").to_csv(place / "ours" / "a3.csv", index=False)
    assert estimate(place, place / "ours") == 2
    streams = capsys.readouterr()
    lines = streams.err.splitlines()
    assert len(lines) == 2
    assert "a1.csv" in lines[0]
    assert "a3.csv: column ground_speed: is missing" in lines[1]
    assert "2 of 4 logs could not be estimated" in lines[1]
    assert slips(place / "out") == {"a0": 0.1, "a2": 0.3}
    assert "Written to" in streams.out
    assert "2 of 4" in streams.out


def test_the_summary_keeps_the_notes_of_each_log(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = log_of(0.2)
    odd["ground_speed"] *= 3.6
    odd.to_csv(place / "ours" / "a1.csv", index=False)
    assert estimate(place, place / "ours") == 0
    said = capsys.readouterr().out
    first, second = said.index("a1.csv: "), said.index("a2.csv: ")
    assert "times the ground speed" in said[first:second]
    assert "times the ground speed" not in said[:first] + said[second:]


def test_a_table_of_drives_joins_files_as_python_does(place: Path) -> None:
    whole = log_of(0.2, 5)
    whole[["time", "ground_speed"]].to_csv(place / "gnss.csv", index=False)
    whole.drop(columns="ground_speed").rename(columns=OTHERS).to_csv(place / "bus.csv", index=False)
    (place / "bus.yaml").write_text(PROFILE.replace("  ground_speed: {from: v}\n", ""))
    table = place / "drives.csv"
    table.write_text(
        "log,profile,drive\nbus.csv,bus.yaml,morning\ngnss.csv,,morning\ntheirs/b0.csv,short.yaml,\nours/a2.csv,,\n"
    )
    assert estimate(place, "--drives", table) == 0
    assert slips(place / "out") == {"morning": 0.2, "b0": 0.1, "a2": 0.3}
    recording = tg.read([place / "bus.csv", place / "gnss.csv"], [place / "bus.yaml", None])
    expected = tg.estimate(recording, tg.Vehicle.load(place / "vehicle.yaml"))
    morning = tg.Estimates.read(place / "out" / "morning.parquet")
    assert np.array_equal(morning["slip_l"], expected["slip_l"], equal_nan=True)


def test_with_takes_a_profile_for_each_source(place: Path) -> None:
    whole = log_of(0.2, 5)
    whole[["time", "ground_speed"]].to_csv(place / "gnss.csv", index=False)
    whole.drop(columns="ground_speed").rename(columns=OTHERS).to_csv(place / "bus.csv", index=False)
    (place / "bus.yaml").write_text(PROFILE.replace("  ground_speed: {from: v}\n", ""))
    (place / "gnss.yaml").write_text("time: {from: time}\nchannels:\n  ground_speed: {from: ground_speed}\n")
    out = place / "joined.parquet"
    words = [
        place / "bus.csv",
        "--with",
        place / "gnss.csv",
        "--profile",
        place / "bus.yaml",
        "--profile",
        place / "gnss.yaml",
    ]
    words += ["--vehicle", place / "vehicle.yaml", "-o", out]
    assert main(["estimate", *map(str, words)]) == 0
    assert np.nanmedian(tg.Estimates.read(out)["slip_l"]) == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("logs\na.csv\n", ["line 1", "has no column log"]),
        ("log,profil\na.csv,x\n", ["unknown column 'profil'"]),
        ("log\n", ["names no log"]),
        ("log,drive\n,x\n", ["row 2", "names no log"]),
        ("log,profile\nours/a0.csv,gone.yaml\n", ["gone.yaml", "no such file"]),
        ("log\nours/gone.csv\nours/a0.csv\n", ["gone.csv", "no such file"]),
    ],
)
def test_a_table_that_cannot_be_used_is_one_line_before_any_work(
    place: Path, capsys: pytest.CaptureFixture[str], text: str, words: list[str]
) -> None:
    (place / "drives.csv").write_text(text)
    assert estimate(place, "--drives", place / "drives.csv") == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    for word in words:
        assert word in line
    assert not (place / "out").exists()


def test_many_logs_and_one_file_is_refused(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "estimate",
        str(place / "ours"),
        "--vehicle",
        str(place / "vehicle.yaml"),
        "-o",
        str(place / "x.parquet"),
    ]
    assert main(words) == 2
    assert "is one file for 3 logs; name a folder" in capsys.readouterr().err
    assert main(["estimate", "--vehicle", str(place / "vehicle.yaml"), "-o", str(place / "x.parquet")]) == 2
    assert "no log is named" in capsys.readouterr().err


@pytest.mark.sample(3)
@pytest.mark.parametrize("clock", [0.0, 1.7e9])
@pytest.mark.parametrize(("gap", "said"), [(0.1, True), (600.0, False)])
def test_a_drive_that_was_cut_into_files_is_said(
    place: Path, capsys: pytest.CaptureFixture[str], clock: float, gap: float, said: bool
) -> None:
    """By times that run on; logs that each begin at 0 are drives of their own."""
    begin = clock
    for number in range(3):
        part = log_of(0.1, number)
        part["time"] += begin
        part.to_csv(place / f"cut{number}.csv", index=False)
        begin = part["time"].iloc[-1] + gap
    logs = [str(place / f"cut{number}.csv") for number in range(3)]
    assert main(["estimate", *logs, "--vehicle", str(place / "vehicle.yaml"), "-o", str(place / "out")]) == 0
    printed = capsys.readouterr().out
    assert ("cut1.csv begins where cut0.csv ends" in printed) is said
    assert printed.count("make one file of them") == 2 * said
    assert (
        main(
            [
                "estimate",
                str(place / "ours"),
                "--vehicle",
                str(place / "vehicle.yaml"),
                "-o",
                str(place / "own"),
            ]
        )
        == 0
    )
    assert "begins where" not in capsys.readouterr().out


def test_a_drive_that_was_cut_into_files_by_dates_is_said(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Times of such a log count from its own beginning."""
    for number in range(2):
        part = log_of(0.1, number)
        part["time"] = pd.Timestamp("2026-03-01T10:00:00Z") + pd.to_timedelta(
            part["time"] + 30.0 * number, unit="s"
        )
        part.to_csv(place / f"cut{number}.csv", index=False)
    logs = [str(place / f"cut{number}.csv") for number in range(2)]
    assert main(["estimate", *logs, "--vehicle", str(place / "vehicle.yaml"), "-o", str(place / "out")]) == 0
    assert "cut1.csv begins where cut0.csv ends" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("step", "gap", "said"),
    [(0.1, 1.9, True), (0.1, 2.1, False), (1.0, 2.9, True), (1.0, 3.1, False), (0.1, -0.1, False)],
)
def test_files_of_one_drive_may_lack_three_rows_or_two_seconds(
    tmp_path: Path, step: float, gap: float, said: bool
) -> None:
    time = step * np.arange(20)
    for name, values in (("first", time), ("second", time[-1] + gap + time)):
        pq.write_table(pa.table({"time": values}), tmp_path / name)
    assert follows(tmp_path / "second", tmp_path / "first") is said


@pytest.mark.parametrize("rows", [0, 1])
def test_a_file_of_hardly_a_row_is_no_part_of_a_drive(tmp_path: Path, rows: int) -> None:
    pq.write_table(pa.table({"time": 0.1 * np.arange(rows)}), tmp_path / "first")
    pq.write_table(pa.table({"time": 0.5 + 0.1 * np.arange(20)}), tmp_path / "second")
    assert follows(tmp_path / "second", tmp_path / "first") is False
