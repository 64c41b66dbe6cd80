"""Rows of a foreign log that repeat the stamp of the row before: a logger that writes twice, or a row a message.

A table in Terragrip's own columns is refused (tests/recording/test_table.py)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pandas.testing
import pytest

from terragrip.errors import InputError
from terragrip.formats import inspect, parquet, read
from terragrip.formats.log_blocks import recordings_of
from terragrip.formats.profile import Profile
from terragrip.recording.repeats import merged

PLAIN = Profile.model_validate(
    {
        "time": {"from": "t", "unit": "s"},
        "channels": {
            "ground_speed": {"from": "v", "unit": "m/s"},
            "wheel_speed_l": {"from": "w", "unit": "rad/s"},
            "soil": {"from": "field"},
        },
    }
)
DERIVED = {
    "time": {"from": "t", "unit": "s"},
    "channels": {
        "ground_speed": {"derivative_of": ["x", "y"], "unit": "m", "window": "0.5 s"},
        "wheel_speed_l": {"from": "w", "unit": "rad/s"},
    },
}
NOTE = "rows repeat the time of the row before without another value: merged with it."


def log(rows: int = 400) -> pd.DataFrame:
    time = 0.02 * np.arange(rows)
    speed = 1 + 0.3 * np.sin(time)
    return pd.DataFrame(
        {
            "t": time.round(4),
            "v": speed,
            "w": 2 * speed,
            "field": ["a", "b"] * (rows // 2),
        }
    )


def doubled(frame: pd.DataFrame, rows: list[int]) -> pd.DataFrame:
    return pd.concat([frame, frame.loc[rows]]).sort_index(kind="stable").reset_index(drop=True)


@pytest.mark.parametrize("rows", [[0, 7, 7, 399], [10, 60]])
def test_rows_written_twice_change_nothing(rows: list[int]) -> None:
    frame = log()
    frame.loc[:50, "v"] = np.nan
    twice, whole = PLAIN.apply(doubled(frame, rows)), PLAIN.apply(frame)
    pandas.testing.assert_frame_equal(twice.to_pandas(), whole.to_pandas())
    assert [n for n in twice.notes if "repeat" in n] == [f"{len(rows)} {NOTE}"]


@pytest.mark.parametrize("size", [50, 1000])
def test_a_log_with_our_own_names_is_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """`inspect` said 'merged with it', and `estimate` refused the log: time repeats."""
    monkeypatch.setattr(parquet, "ROWS", size)
    frame = log().drop(columns="field").set_axis(["time", "ground_speed", "wheel_speed_l"], axis=1)
    path = tmp_path / "log.parquet"
    doubled(frame, [0, 49, 50, 399]).to_parquet(path, row_group_size=70)
    whole, blocks = read(path), list(recordings_of(parquet.parquet_on_disk(str(path))) or ())
    pandas.testing.assert_frame_equal(whole.to_pandas(), read(frame).to_pandas())
    parts = pd.concat([block.to_pandas() for block in blocks], ignore_index=True)
    pandas.testing.assert_frame_equal(parts, whole.to_pandas())
    assert f"4 {NOTE}" in whole.notes
    assert f"4 {NOTE}" in blocks[-1].notes


def test_a_row_for_each_message_makes_one_row() -> None:
    """The others' cells are empty, so that nothing is lost; a column that nobody asked for may count the messages."""
    frame = log()
    speed, wheel = frame.assign(w=np.nan, field="", message=1), frame.assign(v=np.nan, message=2)
    found = PLAIN.apply(pd.concat([speed, wheel]).sort_values("t", kind="stable"))
    pandas.testing.assert_frame_equal(found.to_pandas(), PLAIN.apply(frame).to_pandas())
    assert [n for n in found.notes if "repeat" in n] == [f"400 {NOTE}"]


@pytest.mark.parametrize("size", [1, 50, 1000])
def test_messages_that_come_late_by_a_row_are_sorted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """Two messages of a CAN or ROS logger in the wrong order: refused with 'time goes back', whole and in blocks."""
    monkeypatch.setattr(parquet, "ROWS", size)
    frame, path = log(), tmp_path / "log.parquet"
    order = np.arange(len(frame))
    for row in (0, 49, 200, 398):
        order[[row, row + 1]] = row + 1, row
    swapped = frame.iloc[order].reset_index(drop=True)
    swapped.to_parquet(path, row_group_size=70)
    blocks = list(recordings_of(parquet.parquet_on_disk(str(path)), PLAIN) or ())
    right = PLAIN.apply(frame).to_pandas()
    for found in (PLAIN.apply(swapped).to_pandas(), pd.concat([b.to_pandas() for b in blocks])):
        pandas.testing.assert_frame_equal(found.reset_index(drop=True), right.reset_index(drop=True))
    assert (
        "4 rows stand behind rows of later stamps, by 3 places at most: sorted by time."
        in PLAIN.apply(swapped).notes
    )


