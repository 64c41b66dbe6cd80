"""What inspect proposes of a stranger's columns: by name, unit and data; wrong ones are worse than none."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read
from terragrip.formats.proposal import missing_channels, profile_text
from terragrip.formats.recognition import propose
from terragrip.formats.vocabulary import GENERAL
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle
from terragrip.vehicle_maker import make

TIME = np.arange(0.0, 60.0, 0.1)
SPEED = 3.0 + np.sin(TIME / 5)  # m/s
HEADING = np.cumsum(0.05 * np.sin(TIME / 4)) * 0.1 * 3
WAY = np.cumsum(SPEED) * 0.1


def _propose(columns: dict[str, np.ndarray], units: dict[str, str] | None = None):  # type: ignore[no-untyped-def]
    return propose(columns, (), units or {}, dict.fromkeys(columns, TIME))


def _place() -> dict[str, np.ndarray]:
    """Latitude and longitude of a drive due north at SPEED."""
    return {"lat": 45.0 + WAY / 111_132.0, "lon": 11.0 + 1e-9 * np.arange(len(TIME))}


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("CAN1.TSC1.EngnRqstdTrqTrqLmt", "%"),  # an engine's torque limit, on bus 1
        ("CAN1.EEC1.EngineDemandPercentTorque", "%"),
        ("engineTorquePercent", "%"),  # of what, with friction or without?
        ("velocity_down", "m/s"),
        ("vert-vel", "m/s"),
        ("angular_acceleration_x", "rad/s^2"),
        ("rotational_acceleration_z", "deg/s^2"),
        ("cmd_wheel_speed_fl", "rad/s"),
        ("rl_rpm_sp", "rpm"),  # a wheel's speed without a question mark
        ("rpm_goal_rl", "rpm"),
        ("TorqueSP_RL", "N m"),
        ("torque_rl_tgt", "N m"),
        ("MotorSpdSetpt_L", "rpm"),
        ("GPS_speed_sp", "m/s"),
        ("cruise_speed", "km/h"),
        ("GPS TOW", "s"),
        ("wheel_speed_fl_variance", "rad/s"),
        ("brake_torque_fl", "N m"),
        ("East Velocity", "m/s"),
    ],
)
def test_what_is_not_a_channel_is_not_proposed(name: str, unit: str) -> None:
    assert _propose({name: SPEED}, {name: unit}) == {}


def test_an_engines_torque_is_no_wheels() -> None:
    name = "CAN1.EEC1.ActualEnginePercentTorque"
    assert set(_propose({name: SPEED}, {name: "%"})) == {"engine_torque_share"}


def test_a_gnss_speed_is_no_wheel_and_prefixes_are_seen_through() -> None:
    columns = {
        "CAN1.CCVS1.WheelBasedVehicleSpeed": 3.6 * SPEED * 1.05,
        "CAN2.gnss_speed.Speed": SPEED,
        **{f"CAN2.gnss_pos.{name}": values for name, values in _place().items()},
    }
    result = _propose(columns)
    assert set(result) == {"wheel_based_speed", "ground_speed", "latitude", "longitude"}
    assert result["ground_speed"].columns == ("CAN2.gnss_speed.Speed",)
    assert (result["ground_speed"].unit, result["ground_speed"].doubt) == ("m/s", "")
    assert result["wheel_based_speed"].entry["unit"] == "km/h"


def test_motors_are_left_out_where_wheels_are_and_need_a_gear_ratio_where_not() -> None:
    motors = {f"motor_{side}_rpm": 300 * SPEED for side in ("left", "right")}
    wheels = {f"wheel_speed_{side}_rads": 8 * SPEED for side in ("left", "right")}
    assert {p.columns[0] for p in _propose({**motors, **wheels}).values()} == set(wheels)
    alone = _propose(motors)
    assert set(alone) == {"wheel_speed_l", "wheel_speed_r"}
    assert all("turns per motor turn" in p.give and p.unit == "rpm" for p in alone.values())


@pytest.mark.parametrize(
    ("speed", "torque"),
    [("n_mot_{} [1/min]", "M_mot_{} [Nm]"), ("Motordrehzahl_{} [U/min]", "Motormoment_{} [Nm]"),
     ("n_Antrieb_{} [1/min]", "M_Antrieb_{} [Nm]"), ("esc_{}_rpm", "esc_{}_current"), ("nMot{} [1/min]", "iMot{} [A]")],
)  # fmt: skip
@pytest.mark.parametrize("corners", [("FL", "FR", "RL", "RR"), ("VL", "VR", "HL", "HR")])
def test_what_is_of_a_motor_asks_for_the_gear_ratio(
    tmp_path: Path, speed: str, torque: str, corners: tuple[str, ...]
) -> None:
    """A motor 30 times as fast as its wheel of .35 m; no scale is guessed, and the line says what is missing."""
    columns = {"t [s]": TIME, "v_gps [m/s]": SPEED}
    columns |= {speed.format(c): 30 * SPEED / 0.35 * 60 / (2 * np.pi) for c in corners}
    columns |= {torque.format(c): 3 + 2 * np.sin(TIME + k) for k, c in enumerate(corners)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    found = inspect(tmp_path / "log.csv")
    for wheel in ("fl", "fr", "rl", "rr"):
        for channel in (f"wheel_speed_{wheel}", f"drive_torque_{wheel}"):
            proposal = found.proposals[channel]
            assert "gear ratio" in proposal.give
            assert proposal.entry["scale"] == 1.0
        assert any(
            "0.0117 m per radian" in words for words in found.proposals[f"wheel_speed_{wheel}"].evidence
        )
    assert found.to_text().count("gear ratio") >= 8
    unknown = [line for line in found.profile.splitlines() if "scale: 1.0" in line]
    assert len(unknown) == 8
    assert all("# ? " in line for line in unknown)  # no scale of ours passes for a value that was found


@pytest.mark.parametrize("name", ["drive_torque_{}", "torque_{}", "torque_{}_pct"])
def test_a_torque_in_per_cent_asks_for_its_scale_and_its_profile_loads(tmp_path: Path, name: str) -> None:
    """``unit: '%'`` was proposed, which a profile refuses, or nothing."""
    columns, units = {"ground_speed": SPEED}, {}
    for wheel in ("l", "r"):
        columns[f"wheel_speed_{wheel}"] = SPEED / 0.5
        columns[name.format(wheel)] = 20 + 5 * np.cos(TIME / 5)
        units[name.format(wheel)] = "%"
    proposal = _propose(columns, units)["drive_torque_l"]
    assert proposal.entry == {"from": name.format("l"), "scale": 1.0, "unit": "N m"}
    assert proposal.give == "a torque in %: the scale in N m per % must be given by you"
    table = pd.DataFrame({"time": TIME, **columns}).rename(columns={n: f"{n} [%]" for n in units})
    table.to_csv(tmp_path / "log.csv", index=False)
    plain = inspect(tmp_path / "log.csv").profile
    (tmp_path / "p.yaml").write_text(plain)  # as proposed: 1 N m for each %, without a word
    assert any(
        "a scale of 1 makes 1 N m of each %" in n
        for n in read(tmp_path / "log.csv", tmp_path / "p.yaml").notes
    )
    (tmp_path / "p.yaml").write_text(plain.replace("scale: 1.0", "scale: 1.5"))
    recording = read(tmp_path / "log.csv", tmp_path / "p.yaml")
    assert not any("a scale of 1" in note for note in recording.notes)
    np.testing.assert_allclose(recording["drive_torque_r"], 1.5 * columns[name.format("r")])


@pytest.mark.parametrize(
    "source",
    [
        {"sum_of": {"current_a": 2.1, "current_b": 2.1}},
        {"from": "current_power", "over": "wheel_speed_l", "over_minimum": 0.3},
    ],
)
def test_torques_whose_factors_stand_elsewhere_are_not_asked_for_a_scale(source: dict[str, Any]) -> None:
    columns = {name: np.sin(TIME) + 2 for name in ("current_a", "current_b", "current_power")}
    table = pd.DataFrame({"time": TIME, "wheel_speed_l": 5.0 + TIME, "ground_speed": 1 + TIME / 5, **columns})
    channels = {"ground_speed": "ground_speed", "wheel_speed_l": "wheel_speed_l"}
    profile = Profile.from_dict({"channels": {**channels, "drive_torque_l": {**source, "unit": "N m"}}})
    assert not any("a scale of 1" in note for note in read(table, profile).notes)


def test_a_proposed_profile_fits_a_new_vehicle_with_a_wheel_a_side(tmp_path: Path) -> None:
    sides = {
        f"{side}_wheel_{what}": SPEED / 0.2 for side in ("left", "right") for what in ("rad_s", "torque_Nm")
    }
    pd.DataFrame({"t [s]": TIME, "v_gps [m/s]": SPEED, **sides}).to_csv(tmp_path / "log.csv", index=False)
    found = inspect(tmp_path / "log.csv").proposals
    wheels = make("skid-steer").vehicle.wheels
    assert {f"{what}_{wheel}" for wheel in wheels for what in ("wheel_speed", "drive_torque")} <= set(found)


@pytest.mark.parametrize(
    ("unit", "factor"), [("m/s", 1.0), ("km/h", 3.6), ("mm/s", 1000.0), ("mph", 1 / 0.44704)]
)
def test_positions_tell_the_unit_of_a_speed(unit: str, factor: float) -> None:
    result = _propose({"speed": factor * SPEED, **_place()})["ground_speed"]
    assert (result.unit, result.doubt) == (unit, "")
    assert any("path of lat, lon" in sentence for sentence in result.evidence)


@pytest.mark.parametrize(
    ("names", "doubt"), [(("lat_e7", "lon_e7"), ""), (("Lat", "Lng"), "whole numbers up to")]
)
def test_whole_numbers_of_1e_7_degrees_are_positions(names: tuple[str, str], doubt: str) -> None:
    place = dict(zip(names, [np.round(1e7 * part) for part in _place().values()], strict=True))
    result = _propose({"speed": SPEED, **place})
    assert result["latitude"].entry == {"from": names[0], "scale": pytest.approx(1e-7)}
    assert result["latitude"].doubt.startswith(doubt)
    assert bool(doubt) == bool(result["longitude"].doubt)
    assert result["ground_speed"].columns == ("speed",)
    assert any("path of" in sentence for sentence in result["ground_speed"].evidence)


@pytest.mark.parametrize(
    ("name", "entry"),
    [
        (
            "front axle torque [Nm]",
            'drive_torque_fl: {from: "front axle torque [Nm]", scale: 0.5}\', and so for fr',
        ),
        (
            "Drehmoment_Hinterachse",
            "drive_torque_rl: {from: Drehmoment_Hinterachse, scale: 0.5}', and so for rr",
        ),
        ("rear_motor_torque", "its part times the gear ratio"),
        ("axle2_torque", "drive_torque_2l: {from: axle2_torque"),
    ],
)
def test_the_torque_of_an_axle_is_no_wheels_and_comes_with_its_line(name: str, entry: str) -> None:
    result = _propose({"speed_mps": SPEED, name: 100 + SPEED})
    assert not any(channel.startswith("drive_torque") for channel in result)
    assert any(entry in note for note in result.left_out)


def test_an_axle_with_one_wheel_is_that_wheel() -> None:
    """A tricycle's driven front wheel was left out, and its torque said to be shared evenly by a differential."""
    rear = {"mass": 150, "wheels": ["rl", "rr"], "driven": False}
    tricycle = Vehicle.from_dict(
        {
            "mass": 250,
            "wheelbase": 1.2,
            "center_of_gravity_height": 0.4,
            "axles": {"front": {"mass": 100, "wheels": ["f"], "steered": True}, "rear": rear},
            "wheel": {"radius": 0.2, "inertia": 0.1},
        }
    )
    names = {"v_gps_mps": SPEED, "front_wheel_rpm": 48 * SPEED, "front wheel torque [Nm]": 30 + SPEED}
    result = propose(names, (), {}, dict.fromkeys(names, TIME), vehicle=tricycle)
    assert result["wheel_speed_f"].columns == ("front_wheel_rpm",)
    assert result["drive_torque_f"].columns == ("front wheel torque [Nm]",)
    assert result.left_out == ()


