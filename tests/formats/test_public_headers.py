"""inspect and read on headers and layouts as loggers in public repositories write them, filled with a drive whose truth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read
from terragrip.formats.candidates import candidates_of, columns_of
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.recognition import propose
from terragrip.formats.time_column import find_time
from terragrip.formats.vocabulary import GENERAL
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

TIME = np.arange(0.0, 120.0, 0.05)
SPEED = 2.0 + 0.4 * np.sin(TIME / 7)  # m/s
WHEELS = ("fl", "fr", "rl", "rr")
RADIUS = 0.36  # m
ROVER = Vehicle.from_dict(
    {
        "name": "rover",
        "mass": 490,
        "wheelbase": 0.96,
        "track": 0.86,
        "center_of_gravity_height": 0.48,
        "hitch_height": 0.35,
        "axles": {
            "front": {"mass": 200, "wheels": ["fl", "fr"]},
            "rear": {"mass": 290, "wheels": ["rl", "rr"]},
        },
        "wheel": {"radius": RADIUS, "inertia": 0.4},
    }
)


def _propose(columns: dict[str, np.ndarray], vehicle: Vehicle | None = None) -> dict[str, Proposal]:
    return propose(columns, (), {}, dict.fromkeys(columns, TIME), vehicle=vehicle)


def _channel(name: str, *beside: str) -> str:
    """The channel that a column's name and unit alone stand for first, "" if none."""
    column = columns_of((name, *beside), {}, {}, GENERAL)[name]
    return next((one.channel for one in candidates_of(column)), "")


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("wheel_angular_velocity_fl", "wheel_speed_fl"),
        ("FL_wheel_rate", "wheel_speed_fl"),
        ("WHL_SpdFLVal", "wheel_speed_fl"),
        ("v_l(ips)", "wheel_speed_l"),
        ("Rotação roda dianteira esquerda (rpm)", "wheel_speed_fl"),
        ("Torque roda traseira direita (N.m)", "drive_torque_rr"),
        ("Força de tração (kN)", "drawbar_force"),
        ("v_gps_ms", "ground_speed"),
        ("setup_speed_ms", "ground_speed"),
        ("angular_velocity", "angular_velocity_z"),
        ("/Drive/Gyro/YawVelocityRadPerSec", "angular_velocity_z"),
        ("CAN 1::EBC2::FrontAxleSpeed", "wheel_based_speed"),
        ("CAN 1::EEC1::EngineSpeed", "engine_speed"),
        ("Actual Engine - Percent Torque (%)", "engine_torque_share"),
        ("Wheel-Based Vehicle Speed (kph)", "wheel_based_speed"),
        ("groundSpeedGearbox", "wheel_based_speed"),
        ("LONGTITUDE", "longitude"),
        ("Vehicle Speed (km/h) *OBD", "ground_speed"),
        ("左前轮速(rpm)", "wheel_speed_fl"),
        ("右后轮转矩(N·m)", "drive_torque_rr"),
        ("牵引力(kN)", "drawbar_force"),
        ("横摆角速度(deg/s)", "angular_velocity_z"),
        ("目标车速(km/h)", ""),
    ],
)
def test_names_of_public_loggers(name: str, channel: str) -> None:
    assert _channel(name) == channel


@pytest.mark.parametrize(
    "name",
    [
        "transmission_output_speed_rpm",
        "gearbox_speed_ratio",
        "yaw_rate_left",
        "sample_rate_fl",
        "wheel_angle_fl",
        "wheel_turns_fl",
    ],
)
def test_names_that_are_no_speed_of_a_vehicle_or_a_wheel(name: str) -> None:
    assert _channel(name) not in ("wheel_based_speed", "wheel_speed_l", "wheel_speed_fl")


@pytest.mark.parametrize("name", ["gps_speed_age_ms", "wheel_speed_fl_delay_ms"])
def test_an_age_of_a_speed_is_in_milliseconds(name: str) -> None:
    """They were speeds in m/s, as v_gps_ms is."""
    assert columns_of((name,), {}, {}, GENERAL)[name].unit == "ms"


