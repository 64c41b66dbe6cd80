"""Channels that keep one value, or end at one, are named; what is held between samples, stands, or is at a motor's limit is left alone."""

from __future__ import annotations

import re

import numpy as np
import pytest

from steady_drive import RATE, TIME, log, pulling
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.frozen import cut_warnings, frozen_warnings, overflow_warnings


def repeated(name: str, start: float, end: float, value: float | None = None) -> Recording:
    values = log().channels[name].copy()
    rows = (start <= TIME) & (end >= TIME)
    values[rows] = values[rows][0] if value is None else value
    return log(**{name: values})


def test_a_drive_says_nothing() -> None:
    assert frozen_warnings(log()) == []


@pytest.mark.parametrize("name", ["ground_speed", "wheel_speed_l"])
def test_a_speed_that_is_repeated_for_long_is_named(name: str) -> None:
    (note,) = frozen_warnings(repeated(name, 20.0, 40.0))
    assert note.startswith(f"{name} repeats")
    assert "from 20 to 40 s while other speeds change" in note
    assert frozen_warnings(repeated(name, 20.0, 24.0)) == [], "4 s"


def test_a_speed_that_is_held_2_s_of_every_10_is_named() -> None:
    """Too short for the other speeds to change much."""
    time = np.arange(0.0, 100.0, 0.1)
    draws = np.random.default_rng(2)
    speeds = {name: 1 + 0.01 * draws.standard_normal(len(time)) for name in ("ground_speed", "wheel_speed_l")}
    assert frozen_warnings(Recording.from_frame({"time": time, **speeds})) == []
    rows = np.arange(len(time))
    held = speeds["ground_speed"][np.where(rows % 100 >= 80, rows - rows % 100 + 80, rows)]
    (note,) = frozen_warnings(Recording.from_frame({"time": time, **speeds, "ground_speed": held}))
    assert note.startswith("ground_speed keeps one value for 1 s or more in 10 places at speed (first ")