@pytest.mark.parametrize("steps", [1.1, 1.5, 2.4, 9.0])
def test_a_clock_that_was_set_back_is_no_message_that_comes_late(steps: float) -> None:
    """By one to three steps, 1.5 s of a log at 1 Hz, two runs of the clock were sorted into one another."""
    frame = log()
    frame.loc[200:, "t"] -= steps * (frame["t"][1] - frame["t"][0])
    with pytest.raises(InputError, match="time goes back"):
        PLAIN.apply(frame)


def test_a_receiver_whose_rows_all_come_late_is_no_clock_that_was_set_back() -> None:
    """Stamped between two rows of the others, written behind the second."""
    fast = log()
    slow = log().iloc[25::50].assign(t=lambda rows: rows["t"] + 0.007)
    right = pd.concat([fast, slow]).sort_values("t", ignore_index=True)
    late = pd.concat([fast, slow.assign(key=slow["t"] + 0.02)])
    late = late.assign(key=late["key"].fillna(late["t"])).sort_values("key", ignore_index=True)
    assert (np.diff(late["t"]) < 0).sum() == len(slow)
    found = PLAIN.apply(late.drop(columns="key"))
    pandas.testing.assert_frame_equal(found.to_pandas(), PLAIN.apply(right).to_pandas())


def test_labels_that_differ_in_blanks_alone_are_one() -> None:
    columns = {"t": np.array([0.0, 0.0, 1.0]), "field": np.array(["a", " a ", "b"], dtype=object)}
    kept, repeats = merged(columns, "t")
    assert (kept["t"].tolist(), repeats.merged, repeats.other) == ([0.0, 1.0], 1, 0)


@pytest.mark.parametrize(("column", "value"), [("v", 7.0), ("field", "c")])
def test_another_value_at_the_same_time_is_refused(column: str, value: object) -> None:
    frame = doubled(log(), [100])
    frame.loc[101, column] = value
    with pytest.raises(
        InputError, match=r"column time, row 102 \(time 2 s\): time repeats; keep one row per instant"
    ):
        PLAIN.apply(frame)


@pytest.mark.parametrize("size", [50, 1000, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("rows", [[3], [0, 99, 99, 100, 399], list(range(400))])
def test_a_file_in_blocks_is_what_it_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: list[int], size: int
) -> None:
    monkeypatch.setattr(parquet, "ROWS", size)
    path = tmp_path / "log.parquet"
    frame = doubled(log(), rows)
    frame.to_parquet(path, row_group_size=70)
    whole, blocks = (
        read(path, PLAIN),
        list(recordings_of(parquet.parquet_on_disk(str(path)), PLAIN) or ()),
    )
    parts = pd.concat([block.to_pandas() for block in blocks], ignore_index=True)
    pandas.testing.assert_frame_equal(parts, whole.to_pandas())
    assert sorted(blocks[-1].notes) == sorted(whole.notes)
    assert len(whole) == 400


def test_a_derived_speed_is_that_of_the_log_without_them(tmp_path: Path) -> None:
    frame = log()
    other = pd.DataFrame({"t": frame.t, "x": frame.t**2, "y": 0.5 * frame.t, "w": 2 * frame.t})
    profile = Profile.model_validate(DERIVED)
    twice, whole = profile.apply(doubled(other, [4, 5, 200])), profile.apply(other)
    pandas.testing.assert_frame_equal(twice.to_pandas(), whole.to_pandas())


def test_inspect_shows_rates_and_counts_what_repeats(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame = log().rename(columns={"t": "time", "v": "gps_speed_mps", "w": "omega_left_rad_s"})
    doubled(frame, [4, 200]).to_csv(path, index=False)
    found = inspect(path)
    assert found.time is not None
    assert found.time.repeated == 2
    assert found.rows == 402
    assert [w for w in found.warnings if "repeat" in w] == [f"2 {NOTE}"]
    assert next(c for c in found.columns if c.name == "gps_speed_mps").rate == pytest.approx(50, rel=0.01)