def test_turns_of_unknown_parts_have_a_question_mark_and_those_of_shafts_are_none() -> None:
    """A belt's were the vehicle's, in deg/s for certain, and a feed's roll in rpm was the vehicle's roll."""
    spin = 30 + np.sin(TIME)
    result = _propose({"gps_speed [m/s]": SPEED, "belt_angular_velocity": spin, "Roll speed (rpm)": spin})
    assert result["angular_velocity_z"].is_doubtful
    assert "angular_velocity_x" not in result


def test_a_wheels_rate_is_its_speed_and_its_angle_is_none() -> None:
    """w1_angle was the speed of wheel 1, and w1_rate nothing."""
    names = [f"w{n}_{what}" for n in range(1, 5) for what in ("angle", "rate")]
    read_as = {name: _channel(name, *names) for name in names}
    assert read_as["w2_rate"] == "wheel_speed_2"
    assert read_as["w2_angle"] == ""


@pytest.mark.parametrize(("unit", "factor"), [("m/s", 1.0), ("km/h", 3.6)])
def test_rim_speeds_under_our_own_names_have_a_question_mark(unit: str, factor: float) -> None:
    """wheel_speed_fl in m/s or km/h was proposed as rad/s for certain: slip -.64 and .23 for .11, stated to .08."""
    columns = {f"wheel_speed_{wheel}": factor * SPEED / 0.95 for wheel in WHEELS}
    for name in ("v_ego", "v_ego_mps"):  # in an assumed unit, and in a stated one
        result = _propose(columns | {name: SPEED}, ROVER)
        assert all(result[column].is_doubtful or result[column].unit == unit for column in columns)
        assert any(unit in f"{result[c].doubt} {result[c].unit}" for c in columns)


def test_turning_wheels_under_our_own_names_have_none() -> None:
    columns = {f"wheel_speed_{wheel}": SPEED / 0.95 / RADIUS for wheel in WHEELS}
    for name in ("v_ego", "v_ego_mps"):
        result = _propose(columns | {name: SPEED}, ROVER)
        assert not any(result[column].is_doubtful for column in columns)


def test_a_second_speed_in_another_unit_is_the_vehicles_own() -> None:
    """Both were compared as numbers: km/h beside m/s was no speed of the wheels."""
    result = _propose({"GPS Speed (m/s)": SPEED, "Speed (OBD) (km/h)": 3.6 * SPEED / 0.9})
    assert result["ground_speed"].columns == ("GPS Speed (m/s)",)
    assert result["wheel_based_speed"].columns == ("Speed (OBD) (km/h)",)


def test_accelerations_in_thousandths_of_gravity() -> None:
    """A traceback: mg was a mass where the rate of turn is compared with the acceleration sideways."""
    assert factor_to("mg", "m/s^2") == pytest.approx(9.80665e-3)
    with pytest.raises(ValueError, match="mass"):
        factor_to("mg", "m/s")
    turn = 0.3 * np.sin(TIME / 11)
    columns = {
        "ICM_ax": 20 * np.sin(TIME),
        "ICM_ay": SPEED * turn * 1000 / 9.80665,
        "ICM_az": 1000 + np.sin(TIME),
    }
    result = _propose(columns | {"ICM_gz": np.degrees(turn), "GPS_speed_kmh": 3.6 * SPEED})
    assert result["acceleration_y"].unit == "mg"


def test_the_seconds_of_a_minute_are_no_time() -> None:
    """Columns hour, minute, second: second was the time without a question mark, with 110 gaps."""
    clock = TIME[:2220]
    assert find_time({"minute": np.floor(clock / 60), "second": np.floor(clock) % 60}, (), {}) is None
    assert find_time({"second": TIME}, (), {}) is not None


@pytest.mark.parametrize("back", [0.0, 0.1])
def test_a_short_clock_that_was_set_back_is_a_time_all_the_same(back: float) -> None:
    """'No time column is recognised', of a log of 50 s with one 0 in it, or that begins anew."""
    zero, anew = TIME[:1000].copy(), np.r_[TIME[:600], TIME[:500] + back]
    zero[800] = back
    for name in ("Time (s)", "timestamp"):
        for stamps in (zero, anew):
            result = find_time({name: stamps}, (), {})
            assert result is not None
            assert result.name == name


def test_a_column_named_by_a_unit_of_time_alone_and_lcms_utime() -> None:
    assert find_time({"ms": 1000 * TIME}, (), {}).unit == "ms"
    assert find_time({"utime": 1.7e15 + 1e6 * TIME}, (), {}).unit == "us"


