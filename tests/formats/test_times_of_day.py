"""Times of day in whole seconds, days in a column of their own, and clocks that begin anew at midnight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.formats import Profile, inspect
from terragrip.formats import csv as csv_format
from terragrip.formats.log_blocks import recordings_of

COUNT = 600
SECONDS = np.arange(COUNT)
CHANNELS = {"ground_speed": "v", "wheel_speed_l": "w"}


def log_of(path: Path, **stamps: object) -> Path:
    frame = pd.DataFrame({**stamps, "v": 1 + SECONDS / 1000, "w": 3 + SECONDS / 500})
    if path.suffix == ".parquet":
        frame.to_parquet(path)
    else:
        frame.to_csv(path, index=False)
    return path


def times_from(start: str) -> pd.DatetimeIndex:
    return pd.date_range(start, periods=COUNT, freq="s")


def by_profile(column: str, unit: str = "s") -> Profile:
    return Profile.from_dict({"time": {"from": column, "unit": unit, "zero": "first"}, "channels": CHANNELS})


@pytest.mark.parametrize("day", ["%Y-%m-%d", "%d.%m.%Y", "%m/%d/%Y", None])
def test_a_day_and_a_time_in_whole_seconds_in_two_columns(tmp_path: Path, day: str | None) -> None:
    """As spreadsheets and many loggers write them: either column alone made the log unreadable."""
    times = times_from("2024-04-03 23:55:00")
    if day:
        log = log_of(tmp_path / "log.csv", Date=times.strftime(day), Time=times.strftime("%H:%M:%S"))
    else:
        log = log_of(tmp_path / "log.parquet", Date=times.date, Time=times.time)
    assert "time: {from: Time}" in inspect(log).profile
    recording = tg.read(log, by_profile("Time"))
    assert np.array_equal(recording.time, SECONDS)


def test_a_german_stamp_of_two_digits_for_the_year_is_the_time(tmp_path: Path) -> None:
    """'No time column was found', of a column named Zeitstempel."""
    log = log_of(
        tmp_path / "log.csv", Zeitstempel=times_from("2024-04-03 23:55:00").strftime("%d.%m.%y %H:%M:%S,5")
    )
    assert "time: {from: Zeitstempel, zero: first}" in inspect(log).profile
    recording = tg.read(log, by_profile("Zeitstempel"))
    assert np.array_equal(recording.time, SECONDS)
    assert recording.start == pd.Timestamp("2024-04-03 23:55:00.5").timestamp()


@pytest.mark.parametrize(("unit", "period"), [("s", 86_400), ("ms", 86_400_000), ("h", 24.0), ("s", 604_800)])
@pytest.mark.parametrize("blocks", [False, True])
def test_a_clock_that_begins_anew_at_midnight_counts_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unit: str, period: float, blocks: bool
) -> None:
    """Seconds of the day, or of a GPS week (604 800 s)."""
    ticks = {"s": 1, "ms": 1000, "h": 1 / 3600}[unit]
    log = log_of(tmp_path / "log.csv", tod=(period - 100 * ticks + SECONDS * ticks) % period)
    if blocks:
        monkeypatch.setattr(csv_format, "_LONG", 0)
        monkeypatch.setattr(csv_format, "_BLOCK", 1000)
        monkeypatch.setattr(csv_format, "ROWS", 50)
        table = csv_format.csv_on_disk(str(log))
        parts = list(recordings_of(table, by_profile("tod", unit)) or ())
        time, notes = np.concatenate([part.time for part in parts]), parts[-1].notes
    else:
        recording = tg.read(log, by_profile("tod", unit))
        time, notes = recording.time, recording.notes
        seen = inspect(log, by_profile("tod", unit))
        assert seen.time is not None
        assert seen.time.backward == 0
    assert np.allclose(time, SECONDS, atol=1e-6)
    assert any("begins anew at midnight" in note for note in notes)


def test_times_as_text_count_on_in_blocks_that_begin_after_midnight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = log_of(tmp_path / "log.csv", Time=times_from("2024-04-03 23:58:00").strftime("%H:%M:%S.%f"))
    monkeypatch.setattr(csv_format, "_LONG", 0)
    monkeypatch.setattr(csv_format, "_BLOCK", 1000)
    monkeypatch.setattr(csv_format, "ROWS", 50)
    table = csv_format.csv_on_disk(str(log))
    parts = list(recordings_of(table, by_profile("Time")) or ())
    assert len(parts) > 3
    assert np.allclose(np.concatenate([part.time for part in parts]), SECONDS)


def test_a_clock_that_begins_anew_at_another_time_is_another_log(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log.csv", tod=(50_000 + SECONDS) % 50_300)
    with pytest.raises(InputError, match="goes back"):
        tg.read(log, by_profile("tod"))


@pytest.mark.parametrize("stamp", ["23/10/2023 07:55", "05:03.2", "07:55"])
def test_stamps_that_are_no_times_are_refused_with_what_to_write(tmp_path: Path, stamp: str) -> None:
    """As a spreadsheet exports what it shows; 'leave the cell empty or give a number' was no fix."""
    log = log_of(tmp_path / "log.csv", Zeit=[stamp] * COUNT)
    with pytest.raises(InputError, match="is not a time; give seconds, 10:00:00"):
        tg.read(log, by_profile("Zeit"))


def test_two_midnights_within_a_block_count_on_in_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """450 000 rows of 1 Hz were refused: 'time goes back from 203646 s'."""
    count = 14_000
    times = pd.date_range("2024-04-03 12:00:00", periods=count, freq="30s").strftime("%H:%M:%S")
    log = tmp_path / "log.csv"
    pd.DataFrame({"Time": times, "v": 1.5, "w": 3.0}).to_csv(log, index=False)
    monkeypatch.setattr(csv_format, "_LONG", 0)
    monkeypatch.setattr(csv_format, "_BLOCK", 30_000)
    monkeypatch.setattr(csv_format, "ROWS", 7000)
    parts = list(recordings_of(csv_format.csv_on_disk(str(log)), by_profile("Time")) or ())
    assert max(part.time[-1] - part.time[0] for part in parts[:-1]) > 2 * 86_400
    assert np.allclose(np.concatenate([part.time for part in parts]), 30 * np.arange(count))


def test_a_clock_that_is_set_back_by_a_day_is_no_midnight(tmp_path: Path) -> None:
    """Stamps since 1970 were moved on by a day, as if a clock of one day began anew."""
    log = log_of(tmp_path / "log.csv", since=1.7e9 + SECONDS - np.where(SECONDS < 300, 0, 86_390))
    with pytest.raises(InputError, match="goes back"):
        tg.read(log, by_profile("since"))
