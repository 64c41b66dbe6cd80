"""Pitch of another unit or instant than the accelerometer's, on simulated machines on hills (development kinds)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

Case = tuple[families.Kind, int, float]
MACHINES: list[Case] = [
    (families.Kind("tractor", "saturating", "uncoupled"), 1, 1.0),
    (families.Kind("robot", "brixius", "even"), 6, 20.0),
    (families.Kind("light", "brixius", "uncoupled"), 14, 10.0),
    (families.Kind("robot", "brixius", "multirate"), 20, 100.0),
]


@cache
def drive(kind: families.Kind, seed: int, rate: float | None) -> Recording:
    duration = {1.0: 1500.0, None: None}.get(rate, 200.0)
    return families.draw(kind, seed, rate=rate, duration=duration).recording


def said(log: Recording, pitch: np.ndarray) -> list[str]:
    return [n for n in unit_warnings(log.with_channels(pitch=pitch), None) if n.startswith("pitch")]


@pytest.mark.sample(2)
@pytest.mark.parametrize("case", MACHINES)
def test_a_right_pitch_is_left_alone(case: Case) -> None:
    log = drive(*case)
    assert said(log, log.channels["pitch"]) == []
    assert said(log, 1.1 * log.channels["pitch"] + 0.02) == [], "mounting"


def test_a_right_pitch_on_short_hills_is_not_late() -> None:
    """Two minutes of them show a lag of .20 ± .05 s by chance."""
    log = drive(families.Kind("tractor", "sinkage", "even", "rolling"), 710, None)
    assert said(log, log.channels["pitch"]) == []


@pytest.mark.parametrize("case", MACHINES)
def test_a_grade_in_per_cent_declared_as_degrees_is_named(case: Case) -> None:
    log = drive(*case)
    (note,) = said(log, np.radians(100 * np.tan(log.channels["pitch"])))
    assert note.startswith(("pitch is 1.7 times the climb", "pitch is 1.8 times the climb"))
    assert "declared as degrees: write 'unit: \"%\"'" in note


@pytest.mark.parametrize("case", MACHINES)
def test_radians_declared_as_degrees_are_named(case: Case) -> None:
    log = drive(*case)
    (note,) = said(log, np.radians(log.channels["pitch"]))
    assert "in radians, but was converted from degrees" in note


@pytest.mark.parametrize("case", MACHINES[2:])
@pytest.mark.parametrize("seconds", [0.4, -0.4, 0.2])
def test_a_pitch_that_is_late_or_early_is_named(case: Case, seconds: float) -> None:
    log = drive(*case)
    known = np.isfinite(log.channels["pitch"])
    late = np.full(len(log), np.nan)
    late[known] = np.interp(log.time[known] - seconds, log.time[known], log.channels["pitch"][known])
    (note,) = said(log, late)
    assert note.startswith(f"pitch is about {abs(seconds)} s " + ("behind" if seconds > 0 else "ahead of"))


@pytest.mark.parametrize("case", MACHINES[1:])
@pytest.mark.parametrize("name", ["acceleration_x", "pitch"])
def test_a_zero_that_moves_in_the_drive_is_named_with_the_instant(case: Case, name: str) -> None:
    """A mount that slips by 3 degrees: soil resistance was .05 off from there on, without a word."""
    log, share = drive(*case), np.sin(np.radians(3))
    moved = log.channels[name] + np.where(log.time > 80, share * (9.81 if name != "pitch" else 1), 0)
    (note,) = unit_warnings(log.with_channels(**{name: moved}), None)
    assert "the zero of one of the two moved" in note
    assert float(note.split()[1]) == pytest.approx(80, abs=3)
    off = float(note.split("soil resistance is ")[1].split()[0])
    assert off == pytest.approx(share, rel=0.1)
    unmoved = log.channels["acceleration_x"] + 0.0008 * log.time  # .16 m/s²: warmed up
    assert unit_warnings(log.with_channels(acceleration_x=unmoved), None) == []


@pytest.mark.sample(3)
@pytest.mark.parametrize("case", MACHINES[1:])
def test_an_accelerometer_further_off_than_the_vehicle_file_says_is_named_until_it_is_calibrated(
    case: Case,
) -> None:
    """Soil resistance was .05 off, eight of its standard deviations, behind .5 m/s², without a word."""
    kind, seed, rate = case
    vehicle = families.draw(kind, seed, rate=rate, duration=10.0).vehicle
    log = drive(*case)
    assert vehicle.uncertainty.acceleration_bias == 0.03
    off = log.with_channels(acceleration_x=log.channels["acceleration_x"] + 0.5)
    assert unit_warnings(log, vehicle) == []
    (note,) = unit_warnings(off, vehicle)
    assert "more than speed and pitch explain, where the vehicle file's acceleration_bias is 0.03" in note
    assert float(note.split()[2]) == pytest.approx(0.5, abs=0.1)
    calibrated = Vehicle.from_dict(vehicle.to_dict() | {"calibration": {"acceleration_bias_x": 0.5}})
    assert unit_warnings(off, calibrated) == []