ROWS = "\n".join(
    f"{t:.2f},{3.6 * v:.3f},{v / 0.95 / RADIUS:.3f}" for t, v in zip(TIME[:200], SPEED[:200], strict=True)
)


@pytest.mark.parametrize(
    "header",
    [
        "time,speed,wheel\nf8,f8,f8\ns,km/h,rad/s",  # INCA
        "time,speed,wheel\ns,km/h,rad/s\n,100: gps,200: obd",  # RaceChrono
        "time,speed,wheel\ns,km/h,rad/s",
    ],
)
def test_units_among_the_rows_of_a_header(tmp_path: Path, header: str) -> None:
    """A row of types above the units was data: 'f8' is not a number."""
    log = tmp_path / "log.csv"
    log.write_text(f"{header}\n{ROWS}\n")
    profile = {"channels": {"wheel_speed_l": "wheel", "ground_speed": "speed"}}
    path = tmp_path / "p.yaml"
    path.write_text(f"channels: {profile['channels']}")
    recording = read(log, path)
    assert len(recording.time) == 200
    assert recording["ground_speed"][0] == pytest.approx(2.0, abs=1e-3)


def test_texts_under_a_header_are_no_units(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,ground_speed,wheel_speed_l,mark\n0,1,2,a\n1,1,2,b\n")
    assert len(read(log).time) == 2


def test_remarks_between_rows_are_left_out(tmp_path: Path) -> None:
    """'row 2225: has 1 cell, the header 16', of TrackAddict's lines between laps; #N/A is a cell."""
    log = tmp_path / "log.csv"
    lines = ROWS.split("\n")
    rows = [*lines[:50], "# Lap 1: 00:00:02.50", "#N/A,7.2,5.8", *lines[50:], "# Session End"]
    log.write_text("\n".join(["# RaceRender Data", "time,speed [km/h],wheel_speed_l", *rows]) + "\n")
    path = tmp_path / "p.yaml"
    path.write_text("channels: {wheel_speed_l: wheel_speed_l, ground_speed: speed}")
    assert len(inspect(log).columns) == 3
    assert inspect(log).rows == 201


def test_a_table_with_a_row_for_each_value_says_how_it_becomes_a_log(tmp_path: Path) -> None:
    """Car Scanner's layout got no word: 'No wheel speed'."""
    log = tmp_path / "log.csv"
    rows = [
        f"{t:.2f};{name};{value:.3f};km/h"
        for t, v in zip(TIME[:200], SPEED[:200], strict=True)
        for name, value in (("Speed (GPS)", v), ("Vehicle speed", v / 0.9))
    ]
    log.write_text("\n".join(["SECONDS;PID;VALUE;UNITS", *rows]) + "\n")
    notes = [note for note in inspect(log).warnings if "pivot_table" in note]
    assert len(notes) == 1
    assert notes[0].startswith("VALUE holds the values of 2 signals, which PID names")
    assert 'columns=t["PID"] + " [" + t["UNITS"] + "]"' in notes[0]


@pytest.mark.parametrize(
    ("name", "encoding"), [("车速", "gbk"), ("车速", "utf-8"), ("Geschw. über Grund äöüß", "latin-1")]
)
def test_the_encoding_of_a_header(tmp_path: Path, name: str, encoding: str) -> None:
    log = tmp_path / "log.csv"
    log.write_bytes(f"time,{name},wheel_speed_l\n{ROWS}\n".encode(encoding))
    assert name in [column.name for column in inspect(log).columns]


def test_all_parts_of_a_long_table_are_in_the_encoding_of_its_header(tmp_path: Path) -> None:
    """Each part was judged alone: 沙 alone is UTF-8, too (ɳ), and by 喆, which GB 2312 lacks, all was Latin-1
    behind a header that was Chinese, and the first row began in the middle of it."""
    log, profile = tmp_path / "log.csv", tmp_path / "p.yaml"
    rows = [f"{k / 100:.2f},2.000000,5.000000,{'喆' if k == 10_000 else '沙'}\n" for k in range(120_000)]
    log.write_bytes(("time,车速 车速,轮速,soil\n" + "".join(rows)).encode("gbk"))
    profile.write_text(
        "channels: {wheel_speed_l: 轮速, ground_speed: 车速 车速, soil: soil}", encoding="utf-8"
    )
    recording = read(log, profile)
    assert len(recording.time) == len(rows)
    assert set(recording.labels["soil"]) == {"沙", "喆"}


def test_a_netcdf_3_file_is_named_and_a_header_that_begins_alike_is_none(tmp_path: Path) -> None:
    (tmp_path / "x.nc").write_bytes(b"CDF\x01\x00\x00\x00\x00" + bytes(100))
    with pytest.raises(InputError, match="is a netCDF 3 file"):
        read(tmp_path / "x.nc")
    (tmp_path / "log.csv").write_text("CDF,time,wheel_speed_l,ground_speed\n1,0,2,1\n1,1,2,1\n")
    assert len(read(tmp_path / "log.csv").time) == 2


def test_torques_beside_speeds_of_motors_may_be_the_motors() -> None:
    """FL_torque [Nm] beside FL_motor_speed [rpm] was the wheel's for certain: adhesion a twelfth, behind a gear of 12."""
    rims = {f"{w}_motor_speed [rpm]": 12 * 9.549 * SPEED / RADIUS for w in ("FL", "FR")}
    torques = {f"{w}_torque [Nm]": 10 + np.sin(TIME) for w in ("FL", "FR")}
    result = _propose(rims | torques | {"GPS_speed [km/h]": 3.6 * SPEED}, ROVER)
    assert result["drive_torque_fl"].doubt == "at the wheel, or the motor's, as the speeds are?"
    wheels = {
        f"{w}_wheel_torque [Nm]": values for w, values in zip(("FL", "FR"), torques.values(), strict=True)
    }
    assert not _propose(rims | wheels | {"GPS_speed [km/h]": 3.6 * SPEED}, ROVER)[
        "drive_torque_fl"
    ].is_doubtful


@pytest.mark.parametrize(("name", "sure"), [("omega_{}", True), ("v_wheel_{}", False)])
def test_a_name_that_says_turning_leaves_rims_no_speed(name: str, sure: bool) -> None:
    """With a radius near .28 m, rad/s and km/h look alike; omega is no km/h."""
    columns = {name.format(wheel): SPEED / 0.95 / RADIUS for wheel in WHEELS} | {"gps_kmh": 3.6 * SPEED}
    assert _propose(columns, ROVER)["wheel_speed_fl"].is_doubtful != sure


def test_a_scale_of_0_is_refused() -> None:
    """All speeds were 0: slip .57 ± .36, and a note on a dead sensor."""
    with pytest.raises(InputError, match="makes every value 0; write the factor"):
        Profile.from_dict({"channels": {"ground_speed": {"from": "v", "scale": 0}, "wheel_speed_l": "w"}})


def test_the_number_of_a_group_or_sender_is_no_wheel() -> None:
    numbered = ("Speed", "Speed@1", "Speed@2", "Speed@3", "Speed@0A", "Speed@bus4")
    read = columns_of(numbered, {}, {}, GENERAL)
    assert {column.name.wheel for column in read.values()} == {""}


@pytest.mark.parametrize("missing", [0, 3])
@pytest.mark.parametrize("proper", ["_time", "t [s]"])
def test_a_date_that_never_changes_is_no_time(tmp_path: Path, missing: int, proper: str) -> None:
    """InfluxDB writes when its query began and ended in each row, before _time: inspect proposed the first of them."""
    began, stamps = (
        pd.Timestamp("2026-05-01T10:00:00Z"),
        pd.date_range("2026-05-01T10:00:00Z", periods=200, freq="100ms"),
    )
    table = pd.DataFrame(
        {"_start": began, "_stop": stamps[-1], proper: stamps, "ground_speed": 1.0 + np.arange(200) % 7}
    )
    table.loc[: missing - 1, "_start"] = pd.NaT
    if proper == "t [s]":
        table[proper] = 0.1 * np.arange(200)
    table["wheel_speed_l"] = 5 * table["ground_speed"]
    table.to_csv(tmp_path / "log.csv", index=False)
    assert f"time: {{from: {proper.split()[0]}" in inspect(tmp_path / "log.csv").profile
