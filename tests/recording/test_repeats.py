"""Rows that repeat the stamp of the row before: a logger that writes twice, one row a message, a coarse clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pandas.testing
import pytest

from terragrip.formats import inspect, parquet, read
from terragrip.formats.log_blocks import recordings_of
from terragrip.formats.profile import Profile
from terragrip.recording import Recording

PROFILE = {
    "time": {"from": "t", "unit": "s"},
    "channels": {
        "ground_speed": {"derivative_of": ["x", "y"], "unit": "m", "window": "0.5 s"},
        "wheel_speed_l": {"from": "w", "unit": "rad/s"},
    },
}


def log(rows: int = 400) -> pd.DataFrame:
    time = 0.02 * np.arange(rows)
    speed = 1 + 0.3 * np.sin(time)
    return pd.DataFrame(
        {
            "time": time.round(4),
            "ground_speed": speed,
            "wheel_speed_l": 2 * speed,
            "soil": ["a", "b"] * (rows // 2),
        }
    )


def doubled(frame: pd.DataFrame, rows: list[int]) -> pd.DataFrame:
    return pd.concat([frame, frame.loc[rows]]).sort_index(kind="stable").reset_index(drop=True)


def test_rows_written_twice_change_nothing(tmp_path: Path) -> None:
    whole = Recording.from_frame(log())
    twice = Recording.from_frame(doubled(log(), [0, 7, 7, 399]))
    pandas.testing.assert_frame_equal(twice.to_pandas(), whole.to_pandas())
    assert [n for n in twice.notes if "repeat" in n] == [
        "4 rows repeat the row before, time and values, and are left out."
    ]


def test_a_missing_value_equals_a_missing_value() -> None:
    frame = log().assign(drawbar_force=np.nan)
    frame.loc[50:, "drawbar_force"] = 3.0
    twice = Recording.from_frame(doubled(frame, [10, 60]))
    assert [n for n in twice.notes if "repeat" in n] == [
        "2 rows repeat the row before, time and values, and are left out."
    ]


def test_of_other_values_the_last_that_is_there_counts() -> None:
    frame = log()
    extra = frame.loc[[5]].assign(ground_speed=np.nan, wheel_speed_l=9.0, soil="")
    found = Recording.from_frame(pd.concat([frame[:6], extra, frame[6:]]))
    assert len(found) == len(frame)
    assert (found["ground_speed"][5], found["wheel_speed_l"][5], found["soil"][5]) == (
        frame.ground_speed[5],
        9.0,
        "b",
    )
    assert [n for n in found.notes if "repeat" in n] == [
        "1 row repeats the time of the row before: of each column the last value counts."
    ]


def test_stamps_coarser_than_the_rows_are_said() -> None:
    frame = log()
    frame["time"] = np.floor(frame["time"] * 10) / 10
    found = Recording.from_frame(frame)
    np.testing.assert_allclose(np.diff(found.time), 0.1)
    note = next(n for n in found.notes if "repeat" in n)
    assert "320 rows" in note
    assert "coarser" in note


@pytest.mark.parametrize("size", [1, 50, 1000])
@pytest.mark.parametrize("rows", [[3], [0, 99, 99, 100, 399], list(range(400))])
def test_a_file_in_blocks_is_what_it_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: list[int], size: int
) -> None:
    monkeypatch.setattr(parquet, "ROWS", size)
    path = tmp_path / "log.parquet"
    frame = doubled(log(), rows)
    frame.loc[len(frame) - 1, "wheel_speed_l"] = 5.0
    frame.to_parquet(path, row_group_size=70)
    whole, blocks = read(path), list(recordings_of(parquet.parquet_on_disk(str(path))) or ())
    parts = pd.concat([block.to_pandas() for block in blocks], ignore_index=True)
    pandas.testing.assert_frame_equal(parts, whole.to_pandas())
    assert blocks[-1].notes == whole.notes
    assert len(whole) == 400


def test_a_derived_speed_is_that_of_the_log_without_them(tmp_path: Path) -> None:
    frame = log()
    other = pd.DataFrame({"t": frame.time, "x": frame.time**2, "y": 0.5 * frame.time, "w": 2 * frame.time})
    profile = Profile.model_validate(PROFILE)
    twice, whole = profile.apply(doubled(other, [4, 5, 200])), profile.apply(other)
    pandas.testing.assert_frame_equal(twice.to_pandas(), whole.to_pandas())


def test_inspect_shows_rates_and_counts_what_repeats(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame = log().rename(columns={"ground_speed": "gps_speed_mps", "wheel_speed_l": "omega_left_rad_s"})
    doubled(frame, [4, 200]).to_csv(path, index=False)
    found = inspect(path)
    assert found.time is not None
    assert found.time.repeated == 2
    assert found.rows == 402
    assert [w for w in found.warnings if "repeat" in w] == [
        "2 rows repeat the row before, time and values, and are left out."
    ]
    assert next(c for c in found.columns if c.name == "gps_speed_mps").rate == pytest.approx(50, rel=0.01)
