"""A profile turns foreign columns into the recording's own, and refuses what it cannot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile, read
from terragrip.formats.derivation import unrolled
from terragrip.formats.table import LogTable
from terragrip.recording import Recording, sensor_noise

PROFILE = """\
name: test rig
time: {from: stamp, unit: ms}
channels:
  wheel_speed_l: {from: rpm_left, unit: rpm, sign: -1}
  wheel_speed_r: rpm_right
  drive_torque_l: {from: amps, scale: 2.079, offset: -0.5, unit: N m, invalid: [0, [900, 1000]]}
  ground_speed: {from: kmh, unit: km/h}
  pitch: {from: slope, unit: deg}
  soil: {constant: grass}
"""


@pytest.fixture
def foreign() -> pd.DataFrame:
    """A log with names and units of its own."""
    n = 200
    return pd.DataFrame(
        {
            "stamp": np.arange(n) * 50,
            "rpm_left": -30.0 - np.arange(n) % 7,
            "rpm_right": 3.2 + np.arange(n) % 5 * 0.01,
            "amps": 5.0 + np.arange(n) % 3,
            "kmh": 3.6 + np.arange(n) % 4 * 0.1,
            "slope": -3.0,
            "mode": ["idle"] * 50 + ["calib"] * 150,
        }
    )


def apply(foreign: pd.DataFrame, **channels: Any) -> Recording:
    base: dict[str, Any] = {"wheel_speed_l": "rpm_right", "ground_speed": "kmh"}
    data = {"time": {"from": "stamp", "unit": "ms"}, "channels": {**base, **channels}}
    return Profile.from_dict(data).apply(foreign, source="log.csv")


def test_units_scale_offset_sign_and_invalid_values(tmp_path: Path, foreign: pd.DataFrame) -> None:
    foreign.loc[3, "amps"] = 0.0
    foreign.loc[4, "amps"] = 950.0
    log, profile = tmp_path / "log.csv", tmp_path / "profile.yaml"
    foreign.to_csv(log, index=False)
    profile.write_text(PROFILE)
    recording = read(log, profile)
    np.testing.assert_allclose(recording.time, np.arange(200) * 0.05)
    np.testing.assert_allclose(recording["wheel_speed_l"], -foreign["rpm_left"] * 2 * np.pi / 60)
    np.testing.assert_array_equal(recording["wheel_speed_r"], foreign["rpm_right"])
    np.testing.assert_allclose(recording["ground_speed"], foreign["kmh"] / 3.6)
    np.testing.assert_allclose(recording["pitch"], np.deg2rad(-3))
    expected = 2.079 * foreign["amps"] - 0.5
    expected[3:5] = np.nan
    np.testing.assert_allclose(recording["drive_torque_l"], expected)
    assert set(recording["soil"]) == {"grass"}
    assert recording.sha256 is not None
    assert Profile.load(profile).apply(foreign)["ground_speed"] == pytest.approx(recording["ground_speed"])


def test_delay_moves_a_channel_earlier_on_the_union_of_instants(foreign: pd.DataFrame) -> None:
    recording = apply(foreign, drive_torque_l={"from": "amps", "delay": "20 ms"})
    torque, speed = recording["drive_torque_l"], recording["ground_speed"]
    assert len(recording) == 400
    measured = np.isfinite(torque)
    np.testing.assert_allclose(recording.time[measured], np.arange(200) * 0.05 - 0.02)
    np.testing.assert_array_equal(torque[measured], foreign["amps"])
    np.testing.assert_array_equal(np.isfinite(speed), ~measured)
    np.testing.assert_allclose(recording.time[~measured], np.arange(200) * 0.05)


def test_a_label_lasts_through_the_rows_that_a_delay_makes(foreign: pd.DataFrame) -> None:
    """Left empty there, half of a drive had no soil: its curve was learned from the other half."""
    recording = apply(foreign, drive_torque_l={"from": "amps", "delay": "20 ms"}, soil={"from": "mode"})
    assert len(recording) == 400
    assert list(recording["soil"][:2]) == ["", foreign["mode"].iloc[0]]
    assert list(recording["soil"][2::2]) == list(foreign["mode"].iloc[:199])
    assert list(recording["soil"][1::2]) == list(foreign["mode"])


def test_a_delay_of_whole_rows_makes_no_rows_of_rounding_errors(foreign: pd.DataFrame) -> None:
    recording = apply(foreign, drive_torque_l={"from": "amps", "delay": 0.15}, soil={"from": "mode"})
    assert len(recording) == 203
    assert np.diff(recording.time).min() == pytest.approx(0.05)
    np.testing.assert_array_equal(recording["drive_torque_l"][:200], foreign["amps"])
    np.testing.assert_array_equal(recording["ground_speed"][3:], foreign["kmh"])
    assert list(recording["soil"][:4]) == ["", "", "", "idle"]


def test_nanosecond_stamps_keep_their_digits(foreign: pd.DataFrame) -> None:
    foreign["stamp"] = 1_721_335_045_320_405_150 + np.arange(200) * 1_000_000
    data = {
        "time": {"from": "stamp", "unit": "ns", "zero": "first"},
        "channels": {"wheel_speed_l": "rpm_right", "ground_speed": "kmh"},
    }
    np.testing.assert_allclose(Profile.from_dict(data).apply(foreign).time, np.arange(200) * 1e-3, atol=1e-12)


def test_two_pins_are_added_and_two_pressures_subtracted(tmp_path: Path) -> None:
    """The sum had to be made outside: a hitch load of two pins, a torque of a hydraulic motor's two ports."""
    rows = "0,1,2,4000,30,20,2,1\n.1,1.5,2.5,4000,35,20,2,1\n.2,,2,4000,20,25,2,1\n"
    (tmp_path / "log.csv").write_text(
        "time,l [kN],r [kN],f [N],a [bar],b [bar],ground_speed,wheel_speed_x\n" + rows
    )
    channels = {"ground_speed": "ground_speed", "wheel_speed_x": "wheel_speed_x"}
    pins = {
        "hitch_load": {"sum_of": ["l", "r"]},
        "drawbar_force": {"sum_of": {"l": 1000, "f": 1}, "unit": "N"},
    }
    torque = {"drive_torque_x": {"sum_of": {"a": 14.0, "b": -14.0}, "unit": "N m"}}
    recording = read(tmp_path / "log.csv", Profile.from_dict({"channels": channels | pins | torque}))
    np.testing.assert_allclose(recording["hitch_load"], [3000, 4000, np.nan])
    np.testing.assert_allclose(recording["drawbar_force"], [5000, 5500, np.nan])
    np.testing.assert_allclose(recording["drive_torque_x"], [140, 210, -70])
    unlike = {"hitch_load": {"sum_of": ["l", "f"]}}
    with pytest.raises(InputError, match="columns l, f: are of unlike units"):
        read(tmp_path / "log.csv", Profile.from_dict({"channels": channels | unlike}))


