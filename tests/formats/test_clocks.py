"""Stamps and clocks: the header's unit of time, loggers whose clock was not set, lags between files and within one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

import terragrip as tg
from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read
from terragrip.formats.csv import csv_on_disk
from terragrip.formats.log_blocks import recordings_of
from terragrip.formats.stamps import Stamps
from terragrip.formats.table import LogTable
from terragrip.recording import Recording
from terragrip.recording.alignment import aligned
from terragrip.recording.lag import Speed, lag_between, lag_within
from test_sources import nmea

TIME = np.round(np.arange(0, 200, 0.05), 2)
EPOCH = 1.7e9


def speed_at(time: np.ndarray) -> np.ndarray:
    """A drive with stops that take seconds, as a vehicle's do, and turns of pace."""
    pace = 1.5 + 0.6 * np.sin(time / 9) + 0.3 * np.sin(time / 2.3) + 0.2 * np.sin(time / 31)
    phase = time % 83.0
    return pace * (
        1 - 0.45 * (1 + np.tanh((phase - 30.0) / 0.7)) + 0.45 * (1 + np.tanh((phase - 40.0) / 0.7))
    )


def table(time: np.ndarray, ground: np.ndarray, wheels: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(
        {"time": time, "ground_speed": ground, "wheel_speed_l": wheels, "wheel_speed_r": wheels}
    )


def noisy(values: np.ndarray, seed: int, size: float) -> np.ndarray:
    return np.round(values + size * np.random.default_rng(seed).standard_normal(len(values)), 5)


def put(path: Path, frame: pd.DataFrame, **names: str) -> Path:
    frame.rename(columns=names).to_csv(path, index=False)
    return path


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("s", 1.0), ("min", 1 / 60)])
def test_the_unit_of_time_in_the_header_counts(tmp_path: Path, unit: str, scale: float) -> None:
    frame = table(TIME * scale, speed_at(TIME), 5 * speed_at(TIME))
    own = tg.read(put(tmp_path / "own.csv", frame, time=f"time [{unit}]"))
    assert own.time[-1] == pytest.approx(TIME[-1])
    log = put(tmp_path / "log.csv", frame, time=f"t [{unit}]")
    profile = {
        "time": {"from": "t"},
        "channels": {n: n for n in ("ground_speed", "wheel_speed_l", "wheel_speed_r")},
    }
    assert tg.read(log, Profile.from_dict(profile)).time[-1] == pytest.approx(TIME[-1])
    blocks = recordings_of(csv_on_disk(str(log)), Profile.from_dict(profile))
    assert blocks is not None
    assert [block.time[-1] for block in blocks][-1] == pytest.approx(TIME[-1])
    seen = inspect(log)
    assert seen.time is not None
    assert seen.time.duration == pytest.approx(TIME[-1])
    proposed = tmp_path / "proposed.yaml"
    proposed.write_text(seen.profile)
    assert tg.read(log, proposed).time[-1] == pytest.approx(TIME[-1])


def test_a_profile_that_gives_another_unit_of_time_counts_and_is_noted(tmp_path: Path) -> None:
    frame = table(TIME, speed_at(TIME), 5 * speed_at(TIME))
    log = put(tmp_path / "log.csv", frame, time="t [ms]")
    channels = {n: n for n in ("ground_speed", "wheel_speed_l", "wheel_speed_r")}
    recording = tg.read(log, Profile.from_dict({"time": {"from": "t", "unit": "s"}, "channels": channels}))
    assert recording.time[-1] == pytest.approx(TIME[-1])
    assert "The log states ms for t; the profile's s is used." in recording.notes


@pytest.mark.parametrize("unit", ["1/min", "min-1", "min^-1", "min⁻¹", "U/min", "RPM", "rpm", "r/min"])
def test_turns_a_minute_however_they_are_written(tmp_path: Path, unit: str) -> None:
    frame = table(TIME, speed_at(TIME), 60 / (2 * np.pi) * 5 * speed_at(TIME))
    log = put(
        tmp_path / "log.csv",
        frame,
        wheel_speed_l=f"wheel_speed_l [{unit}]",
        wheel_speed_r=f"wheel_speed_r ({unit})",
    )
    recording = tg.read(log)
    assert np.allclose(recording["wheel_speed_l"], 5 * speed_at(TIME))
    assert np.allclose(recording["wheel_speed_r"], 5 * speed_at(TIME))