def test_axles_are_counted_from_the_first_number_in_the_log() -> None:
    """axle0 and axle1: the second's torque was given to the front wheels, and the first left out without a word."""
    result = _propose({"speed_mps": SPEED, "axle0_torque": 90 + SPEED, "axle1_torque": 100 + SPEED})
    shown = [note for note in result.left_out if "torque of an axle" in note]
    assert ["drive_torque_1l: {from: axle0" in shown[0], "drive_torque_2l: {from: axle1" in shown[1]] == [
        True,
        True,
    ]


def test_a_name_that_ends_in_e7_by_chance_is_in_degrees() -> None:
    names = {
        f"{name}_node7": values
        for name, values in zip(("latitude", "longitude"), _place().values(), strict=True)
    }
    assert {"latitude", "longitude"} <= set(_propose({"speed": SPEED, **names}))


def test_degrees_and_minutes_are_no_degrees() -> None:
    place = {name: 100 * np.floor(v) + 60 * (v % 1) for name, v in _place().items()}
    result = _propose({"speed": SPEED, **place})
    assert "latitude" not in result
    assert any("lat in deg" in note and "degrees and minutes" in note for note in result.left_out)


@pytest.mark.parametrize("factor", [1.0, 1000.0])
def test_a_speed_without_unit_or_check_has_a_question_mark(factor: float) -> None:
    result = _propose({"speed": factor * SPEED}).get("ground_speed")
    assert result is None or "no unit" in result.doubt  # 3000 m/s is none


