"""Logs that are read, looked at and estimated in blocks give what they give as a whole."""

from __future__ import annotations

import gzip
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import terragrip as tg
from can_frames import drive, write_log
from terragrip.errors import InputError
from terragrip.formats import Profile, csv, inspect
from terragrip.formats.log_blocks import long_log, recordings_of
from terragrip.formats.reading import read_table
from terragrip.vehicle import Vehicle

TEXTS = {
    "plain": ("time,ground_speed,wheel_speed_l,gear\n", "{t},{v},{w},{k}\n"),
    "units and comments": ("# by hand\ntime;ground_speed;wheel_speed_l\ns;km/h;rpm\n", "{t};{v};{w}\n"),
    "decimal comma": ("time;ground_speed;wheel_speed_l\n", "{c};{c};1,5\n"),
    "blanks": ("time ground_speed wheel_speed_l\n", " {t}   {v}  {w}\n"),
    "labels": ("time,ground_speed,wheel_speed_l,soil\n", "{t},{v},{w},Löß {s}\n"),
    "empty cells": ("time,ground_speed,wheel_speed_l,late\n", "{t},{v},,{late}\n"),
    "a text among numbers": ("time,ground_speed,wheel_speed_l,odd\n", "{t},{v},{w},{odd}\n"),
}


def text_of(kind: str, rows: int = 400) -> str:
    head, row = TEXTS[kind]
    lines = (
        row.format(
            t=k / 100, v=1 + k % 7 / 10, w=5 + k % 5, k=k, s=k // 150, c=str(k / 100).replace(".", ","),
            late=k if k > 300 else "", odd="x" if k == 250 else k,
        )
        for k in range(rows)
    )  # fmt: skip
    return head + "".join(lines)