def test_a_header_with_more_names_than_cells_is_refused_by_its_row(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = "".join(f"{t},1.{k % 7},2.{k % 5}\n" for k, t in enumerate(TIME[:50]))
    log.write_text("time,ground_speed,wheel_speed_l,wheel_speed_r,drawbar_force,soil\n" + rows)
    with pytest.raises(InputError, match=r"row 1: has 3 cells, the header 6"):
        tg.read(log)


@pytest.mark.parametrize(
    "profile", [None, {"channels": {"ground_speed": "ground_speed", "wheel_speed_l": "wheel_speed_l"}}]
)
def test_rows_from_before_the_clock_was_set_are_left_out(
    tmp_path: Path, profile: dict[str, object] | None
) -> None:
    frame = table(np.r_[0.0, 0.05, EPOCH + TIME[2:]], speed_at(TIME), 5 * speed_at(TIME))
    log = put(tmp_path / "log.csv", frame)
    chosen = None if profile is None else Profile.from_dict(profile)
    recording = tg.read(log, chosen)
    assert recording.time[-1] - recording.time[0] == pytest.approx(TIME[-1] - TIME[2])
    assert any("first 2 rows were stamped before the logger's clock was set" in n for n in recording.notes)
    blocks = recordings_of(csv_on_disk(str(log)), chosen)
    assert blocks is not None
    assert np.array_equal(np.concatenate([block.time for block in blocks]), recording.time)


def test_a_table_since_1970_beside_a_receiver(tmp_path: Path) -> None:
    from can_frames import START

    wheels = pd.DataFrame(
        {"time": START + TIME, "wheel_speed_l": 5 * speed_at(TIME), "wheel_speed_r": 5 * speed_at(TIME)}
    )
    log = put(tmp_path / "wheels.csv", wheels)
    fixes = np.arange(5, 195, 0.2)
    gnss = nmea(tmp_path / "gnss.nmea", fixes, speed_at(fixes), late=0.0)
    for paths in ([log, gnss], [gnss, log]):
        recording = tg.read(paths)
        assert recording.time[-1] - recording.time[0] == pytest.approx(TIME[-1], abs=0.1)
    late = put(tmp_path / "late.csv", wheels.assign(time=TIME))  # a clock that does not say since when
    recording = tg.read([gnss, late])
    assert recording.time[-1] - recording.time[0] < 210


@pytest.mark.parametrize("seed", range(1000, 1006))
def test_a_vehicle_that_follows_its_wheels_is_no_wrong_clock(seed: int) -> None:
    rim = speed_at(TIME)
    slip = np.gradient(np.convolve(rim, np.ones(21) / 21, "same"), TIME) / (
        9.81 * 2.5
    )  # of a pull that rises by 2.5 per slip
    wheels = Speed(TIME, noisy(5 * rim, seed, 0.02), None)
    ground = Speed(TIME, noisy(rim * (1 - slip), seed + 100, 0.02), float(np.median(rim)))
    for lag in (lag_between(wheels, ground), lag_between(ground, wheels)):
        assert lag is not None
        assert not lag.is_of_the_clock, lag


@pytest.mark.parametrize("seed", range(1000, 1006))
def test_an_offset_within_twice_its_deviation_is_not_corrected(seed: int) -> None:
    first = Speed(TIME, noisy(speed_at(TIME), seed, 0.1), 1.5)
    second = Speed(TIME, noisy(speed_at(TIME), seed + 100, 0.1), 1.5)
    lag = lag_between(first, second)
    assert lag is not None
    assert abs(lag.seconds) > 2 * lag.std or not lag.is_of_the_clock


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(1000, 1004))
@pytest.mark.parametrize("held", [False, True])
def test_a_lag_within_one_file_is_found_and_said(tmp_path: Path, seed: int, held: bool) -> None:
    """GNSS .2 s behind the wheels, at each row or held at 5 Hz, is set right; by a profile's ``delay`` there is nothing left to say."""

    def ground(late: float) -> np.ndarray:
        values = noisy(speed_at(TIME - late), seed, 0.01)
        return values[np.arange(len(TIME)) // 4 * 4] if held else values

    wheels = noisy(5 * speed_at(TIME), seed + 100, 0.05)
    late = tg.read(put(tmp_path / "late.csv", table(TIME, ground(0.2), wheels)))
    (notes,) = [note for note in late.notes if "behind" in note]
    known = np.isfinite(late["ground_speed"])
    assert known[:-5].all()
    true = speed_at(TIME - 0.1 * held)[known]  # a held value is late by half its period on average
    left_in = ground(0.2)[known] - true
    assert np.std(late["ground_speed"][known] - true) < 0.5 * np.std(left_in)
    if held:
        assert set(late["ground_speed"][known]) <= set(ground(0.2))
    result, spread = (float(notes.split()[k]) for k in (2, 4))
    assert result == pytest.approx(0.2, abs=0.03)
    assert abs(result - 0.2) < 3 * spread
    (block,) = recordings_of(csv_on_disk(str(tmp_path / "late.csv"))) or ()
    assert block.notes == late.notes
    right = tg.read(put(tmp_path / "right.csv", table(TIME, ground(0.0), wheels)))
    assert not [note for note in right.notes if "behind" in note]
    channels = {
        "ground_speed": {"from": "ground_speed", "delay": "0.2 s"},
        **{n: n for n in ("wheel_speed_l", "wheel_speed_r")},
    }
    mended = tg.read(tmp_path / "late.csv", Profile.from_dict({"channels": channels}))
    assert not [note for note in mended.notes if "behind" in note]


@pytest.mark.parametrize("seed", range(3))
def test_a_free_wheel_that_was_made_of_the_ground_speed_hides_no_lag(seed: int) -> None:
    """A caster without a sensor gets the ground speed over its radius (docs/vehicle.md); averaged with the others it halved the lag."""
    late = noisy(speed_at(TIME - 0.3), seed, 0.02)
    every = np.where(np.arange(len(TIME)) % 4 == 0, late, np.nan)
    columns = {
        "ground_speed": every,
        "wheel_speed_l": noisy(speed_at(TIME) / 0.065, seed + 10, 0.1),
        "wheel_speed_r": noisy(speed_at(TIME) / 0.065, seed + 20, 0.1),
        "wheel_speed_c": every / 0.03,
    }
    lag = lag_within(TIME, columns)
    assert lag is not None
    assert abs(lag.seconds - 0.3) < 3 * lag.std
    (mended,) = aligned([Recording.from_frame({"time": TIME, **columns})])
    assert np.nanmax(np.abs(mended["ground_speed"] - speed_at(TIME))) < 0.12
    np.testing.assert_allclose(mended["wheel_speed_c"], mended["ground_speed"] / 0.03)


def test_effort_is_a_torque(tmp_path: Path) -> None:
    frame = table(TIME, speed_at(TIME), 5 * speed_at(TIME)).assign(
        effort_l=15 + np.sin(TIME), effort_r=15 + np.cos(TIME)
    )
    seen = inspect(put(tmp_path / "log.csv", frame))
    assert seen.recognised["drive_torque_l"] == ("effort_l",)
    assert not any("No drive torque" in text for text in seen.missing)


@pytest.mark.parametrize("seed", range(1000, 1003))
def test_right_clocks_stay_and_wrong_ones_are_set_right(tmp_path: Path, seed: int) -> None:
    """Two loggers: of right clocks the vehicle's own lag moves nothing; a clock 0.4 s late is set right."""
    rim = speed_at(TIME)
    slip = np.gradient(rim, TIME) / (9.81 * 2.0)
    wheels = pd.DataFrame(
        {"time": TIME, "wheel_speed_l": noisy(5 * rim, seed, 0.02), "wheel_speed_r": 5 * rim}
    )
    ground = pd.DataFrame({"time": TIME, "ground_speed": noisy(rim * (1 - slip), seed + 100, 0.02)})
    first, second = put(tmp_path / "wheels.csv", wheels), put(tmp_path / "gnss.csv", ground)
    right = tg.read([first, second])
    assert len(right) == len(TIME)  # not moved, so that stamps still coincide
    (note,) = [note for note in right.notes if "clock of gnss.csv" in note]
    assert note.endswith("so it is used as it is.")
    put(second, ground.assign(time=TIME + 0.4))
    late = tg.read([first, second])
    (note,) = [note for note in late.notes if "clock of gnss.csv" in note]
    assert note.endswith("and was shifted by that.")
    fresh = np.isfinite(late["ground_speed"])
    assert np.abs(late.time[fresh][0]) < 0.1


@pytest.mark.parametrize(("unit", "tick"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_column_named_time_that_counts_ticks_since_1970_is_proposed_in_its_unit(
    tmp_path: Path, unit: str, tick: float
) -> None:
    log = tmp_path / "log.csv"
    frame = table(TIME, speed_at(TIME), 5 * speed_at(TIME))
    frame["time"] = [round((EPOCH + t) * tick) for t in TIME]
    frame.to_csv(log, index=False)
    with pytest.raises(tg.InputError, match=f"since 1970 in {unit}"):
        tg.read(log)
    seen = inspect(log)
    assert seen.time is not None
    assert seen.time.unit == unit
    assert seen.time.duration == pytest.approx(TIME[-1] - TIME[0])
    (tmp_path / "p.yaml").write_text(seen.profile)
    assert tg.read(log, tmp_path / "p.yaml").time[-1] == pytest.approx(TIME[-1] - TIME[0])


def test_only_a_logs_first_rows_tell_of_a_clock_that_was_set() -> None:
    """A later block of dates lost its rows before a jump."""
    dates = np.datetime64("2020-05-01T10:00:00", "ms") + 1000 * np.arange(20)
    later = dates + np.timedelta64(20, "s")
    later = np.where(np.arange(20) < 5, later, later + np.timedelta64(4 * 365, "D"))
    stamps = Stamps("t", "s")
    for block in (dates[:0], dates, later):
        table = stamps.corrected(LogTable(("t",), {"t": block}))
        assert (len(table.columns["t"]), table.notes) == (len(block), ())


@pytest.mark.parametrize(
    "names", [("sec", "nsec"), ("header.stamp.secs", "header.stamp.nsecs"), ("stamp_sec", "stamp_nanosec")]
)
def test_seconds_and_nanoseconds_in_two_columns_are_one_time(tmp_path: Path, names: tuple[str, str]) -> None:
    """The nanoseconds alone were proposed as time, surely, and 'estimate' then said that another log seemed to begin each second."""
    time = np.arange(0, 30, 0.05)
    speed = 1 + 0.3 * np.sin(time / 3)
    stamps = np.round(1e9 * time).astype(np.int64) + 1_656_084_000_000_000_000
    columns = dict(zip(names, (stamps // 1_000_000_000, stamps % 1_000_000_000), strict=True))
    columns |= {"left_rpm": 60 * speed, "right_rpm": 61 * speed, "gps_speed_mps": speed}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    found = inspect(tmp_path / "log.csv")
    assert f"time: {{from: {names[0]}, nanoseconds: {names[1]}, zero: first}}\n" in found.profile
    profile = Profile.from_dict(yaml.safe_load(found.profile))
    recording = read(tmp_path / "log.csv", profile)
    np.testing.assert_allclose(recording.time, time, atol=1e-6)
    assert recording.start == pytest.approx(1_656_084_000)
    wrong = {**yaml.safe_load(found.profile), "time": {"from": names[0], "nanoseconds": "gone"}}
    with pytest.raises(InputError, match=r"column gone.*is missing"):
        read(tmp_path / "log.csv", Profile.from_dict(wrong))


@pytest.mark.parametrize(
    ("seconds", "rest", "unit", "reason"),
    [
        (1.0, 1e-3, "s", "it is in microseconds, it seems"),
        (1.0, 5.0, "s", "are not whole seconds and a part of one"),
        (0.5, 1.0, "s", "are not whole seconds and a part of one"),
        (1e3, 1.0, "ms", "works with whole seconds only"),
    ],
)
def test_what_are_no_nanoseconds_of_whole_seconds_is_refused(
    tmp_path: Path, seconds: float, rest: float, unit: str, reason: str
) -> None:
    """A log of 30 s came to 29 s with jumps, or to .03, without a word."""
    stamps = np.arange(0, 30_000_000_000, 50_000_000)
    columns = {
        "s": seconds * (stamps // 10**9),
        "ns": rest * (stamps % 10**9),
        "ground_speed": 1.0 + stamps / 3e10,
    }
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    entry = {"from": "s", "nanoseconds": "ns", "unit": unit}
    with pytest.raises(InputError, match=reason):
        read(
            tmp_path / "log.csv",
            Profile.from_dict({"time": entry, "channels": {"ground_speed": "ground_speed"}}),
        )