def test_a_speed_that_is_held_between_its_samples_is_left_alone() -> None:
    """A receiver of 1 Hz in rows of 10 Hz, of one digit: it repeats values by nature."""
    ground = np.round(log().channels["ground_speed"][(np.arange(len(TIME)) // RATE) * RATE], 1)
    assert frozen_warnings(log(ground_speed=ground)) == []


def test_a_cruise_in_tenths_of_kmh_is_left_alone() -> None:
    """At 10 km/h the noise of a centimetre a second seldom shows in the display's steps of 3 cm/s."""
    noise = 0.01 * np.random.default_rng(4).standard_normal(len(TIME))
    ground = np.round((2.78 + 0.3 * np.sin(TIME / 20) * (TIME // 30 % 2) + noise) * 36) / 36
    assert frozen_warnings(log(ground_speed=ground)) == []


def test_a_ground_speed_of_0_may_be_a_vehicle_that_is_stuck() -> None:
    assert frozen_warnings(repeated("ground_speed", 20.0, 40.0, 0.0)) == []


@pytest.mark.parametrize("name", ["drive_torque_l", "drawbar_force"])
def test_a_torque_or_a_pull_that_is_repeated_is_named(name: str) -> None:
    values = pulling().channels[name].copy()
    assert frozen_warnings(pulling()) == []
    rows = (TIME >= 20) & (TIME <= 30)
    values[rows] = values[rows][0]
    (note,) = frozen_warnings(pulling(**{name: values}))
    assert note.startswith(f"{name} repeats")
    assert "from 20 to 30 s while other forces change" in note


def test_a_torque_at_its_limit_and_an_axle_that_is_off_are_left_alone() -> None:
    rows = (TIME >= 20) & (TIME <= 30)
    left, right = (pulling().channels[f"drive_torque_{side}"].copy() for side in "lr")
    assert frozen_warnings(pulling(drive_torque_l=np.where(rows, 500.0, left))) == []
    off = {"drive_torque_l": np.where(rows, 0.0, left), "drive_torque_r": np.where(rows, 0.0, right)}
    assert frozen_warnings(pulling(**off)) == []


def test_steps_of_a_speed_are_not_its_repetition_where_its_lag_was_corrected() -> None:
    """.1 km/h of a receiver of 5 Hz: between two samples its resolution does not show, and a cruise was called not measured."""
    time = np.arange(0, 300, 0.2)
    speed = (3.5 + 1.5 * np.sign(np.sin(time / 12)) * np.abs(np.sin(time / 12)) ** 0.01) / 3.6
    speed += 0.011 * np.random.default_rng(7).standard_normal(len(time))
    steps = np.round(3.6 * speed, 1) / 3.6
    wheels = {"wheel_speed_l": speed / 0.4}
    for ground in (steps, np.interp(time + 0.0813, time, steps)):
        assert frozen_warnings(Recording(time, {"ground_speed": ground, **wheels})) == []


def test_a_logger_that_hung_is_named_and_a_gap_is_no_repetition() -> None:
    drive = pulling()
    rows = (TIME >= 20) & (TIME <= 30)
    held = {name: np.where(rows, values[rows][0], values) for name, values in drive.channels.items()}
    notes = frozen_warnings(pulling(**held))
    assert notes == [
        note for note in notes if note.startswith("All channels keep their values from 20.1 to 30 s")
    ]
    assert notes
    two = drive.select(np.flatnonzero(~rows | (TIME == 20) | (TIME == 30)))
    speed = two.channels["wheel_speed_l"].copy()
    speed[(two.time == 20) | (two.time == 30)] = 3.33
    assert frozen_warnings(two.with_channels(wheel_speed_l=speed)) == []


@pytest.mark.parametrize("every", [1, 3])
def test_speeds_that_freeze_together_while_forces_go_on_are_named(every: int) -> None:
    """A bus that fell silent, and a logger that repeats what it had: slip and resistance were those of an earlier instant."""
    rows = (TIME >= 20) & (TIME <= 40)
    here = np.arange(len(TIME)) % every == 0
    drive = {n: np.where(here, v, np.nan) if "speed" in n else v for n, v in pulling().channels.items()}
    frozen = {n: np.where(rows & here, v[here & rows][0], v) if "speed" in n else v for n, v in drive.items()}
    assert frozen_warnings(pulling(**drive)) == []
    notes = [n for n in frozen_warnings(pulling(**frozen)) if n.startswith("All speeds keep their values")]
    assert len(notes) == 1
    assert "while other channels go on" in notes[0]
    gone = {n: np.where(rows, np.nan, v) if "speed" in n else v for n, v in drive.items()}
    assert frozen_warnings(pulling(**gone)) == [], "empty cells"
    cruise = {n: np.round(v, 1) if "speed" in n else v for n, v in frozen.items()}
    assert frozen_warnings(pulling(**cruise)) == [], "a cruise by coarse speeds"


def test_speeds_that_are_all_there_is_hang_with_the_logger() -> None:
    """'While other channels go on' was said where there was none."""
    rows = (TIME >= 20) & (TIME <= 40)
    drive = log().channels
    speeds = {"ground_speed": drive["ground_speed"], "wheel_based_speed": 0.4 * drive["wheel_speed_l"]}
    held = {name: np.where(rows, values[rows][0], values) for name, values in speeds.items()}
    notes = frozen_warnings(Recording(TIME, held))
    assert notes == [
        "All channels keep their values from 20.1 to 40 s: the logger hung, it seems. Leave these rows out."
    ]


def test_a_ground_speed_in_coarse_steps_is_named() -> None:
    """Of 2 km/h."""
    coarse = np.round(3.6 * log().channels["ground_speed"] / 2) * 2 / 3.6
    (note,) = frozen_warnings(log(ground_speed=coarse))
    assert note.startswith("ground_speed comes in steps of 0.556, where 2.22 is fast")


@pytest.mark.parametrize(
    ("name", "value", "beginning"),
    [
        ("ground_speed", 0.0, "ground_speed (0) never changes while the wheels turn"),
        ("ground_speed", 1.2, "ground_speed (1.2) never changes while the wheels turn"),
        ("acceleration_x", 0.0, "acceleration_x (0) never changes while the speed does"),
    ],
)
def test_a_channel_of_one_value_is_named(name: str, value: float, beginning: str) -> None:
    (note,) = frozen_warnings(log(**{name: value}))
    assert note.startswith(beginning)


def test_a_steady_drive_has_no_acceleration() -> None:
    steady = {"ground_speed": 1.2, "wheel_speed_l": 3.0, "wheel_speed_r": 3.0, "acceleration_x": 0.0}
    assert frozen_warnings(log(**steady)) == []


def test_a_spoiled_value_is_no_step_of_a_channel() -> None:
    """Beside 1e30 all other values are one."""
    speed = log().channels["ground_speed"].copy()
    speed[300] = 1e30
    assert frozen_warnings(log(ground_speed=speed)) == []
    speed[(TIME >= 40) & (TIME <= 60)] = 1.5
    (note,) = frozen_warnings(log(ground_speed=speed))
    assert note.startswith("ground_speed repeats 1.5 from 40 to 60 s")


def test_a_spoiled_value_is_no_change_of_another_speed() -> None:
    """The wheels go on at one speed while the ground speed repeats a value: so may a vehicle."""
    rows = (TIME >= 20) & (TIME <= 40)
    noise = np.round(0.01 * np.random.default_rng(7).standard_normal(len(TIME)), 3)
    columns = {n: np.where(rows, v[rows][0] + noise, v) for n, v in log().channels.items() if "wheel" in n}
    columns["ground_speed"] = np.where(rows, 1.5, log().channels["ground_speed"])
    steady = log(**columns)
    assert frozen_warnings(steady) == []
    columns["wheel_speed_l"][300] = 1e30
    assert frozen_warnings(log(**columns)) == []


def test_a_load_cell_at_its_limit_torques_that_freeze_together_and_an_accelerometer_are_named() -> None:
    """Soil resistance was .17 off behind a cell that ended at its limit in all of the log, .06 behind an accelerometer that froze."""
    drive = pulling().channels
    rows = (TIME >= 20) & (TIME <= 30)
    limited = drive["drawbar_force"].copy()
    limited[rows | (limited > limited[rows][0])] = limited[rows][0]
    (note,) = frozen_warnings(pulling(drawbar_force=limited))
    assert note.startswith(f"drawbar_force repeats {limited[rows][0]:.4g} from ")
    torques = {n: np.where(rows, drive[n][rows][0], drive[n]) for n in ("drive_torque_l", "drive_torque_r")}
    assert [note.split(" repeats")[0] for note in frozen_warnings(pulling(**torques))] == list(torques)
    acceleration = np.where(rows, drive["acceleration_x"][rows][0], drive["acceleration_x"])
    (note,) = frozen_warnings(pulling(acceleration_x=acceleration))
    assert note.startswith("acceleration_x repeats")


@pytest.mark.parametrize("value", [0.0, 0.013])
@pytest.mark.parametrize("name", ["acceleration_x", "acceleration_y", "angular_velocity_z", "pitch"])
def test_an_inertial_sensor_that_stops_is_named(name: str, value: float) -> None:
    """An accelerometer that read 0 from the middle on said nothing: soil resistance held in 53 % of the rows."""
    draws = np.random.default_rng(5)
    sound = 0.02 * np.sin(TIME / 5) + 0.003 * draws.standard_normal(len(TIME))
    (note,) = frozen_warnings(log(**{name: np.where(TIME > 120, value, sound)}))
    assert note.startswith(f"{name} repeats {value:.4g} from ")
    assert frozen_warnings(log(**{name: sound})) == []


@pytest.mark.parametrize("step", [0.0, 0.001])
def test_a_gyroscope_with_a_dead_band_measures_straight_on(step: float) -> None:
    """'Not measured, it seems. Leave these cells empty' was said of a controller that sends 0 below .03 rad/s."""
    draws = np.random.default_rng(3)
    way = np.where(TIME % 120 < 60, 0.4, -0.4)
    turn = np.where(TIME % 60 > 50, way * np.sin((TIME % 60 - 50) / 10 * np.pi), 0.0)
    sent = turn + 0.008 * draws.standard_normal(len(TIME))
    sent = np.round(sent / step) * step if step else sent
    assert frozen_warnings(log(angular_velocity_z=np.where(np.abs(sent) < 0.03, 0.0, sent))) == []


def test_a_pitch_in_coarse_steps_keeps_its_value_on_level_ground() -> None:
    """Half a degree each, at 10 Hz."""
    coarse = np.round(0.02 * np.sin(TIME / 60) / 0.0087) * 0.0087
    assert frozen_warnings(log(pitch=coarse)) == []


def test_wheels_that_hardly_ever_leave_0_do_not_change_while_a_speed_is_repeated() -> None:
    """The last digit of two dead sensors flickers."""
    rows = (TIME >= 20) & (TIME <= 30)
    flicker = np.where(rows & (np.arange(len(TIME)) % 3 == 0), 0.001, 0.0)
    ground = np.where(rows, 1.5, log().channels["ground_speed"])
    dead = log(ground_speed=ground, wheel_speed_l=flicker, wheel_speed_r=flicker)
    assert frozen_warnings(dead) == []


def test_a_drive_in_which_everything_rises_is_no_logger_that_hung() -> None:
    """It speeds up under a growing pull for ten seconds; later it stands."""
    rows, stands = (TIME >= 20) & (TIME <= 30), np.abs(TIME - 100) < 10
    rising = {n: np.where(rows, v[rows][0] + 0.05 * (TIME - 20), v) for n, v in pulling().channels.items()}
    rising["ground_speed"] = np.where(stands, 0.0, rising["ground_speed"])
    assert frozen_warnings(pulling(**rising)) == []


def test_a_torque_in_coarse_steps_keeps_its_value_by_them() -> None:
    """Steps of 12 N m, where it is 140: held for long beside a pull that changes, it was "not measured", without a fault."""
    calm = np.where(abs(TIME - 100) < 20, 110.0, 100 + 40 * np.sin(TIME / 3))
    noisy = calm + np.random.default_rng(3).standard_normal(len(TIME))
    assert frozen_warnings(pulling(drive_torque_l=np.round(noisy / 12) * 12)) == []


def test_the_ends_of_a_drive_with_noise_or_steps_say_nothing() -> None:
    assert cut_warnings(pulling()) == []
    coarse = {name: np.round(values) for name, values in pulling().channels.items() if "torque" in name}
    assert cut_warnings(pulling(**coarse)) == [], "a channel of whole N m"


@pytest.mark.parametrize("name", ["drive_torque_l", "drawbar_force", "acceleration_x"])
def test_a_channel_that_its_range_cuts_is_named(name: str) -> None:
    """All three read on without a word before."""
    values = pulling().channels[name]
    most = float(np.quantile(values, 0.9))
    cut = pulling(**{name: np.minimum(values, most)})
    (note,) = cut_warnings(cut)
    assert re.match(rf"{name} is {most:.4g} in (9|1[0-3])% of the driving", note)
    assert "never more" in note
    assert note in unit_warnings(cut, None)
    (note,) = cut_warnings(pulling(**{name: -np.minimum(values, most)}))
    assert "never less" in note


def test_a_motor_at_its_limit_and_a_slack_bar_are_left_alone() -> None:
    """Both stay at one value for long: the noise of a force that is cut comes and goes."""
    torque = np.where((TIME > 20) & (TIME < 60), 150.0, pulling().channels["drive_torque_l"])
    pull = np.where(TIME < 90, 0.0, pulling().channels["drawbar_force"])
    assert cut_warnings(pulling(drive_torque_l=torque, drawbar_force=pull)) == []
    assert cut_warnings(log()) == []


def overflown(values: np.ndarray, bits: int, most: float) -> np.ndarray:
    """Values as a signed number of so many bits holds them, whose greatest is ``most``."""
    scale = 2.0 ** (bits - 1) / most
    return ((np.round(values * scale) + 2.0 ** (bits - 1)) % 2.0**bits - 2.0 ** (bits - 1)) / scale


@pytest.mark.parametrize(("name", "bits"), [("drive_torque_l", 16), ("drawbar_force", 12)])
def test_a_number_that_overflows_is_named(name: str, bits: int) -> None:
    """In 3 % of the rows: two of four drives had no note, the others one on the scale of all torques."""
    values = pulling().channels[name]
    most = float(np.quantile(values, 0.97))
    wrong = pulling(**{name: overflown(values, bits, most)})
    (note,) = overflow_warnings(wrong)
    assert re.match(
        rf"{name} leaps from one end of the range to the other and back \(\d+ times, first at", note
    )
    assert note in unit_warnings(wrong, None)
    assert overflow_warnings(pulling(**{name: np.minimum(values, most)})) == []


def test_a_force_that_is_switched_from_end_to_end_does_not_overflow() -> None:
    """From there it does not go on: it stays, or comes back by other steps."""
    draws = np.random.default_rng(1002)
    switched = 100.0 * np.sign(np.sin(TIME)) + draws.standard_normal(len(TIME))
    assert overflow_warnings(pulling(drive_torque_l=np.round(switched, 1))) == []
    # A robot's commands, which had the note: full forward, full back, none; and ramps to a limit, from which it is reversed.
    commands = np.resize(np.repeat([100.0, -100.0, 0.0], [15, 15, 50]), len(TIME))
    assert overflow_warnings(pulling(drive_torque_l=commands)) == []
    ramps = np.concatenate(
        [np.linspace(0, 1, 8), np.ones(5), -np.ones(5), np.linspace(-1, 0, 8), np.zeros(30)]
    )
    for noise in (0.0, 2.0):
        limited = 100.0 * np.resize(ramps, len(TIME)) + noise * draws.standard_normal(len(TIME))
        assert overflow_warnings(pulling(drive_torque_l=limited)) == []
    spikes = np.where(draws.random(len(TIME)) < 0.01, -1.0, 1.0) * pulling().channels["drive_torque_l"]
    assert overflow_warnings(pulling(drive_torque_l=spikes)) == []