@pytest.fixture
def in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read any text table in blocks of a kilobyte."""
    monkeypatch.setattr(csv, "_LONG", 0)
    monkeypatch.setattr(csv, "_BLOCK", 1000)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "gzip"])
@pytest.mark.parametrize("kind", list(TEXTS))
def test_a_table_in_blocks_is_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, encoding: str
) -> None:
    path = tmp_path / "log.csv"
    if encoding == "gzip":
        path.write_bytes(gzip.compress(text_of(kind).encode()))
    else:
        path.write_text(text_of(kind), encoding=encoding)
    whole = read_table(path)
    monkeypatch.setattr(csv, "_LONG", 0)
    monkeypatch.setattr(csv, "_BLOCK", 1000)
    result = read_table(path)
    assert (result.names, result.units, result.sha256) == (whole.names, whole.units, whole.sha256)
    for name, column in whole.columns.items():
        if name == "odd":  # blocks of numbers alone stay numbers, beside the text
            assert [str(float(c)) if str(c) != "x" else "x" for c in result.columns[name]][249:252] == [
                "249.0",
                "x",
                "251.0",
            ]
        elif column.dtype.kind == "O":
            assert result.columns[name].tolist() == column.tolist()
        else:
            assert np.array_equal(result.columns[name], column, equal_nan=True)


@pytest.mark.usefixtures("in_blocks")
def test_what_is_wrong_in_a_late_block_is_named_by_its_row(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = text_of("plain").splitlines(keepends=True)
    for row, line, text in (
        (350, "3.49,fast,5,1\n", "column ground_speed, row 350: 'fast' is not a number"),
        (360, "3.59,1.0,5\n", "row 360: has 3 cells, the header 4"),
    ):
        path.write_text("".join([*lines[:row], line, *lines[row + 1 :]]))
        with pytest.raises(InputError, match=text):
            tg.read(path)
    path.write_text("".join(lines) + "4.00,1.")
    cut = tg.read(path)
    assert len(cut) == 400
    assert "The last row is cut off and was left out." in cut.notes
    path.write_bytes(gzip.compress("".join(lines).encode())[:-30])
    with pytest.raises(InputError, match="is a damaged gzip file"):
        tg.read(path)


def test_a_small_file_that_unpacks_to_a_large_one_is_read_in_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(gzip.compress(text_of("plain").encode()))
    whole = tg.read(path)
    monkeypatch.setattr(csv, "_LONG", 1000)
    monkeypatch.setattr(csv, "_BLOCK", 1000)
    assert np.array_equal(tg.read(path)["ground_speed"], whole["ground_speed"])
    path.write_bytes(gzip.compress(bytes(100_000)))
    with pytest.raises(InputError, match="is not a table of text"):
        tg.read(path)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "content", ["0.0,1.0,5.0,1\n", "\n", "\0", "1"], ids=["rows", "lines", "zeros", "one line"]
)
def test_a_packed_file_that_unpacks_to_no_log_is_refused_before_it_fills_the_memory(
    tmp_path: Path, content: str
) -> None:
    path = tmp_path / "bomb.csv.gz"
    size = 120_000_000
    path.write_bytes(gzip.compress((TEXTS["plain"][0] + content * (size // len(content))).encode(), 6))
    assert path.stat().st_size < size / 300
    tracemalloc.start()
    try:
        for look in (tg.read, inspect):
            with pytest.raises(
                InputError, match=r"unpacks to more than \d+ MB from .* MB.*gunzip"
            ) as refused:
                look(path)
            assert "\n" not in str(refused.value)
        assert tracemalloc.get_traced_memory()[1] < 2 * size
    finally:
        tracemalloc.stop()


def test_a_packed_log_of_a_standing_machine_is_no_bomb(tmp_path: Path) -> None:
    """Forty megabytes of text, packed as well as a log ever is: only its clock counts."""
    path = tmp_path / "log.csv.gz"
    rows = 1_000_000
    text = TEXTS["plain"][0] + "".join(f"{i / 100:.3f},0.000000000,0.000000000,0\n" for i in range(rows))
    path.write_bytes(gzip.compress(text.encode()))
    assert len(text) > 34_000_000
    assert len(tg.read(path)) == rows


def drive_of_a_robot(rows: int = 3000) -> pd.DataFrame:
    draws, time = np.random.default_rng(1000), np.arange(rows) / 50
    speed = 1 + 0.3 * np.sin(time / 3)
    wheels = {f"wheel_speed_{w}": speed / 0.2 / 0.9 + 0.02 * draws.standard_normal(rows) for w in ("l", "r")}
    torques = {f"drive_torque_{w}": 15 + draws.standard_normal(rows) for w in ("l", "r")}
    return pd.DataFrame(
        {"time": time, "ground_speed": speed + 0.01 * draws.standard_normal(rows), **wheels, **torques}
    )


def robot() -> Vehicle:
    axle = {"mass": 60, "wheels": ["l", "r"]}
    return Vehicle.from_dict({"mass": 60, "axles": {"axle": axle}, "wheel": {"radius": 0.2, "inertia": 0.1}})


def test_blocks_of_a_long_table_are_its_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.csv"
    frame = drive_of_a_robot()
    dates = frame.assign(time=pd.Timestamp("2026-05-01") + pd.to_timedelta(frame["time"], unit="s"))
    monkeypatch.setattr(csv, "ROWS", 500)
    for table in (frame, dates):
        table.to_csv(path, index=False)
        whole, blocks = tg.read(path), list(recordings_of(csv.csv_on_disk(str(path))) or ())
        monkeypatch.setattr(csv, "_BLOCK", 10_000)
        assert np.allclose(np.concatenate([b.time for b in blocks]), whole.time, atol=1e-12)
        for name, values in whole.channels.items():
            assert np.array_equal(np.concatenate([b[name] for b in blocks]), values)
        assert blocks[-1].sha256 == whole.sha256
        assert blocks[-1].notes == whole.notes


PROFILE = {
    "time": {"from": "stamp", "unit": "ms", "zero": "first"},
    "channels": {
        "ground_speed": {"from": "*v", "unit": "km/h", "invalid": [0]},
        "acceleration_x": {"from": "not_there", "optional": True},
        "pitch": {"pitch_of": ["qx", "qy", "qz", "qw"]},
        **{f"wheel_speed_{w}": {"from": f"omega_{w}", "unit": "rpm", "sign": -1} for w in ("l", "r")},
        **{f"drive_torque_{w}": {"from": f"amps_{w}", "scale": 2.0} for w in ("l", "r")},
    },
}


def foreign(rows: int = 3000) -> pd.DataFrame:
    """`drive_of_a_robot` under other names and units."""
    frame = drive_of_a_robot(rows)
    turn = np.sin(frame["time"]) / 5
    return pd.DataFrame(
        {
            "stamp": (1_750_000_000_000 + 20 * np.arange(rows)).astype(np.int64),
            "v": (3.6 * frame["ground_speed"]).where(frame.index % 7 > 0, 0),
            **{f"omega_{w}": -frame[f"wheel_speed_{w}"] * 30 / np.pi for w in ("l", "r")},
            **{f"amps_{w}": frame[f"drive_torque_{w}"] / 2 for w in ("l", "r")},
            **dict(
                zip(("qx", "qy", "qz", "qw"), (0 * turn, np.sin(turn), 0 * turn, np.cos(turn)), strict=True)
            ),
        }
    )


def write_foreign(path: Path, frame: pd.DataFrame) -> Path:
    if path.suffix == ".csv":
        frame.to_csv(path, index=False)
    elif path.suffix == ".parquet":
        frame.to_parquet(path)
    else:
        with h5py.File(path, "w") as file:
            for name, column in frame.items():
                file[str(name)] = column.to_numpy().reshape(1, -1)
                file[str(name)].attrs["MATLAB_class"] = np.bytes_("double")
            file["t"] = (frame["stamp"].to_numpy() / 1000).reshape(1, -1)
            file["t"].attrs["MATLAB_class"] = np.bytes_("double")
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat"])
def test_blocks_through_a_profile_are_its_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    path, profile = write_foreign(tmp_path / f"log{suffix}", foreign()), Profile.from_dict(PROFILE)
    whole = tg.read(path, profile)
    monkeypatch.setattr(csv, "_LONG", 0)
    for module in ("parquet", "matlab_long"):
        monkeypatch.setattr(f"terragrip.formats.{module}._LONG", 0)
    for module in ("csv", "parquet", "matlab_long"):
        monkeypatch.setattr(f"terragrip.formats.{module}.ROWS", 500)
    monkeypatch.setattr(csv, "_BLOCK", 10_000)
    log = long_log(path)
    assert log is not None
    blocks = list(recordings_of(log, profile) or ())
    assert len(blocks) > 3
    assert np.allclose(np.concatenate([b.time for b in blocks]), whole.time, atol=1e-9)
    assert set(blocks[0].channels) == set(whole.channels)
    for name, values in whole.channels.items():
        assert np.array_equal(np.concatenate([b[name] for b in blocks]), values, equal_nan=True), name
    assert blocks[-1].sha256 == whole.sha256
    assert set(blocks[-1].notes) == set(whole.notes)


@pytest.mark.parametrize(
    "channel",
    [
        {"derivative_of": ["x", "y"]},
        {"from": ["v", "omega_l"]},
        {"from": "*m*"},
        {"from": "v", "delay": "50 ms"},
        {"from": "v", "over": "qw", "over_minimum": 0.3},
        {"from": "v", "else": {"from": "omega_l"}},
    ],
)
def test_a_profile_that_looks_beside_a_row_takes_the_whole_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, channel: dict[str, Any]
) -> None:
    monkeypatch.setattr("terragrip.formats.parquet._LONG", 0)
    log = long_log(write_foreign(tmp_path / "log.parquet", foreign(100)))
    assert log is not None
    profile = Profile.from_dict({**PROFILE, "channels": {**PROFILE["channels"], "ground_speed": channel}})
    assert recordings_of(log, profile) is None


@pytest.mark.parametrize("torque", [True, False])
def test_estimates_in_parts_are_the_estimates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, torque: bool
) -> None:
    frame = drive_of_a_robot()
    frame.loc[1000:1300, ["ground_speed", "wheel_speed_l", "wheel_speed_r"]] = np.nan  # a gap
    if not torque:
        frame = frame.drop(columns=["drive_torque_l", "drive_torque_r"])
    recording = tg.Recording.from_frame(frame)
    whole = tg.estimate(recording, robot())
    target = tmp_path / "estimates.parquet"
    monkeypatch.setattr("terragrip.from_log.ROWS", 437)
    summary = tg.estimate_file(recording, robot(), target)
    assert summary.replace(str(target), "ESTIMATES") == whole.summary()
    parts = pq.read_table(target).to_pandas()
    expected = whole.to_pandas()
    assert list(parts) == list(expected)
    for name in expected.columns.drop("event"):
        assert np.allclose(parts[name], expected[name], rtol=1e-12, atol=1e-12, equal_nan=True), name
    assert parts["event"].tolist() == expected["event"].tolist()


@pytest.mark.parametrize("kind", ["csv", "parquet", "blf", "asc", "log"])
def test_a_long_log_is_looked_at_in_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    path = tmp_path / f"log.{kind}"
    if kind in ("blf", "asc", "log"):
        write_log(path, drive(1000, 60.0).frames)
    else:
        frame = drive_of_a_robot(30_000)
        frame.to_csv(path, index=False) if kind == "csv" else frame.to_parquet(path)
    whole = inspect(path)
    module = sys.modules["terragrip.formats.seen"]
    size = path.stat().st_size
    monkeypatch.setattr(module, "_LONG", size // 2)
    monkeypatch.setattr(module, "_ENOUGH", size / 4)
    monkeypatch.setattr(csv, "_LONG", 0)
    monkeypatch.setattr(csv, "_LOOK", size // 40)
    monkeypatch.setattr("terragrip.formats.parquet._BLOCK", 500)
    monkeypatch.setattr("terragrip.formats.can.frames._BLOCK", 100)
    some = inspect(path)
    assert "one of every 4 blocks" in some.warnings[0]
    assert some.rows < whole.rows / 2
    assert (some.recognised, some.ready, some.fitting) == (whole.recognised, whole.ready, whole.fitting)
    for few, all_ in zip(some.columns, whole.columns, strict=True):
        assert few.name == all_.name
        if all_.rate is not None:
            assert few.rate == pytest.approx(all_.rate, rel=0.05)
            assert few.median == pytest.approx(all_.median, rel=0.2, abs=0.1)
