"""Parquet: whole and in blocks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, parquet, read
from terragrip.formats.log_blocks import recordings_of
from terragrip.recording import Recording


def put(folder: Path, log: pd.DataFrame) -> Path:
    path = folder / "log.parquet"
    log.to_parquet(path, index=False, row_group_size=70)
    return path


def test_whole_file(tmp_path: Path, log: pd.DataFrame) -> None:
    recording = read(put(tmp_path, log.assign(extra=1)))
    for name in log.columns:
        np.testing.assert_array_equal(recording[name], log[name].to_numpy())
    assert recording.sha256 is not None
    assert recording.notes == ("Columns that are not used: extra.",)


@pytest.mark.parametrize("name", [None, "stamp"])
def test_a_clock_that_is_the_frames_index_is_the_time(
    tmp_path: Path, log: pd.DataFrame, name: str | None
) -> None:
    """As in the frame itself: the file of the same frame was refused for want of a time."""
    stamps = pd.Timestamp("2026-03-01 10:00", tz="UTC") + pd.to_timedelta(log["time"], unit="s")
    frame = log.drop(columns="time").set_index(pd.DatetimeIndex(stamps, name=name))
    frame.to_parquet(tmp_path / "log.parquet")
    recording = read(tmp_path / "log.parquet")
    np.testing.assert_allclose(recording.time, log["time"] - log["time"][0], atol=1e-6)
    assert recording.start == stamps[0].timestamp()
    if name:  # a profile may name it as the frame does
        profile = Profile.from_dict(
            {
                "time": {"from": name, "zero": "first"},
                "channels": {n: n for n in ("ground_speed", "wheel_speed_l")},
            }
        )
        np.testing.assert_allclose(read(tmp_path / "log.parquet", profile).time, recording.time, atol=1e-6)
    frame.reset_index(drop=True).to_parquet(tmp_path / "rows.parquet")
    with pytest.raises(InputError, match="column time: is missing"):
        read(tmp_path / "rows.parquet")


def test_columns_of_two_levels_have_one_name(tmp_path: Path, log: pd.DataFrame) -> None:
    """\"('wheel_speed', 'l')\" had to be mapped one by one."""
    pairs = [tuple(name.rsplit("_", 1)) if name[-2:] in ("_l", "_r") else (name, "") for name in log.columns]
    log.set_axis(pd.MultiIndex.from_tuples(pairs), axis=1).to_parquet(tmp_path / "log.parquet")
    recording = read(tmp_path / "log.parquet")
    for name in log.columns:
        np.testing.assert_array_equal(recording[name], log[name].to_numpy())


def test_types_become_numbers_and_labels(tmp_path: Path, log: pd.DataFrame) -> None:
    log["soil"] = log["soil"].astype("category")
    log["ground_speed"] = log["ground_speed"].astype("float32").astype("Float32").where(log.index != 3)
    log["drawbar_force"] = log["drawbar_force"].astype(int)
    recording = read(put(tmp_path, log))
    assert recording["soil"][0] == "grass"
    assert np.flatnonzero(np.isnan(recording["ground_speed"])).tolist() == [3]
    assert recording["drawbar_force"].dtype == np.float64


def test_json_as_a_struct_in_parquet_is_inspected_and_read(tmp_path: Path) -> None:
    """A telemetry's objects, one a line, by pandas: its structs were passed over in silence, its stamps no time."""
    when = pd.Timestamp("2026-07-01 14:00") + pd.to_timedelta(np.arange(300) / 10, unit="s")
    speed = 1 + 0.3 * np.sin(np.arange(300) / 40)
    rows = [
        {
            "ts": f"{t.isoformat(timespec='milliseconds')}+02:00",
            "gnss": {"speed_mps": v},
            "wheels": {side: {"rpm": 30 * v} for side in "lr"},
        }
        for t, v in zip(when, speed, strict=True)
    ]
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, rows)))
    path = put(tmp_path, pd.read_json(tmp_path / "log.jsonl", lines=True))
    found = inspect(path)
    assert set(found.proposals) == {"ground_speed", "wheel_speed_l", "wheel_speed_r"}
    (tmp_path / "p.yaml").write_text(found.profile)
    recording = read(path, tmp_path / "p.yaml")
    np.testing.assert_allclose(recording["ground_speed"], speed)
    assert recording.time[-1] == pytest.approx(29.9)
    assert recording.start == pd.Timestamp("2026-07-01 12:00", tz="UTC").timestamp()


def in_blocks(path: Path, rows: int) -> list[Recording]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parquet, "ROWS", rows)
        return list(recordings_of(parquet.parquet_on_disk(str(path))) or ())


