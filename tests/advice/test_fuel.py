"""Fuel that the bus tells: through the shipped profile to litres per hour and per hectare of advice."""

from __future__ import annotations

import struct
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "formats"))  # for can_frames.py

import terragrip as tg
from advice_drives import VEHICLE, drive, slip_only
from can_frames import START, WHEEL_BASED, payload, write_log
from terragrip.advice.analysis import advise
from terragrip.advice.fuel import fuel_rate_of
from terragrip.vehicle import Vehicle

WIDE = Vehicle.from_dict({**VEHICLE.to_dict(), "working_width": 4.0})


def with_fuel(estimates, rate):
    return replace(estimates, columns={**estimates.columns, "fuel_rate": np.asarray(rate, dtype=float)})


def test_a_j1939_fuel_rate_comes_through_the_shipped_profile_into_the_estimates(tmp_path):
    frames = []
    for k in range(900):
        time = START + 0.1 * k
        frames.append((time, WHEEL_BASED, payload(2.0 + 0.001 * (k % 3))))
        frames.append((time + 0.004, 0x0CFE4980, payload(1.8 + 0.001 * (k % 2))))
        frames.append(
            (time + 0.006, 0x18FEF200, struct.pack("<H", round(20 / 0.05)) + b"\xff" * 6)
        )  # SPN 183
    recording = tg.read(write_log(tmp_path / "log.blf", frames), "tractor-isobus")
    assert np.nanmax(np.abs(recording["fuel_rate"] - 20e-3 / 3600)) < 1e-12
    estimates = tg.estimate(recording, WIDE)
    advice, _ = advise([estimates], WIDE)
    work = advice[""].field_work
    assert work["litres_per_hour"] == pytest.approx(20.0)
    assert work["litres_per_hectare_measured"] == pytest.approx(20 / (1.8 * 3600 * 4 / 1e4), rel=2e-3)


def test_litres_per_hectare_are_what_was_burnt_over_what_was_worked():
    estimates = drive(vehicle=WIDE)
    rate = np.where(np.arange(len(estimates)) % 4 == 0, 5e-6, np.nan)  # slower than the rows
    one = advise([with_fuel(estimates, rate)], WIDE)[0][""]
    hectares = 1.5 * 3600 * 4 / 1e4  # the drive goes at 1.5 m/s
    assert one.field_work["litres_per_hour"] == pytest.approx(18.0)
    assert one.field_work["litres_per_hectare_measured"] == pytest.approx(18 / hectares, rel=1e-6)
    assert not any("fuel rate" in sentence for sentence in one.missing)


def test_without_a_fuel_rate_its_lack_is_named():
    one = advise([drive()], VEHICLE)[0][""]
    assert "litres_per_hour" not in one.field_work
    assert any("fuel rate" in sentence for sentence in one.missing)


def test_holes_are_not_bridged_and_little_fuel_gives_no_figure():
    estimates = slip_only(np.full(200, 0.1))
    rate = np.full(200, np.nan)
    rate[:20] = rate[60:80] = 4e-6
    filled = fuel_rate_of(with_fuel(estimates, rate))
    assert np.isnan(filled[20:60]).all()
    assert np.isnan(filled[80:]).all()
    assert "litres_per_hour" not in advise([with_fuel(estimates, rate)], VEHICLE)[0][""].field_work