def test_rows_are_selected(foreign: pd.DataFrame) -> None:
    data = {
        "time": {"from": "stamp", "unit": "ms"},
        "rows": {"column": "mode", "equals": "calib"},
        "channels": {"wheel_speed_l": "rpm_right", "ground_speed": "kmh"},
    }
    assert len(Profile.from_dict(data).apply(foreign)) == 150
    data["rows"] = {"column": "mode", "equals": "drive"}
    with pytest.raises(InputError, match="column mode: no row equals 'drive'; the column holds calib, idle"):
        Profile.from_dict(data).apply(foreign)


@pytest.mark.parametrize(
    ("header", "source", "value"),
    [
        ("M [kNm]", {"from": "M", "scale": 0.5, "unit": "kN m"}, 2000.0),
        ("M [kNm]", {"from": "M", "scale": 500, "unit": "N m"}, 2000.0),
        ("M [kNm]", {"from": "M", "scale": 1000}, 4000.0),
        ("M [Nm]", {"from": "M", "scale": 0.5}, 2.0),
        ("M [A]", {"from": "M", "scale": 0.5}, 2.0),
        ("M [kNm]", {"from": "M", "scale": -1}, -4000.0),
        ("M [kNm]", {"sum_of": {"M": 1, "back": -1}}, 3000.0),
        ("M [kNm]", {"from": "M", "scale": 0.5}, None),
        ("M [kNm]", {"sum_of": {"M": 0.5, "back": -0.5}}, None),
    ],
)
def test_a_scale_beside_the_logs_own_unit_is_not_guessed_at(
    tmp_path: Path, header: str, source: dict[str, object], value: float | None
) -> None:
    """An axle's torque in kNm by the header, half of it for each wheel: the unit was dropped, and adhesion a thousandth."""
    (tmp_path / "log.csv").write_text(
        f"time [s],v [m/s],back [kNm],{header}\n" + "".join(f"{k},1,1,4\n" for k in range(5))
    )
    channels = {"ground_speed": "v", "wheel_speed_fl": {"constant": 1.0}, "drive_torque_fl": source}
    profile = Profile.from_dict({"channels": channels})
    if value is not None:
        assert read(tmp_path / "log.csv", profile)["drive_torque_fl"] == pytest.approx(np.full(5, value))
        return
    with pytest.raises(
        InputError, match=r"channel drive_torque_fl: is in kNm by the log.*write 'unit: kNm' beside"
    ):
        read(tmp_path / "log.csv", profile)