@pytest.mark.parametrize("rows", [1, 64, 299, 300, 1000])
def test_blocks_make_up_the_whole(tmp_path: Path, log: pd.DataFrame, rows: int) -> None:
    log.loc[:150, "drawbar_force"] = np.nan  # a block may lack a channel
    path = put(tmp_path, log)
    whole, blocks = read(path), in_blocks(path, rows)
    assert max(len(block) for block in blocks) <= rows
    for name in log.columns:
        np.testing.assert_array_equal(np.concatenate([block[name] for block in blocks]), whole[name])
    assert {(block.sha256, block.notes, block.source) for block in blocks} == {
        (whole.sha256, whole.notes, whole.source)
    }


@pytest.mark.parametrize(
    ("column", "row", "value", "message"),
    [
        ("time", 200, 1.99, r"column time, row 201 \(time 1.99 s\): time repeats"),
        ("time", 200, 0.5, r"column time, row 201 \(time 0.5 s\): time goes back from 1.99 s"),
        ("time", 250, np.nan, "column time, row 251: time is not a finite number"),
        ("wheel_speed_l", 250, np.inf, r"column wheel_speed_l, row 251 \(time 2.5 s\): is infinite"),
    ],
)
@pytest.mark.parametrize("rows", [50, 100, 1000])
def test_blocks_name_the_row_of_the_whole(
    tmp_path: Path, log: pd.DataFrame, column: str, row: int, value: float, message: str, rows: int
) -> None:
    log.loc[row, column] = value
    path = put(tmp_path, log)
    with pytest.raises(InputError, match=message):
        read(path)
    with pytest.raises(InputError, match=message):
        in_blocks(path, rows)


def test_blocks_refuse_what_the_whole_refuses(tmp_path: Path, log: pd.DataFrame) -> None:
    for spoilt, message in (
        (log.drop(columns="ground_speed"), "column ground_speed: is missing"),
        (log.assign(ground_speed=np.nan), "column ground_speed: has no value"),
        (log.assign(ground_speed="fast"), "'fast' is not a number"),
        (log.iloc[:0], "the table is empty"),
    ):
        path = put(tmp_path, spoilt)
        for reading in (read, lambda p: in_blocks(p, 100)):
            with pytest.raises(InputError, match=message):
                reading(path)


def test_a_name_that_occurs_twice_is_in_the_way_of_that_column_alone(
    tmp_path: Path, log: pd.DataFrame
) -> None:
    """As in a text table: inspect refused the file for a column that nobody asked for."""
    path = tmp_path / "log.parquet"
    columns = [*log.columns, "Speed", "Speed"]
    table = pa.Table.from_pandas(log, preserve_index=False)
    pq.write_table(
        pa.table([*table.columns, table["time"], table["time"]], names=columns), path, row_group_size=70
    )
    assert "Columns that occur twice are left out: Speed. Rename one to use it." in inspect(path).warnings
    assert len(read(path)) == len(log)
    with pytest.raises(InputError, match="column Speed: occurs twice"):
        read(path, Profile.from_dict({"channels": {"ground_speed": "Speed"}}))


@pytest.mark.parametrize(
    "noted",
    [
        b"\x88",
        b"{",
        b"[1]",
        b"null",
        b'{"index_columns": 3}',
        b'{"index_columns": [{}, 1, "x"]}',
        b"[" * 100_000,
    ],
)
def test_a_log_is_read_whatever_pandas_notes_of_its_index(
    tmp_path: Path, log: pd.DataFrame, noted: bytes
) -> None:
    """A damaged byte of the metadata was a traceback (make fuzz)."""
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({n: log[n] for n in log}).replace_schema_metadata({b"pandas": noted}), path)
    assert len(read(path)) == len(log)


def test_a_column_of_lists_is_refused(tmp_path: Path, log: pd.DataFrame) -> None:
    path = tmp_path / "log.parquet"
    table = pa.table({**{n: log[n] for n in log if n != "ground_speed"}, "ground_speed": [[1.0, 2.0]] * 300})
    pq.write_table(table, path)
    with pytest.raises(InputError, match=r"column ground_speed: has list<.*>, not numbers"):
        read(path)


def test_one_long_row_group_is_not_held_in_memory(tmp_path: Path) -> None:
    """A writer that cuts no row groups (polars, Spark) puts all rows into one; its column chunks are read a piece at a time."""
    rows, draw = 400_000, np.random.default_rng(0)
    columns = {"time": 0.01 * np.arange(rows), **{f"c{k}": draw.standard_normal(rows) for k in range(8)}}
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table(columns), path, row_group_size=rows, use_dictionary=False, data_page_size=1 << 16)
    before, most = pa.total_allocated_bytes(), 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parquet, "ROWS", 10_000)
        for block in parquet.parquet_on_disk(str(path)).blocks(list(columns), 1):
            assert len(block["time"]) == 10_000
            most = max(most, pa.total_allocated_bytes() - before)
    assert most < 0.6 * path.stat().st_size  # all of it, or more, where a group is read at once