def test_a_speed_that_positions_contradict_is_not_proposed() -> None:
    result = _propose({"speed": 17 * SPEED, **_place()}, {"speed": "m/s"})
    assert result.get("ground_speed") is None or result["ground_speed"].columns != ("speed",)


def test_a_stated_unit_that_positions_contradict_is_in_doubt() -> None:
    result = _propose({"gps_speed": 3.6 * SPEED, **_place()}, {"gps_speed": "m/s"})["ground_speed"]
    assert "km/h" in result.doubt


@pytest.mark.parametrize(("unit", "gravity"), [("g", 1.0), ("m/s^2", 9.80665), ("mg", 1000.0)])
def test_gravity_tells_the_unit_of_accelerations(unit: str, gravity: float) -> None:
    noise = np.random.default_rng(1).normal(0, 0.02, (2, len(TIME))) * gravity
    result = _propose(
        {"acc_x": noise[0], "acc_y": noise[1], "acc_z": gravity + 0 * TIME + 0.01 * gravity * np.sin(TIME)}
    )
    assert {(p.unit, p.doubt) for p in result.values()} == {(unit, "")}


@pytest.mark.parametrize(("unit", "factor"), [("rad/s", 1.0), ("deg/s", 57.29578)])
def test_a_heading_tells_the_unit_of_a_gyro(unit: str, factor: float) -> None:
    rate = np.gradient(HEADING, TIME)
    result = _propose({"heading": np.degrees(HEADING) % 360, "gyro_z": factor * rate})["angular_velocity_z"]
    assert (result.unit, result.doubt) == (unit, "")


def test_a_wheel_speed_whose_radius_is_no_wheels_is_in_doubt() -> None:
    columns = {
        "gps_speed_mps": SPEED,
        "wheel_speed_fl_rads": SPEED / 0.002,
        "wheel_speed_fr_rads": SPEED / 0.3,
    }
    result = _propose(columns)
    assert "radius of 0.002 m" in result["wheel_speed_fl"].doubt
    assert result["wheel_speed_fr"].doubt.startswith("wheel_speed_fl_rads: ")  # of one unit with it


def test_noise_at_rest_gives_no_radius() -> None:
    noise = np.random.default_rng(1).standard_normal((2, 300))
    columns = {"wheel speed fl [rpm]": 0.3 * noise[0], "ground speed [km/h]": 0.07 * noise[1]}
    assert not any("radius" in word for word in _propose(columns)["wheel_speed_fl"].evidence)


def test_a_gyroscope_comes_before_the_rate_of_turn_of_odometry() -> None:
    """The receiver's filtered rate was chosen, surely, where both were in the log and its topic came first."""
    rate, gyro = "/gps/odom.twist.twist.angular.z", "/imu/data.angular_velocity.z"
    columns = {rate: 1.05 * np.sin(TIME / 4), gyro: np.sin(TIME / 4)}
    assert _propose(columns)["angular_velocity_z"].columns == (gyro,)
    assert _propose({rate: columns[rate]})["angular_velocity_z"].columns == (rate,)


def test_a_rate_of_turn_that_follows_from_the_wheels_is_asked_for() -> None:
    """It was a gyroscope's, surely, and the hubs then turn as the rims do: no slip in turns."""
    left, right = SPEED - 0.3 * np.sin(TIME / 4), SPEED + 0.3 * np.sin(TIME / 4)
    columns = {"wheel speed l [m/s]": left, "wheel speed r [m/s]": right}
    rate = "/odom.twist.twist.angular.z"
    made = _propose({**columns, rate: (right - left) / 0.6})["angular_velocity_z"]
    assert "follows from the wheel speeds" in made.doubt
    slips = _propose({**columns, rate: (right - left) / 0.6 * (1 + 0.1 * np.sin(TIME))})["angular_velocity_z"]
    assert not slips.doubt


@pytest.mark.parametrize("name", ["/imu/data.angular_velocity.z", "angular_velocity_z", "yaw rate [rad/s]"])
def test_a_gyroscope_on_firm_ground_is_not_asked_for(name: str) -> None:
    """The rims' difference is its rate of turn there, to its noise: 'no gyroscope?' was asked of each."""
    turn = np.sin(TIME / 4)
    columns = {"wheel speed l [m/s]": SPEED - 0.3 * turn, "wheel speed r [m/s]": SPEED + 0.3 * turn}
    read = turn + 0.003 * np.random.default_rng(0).standard_normal(len(TIME))
    assert not _propose({**columns, name: read})["angular_velocity_z"].doubt


def test_odometry_is_no_ground_speed() -> None:
    result = _propose({"odom_vx": SPEED, "gps_speed_mps": SPEED})
    assert result["ground_speed"].columns == ("gps_speed_mps",)
    assert result["wheel_based_speed"].columns == ("odom_vx",)
    assert "ground_speed" not in _propose({"odom_vx": SPEED})


def test_units_and_several_header_rows_reach_the_profile(tmp_path: Path) -> None:
    path, profile = tmp_path / "log.csv", tmp_path / "profile.yaml"
    rows = "".join(
        f"{1000 * t:.0f};{n:.3f};{n:.3f};{3.6 * v:.4f}\n"
        for t, n, v in zip(TIME, 95 * SPEED, SPEED, strict=True)
    )
    path.write_text(
        f"Time;Wheel speed left;Wheel speed right;GPS speed\nms;1/min;1/min;km/h\nt;nl;nr;v\n{rows}"
    )
    inspection = inspect(path)
    profile.write_text(inspection.profile)
    assert "?" not in inspection.profile.split("\n", 1)[1].replace("???", "")
    recording = read(path, profile)
    np.testing.assert_allclose(recording["ground_speed"], SPEED, atol=1e-4)
    np.testing.assert_allclose(recording["wheel_speed_l"], 95 * SPEED * 2 * np.pi / 60, rtol=1e-4)
    np.testing.assert_allclose(recording.time, TIME, atol=1e-9)


@pytest.mark.parametrize("mark", ["#", "# ", "// ", "% "])
def test_a_header_behind_a_comment_mark_is_one(tmp_path: Path, mark: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"# logger 3\n{mark}vx_mps,wheel_fl(rad/s)\n1.0,2.0\n1.5,3.0\n2.0,4.0\n")
    names = [column.name for column in inspect(path).columns]
    assert names == ["vx_mps", "wheel_fl"]


