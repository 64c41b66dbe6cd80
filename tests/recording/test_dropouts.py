"""A wheel's speed, or one wheel's torque, that alone drops to 0 is named."""

from __future__ import annotations

import numpy as np
import pytest

from steady_drive import TIME, log, pulling
from terragrip.recording import Recording
from terragrip.recording.dropouts import dropout_warnings


@pytest.mark.parametrize(
    ("name", "what"),
    [("drive_torque_l", "while all other torques are not"), ("wheel_speed_l", "while the vehicle drives")],
)
def test_a_channel_that_alone_drops_to_0_is_named(name: str, what: str) -> None:
    values = np.where((TIME >= 20) & (TIME <= 30), 0.0, pulling().channels[name])
    (note,) = dropout_warnings(pulling(**{name: values}))
    assert note.startswith(f"{name} is 0 from 20 to 30 s {what}")
    assert (
        dropout_warnings(
            pulling(**{name: np.where((TIME >= 20) & (TIME <= 24), 0.0, pulling().channels[name])})
        )
        == []
    )


@pytest.mark.parametrize("zero", [20_000.0, 1.7e9])
def test_where_a_stretch_is_can_be_read_late_in_a_day_and_since_1970(zero: float) -> None:
    """'from 1.713e+09 to 1.713e+09 s' named no row."""
    values = np.where((TIME >= 20) & (TIME <= 30), 0.0, log().channels["wheel_speed_l"])
    whole = log(wheel_speed_l=values)
    (note,) = dropout_warnings(Recording(time=zero + whole.time, channels=whole.channels))
    assert f"from {zero + 20:.0f} to {zero + 30:.0f} s while" in note


def test_a_drive_and_an_axle_that_is_off_say_nothing() -> None:
    rows = (TIME >= 20) & (TIME <= 30)
    assert dropout_warnings(log()) == []
    assert dropout_warnings(pulling()) == []
    off = {n: np.where(rows, 0.0, pulling().channels[n]) for n in ("drive_torque_l", "drive_torque_r")}
    assert dropout_warnings(pulling(**off)) == []


def test_a_receiver_and_all_wheels_that_read_0_are_named() -> None:
    """Slip was 1.1 off and soil resistance .02 behind wheels that all read 0; a receiver that reads 0 without a fix made 'stuck' alone."""
    rows = (TIME >= 20) & (TIME <= 30)
    (note,) = dropout_warnings(log(ground_speed=np.where(rows, 0.0, log().channels["ground_speed"])))
    assert note.startswith(
        "ground_speed is 0 from 20 to 30 s while all wheels turn: the vehicle is stuck, or"
    )
    wheels = {n: np.where(rows, 0.0, log().channels[n]) for n in ("wheel_speed_l", "wheel_speed_r")}
    (note,) = dropout_warnings(log(**wheels))
    assert note.startswith("wheel_speed_l, wheel_speed_r are 0 from 20 to 30 s while the vehicle drives")
    assert (
        dropout_warnings(log(**wheels, ground_speed=np.where(rows, 0.0, log().channels["ground_speed"])))
        == []
    )


def test_a_reference_force_is_no_speed() -> None:
    """A wheel-force sensor that reads 0 now and then was said to be a speed with zeros for missing values."""
    force = np.where(np.arange(len(TIME)) % 10 == 3, 0.0, 50.0)
    assert dropout_warnings(log(wheel_force_x_l=force)) == []


@pytest.mark.parametrize("name", ["ground_speed", "wheel_speed_l"])
def test_zeros_for_values_that_were_not_there_are_named(name: str) -> None:
    """With every tenth ground speed 0 slip was .3 beyond the truth, and nothing was said."""
    values = np.where(np.arange(len(TIME)) % 10 == 3, 0.0, log().channels[name])
    (note,) = dropout_warnings(log(**{name: values}))
    assert note.startswith(f"{name} is 0 in ")
    assert "samples between others at speed, as no vehicle drives" in note


def test_holes_that_a_join_of_unlike_rates_filled_with_zeros_are_named() -> None:
    """All speeds are 0 in the same rows: the notes were of units and gear ratios."""
    time = np.arange(0.0, 30.0, 0.01)
    filled = np.where(np.arange(len(time)) % 2 == 1, 0.0, 1.0)
    speeds = {
        n: v * filled for n, v in (("ground_speed", 0.5), ("wheel_speed_l", 2.5), ("wheel_speed_r", 2.5))
    }
    (note,) = dropout_warnings(Recording(time, speeds))
    assert "ground_speed is 0 in 1499 samples between others at speed" in note


def test_a_vehicle_that_stops_for_a_moment_has_no_zeros_that_were_not_there() -> None:
    rows = np.arange(len(TIME)) % 40 // 4 == 1  # .2 s: in a row no vehicle stops and starts
    still = {
        n: np.where(rows, 0.0, log().channels[n]) for n in ("ground_speed", "wheel_speed_l", "wheel_speed_r")
    }
    assert dropout_warnings(log(**still)) == []
    assert (
        dropout_warnings(log(ground_speed=np.where(TIME % 50 < 0.05, 0.0, log().channels["ground_speed"])))
        == []
    )


def test_a_speed_that_creeps_is_rounded_to_0_by_chance() -> None:
    """A vehicle that is stuck while its wheels turn."""
    creeps = np.round(0.02 + 0.01 * np.random.default_rng(1).standard_normal(len(TIME)), 2)
    assert dropout_warnings(log(ground_speed=creeps)) == []


def test_logs_without_a_ground_speed_or_wheels_say_nothing() -> None:
    channels = log().channels
    rims = {n: v for n, v in channels.items() if n != "ground_speed"}
    for kept in (rims, {"ground_speed": np.where(TIME % 5 == 3, 0.0, channels["ground_speed"])}):
        assert dropout_warnings(Recording(TIME, kept)) == []


def test_wheels_that_read_0_below_their_least_speed_are_not_locked() -> None:
    """Ten seconds of creeping after a stop, at .1 m/s where others drive at 2: a sensor of pulses reads 0."""
    drive = log().channels
    creeps = (TIME >= 100) & (TIME <= 110)
    ground = np.where(creeps, 0.1, drive["ground_speed"])
    still = {n: np.where(creeps, 0.0, drive[n]) for n in ("wheel_speed_l", "wheel_speed_r")}
    assert dropout_warnings(log(ground_speed=ground, **still)) == []


def test_a_wheel_of_few_pulses_reads_0_between_them_without_an_error() -> None:
    """It creeps for twenty seconds: every other sample has a pulse."""
    drive = log().channels
    creeps = (TIME >= 95) & (TIME <= 115)
    ground = np.where(creeps, 0.1, drive["ground_speed"])
    pulses = np.where(creeps, 0.5 * (np.arange(len(TIME)) % 2), drive["wheel_speed_l"])
    assert dropout_warnings(log(ground_speed=ground, wheel_speed_l=pulses)) == []


def test_a_receiver_that_never_reads_anything_but_0_is_named_once() -> None:
    """By `frozen_warnings`, which say that it never changes."""
    assert dropout_warnings(log(ground_speed=0.0)) == []


@pytest.mark.parametrize(("first", "last"), [(0.0, 8.0), (192.0, 199.9)])
def test_wheels_that_read_0_from_the_start_or_to_the_end_are_named(first: float, last: float) -> None:
    rows = (first <= TIME) & (last >= TIME)
    (note,) = dropout_warnings(log(wheel_speed_l=np.where(rows, 0.0, log().channels["wheel_speed_l"])))
    assert note.startswith(f"wheel_speed_l is 0 from {first:g} to {last:g} s while the vehicle drives")