def test_a_unit_that_the_log_states_is_used(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,speed [km/h],left [rpm],amps [A]\n0,3.6,60,2\n1,7.2,60,2\n")
    channels = {
        "ground_speed": "speed",
        "wheel_speed_l": "left",
        "drive_torque_l": {"from": "amps", "scale": 2.0},
    }
    recording = read(log, Profile.from_dict({"time": {"from": "t"}, "channels": channels}))
    np.testing.assert_allclose(recording["ground_speed"], [1, 2])
    np.testing.assert_allclose(recording["wheel_speed_l"], 2 * np.pi)
    np.testing.assert_allclose(recording["drive_torque_l"], 4.0)
    channels["drive_torque_l"] = {"from": "amps"}
    with pytest.raises(InputError, match="column amps: 'A' measures a current, where a torque is needed"):
        read(log, Profile.from_dict({"time": {"from": "t"}, "channels": channels}))


def drive(rate: float, *, seed: int, noise: float) -> tuple[pd.DataFrame, np.ndarray]:
    """A tracked drive along a curve, forward then backward, and its true signed speed."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 60, 1 / rate)
    speed = np.where(time < 40, 0.8 + 0.2 * np.sin(0.6 * time), -0.5)
    yaw = 0.3 * np.sin(0.2 * time)
    x, y = (np.cumsum(speed * f(yaw)) / rate for f in (np.cos, np.sin))
    frame = pd.DataFrame(
        {
            "stamp": time * 1000, "rpm_right": 4.0, "kmh": 1.0, "yaw_deg": np.rad2deg(yaw),
            "x": x + noise * rng.standard_normal(len(time)), "y": y + noise * rng.standard_normal(len(time)),
            "qx": 0.0, "qy": 0.0, "qz": np.sin(yaw / 2), "qw": np.cos(yaw / 2),
        }
    )  # fmt: skip
    return frame, speed


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "forward", [{"yaw": "yaw_deg", "unit": "deg"}, {"quaternion": ["qx", "qy", "qz", "qw"]}]
)
def test_signed_speed_from_positions(forward: dict[str, Any], seed: int) -> None:
    frame, speed = drive(20, seed=seed, noise=0.002)
    source = {"derivative_of": ["x", "y"], "unit": "m", "window": "0.5 s", "forward": forward}
    recording = apply(frame, ground_speed=source)
    result = recording["ground_speed"]
    # The turn-round takes no time, which no derivative can follow; a one-sided window tells little.
    away = np.abs(recording.time - 40) > 0.5
    assert recording.time[away & np.isnan(result)] == pytest.approx([0, 0.05, 59.9, 59.95])
    away &= np.isfinite(result)
    error = (result - speed)[away]
    assert np.std(error) < 0.008
    assert abs(np.mean(error)) < 0.002
    assert recording.noise["ground_speed"] == pytest.approx(np.std(error), rel=0.25)
    assert sensor_noise(recording)["ground_speed"] == recording.noise["ground_speed"]
    assert any("derivative of x, y over 0.5 s" in note for note in recording.notes)


@pytest.mark.parametrize("seed", range(3))
def test_outlying_positions_weigh_nothing(seed: int) -> None:
    frame, speed = drive(20, seed=seed, noise=0.002)
    source = {
        "derivative_of": ["x", "y"],
        "unit": "m",
        "window": "0.8 s",
        "forward": {"yaw": "yaw_deg", "unit": "deg"},
    }
    away = np.abs(np.arange(1200) / 20 - 40) > 0.5
    clean = apply(frame, ground_speed=source)["ground_speed"][away] - speed[away]
    rows = np.random.default_rng(seed).choice(1200, 30, replace=False)
    frame.loc[rows, "x"] += 0.03
    result = apply(frame, ground_speed=source)["ground_speed"][away] - speed[away]
    assert np.isfinite(result).mean() > 0.9
    assert np.nanstd(result) < 1.3 * np.nanstd(clean)


def test_speed_from_one_coordinate_and_without_heading() -> None:
    frame, speed = drive(20, seed=1, noise=0.0)
    frame["odometer_cm"] = 100 * np.cumsum(speed) / 20
    recording = apply(frame, ground_speed={"derivative_of": ["odometer_cm"], "unit": "cm"})
    inner = (np.abs(recording.time - 40) > 0.5) & (recording.time > 0.5) & (recording.time < 59)
    np.testing.assert_allclose(recording["ground_speed"][inner], speed[inner], atol=0.01)
    unsigned = apply(frame, ground_speed={"derivative_of": ["x", "y"], "unit": "m"})
    np.testing.assert_allclose(unsigned["ground_speed"][inner], np.abs(speed)[inner], atol=0.01)


def test_a_speed_from_whole_numbers_of_1e_7_degrees(foreign: pd.DataFrame) -> None:
    north = 48.0 + 2.0 * 0.05 * np.arange(200) / 111_200.0
    east = 11.0 + 1e-9 * np.arange(200)
    frame = foreign.assign(lat=np.round(1e7 * north), lon=np.round(1e7 * east))
    source = {"derivative_of": ["lat", "lon"], "unit": "deg", "window": "2 s"}
    with pytest.raises(InputError, match=r"most of its values are no latitude in degrees; .* 'scale: 1e-7'"):
        apply(frame, ground_speed=source)
    speed = apply(frame, ground_speed={**source, "scale": 1e-7}).channels["ground_speed"]
    assert speed[40:160] == pytest.approx(2.0, rel=5e-3)


def test_counts_of_an_encoder_become_a_wheel_speed() -> None:
    """1200 counts a turn at 10 Hz, forward, at rest and backward; one column needs no list."""
    time = np.arange(0, 30, 0.1)
    turned = np.interp(time, [0, 10, 20, 30], [0, 50, 50, 20])
    frame = {"t": time, "v": np.full(len(time), 0.3), "ticks": np.floor(turned * 1200 / (2 * np.pi))}
    source = {"derivative_of": "ticks", "scale": 2 * np.pi / 1200, "unit": "rad"}
    speed = Profile.from_dict(
        {"time": {"from": "t"}, "channels": {"ground_speed": "v", "wheel_speed_rl": source}}
    )
    recording = speed.apply(frame)
    for middle, expected in ((5.0, 5.0), (15.0, 0.0), (25.0, -3.0)):
        near = np.abs(recording.time - middle) < 3
        assert np.allclose(recording.channels["wheel_speed_rl"][near], expected, atol=0.05)


@pytest.mark.parametrize("low", [0, -2048])
def test_counts_that_overflow_go_on(low: int) -> None:
    """12 bits of 1024 counts a turn, four turns: a fifth of the rows were off, to -59 rad/s for 9.5."""
    time = np.arange(0, 60, 0.02)
    turned = np.interp(time, [0, 30, 35, 60], [0, 285, 285, 100])
    counts = (np.floor(turned * 1024 / (2 * np.pi)) - low) % 4096 + low
    source = {"derivative_of": "ticks", "scale": 2 * np.pi / 1024, "unit": "rad", "window": "0.5 s"}
    channels = {"ground_speed": "v", "wheel_speed_rl": source}
    profile = Profile.from_dict({"time": {"from": "t"}, "channels": channels})
    speed = profile.apply({"t": time, "v": np.full(len(time), 0.3), "ticks": counts})["wheel_speed_rl"]
    for rows, expected in (((time > 1) & (time < 29), 9.5), ((time > 36) & (time < 59), -7.4)):
        assert np.allclose(speed[rows], expected, atol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_jumps_of_the_pose_gaps_and_held_poses(seed: int) -> None:
    frame, speed = drive(20, seed=seed, noise=0.002)
    pose = ["x", "y"]
    row = np.arange(len(frame)) // 2 * 2  # fresh every other row
    frame[pose] = frame[pose].to_numpy()[row]
    frame.loc[300:302, "x"] += 5.0  # a lost track
    frame.loc[500:561, pose] = np.nan  # 3 s without a pose
    source = {
        "derivative_of": pose,
        "unit": "m",
        "window": "0.6 s",
        "forward": {"yaw": "yaw_deg", "unit": "deg"},
    }
    result = apply(frame, ground_speed=source)["ground_speed"]
    known = np.isfinite(result)
    assert known.mean() == pytest.approx(0.5 * (1 - 72 / 1200), abs=0.02)
    assert not known[500:562].any()
    time = np.arange(1200) / 20
    away = known & (np.abs(time - 40) > 0.7)
    # A pose stands for the instant it appeared at; half a row of lag moves the speed by 0.003.
    assert np.abs((result - speed)[away]).max() < 0.03


def test_pitch_and_roll_from_a_quaternion() -> None:
    frame, _ = drive(20, seed=0, noise=0.0)
    half = np.deg2rad(5.0) / 2
    frame["qy"], frame["qz"], frame["qw"] = np.sin(half), 0.0, np.cos(half)  # about the left axis: nose down
    pitch = apply(frame, pitch={"pitch_of": ["qx", "qy", "qz", "qw"]})["pitch"]
    np.testing.assert_allclose(pitch, np.deg2rad(-5.0))
    roll = apply(frame, roll={"roll_of": ["qy", "qx", "qz", "qw"], "sign": -1})["roll"]
    np.testing.assert_allclose(roll, np.deg2rad(-5.0))


@pytest.mark.parametrize(
    ("old", "new", "place", "problem", "hint"),
    [
        ("from: kmh", "fron: kmh", "channels.ground_speed.fron (line 7)", "unknown key", "did you mean from?"),
        ("ground_speed:", "groundspeed:", "channels.groundspeed (line 7)", "no such channel", "mean ground_speed"),
        ("unit: km/h", "unit: kg", "channels.ground_speed (line 7)", "measures a mass, where a speed", "m/s"),
        ("unit: km/h", "unit: mph/", "channels.ground_speed (line 7)", "is not a unit", "N m"),
        ("channels:\n", "channels:\n  time: stamp\n", "channels.time (line 4)", "time is not a channel", "beside channels"),
        ("sign: -1", "sign: 2", "channels.wheel_speed_l.sign (line 4)", "", ""),
        ("scale: 2.079", "scale: .nan", "channels.drive_torque_l.scale (line 6)", "", ""),
        ("{constant: grass}", "{unit: m}", "channels.soil (line 9)", "needs exactly one source", "derivative_of"),
        ("{constant: grass}", "{constant: a, from: b}", "channels.soil (line 9)", "needs exactly one source", ""),
        ("unit: ms", "unit: m", "time.unit (line 2)", "measures a length, where a time is needed", "'s'"),
        ("[900, 1000]", "[900, 1000, 2]", "channels.drive_torque_l.invalid", "", ""),
        ("{constant: grass}", "{constant: grass, window: 1 s}", "channels.soil.window (line 9)", "works with derivative_of, or", "leave"),
        ("from: kmh", "derivative_of: [a], forward: {yaw: y}", "channels.ground_speed.forward", "needs derivative_of two", ""),
        ("name: test rig", "delay: 3", "delay (line 1)", "unknown key", ""),
    ],
)  # fmt: skip
def test_a_faulty_profile_is_refused(
    tmp_path: Path, old: str, new: str, place: str, problem: str, hint: str
) -> None:
    path = tmp_path / "profile.yaml"
    assert old in PROFILE
    path.write_text(PROFILE.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        Profile.load(path)
    assert place in (caught.value.place or "")
    assert problem in caught.value.problem
    assert hint in (caught.value.hint or "")


def _rename(name: str, other: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda frame: frame.rename(columns={name: other})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_rename("kmh", "speed_kmh"), "column kmh: is missing, but the profile names it; the nearest column is 'speed_kmh'"),
        (_rename("kmh", "?"), "column kmh: is missing, but the profile names it; its columns are stamp, rpm_left"),
        (lambda f: f.assign(kmh="fast"), "column kmh, row 1 (time 0 s): 'fast' is not a number"),
        (lambda f: f.assign(stamp=f["stamp"].iloc[::-1].to_numpy()), "column time, row 2 (time 9.9 s): time goes back"),
        (lambda f: f.iloc[:0], "the table is empty"),
    ],
)  # fmt: skip
def test_a_log_that_does_not_fit_is_refused(
    foreign: pd.DataFrame, change: Callable[[pd.DataFrame], pd.DataFrame], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        apply(change(foreign), drive_torque_l="amps")
    assert str(caught.value).startswith(f"log.csv: {message}")


def test_measured_poses(shared: Callable[[str], Path]) -> None:
    """Warthog on grass: the speed of the lidar pose against the wheels', where both sides turn alike."""
    log = shared("data/drive_warthog/raw20hz/warthog_wheels_grass_2024_7_29_14h46s15.csv.gz")
    pose = [f"icp_quat_{axis}" for axis in "xyzw"]
    channels = {
        "wheel_speed_l": {"from": "meas_left_vel", "unit": "rad/s"},
        "wheel_speed_r": {"from": "meas_right_vel", "unit": "rad/s"},
        "ground_speed": {
            "derivative_of": ["icp_pos_x", "icp_pos_y"], "unit": "m", "window": "0.8 s", "forward": {"quaternion": pose},
        },
        "pitch": {"pitch_of": pose},
    }  # fmt: skip
    recording = read(log, Profile.from_dict({"time": {"from": "time_s"}, "channels": channels}))
    left, right, speed = (recording[c] for c in ("wheel_speed_l", "wheel_speed_r", "ground_speed"))
    assert np.isfinite(speed).mean() == pytest.approx(
        0.4, abs=0.05
    )  # poses arrive at 8 to 9 Hz in 20 Hz rows
    straight = (
        np.isfinite(speed)
        & (np.abs(left + right) > 4.0)
        & (np.abs(left - right) < 0.2 * np.abs(left + right))
    )
    ratio = speed[straight] / (0.3 * 0.5 * (left + right)[straight])
    assert straight.sum() > 100
    assert 0.90 < np.median(ratio) < 1.0  # the data's own notes: slip of 0.05 on grass; and the sign is right
    assert np.mean(ratio > 0.5) > 0.95
    assert np.rad2deg(np.abs(np.nanmedian(recording["pitch"]))) < 3


def test_a_quotient_is_missing_where_the_divisor_is_small_and_while_the_dividend_is_held(
    foreign: pd.DataFrame,
) -> None:
    n = len(foreign)
    foreign["speed"] = np.where(np.arange(n) < 40, 0.1, -2.0) + 0.001 * (np.arange(n) % 7)
    foreign["amps"] = np.repeat(np.random.default_rng(4).normal(20.0, 5.0, n // 10), 10)
    torque = apply(
        foreign,
        drive_torque_l={"from": "amps", "over": "speed", "over_minimum": 0.3, "scale": 48, "unit": "N m"},
    )["drive_torque_l"]
    updates = np.arange(40, n, 10)
    assert np.flatnonzero(np.isfinite(torque)).tolist() == updates.tolist()
    np.testing.assert_allclose(torque[updates], 48 * foreign["amps"][updates] / foreign["speed"][updates])


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ({"from": "amps", "over": "speed"}, "over_minimum"),
        ({"from": "amps", "over_minimum": 0.3}, "serves over only"),
        ({"constant": 1.0, "over": "speed", "over_minimum": 0.3}, "serves from only"),
        ({"from": "amps", "over": "kmhh", "over_minimum": 0.3}, "kmh"),
    ],
)
def test_a_quotient_needs_both_columns_and_a_least_divisor(
    foreign: pd.DataFrame, source: dict[str, Any], expected: str
) -> None:
    with pytest.raises(InputError, match=expected):
        apply(foreign, drive_torque_l=source)


def test_a_quotient_of_columns_that_never_stand_in_one_row_says_so(tmp_path: Path) -> None:
    """It was "holds no value", which says nothing of the stamps."""
    time, odd = np.arange(0, 20, 0.1), np.arange(200) % 2 == 1
    columns = {
        "time": time,
        "v": 1.0 + 0 * time,
        "w": np.where(odd, 10.0, np.nan),
        "p": np.where(odd, np.nan, 30.0),
    }
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    text = "channels:\n  ground_speed: {from: v}\n  wheel_speed_l: {from: w}\n"
    text += "  drive_torque_l: {from: p, over: w, over_minimum: 0.3, unit: N m}\n"
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(
        InputError, match="channel drive_torque_l, over: p and w are never stamped together; log both"
    ):
        read(tmp_path / "log.csv", tmp_path / "p.yaml")


@pytest.mark.parametrize(
    "names", [["lon", "lat"], ["/fix.longitude", "/fix.latitude"], ["/platform.lon", "/platform.lat"]]
)
def test_a_longitude_before_its_latitude_is_refused(names: list[str]) -> None:
    """At 50 degrees north it gave a wrong speed, and slip with it, without a word."""
    source = {"derivative_of": names, "unit": "deg"}
    with pytest.raises(InputError, match="names the longitude first; write the latitude first"):
        Profile.from_dict({"channels": {"ground_speed": source}})
    Profile.from_dict({"channels": {"ground_speed": {**source, "derivative_of": names[::-1]}}})


def test_a_frame_is_a_log_too() -> None:
    frame = pd.DataFrame({"t": [0.0, 0.1, 0.2], "kmh": [3.6, 7.2, 7.2], "n": [5.0, 6.0, 6.0]})
    units = {"ground_speed": {"from": "kmh", "unit": "km/h"}, "wheel_speed_l": "n"}
    profile = Profile.from_dict({"time": {"from": "t"}, "channels": units})
    np.testing.assert_allclose(read(frame, profile)["ground_speed"], [1.0, 2.0, 2.0])
    own = frame.rename(columns={"kmh": "ground_speed", "n": "wheel_speed_l", "t": "time"})
    np.testing.assert_array_equal(read(own).time, own["time"])
    np.testing.assert_array_equal(read(own.set_index("time")).time, own["time"])
    dated = own.drop(columns="time").set_index(
        pd.date_range("2026-05-11 08:00", periods=3, freq="100ms", tz="Europe/Berlin")
    )
    assert read(dated).start == pd.Timestamp("2026-05-11 06:00", tz="UTC").timestamp()
    np.testing.assert_allclose(read(dated).time, own["time"])
    assert "time" not in dated.columns
    with pytest.raises(InputError, match="column kmh: is missing"):
        read(own, profile)
    with pytest.raises(InputError, match="several profiles for one table"):
        read(own, [profile, profile])
    with pytest.raises(InputError, match="a dict is no profile; give a path, or tg"):
        read("log.csv", {"channels": {"ground_speed": "v"}})  # type: ignore[arg-type]


def test_a_pattern_without_a_column_names_the_channel_and_not_what_it_leaves_out(
    foreign: pd.DataFrame,
) -> None:
    """The message of ros2-4wd led to the wheel odometry, which the profile leaves out since it hides slip."""
    speed = {"from": "*visual*.linear.x", "else": {"from": "*gnss*.speed"}}
    log = foreign.rename(columns={"kmh": "/odom.linear.x"})
    profile = Profile.from_dict({"time": {"from": "stamp"}, "channels": {"ground_speed": speed}})
    with pytest.raises(InputError, match="for ground_speed, and so are its alternatives") as refused:
        profile.apply(log)
    assert "/odom" not in str(refused.value)


@pytest.mark.parametrize("command", ["/cmd_vel.twist.linear.x", "/Target_vel.twist.linear.x"])
def test_any_text_of_a_pattern_is_no_command(foreign: pd.DataFrame, command: str) -> None:
    """ROS 2 stamps /cmd_vel since Jazzy: ros2-4wd took it for the ground speed, before /gps/vel, and slip was what the driver asked for."""
    log = foreign.rename(columns={"kmh": command}).assign(**{"/gps/vel.twist.linear.x": 7.0})
    for pattern, expected in (
        ("*vel.twist.linear.x", np.full(len(log), 7.0)),
        (f"*{command[1:7]}*.x", log[command]),
    ):
        channels = {"ground_speed": pattern, "wheel_speed_rl": "rpm_left"}
        profile = Profile.from_dict({"time": {"from": "stamp"}, "channels": channels})
        np.testing.assert_array_equal(profile.apply(log)["ground_speed"], expected)


def test_patterns_take_no_column_of_another_machine(foreign: pd.DataFrame) -> None:
    """Of two robots in one bag the ground speed was the other's, where the first had none that the profile prefers."""
    names = {"rpm_left": "/r1/joints.fl", "kmh": "/r2/vel.x"}
    log = foreign.rename(columns=names).assign(**{"/r2/joints.fl": 1.0, "/r2/fix.x": 2.0, "/r1/fix.x": 3.0})
    speed = {"from": ["*vel.x", "*fix.x"]}
    channels = {"ground_speed": speed, "wheel_speed_fl": "*joints.fl"}
    result = Profile.from_dict({"time": {"from": "stamp"}, "channels": channels}).apply(log)
    np.testing.assert_array_equal(result["ground_speed"], 3.0)
    assert any("several machines, /r1, /r2, of which /r1 is read" in note for note in result.notes)
    # What the profile names counts, and a namespace of its own for each sensor is no machine.
    stated = {"ground_speed": "/r2/vel.x", "wheel_speed_fl": "/r1/joints.fl"}
    result = Profile.from_dict({"time": {"from": "stamp"}, "channels": stated}).apply(log)
    np.testing.assert_array_equal(result["ground_speed"], foreign["kmh"])
    assert not any("machines" in note for note in result.notes)


def test_a_namespace_picks_one_of_several_machines(foreign: pd.DataFrame) -> None:
    columns = {"stamp": foreign["stamp"], "/fix.x": 9.0}
    for k, robot in enumerate(("/r1", "/r2"), 1):
        columns |= {f"{robot}/joints.fl": 5.0 * k, f"{robot}/gps/vel.x": 1.0 * k}
    log = pd.DataFrame(columns)
    content = {
        "time": {"from": "stamp"},
        "channels": {"ground_speed": {"from": ["*fix.x", "*vel.x"]}, "wheel_speed_fl": "/joints.fl"},
    }
    profile = Profile.from_dict({**content, "namespace": "r2"})
    for one in (profile, Profile.from_dict(profile.to_dict())):
        result = one.apply(log)
        assert (result["ground_speed"][0], result["wheel_speed_fl"][0]) == (2.0, 10.0)
        assert not any("machines" in note for note in result.notes)
    with pytest.raises(InputError, match=r"column /r3/\*fix\.x: is missing"):
        Profile.from_dict({**content, "namespace": "/r3"}).apply(log)


@pytest.mark.parametrize("empty", [0.0, np.nan])
def test_efforts_that_are_nothing_but_0_are_no_torques(foreign: pd.DataFrame, empty: float) -> None:
    """A driver without a current sensor fills them in; adhesion was 0 with an interval. A torque of another name may be 0."""
    names = {
        "/joint_states.velocity.front_left": "wheel_speed_fl",
        "/joint_states.effort.front_left": "drive_torque_fl",
    }
    log = foreign.rename(columns={"rpm_left": "/joint_states.velocity.front_left"})
    log = log.assign(**{"/joint_states.effort.front_left": empty, "torque": 0.0})
    content = {
        "time": {"from": "stamp"},
        "channels": {"ground_speed": "kmh", **{v: k for k, v in names.items()}},
    }
    result = Profile.from_dict(content).apply(log)
    assert "drive_torque_fl" not in result
    note = "/joint_states.effort.front_left hold nothing but 0, as drivers do that measure no torque: drive_torque_fl"
    assert any(text.startswith(note) for text in result.notes)
    content["channels"]["drive_torque_fl"] = "torque"
    np.testing.assert_array_equal(Profile.from_dict(content).apply(log)["drive_torque_fl"], 0.0)
    log["/joint_states.effort.front_left"] = np.where(np.arange(len(log)) == 1, 2.0, empty)
    content["channels"]["drive_torque_fl"] = "/joint_states.effort.front_left"
    assert Profile.from_dict(content).apply(log)["drive_torque_fl"][1] == 2.0


def test_counts_that_go_by_in_a_gap_are_no_overflow() -> None:
    """20 s are missing, in which 2700 of 3900 counts went by: they were counted backwards."""
    time = np.r_[np.arange(0, 20, 0.1), np.arange(40, 60, 0.1)]
    counts = np.floor(np.interp(time, [0, 20, 40, 60], [0, 500, 3200, 3900]))
    assert np.array_equal(unrolled(counts, None), counts)


def test_efforts_of_which_nothing_states_the_unit_are_named(foreign: pd.DataFrame) -> None:
    """`ros2-4wd` read a driver's amperes as N m without a word; what the log or the profile states is no question."""
    names = {"rpm_left": "/joint_states.velocity.front_left", "rpm_right": "/joint_states.effort.front_left"}
    log = foreign.rename(columns=names)
    channels: dict[str, Any] = {"ground_speed": "kmh", "wheel_speed_fl": names["rpm_left"]}

    def notes(effort: Any, log: pd.DataFrame = log) -> list[str]:
        content = {"time": {"from": "stamp"}, "channels": channels | {"drive_torque_fl": effort}}
        return [n for n in Profile.from_dict(content).apply(log).notes if "efforts of joints" in n]

    (note,) = notes(names["rpm_right"])
    assert note.startswith("drive_torque_fl are efforts of joints as N m")
    assert "'unit: N m'" in note
    assert len(notes({"from": names["rpm_right"], "sign": -1})) == 1
    assert not notes({"from": names["rpm_right"], "unit": "N m"})
    assert not notes({"from": names["rpm_right"], "scale": 2.1})
    stated = f"{names['rpm_right']} [N m]"
    assert not notes(stated, log.rename(columns={names["rpm_right"]: stated}))


def test_a_velocity_on_the_axes_of_a_map_is_named(foreign: pd.DataFrame) -> None:
    """An odometry in its map's frame, driven north-east: its x alone was the ground speed, and slip .46 in place of .10."""
    log = foreign.assign(**{"/vo.linear.x": 0.6 * foreign["kmh"], "/vo.linear.y": 0.8 * foreign["kmh"]})
    channels = {"ground_speed": "*vo.linear.x", "wheel_speed_fl": "rpm_left"}
    profile = Profile.from_dict({"time": {"from": "stamp"}, "channels": channels})
    words = "ground_speed may be one component of a velocity: /vo.linear.y is 1.3 times /vo.linear.x."
    assert profile.wants("/vo.linear.y")
    assert any(words in note for note in profile.apply(log).notes)
    for beside in (0.1 * log["/vo.linear.y"], "not fixed"):  # a slide; a text was a traceback
        log["/vo.linear.y"] = beside
        assert not any("component" in note for note in profile.apply(log).notes)


def test_units_behind_the_names_of_a_table_in_memory_count_as_in_a_file(foreign: pd.DataFrame) -> None:
    """'the nearest column is ground_speed [km/h]: rename it' led to km/h taken for m/s."""
    names = {"kmh": "ground_speed [km/h]", "rpm_left": "wheel_speed_fl (rpm)", "stamp": "time"}
    log = foreign[list(names)].rename(columns=names)
    for result in (
        read(log),
        read([log[["time", "ground_speed [km/h]"]], log[["time", "wheel_speed_fl (rpm)"]]]),
    ):
        np.testing.assert_allclose(result["ground_speed"], foreign["kmh"] / 3.6)
        np.testing.assert_allclose(result["wheel_speed_fl"], foreign["rpm_left"] * np.pi / 30)


@pytest.mark.parametrize("kind", ["frame", "csv", "parquet"])
@pytest.mark.parametrize("name", ["Speed (km/h)", "Speed"])
@pytest.mark.parametrize("unit", [{}, {"unit": "km/h"}])
def test_a_profile_names_a_column_with_its_unit_or_without(
    tmp_path: Path, foreign: pd.DataFrame, kind: str, name: str, unit: dict[str, str]
) -> None:
    """Parquet and frames took 'Speed (km/h)' for m/s without a word, and refused the names that the same table had as CSV."""
    log: Any = foreign.rename(columns={"kmh": "Speed (km/h)", "rpm_left": "n (rpm)", "stamp": "t [s]"})
    if kind != "frame":
        getattr(log, f"to_{kind}")(tmp_path / f"log.{kind}", index=False)
        log = tmp_path / f"log.{kind}"
    channels = {"ground_speed": {"from": name, **unit}, "wheel_speed_fl": {"from": ["n (rpm)", "n"]}}
    got = read(log, Profile.from_dict({"time": {"from": "t [s]"}, "channels": channels}))
    np.testing.assert_allclose(got["ground_speed"], foreign["kmh"] / 3.6)
    np.testing.assert_allclose(got["wheel_speed_fl"], foreign["rpm_left"] * np.pi / 30)


def test_a_log_without_time_says_where_to_name_it(foreign: pd.DataFrame) -> None:
    profile = Profile.from_dict({"channels": {"ground_speed": {"from": "kmh", "unit": "km/h"}}})
    with pytest.raises(
        InputError, match=r"column time: is missing; name it in the profile: 'time: \{from: \.\.\.\}'"
    ):
        profile.apply(foreign)


def test_a_profile_that_reads_nothing_of_a_log_of_signals_is_refused() -> None:
    """A KeyError before, on what `inspect` proposes for MATLAB tables without a time."""
    log = LogTable(("time", "Data.Weight"), {}, source="log.mat", clocked=True)
    with pytest.raises(InputError, match="the profile reads none of its signals"):
        Profile.from_dict({"channels": {}}).apply(log)