def test_a_comment_of_another_width_is_no_header(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("# made by hand, twice, today\n1.0,2.0\n1.5,3.0\n")
    with pytest.raises(InputError, match="not column names"):
        inspect(path)


def test_a_vbo_file_is_read_in_seconds_and_degrees(tmp_path: Path) -> None:
    path = tmp_path / "log.vbo"
    path.write_bytes(
        "File created on 01/03/2016 @ 14:26\r\n\r\n[header]\r\nsatellites\r\n\r\n[channel units]\r\n\r\n°/s\r\nkm/h\r\n\r\n"
        "[column names]\r\nsats time lat long velocity YawRate WheelSpFL\r\n\r\n[data]\r\n"
        "014 235959.50 +3141.60 +0099.60 036.0 +1.0E+00 35.0\r\n014 000000.50 +3141.66 +0099.60 036.0 -1.0E+00 36.0\r\n".encode("latin-1")
    )  # fmt: skip
    inspection = inspect(path)
    by_name = {column.name: column for column in inspection.columns}
    assert inspection.time is not None
    assert inspection.time.duration == pytest.approx(1.0)
    assert (by_name["lat"].minimum, by_name["long"].minimum) == pytest.approx((52.36, -1.66))
    assert [by_name[n].unit for n in ("velocity", "YawRate", "WheelSpFL")] == ["km/h", "deg/s", "km/h"]


@pytest.mark.parametrize(
    ("name", "concepts", "wheel", "unit"),
    [
        ("TwheelRL_Nm", {"torque", "wheel"}, "rl", "N m"),
        ("AvgWhl_V", {"speed", "wheel"}, "", None),
        ("EngnRqstdTrqLmt", {"other", "command", "torque"}, "", None),
        ("heightAboveWgs84EllipsoidM", {"altitude"}, "", "m"),
        ("ay_mps2", {"acceleration"}, "", "m/s^2"),
        ("Wheel speed RR [1/min]", {"speed", "wheel"}, "rr", "1/min"),
        ("lngDeg", {"longitude"}, "", "deg"),
    ],
)
def test_names_are_read(name: str, concepts: set[str], wheel: str, unit: str | None) -> None:
    read_name = GENERAL.read(name)
    assert (set(read_name.concepts), read_name.wheel, read_name.unit) == (concepts, wheel, unit)


WORDS = ("wheel", "speed", "fl", "gps", "vx", "lat", "lon", "1", "0", "acc", "x", "z", "gyro", "torque")
UNITS = ("motor", "time", "ms", "kmh", "pitch", "[m/s]", "(g)")


def _log(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = zip(TIME, *columns.values(), strict=True)
    lines = [",".join(["time_s", *columns]), *(",".join(f"{cell:.6f}" for cell in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_bus_speed_that_goes_with_positions_may_still_be_the_wheels() -> None:
    result = _propose({"VehicleSpeed_kmh": 3.6 * SPEED, **_place()})["ground_speed"]
    assert "wheels" in result.doubt


def test_a_receiver_that_stands_contradicts_no_speed() -> None:
    noise = np.cumsum(np.random.default_rng(3).normal(0, 2e-8, (2, len(TIME))), axis=1)
    columns = {"gps_speed_mps": 0.02 + 0.01 * np.sin(TIME), "lat": 45 + noise[0], "lon": 11 + noise[1]}
    result = _propose(columns)["ground_speed"]
    assert (result.columns, result.doubt) == (("gps_speed_mps",), "")


def test_wheels_that_never_turn_are_named_in_the_refusal(tmp_path: Path) -> None:
    inspection = inspect(
        _log(tmp_path / "idle.csv", {"WheelBasedVehicleSpeed": 0 * TIME, "EngineSpeed": 90 + SPEED})
    )
    assert "WheelBasedVehicleSpeed" in inspection.refused
    assert "0 throughout" in inspection.refused


def test_several_logs_and_a_folder_in_one_call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wheels = {"gps_speed_mps": SPEED, "wheel_left_rpm": 30 * SPEED, "wheel_right_rpm": 30 * SPEED}
    folder = tmp_path / "day"
    folder.mkdir()
    for name in ("a.csv", "b.csv"):
        _log(folder / name, wheels)
    (folder / "notes.md").write_text("# not a log\n")
    alone = _log(tmp_path / "imu.csv", {"gyro_z": SPEED})
    assert main(["inspect", str(folder), str(alone)]) == 0
    output = capsys.readouterr().out
    assert all(name in output for name in ("a.csv", "b.csv", "imu.csv"))
    assert output.count("# Proposed by") == 1  # a and b have the same columns, imu has no wheels
    assert "imu.csv has no wheel speed" in output
    (folder / "c.csv").write_bytes(b"\x00\x01")
    profile = tmp_path / "p.yaml"
    assert main(["inspect", str(folder), "--write-profile", str(profile)]) == 2
    streams = capsys.readouterr()
    assert "a.csv" in streams.out
    assert streams.err.count("\n") == 1
    assert "c.csv: is not a table of text" in streams.err
    (folder / "c.csv").unlink()
    assert main(["inspect", str(folder), "--write-profile", str(profile)]) == 0
    recording = read(folder / "b.csv", profile)
    np.testing.assert_allclose(recording["wheel_speed_r"], 30 * SPEED * 2 * np.pi / 60, atol=1e-5)


def test_a_folder_without_logs_and_logs_of_two_kinds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "day"
    folder.mkdir()
    assert main(["inspect", str(folder)]) == 2
    assert "holds no log" in capsys.readouterr().err
    _log(folder / "a.csv", {"gps_speed_mps": SPEED, "wheel_left_rpm": SPEED})
    _log(folder / "b.csv", {"gps_speed_kmh": SPEED, "wheel_left_rpm": SPEED})
    assert main(["inspect", str(folder), "--write-profile", str(tmp_path / "p.yaml")]) == 2
    assert "2 layouts" in capsys.readouterr().err


def test_a_log_without_wheels_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _log(tmp_path / "imu.csv", {"gyro_z": SPEED, "gps_speed_mps": SPEED})
    assert main(["inspect", str(path)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "no wheel speed" in line
    assert "ground_speed" in line
    profile = tmp_path / "p.yaml"  # for a log to be joined to another
    assert main(["inspect", str(path), "--write-profile", str(profile)]) == 0
    assert "gps_speed_mps" in profile.read_text()


def test_the_efforts_of_a_joint_state_are_torques_and_a_profile_that_fits_says_what_is_missing(
    tmp_path: Path,
) -> None:
    columns = {}
    for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
        columns[f"/joint_states.velocity.{wheel}_wheel"] = 10 * SPEED
        columns[f"/joint_states.effort.{wheel}_wheel"] = 5 + 0 * SPEED + np.sin(TIME)
    inspection = inspect(_log(tmp_path / "robot.csv", columns))
    assert {"drive_torque_fl", "wheel_speed_rr"} <= inspection.recognised.keys()
    assert not any("drive torque" in sentence for sentence in inspection.missing)
    (text,) = (sentence for sentence in inspection.nearly if "ros2-4wd" in sentence)
    assert "wheel_speed_fl <- /joint_states.velocity.front_left_wheel" in text
    assert "no ground_speed" in text
    assert "twist.twist.linear.x" in text


def test_an_effort_that_states_no_unit_may_be_a_current() -> None:
    """In a log without a drawbar force nothing contradicts a driver's amperes: they were newton metres, without a question mark."""
    columns = {"/joint_states.velocity.front_left_wheel": 10 * SPEED, "/gps.speed [m/s]": SPEED}
    effort = 5 + np.sin(TIME)
    bare = _propose(columns | {"/joint_states.effort.front_left_wheel": effort})["drive_torque_fl"]
    assert bare.doubt == "no unit is stated: N m, or a current, as many drivers give it?"
    stated = _propose(columns | {"/joint_states.effort.front_left_wheel [N m]": effort})["drive_torque_fl"]
    assert not stated.doubt


@pytest.mark.parametrize("size", [0.94, 1.0, 1.06])
def test_two_speeds_over_ground_of_other_sizes_are_a_question(size: float) -> None:
    """A radar 6 % off beside a receiver was proposed as surely as any, and slip was .06 off with a fifth of that as its interval."""
    draws = np.random.default_rng(5)
    noise = 0.02 * draws.standard_normal((2, len(TIME)))
    columns = {"Radar Speed [m/s]": size * SPEED + noise[0], "GNSS Speed [km/h]": 3.6 * (SPEED + noise[1])}
    speed = _propose(columns)["ground_speed"]
    assert ("which of them has the right scale" in speed.doubt) is (size != 1.0)
    columns["Ground Speed From Wheels [m/s]"] = columns.pop("Radar Speed [m/s]")  # of which it is slip
    assert "right scale" not in _propose(columns)["ground_speed"].doubt


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("drawbar_force_daN", "daN"),
        ("Zugkraft daN", "daN"),
        ("draft_kgf", "kgf"),
        ("Draft_hN", "hN"),
        ("F_Zug/daN", "daN"),
    ],
)
def test_a_unit_at_a_names_end_is_read_whole(name: str, unit: str) -> None:
    """force_daN was in N, surely, a tenth: its capital began a word."""
    proposal = _propose({name: 2000 + SPEED})["drawbar_force"]
    assert (proposal.unit, proposal.is_doubtful) == (unit, False)
    assert GENERAL.read("Drawbar_ForcekN").unit == "kN"
    for name in ("hookN", "DrawbarPeakN", "pull_linkN"):
        assert GENERAL.read(name).unit == "N"  # no hoo, Pea, lin in kN


@pytest.mark.parametrize("unit", ["mNm", "cNm", "hNm", "daN m", "daN*m", "kpm", "kgfcm", "ozin"])
def test_a_torque_of_another_unit_is_not_in_newton_metres(unit: str) -> None:
    """wheel_torque_rl_mNm was in N m, surely, and so were the others under Terragrip's own names."""
    assert _propose({f"wheel_torque_rl_{unit}": 2 + SPEED})["drive_torque_rl"].unit == unit
    (own,) = _propose({f"drive_torque_rl_{unit}": 2 + SPEED}).values()
    assert own.unit == unit


def test_a_wheel_has_no_unit_in_brackets_for_its_name() -> None:
    """'drive_torque_rl [furlong N]' was the torque of a wheel 'rl [furlong N]' in N m, surely."""
    assert all(p.is_doubtful for p in _propose({"drive_torque_rl [furlong N]": 2 + SPEED}).values())


def test_a_pitch_in_mrad_is_not_in_degrees() -> None:
    """pitch_mrad was in degrees by its size, surely: 17 times as steep."""
    assert _propose({"pitch_mrad": 30 * SPEED})["pitch"].unit == "mrad"


@pytest.mark.parametrize(("name", "unit"), [("motor_current_{}_mA", None), ("motor_current_{}", "mA")])
def test_the_constant_of_a_current_is_asked_for_in_its_unit(name: str, unit: str | None) -> None:
    """'in A; the scale in N m per A' was said of mA, of which torques were 1000 times as large."""
    columns = {name.format(side): 2000 + SPEED for side in ("rl", "rr")}
    stated = dict.fromkeys(columns, unit) if unit else {}
    proposal = _propose(columns, stated)["drive_torque_rl"]
    assert "the scale in N m per mA times the gear ratio must be given by you" in proposal.give


@pytest.mark.parametrize(
    ("name", "channel"), [("Zugkraft {} [kN]", "drawbar_force"), ("hitch vertical {} [kN]", "hitch_load")]
)
def test_the_two_pins_of_a_hitch_are_added(name: str, channel: str) -> None:
    """The left one was the whole, surely."""
    columns = {name.format(side): 2 + SPEED for side in ("links", "rechts")}
    proposal = _propose(columns)[channel]
    assert proposal.entry == {"sum_of": list(columns), "unit": "kN"}
    assert not proposal.doubt


def test_a_profile_of_four_wheels_does_not_fit_a_rover_of_six(tmp_path: Path) -> None:
    """'A profile fits: --profile ros2-4wd' led to a refusal for want of wheel_speed_ml; the joints named drive were no wheels."""
    columns = {"/vio/odometry.twist.twist.linear.x": SPEED}
    for wheel in ("left_front", "right_front", "left_middle", "right_middle", "left_rear", "right_rear"):
        columns[f"/joint_states.velocity.drive_{wheel}_joint"] = 5 * SPEED
    inspection = inspect(_log(tmp_path / "rover.csv", columns))
    assert {"wheel_speed_fl", "wheel_speed_ml", "wheel_speed_rr"} <= inspection.recognised.keys()
    assert inspection.fitting == ()


def test_of_a_wrench_the_force_along_the_vehicle_is_the_drawbars_and_is_in_newtons() -> None:
    """The first of the six was, surely: the vertical one of a cell that lists it first."""
    name = "/drawbar/wrench.wrench.{}.{}"
    columns = {name.format(what, axis): SPEED + TIME for what in ("torque", "force") for axis in "zyx"}
    (proposal,) = _propose(columns).values()
    assert proposal.entry == {"from": name.format("force", "x")}
    assert (proposal.unit, proposal.is_doubtful, proposal.alternatives) == ("N", False, ())


@pytest.mark.parametrize(
    ("name", "channel"),
    [  # in the manner of other people's loggers, some from public code, some made up; the rules were repaired by them
        ("WhlSpdFrntLft", "wheel_speed_fl"),
        ("WheelSpFL_rpm", "wheel_speed_fl"),
        ("Drehzahl Rad vorne links", "wheel_speed_fl"),
        ("nRadHR", "wheel_speed_rr"),
        ("left_rpm", "wheel_speed_l"),
        ("HRW.FrontAxleLeftWheelSpeed", "wheel_speed_fl"),
        ("TheoreticalSpeed_kmh", "wheel_based_speed"),
        ("RadarSpeed_kmh", "ground_speed"),
        ("DraftForce_kN", "drawbar_force"),
        ("log.Fdraw", "drawbar_force"),
        ("F_hitch", "drawbar_force"),
        ("F_draw_N", "drawbar_force"),
        ("hitch_position", None),
        ("current_draw", None),
        ("/odometry/gps.twist.twist.linear.x", "ground_speed"),
        ("/lidar_odometry.twist.twist.linear.x", "ground_speed"),
        ("/wheel_odometry.twist.twist.linear.x", "wheel_based_speed"),
        ("/odometry/filtered_gps.twist.twist.linear.x", None),
        ("a_z", "acceleration_z"),
        ("EBC2.RlvSpeedFrontAxleLeftWheel", None),  # relative
        ("steering_wheel_speed", None),
        ("wheel_2_steering_velocity", None),
        ("tyre_pressure_fl", None),
        ("slip_ratio_fl", None),
        ("VelD", None),
        ("VelE", None),
        ("erpm_3", None),
        ("Accel_magnitude", None),
        ("PTO_Speed_rpm", None),
        ("FuelRate_Lph", None),
        ("/joint_states.velocity.drive_left_middle_joint", "wheel_speed_ml"),
        ("/joint_states.velocity.rocker_left_joint", None),
        ("/joint_states.effort.bogie_right_joint", None),
        ("M_Antrieb_VL [Nm]", "drive_torque_fl"),
        ("M_Brems_VL [Nm]", None),
        ("Längsbeschleunigung [m/s²]", "acceleration_x"),
        ("Querneigung [°]", "roll"),
        ("Steigung [‰]", "pitch"),
        ("RoadSlope [%]", "pitch"),
        ("side_slope [deg]", None),
        ("GrossMass [kg]", "mass"),
        ("Bunkergewicht [t]", None),
        ("Maschinengewicht [kg]", "mass"),
        ("Hakenkraft [kN]", "drawbar_force"),
        ("GPS_Height [m]", "altitude"),
        ("boom_height_m", None),
        ("Hubwerkshöhe [cm]", None),
    ],
)
def test_names_of_others(name: str, channel: str | None) -> None:
    assert set(_propose({name: SPEED})) == ({channel} if channel else set())


@pytest.mark.parametrize(
    ("name", "channel", "unit", "si"),
    [
        ("radar_mph", "ground_speed", "m/s", 0.44704),  # was metres an hour, without a doubt
        ("GPS_SPEED_MPH", "ground_speed", "m/s", 0.44704),
        ("pull_lbf", "drawbar_force", "N", 4.4482216152605),
        ("DRAWBAR_KLBF", "drawbar_force", "N", 4448.2216152605),
        ("LR_torque_ftlb", "drive_torque_rl", "N m", 1.3558179483314),
        ("torque_lr_lb_ft", "drive_torque_rl", "N m", 1.3558179483314),
        ("TorqueLrFtLb", "drive_torque_rl", "N m", 1.3558179483314),
        ("torque_lr_N_m", "drive_torque_rl", "N m", 1.0),
        ("Accel_X (G)", "acceleration_x", "m/s^2", 9.80665),
        ("Torque_LR [FT-LB]", "drive_torque_rl", "N m", 1.3558179483314),
    ],
)
def test_units_of_american_loggers(name: str, channel: str, unit: str, si: float) -> None:
    proposal = _propose({name: SPEED})[channel]
    assert not proposal.is_doubtful
    assert factor_to(str(proposal.entry.get("unit", unit)), unit) == pytest.approx(si)


@pytest.mark.parametrize("name", ["enc_count_{}", "ticks_{}", "{}_encoder", "wheel_{}_pulses"])
def test_counts_of_encoders_are_proposed_with_the_scale_that_is_missing(tmp_path: Path, name: str) -> None:
    """'has no wheel speed: log the wheels too' was all that a robot with encoders got."""
    counts = np.floor(1024 / (2 * np.pi) * WAY / 0.7)
    columns = {"time": TIME, "ground_speed": SPEED}
    columns |= {name.format(side): counts for side in ("left", "right")}
    columns |= {"error_count_left": np.floor(TIME), "encoder_temp_left": np.round(20 + TIME)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    inspection = inspect(tmp_path / "log.csv", vehicle=_tractor(tmp_path))
    assert set(inspection.recognised) == {"ground_speed", "wheel_speed_rl", "wheel_speed_rr"}
    proposal = inspection.proposals["wheel_speed_rl"]
    assert proposal.columns == (name.format("left"),)
    assert "2 pi over the counts in a turn of the wheel (some 102" in proposal.give
    (tmp_path / "p.yaml").write_text(inspection.profile.replace("scale: 1.0", f"scale: {2 * np.pi / 1024}"))
    speed = read(tmp_path / "log.csv", tmp_path / "p.yaml")["wheel_speed_rl"]
    assert np.nanmedian(np.abs(speed * 0.7 / SPEED - 1)) < 0.01


def test_counts_in_each_row_are_not_taken_for_counts_that_go_on() -> None:
    counts = np.floor(1024 / (2 * np.pi) * WAY / 0.2)
    for beside in ({"ground_speed": SPEED}, {}):
        steps = {f"ticks_{side}": np.diff(counts, prepend=0.0) for side in ("left", "right")}
        assert set(_propose({**steps, **beside})) == set(beside)


def test_angles_of_joints_become_wheel_speeds_where_a_driver_gives_no_velocity() -> None:
    joints = {f"/joint_states.position.{side}_wheel_joint": WAY / 0.2 for side in ("left", "right")}
    steered = {"/joint_states.position.front_left_steering_joint": WAY / 0.2}
    result = _propose({**joints, **steered, "ground_speed": SPEED})
    assert set(result) == {"wheel_speed_l", "wheel_speed_r", "ground_speed"}
    name = "/joint_states.position.left_wheel_joint"
    assert result["wheel_speed_l"].entry == {"derivative_of": name, "unit": "rad"}
    assert not result["wheel_speed_l"].is_doubtful
    velocities = {name.replace("position", "velocity"): SPEED / 0.2 for name in joints}
    assert _propose({**joints, **velocities})["wheel_speed_l"].entry == {
        "from": "/joint_states.velocity.left_wheel_joint"
    }


def _tractor(folder: Path) -> Vehicle:
    (folder / "tractor.yaml").write_text(
        "mass: 5 t\nwheelbase: 2.5 m\ncenter_of_gravity_height: 0.9 m\naxles:\n"
        "  front: {mass: 2 t, wheels: [fl, fr], wheel: {radius: 0.4 m, inertia: 20 kg m^2}, driven: false}\n"
        "  rear: {mass: 3 t, wheels: [rl, rr], wheel: {radius: 0.7 m, inertia: 90 kg m^2}}\n"
    )
    return Vehicle.load(folder / "tractor.yaml")


def test_left_and_right_of_a_vehicle_with_one_driven_axle_are_its_wheels(tmp_path: Path) -> None:
    """'but the vehicle's wheels are fl, fr, rl, rr', of a tractor's torque hubs."""
    columns = {"t": TIME, "ground_speed": SPEED}
    for side in ("left", "right"):
        columns |= {f"{side}_rpm": SPEED / 0.7 * 30 / np.pi, f"{side}_torque_kNm": 5 + np.sin(TIME)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    result = inspect(tmp_path / "log.csv", vehicle=_tractor(tmp_path)).proposals
    wheels = ("wheel_speed_rl", "wheel_speed_rr", "drive_torque_rl", "drive_torque_rr", "ground_speed")
    assert {n: p.is_doubtful for n, p in result.items()} == dict.fromkeys(wheels, False)


def test_a_wheel_has_one_name_in_a_proposal(tmp_path: Path) -> None:
    """wheel_speed_left and drive_torque_l: two wheels, of which neither could be estimated; and no profile was shown."""
    columns = {"time": TIME, "ground_speed": SPEED}
    for side in ("left", "right"):
        columns |= {f"wheel_speed_{side}": SPEED / 0.7, f"torque_{side}": 5 + np.sin(TIME)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    inspection = inspect(tmp_path / "log.csv")
    assert {"wheel_speed_left", "drive_torque_left"} <= inspection.recognised.keys()
    assert "drive_torque_left: {from: torque_left}" in inspection.to_text()


def test_a_torque_by_our_name_in_a_struct_is_at_the_wheel() -> None:
    """'at the wheel (scale 1), or motor side, which needs the gear ratio', of what savemat wrote of our own table."""
    proposal = _propose({"log.drive_torque_fl": SPEED})["drive_torque_fl"]
    assert (proposal.entry, proposal.is_doubtful) == ({"from": "log.drive_torque_fl"}, False)


@pytest.mark.parametrize("element", ["{}0 {}1", "{}_0 {}_1", "{}[0] {}[1]"])
def test_joints_of_a_message_in_a_table_are_named_by_its_own_columns(tmp_path: Path, element: str) -> None:
    names, speeds, torques = ([n.format(w) for n in element.split()] for w in ("name", "velocity", "effort"))
    columns = {"time": TIME, "gps_speed_mps": SPEED}
    for k, side in enumerate(("left", "right")):
        columns |= {names[k]: f"wheel_{side}_joint", speeds[k]: SPEED / 0.2, torques[k]: 5 + np.sin(TIME + k)}
    table = pd.DataFrame(columns)
    table.to_csv(tmp_path / "log.csv", index=False)
    recognised = inspect(tmp_path / "log.csv").recognised
    assert recognised["wheel_speed_l"] == (speeds[0],)
    assert recognised["drive_torque_r"] == (torques[1],)
    # In another order from row to row the same columns are of any joint: effort_1 was proposed for a wheel 1.
    table.loc[::3, names] = table.loc[::3, names[::-1]].to_numpy()
    table.to_csv(tmp_path / "mixed.csv", index=False)
    inspection = inspect(tmp_path / "mixed.csv")
    assert set(inspection.recognised) == {"ground_speed"}
    assert any("other joints from row to row. Make a column of each joint" in w for w in inspection.warnings)


def test_torques_counted_from_0_are_of_no_known_wheel() -> None:
    """effort_1 was the torque of a wheel 1, the second one's, and effort_0 nobody's."""
    assert _propose({f"effort_{k}": 5 + np.sin(TIME + k) for k in range(4)}) == {}


def test_lists_in_cells_are_named(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": TIME, "gps_speed_mps": SPEED, "velocity": [[v, v] for v in SPEED / 0.2]})
    table.to_csv(tmp_path / "log.csv", index=False)
    warnings = inspect(tmp_path / "log.csv").warnings
    assert "column velocity has a list in each row: make a column of each of its elements." in warnings


names = st.one_of(
    st.text(max_size=12), st.builds("_".join, st.lists(st.sampled_from((*WORDS, *UNITS)), max_size=4))
)
values = st.one_of(st.floats(width=32), st.just(np.nan), st.just(0.0), st.floats(-10, 10))


@given(
    st.dictionaries(names, st.integers(0, 2**31), max_size=6),
    st.lists(values, max_size=12),
    st.booleans(),
    st.sampled_from([None, "m/s", "g", "ms^2", "?", ""]),
)
def test_any_table_gives_proposals(
    seeds: dict[str, int], cells: list[float], timed: bool, unit: str | None
) -> None:
    rows = np.array(cells, dtype=np.float64)
    columns = {name: np.random.default_rng(seed).permutation(rows) for name, seed in seeds.items()}
    clocks = dict.fromkeys(columns, np.arange(len(rows)) / 10) if timed else {}
    result = propose(columns, (), {} if unit is None else dict.fromkeys(columns, unit), clocks)
    used = [column for proposal in result.values() for column in proposal.columns]
    assert set(used) <= set(columns)
    assert all(0 <= proposal.confidence <= 1 for proposal in result.values())


@pytest.mark.long  # each kind of header: above
def test_measured_headers_leaving_one_logger_out(shared: Callable[[str], Path]) -> None:
    shared("data/headers/truth.json")
    path = Path(__file__).parents[2] / "benchmarks" / "bench_inspect.py"
    sys.path.insert(0, str(path.parent))
    try:
        spec = importlib.util.spec_from_file_location("bench_inspect", path)
        assert spec is not None
        assert spec.loader is not None
        bench = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = bench
        spec.loader.exec_module(bench)
    finally:
        sys.path.remove(str(path.parent))
    total = bench.judged(headers_only=True)
    right = total["right"] + total["right, with a ?"]
    assert right >= 0.85 * (right + total["left open"] + total["wrong, with a ?"] + total["wrong and sure"])
    assert total["wrong and sure"] <= 2


@pytest.mark.parametrize(
    ("column", "channel"),
    [
        ("Machine weight [t]", "mass"),
        ("vehicle_mass_kg", "mass"),
        ("Fahrzeugmasse", "mass"),
        ("Hitch vertical force [kN]", "hitch_load"),
        ("Hitch draft [kN]", "drawbar_force"),
        ("Tank weight [kg]", None),
        ("Air mass flow", None),
        ("Weight front axle", None),
        ("Payload mass", None),
        ("pull [kg]", "drawbar_force"),
        ("Wheel torque FL [lb ft]", "drive_torque_fl"),
        ("spindle [deg/s]", "angular_velocity_z"),
        ("spindle [rpm]", None),  # shafts are counted so, a vehicle's turning is not
    ],
)
def test_masses_hitch_forces_torques_and_turns_by_their_names_and_units(column, channel):
    from terragrip.formats.candidates import candidates_of, columns_of
    from terragrip.formats.vocabulary import GENERAL

    found = candidates_of(columns_of([column], {}, {}, GENERAL)[column])
    assert [one.channel for one in found] == ([] if channel is None else [channel])


@pytest.mark.parametrize(
    ("speed", "torque", "wheels"),
    [
        ("Drehzahl {} [1/min]", "Radmoment {} [Nm]", dict(zip(*2 * [("1l", "1r", "2l", "2r", "3l", "3r")], strict=True))),
        ("axle{}_wheel_rpm", "axle{}_torque_Nm", {"1_left": "1l", "1_right": "1r", "2_left": "2l", "2_right": "2r"}),
        ("{} speed (rad/s)", "{} torque (Nm)", {"LF wheel": "fl", "RF wheel": "fr", "LM wheel": "ml", "RM wheel": "mr",
                                                "LR wheel": "rl", "RR wheel": "rr"}),
        ("wheel_{}_rpm", "wheel_{}_torque_Nm", {"front_left": "fl", "front_right": "fr", "middle_left": "ml",
                                                "middle_right": "mr", "rear_left": "rl", "rear_right": "rr"}),
        ("wheel_{}_rpm", "wheel_{}_torque_Nm", {"left_1": "1l", "left_2": "2l", "right_1": "1r", "right_2": "2r"}),
        ("ESC1 {} rpm", "ESC1 {} torque Nm", {"left": "l", "right": "r"}),  # one controller's number counts no axles
    ],
)  # fmt: skip
def test_the_wheels_of_all_axles_are_proposed(speed: str, torque: str, wheels: dict[str, str]) -> None:
    """Of six wheels two were proposed, `l` and `r`."""
    columns = {"ground_speed": SPEED}
    for k, wheel in enumerate(wheels):
        columns[speed.format(wheel)] = (
            SPEED / 0.35 * 60 / (2 * np.pi) * (1 if "rad/s" not in speed else 0.1047)
        )
        columns[torque.format(wheel)] = 30 + 2 * np.sin(TIME + k)
    proposals = _propose(columns)
    for column, wheel in wheels.items():
        assert proposals[f"wheel_speed_{wheel}"].entry["from"] == speed.format(column)
        assert proposals[f"drive_torque_{wheel}"].entry["from"] == torque.format(column)


def test_motors_in_a_list_that_no_name_tells_apart_are_named() -> None:
    """A message of one's own, MotorStatus[] motors: which is which only its writer knows."""
    columns = [f"/motors/status.motors[{k}].{field}" for k in range(4) for field in ("rpm", "temp_fet", "id")]
    said = missing_channels((), has_time=True, columns=columns)
    (sentence,) = (s for s in said if "is not known" in s)
    assert "/motors/status.motors[].rpm is not known" in sentence
    assert 'wheel_speed_fl: {from: "/motors/status.motors[0].rpm"}' in sentence


def test_channels_of_two_robots_in_one_bag_are_not_mixed() -> None:
    """The wheels of one were proposed with the ground speed of the other, without a doubt."""
    columns = {
        f"/{robot}/joint_states.velocity.front_{side}": 5 * SPEED
        for robot in ("alpha", "beta")
        for side in ("left", "right")
    }
    columns["/beta/gps/vel.twist.linear.x"] = 0.9 * SPEED
    proposals = _propose(columns)
    assert {proposal.columns[0][:6] for proposal in proposals.values()} == {"/alpha"}
    assert any(
        "several machines, /alpha, /beta, of which /alpha is read" in sentence
        for sentence in proposals.left_out
    )
    columns["/alpha/gps/vel.twist.linear.x"] = SPEED
    assert _propose(columns)["ground_speed"].columns[0].startswith("/alpha")


@pytest.mark.parametrize(
    "robots", [("/r1", "/r2"), ("/left", "/right"), ("/front", "/rear"), ("/target_1", "/a")]
)
def test_names_are_read_inside_a_robots_namespace(robots: tuple[str, str]) -> None:
    """Of /r1 the ground speed was lost, of /left the right wheels, of /front the rear ones, of /target_1 all."""
    columns = {}
    for robot in robots:
        for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
            columns[f"{robot}/joint_states.velocity.{wheel}_wheel"] = 5 * SPEED
            columns[f"{robot}/joint_states.effort.{wheel}_wheel"] = 30 + 2 * np.sin(TIME)
        columns[f"{robot}/gps/vel.twist.linear.x"] = SPEED
    proposals = _propose(columns)
    expected = {
        f"{quantity}_{w}" for quantity in ("wheel_speed", "drive_torque") for w in ("fl", "fr", "rl", "rr")
    }
    assert proposals.keys() == {*expected, "ground_speed"}
    assert all(column.startswith(f"{robots[0]}/") for one in proposals.values() for column in one.columns)
    text = profile_text("a log", None, proposals, since_1970=False, namespace=proposals.namespace)
    other = yaml.safe_load(text.replace(f"namespace: {robots[0]}", f"namespace: {robots[1]}"))
    assert other["namespace"] == robots[1]
    sources = Profile.from_dict(other).sources - {"time"}
    assert sources == {column for column in columns if column.startswith(f"{robots[1]}/")}


def test_the_sides_of_one_machine_are_no_machines() -> None:
    columns = {
        f"/{side}/{axle}_wheel.speed": 5 * SPEED for side in ("left", "right") for axle in ("front", "rear")
    }
    proposals = _propose(columns)
    assert proposals.namespace == ""
    assert {f"wheel_speed_{w}" for w in ("fl", "fr", "rl", "rr")} <= proposals.keys()


@pytest.mark.parametrize(
    ("column", "is_soil"), [("Boden", True), ("ground", True), ("Suelo", True), ("GPS fix", False)]
)
def test_a_text_by_the_name_of_the_ground_is_the_soils_label(column: str, is_soil: bool) -> None:
    """German, French and Spanish logs had no labels proposed, so no curves."""
    texts = {column: np.array(["field", "track"] * (len(TIME) // 2), dtype=object)}
    proposals = propose({"speed": SPEED}, texts, {}, {"speed": TIME})
    assert ("soil" in proposals) == is_soil
