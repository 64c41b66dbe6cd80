"""Several sources of one drive: clocks set right by the correlation of the speeds."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pynmea2
import pytest

import terragrip as tg
from can_frames import GROUND_BASED, START, drive, write_log
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.recording.lag import offset_between


def speed_at(time: np.ndarray) -> np.ndarray:
    """A drive with stops and turns of pace, which no shift of itself resembles."""
    pace = 1.5 + 0.6 * np.sin(time / 9) + 0.3 * np.sin(time / 2.3) + 0.2 * np.sin(time / 31)
    return np.where((time % 83) < 6, 0.1, 1.0) * pace


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
@pytest.mark.parametrize("ahead", [-7.3, 0.0, 0.42, 31.7])
def test_the_offset_of_a_clock_is_found(seed: int, ahead: float) -> None:
    draws = np.random.default_rng(seed)
    mine, theirs = np.arange(0, 200, 0.05), np.sort(draws.uniform(20, 260, 1500))
    a = 5.0 * speed_at(mine) + 0.1 * draws.standard_normal(len(mine))  # wheel speed: another scale
    b = speed_at(theirs) + 0.05 * draws.standard_normal(len(theirs))
    result = offset_between((mine, a), (theirs + ahead, b))
    assert result is not None
    assert result.seconds == pytest.approx(ahead, abs=0.05)
    assert abs(result.seconds - ahead) < 4 * result.std
    assert result.correlation > 0.95


def test_speeds_that_tell_nothing_give_no_offset() -> None:
    time = np.arange(0, 200, 0.1)
    draws = np.random.default_rng(1000)
    noise = 1 + 0.01 * draws.standard_normal(len(time))
    assert offset_between((time, noise), (time, speed_at(time))) is None
    wave = np.sin(2 * np.pi * time / 10)  # every 10 s another offset fits as well
    assert offset_between((time, wave), (time, wave)) is None
    assert offset_between((time, speed_at(time)), (time, speed_at(time + 40)), reach=10.0) is None
    assert offset_between((time[:50], wave[:50]), (time, wave)) is None


def nmea(path: Path, time: np.ndarray, speed: np.ndarray, late: float) -> Path:
    """RMC sentences of a receiver whose clock is ``late`` [s] behind."""
    lines = []
    for t, v in zip(time, speed, strict=True):
        seconds = (START + t - late) % 86400
        clock = f"{int(seconds // 3600):02d}{int(seconds // 60 % 60):02d}{seconds % 60:05.2f}"
        knots = f"{v * 3600 / 1852:.5f}"
        rmc = (clock, "A", "5103.0000", "N", "01344.0000", "E", knots, "90.0", "141123", "", "")
        lines.append(str(pynmea2.RMC("GP", "RMC", rmc)))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_tractor_and_a_receiver_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = drive(1000, 200.0)
    bus = [frame for frame in machine.frames if frame[1] != GROUND_BASED]
    log = write_log(tmp_path / "bus.blf", bus)
    fixes = np.arange(5, 195, 0.2)
    gnss = nmea(tmp_path / "gnss.nmea", fixes, np.interp(fixes, machine.time, machine.speed), late=18.0)
    with pytest.raises(InputError, match="is missing, but the profile names it"):
        tg.read(log, "tractor-isobus")
    recording = tg.read(
        [log, gnss], ["tractor-isobus", tg.Profile.from_dict({"channels": {"ground_speed": "ground_speed"}})]
    )
    note = next(note for note in recording.notes if "clock of gnss.nmea" in note)
    reported = re.search(r"gnss.nmea is ([\d.]+) ± ([\d.]+) s behind the first one", note)
    assert reported is not None, note
    assert float(reported[1]) == pytest.approx(18.0, abs=0.2)
    assert abs(float(reported[1]) - 18.0) < 3 * float(reported[2])
    fresh = np.isfinite(recording["ground_speed"])
    truth = np.interp(recording.time[fresh], machine.time, machine.speed)
    assert np.sqrt(np.mean((recording["ground_speed"][fresh] - truth) ** 2)) < 0.02
    vehicle = tmp_path / "tractor.yaml"
    vehicle.write_text(
        "mass: 6000 kg\naxles:\n  all: {mass: 6000 kg, wheels: [l, r]}\nwheel: {radius: 0.8 m, inertia: 50 kg m^2}\n"
    )
    out = tmp_path / "estimates.parquet"
    profile = tmp_path / "profile.yaml"
    profile.write_text(
        "channels:\n  wheel_based_speed: WheelBasedMachineSpeed\n  ground_speed: ground_speed\n"
    )
    words = ["estimate", str(log), "--with", str(gnss), "--vehicle", str(vehicle), "--profile", str(profile)]
    assert main([*words, "-o", str(out)]) == 0
    assert "by the correlation of the speeds" in " ".join(capsys.readouterr().out.split())
    estimates = tg.Estimates.read(out)
    inner = (estimates.time > 10) & (estimates.time < 190)
    slip = 1 - (1 - np.interp(estimates.time, machine.time, machine.slip)) / 0.99
    assert np.sqrt(np.mean((estimates["slip_drive"] - slip)[inner] ** 2)) < 0.015


def test_tables_that_start_together_without_a_profile(tmp_path: Path) -> None:
    time = np.arange(0, 60, 0.1)
    pd.DataFrame({"time": time, "wheel_speed_l": 5.0, "wheel_speed_r": 5.0}).to_csv(
        tmp_path / "a.csv", index=False
    )
    pd.DataFrame({"time": time + 0.05, "ground_speed": 1.0}).to_csv(tmp_path / "b.csv", index=False)
    recording = tg.read([tmp_path / "a.csv", tmp_path / "b.csv"])
    assert len(recording) == 2 * len(time)
    assert any("b.csv is used as it is (it starts with the first one)" in note for note in recording.notes)
    with pytest.raises(InputError, match="2 profiles for 1 logs"):
        tg.read([tmp_path / "a.csv"], ["tractor-isobus", "simulink"])
    with pytest.raises(InputError, match="there is no log"):
        tg.read([])


def test_tables_in_memory_are_sources_too() -> None:
    """Two DataFrames were 'expected str, bytes or os.PathLike object, not DataFrame'."""
    wheels = pd.DataFrame({"time": np.arange(100) / 10, "wheel_speed_rl": 5.0})
    speed = pd.DataFrame({"time": np.arange(20) / 2, "kmh": 3.6})
    profile = tg.Profile.from_dict(
        {"time": {"from": "time"}, "channels": {"ground_speed": {"from": "kmh", "unit": "km/h"}}}
    )
    recording = tg.read([wheels, speed], [None, profile])
    np.testing.assert_allclose(recording["ground_speed"][::5], 1.0)
    assert np.isfinite(recording["ground_speed"]).sum() == len(speed)
    for wrong in (speed["kmh"], [wheels, 7], None):
        with pytest.raises(InputError, match="is no log; give a path, a DataFrame or a dict of arrays"):
            tg.read(wrong)
    with pytest.raises(InputError, match="BytesIO is no log; give a path"):  # it was its first line, 'bytes'
        tg.read(io.BytesIO(b"time,ground_speed\n"))


def test_a_file_that_goes_on_where_another_ends_is_refused(tmp_path: Path) -> None:
    """Both have the same channels: the second one's rows would be left out without a word."""
    time = np.arange(0, 100, 0.1)
    drive = pd.DataFrame({"time": time, "ground_speed": speed_at(time), "wheel_speed_l": 5 * speed_at(time)})
    drive[:600].to_csv(tmp_path / "1.csv", index=False)
    drive[500:].to_csv(tmp_path / "2.csv", index=False)
    with pytest.raises(InputError, match=r"2\.csv: has no channel that the logs before it lack") as caught:
        tg.read([tmp_path / "1.csv", tmp_path / "2.csv"])
    assert "made one file first" in str(caught.value)


@pytest.mark.parametrize("late", [0.0, 0.3])
def test_a_logger_for_each_wheel_is_set_right_by_the_wheels(late: float) -> None:
    """By the first one's slow receiver, .3 s late, the other wheel's clock was shifted: one wheel's speed and torque stood beside the
    other's of another instant."""
    draws = np.random.default_rng(4)
    time = np.arange(0.0, 200.0, 0.05)
    receiver = np.where(np.arange(len(time)) % 20 == 0, speed_at(time - 0.3), np.nan)
    noise = 0.02 * draws.standard_normal((2, len(time)))
    left = pd.DataFrame(
        {"time": time, "wheel_speed_l": 5 * speed_at(time) + noise[0], "ground_speed": receiver}
    )
    right = pd.DataFrame({"time": time, "wheel_speed_r": 5 * speed_at(time + late) + noise[1]})
    joined = tg.read([left, right])
    (note,) = [note for note in joined.notes if "clock of" in note]
    ahead = re.search(r"is ([\d.]+) ± ([\d.]+) s (ahead of|behind)", note)
    assert ahead is not None
    assert float(ahead[1]) == pytest.approx(late, abs=0.02)
    assert ("was shifted by that" in note) == bool(late)
