"""Inspect: what is in a log, and a profile that works as proposed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read
from terragrip.formats.recognition import propose
from terragrip.vehicle import Vehicle


def ramp(size: float) -> np.ndarray:
    return np.linspace(-size, size, 50)


@pytest.mark.parametrize(
    ("name", "size", "channel", "unit"),
    [
        ("wheel_speed_fl", 3, "wheel_speed_fl", None),
        ("vel_fl", 3, "wheel_speed_fl", None),
        ("omega_l", 3, "wheel_speed_l", None),
        ("meas_left_vel", 3, "wheel_speed_l", None),
        ("WheelSpeedRR_rpm", 30, "wheel_speed_rr", "rpm"),
        ("rpm_rear_right", 30, "wheel_speed_rr", "rpm"),
        ("w_rl", 3, "wheel_speed_rl", None),
        ("M1", 20, "drive_torque_1", None),
        ("log.n_fl", 3, "wheel_speed_fl", None),
        ("run.wheels.T_rr", 20, "drive_torque_rr", None),
        ("torque_front_left", 20, "drive_torque_fl", None),
        ("right_wheel_current", 20, "drive_torque_r", None),
        ("speed", 1, "ground_speed", None),
        ("gps_speed_kmh", 9, "ground_speed", "km/h"),
        ("VehicleSpeed", 3, "ground_speed", None),
        ("drawbar_kN", 2, "drawbar_force", "kN"),
        ("imu_acceleration_x", 2, "acceleration_x", None),
        ("ax", 2, "acceleration_x", None),
        ("gyro_z", 2, "angular_velocity_z", None),
        ("pitch", 12, "pitch", "deg"),
        ("engine_speed", 200, "engine_speed", None),
        ("lat_rad", 0.7, "latitude", "rad"),
    ],
)
def test_names_are_recognised(name: str, size: float, channel: str, unit: str | None) -> None:
    proposals = propose({name: ramp(size)}, (), {})
    assert list(proposals) == [channel]
    assert proposals[channel].entry["from"] == name
    assert proposals[channel].entry.get("unit") == unit


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("Motormoment VL", "motor side, needs the gear ratio"),
        ("Antriebsmoment VL", "at the wheel (scale 1), or motor side"),
    ],
)
def test_which_side_of_the_gear_a_torque_is_of_is_asked(name: str, side: str) -> None:
    proposals = propose({name: ramp(20)}, (), {name: "Nm"})
    assert side in proposals["drive_torque_fl"].give


@pytest.mark.parametrize(
    "name", ["cmd_vel_x", "left_wheel_voltage", "odom_wz_std", "fan_speed", "calib_step", "temp_l", "x"]
)
def test_other_names_are_left_alone(name: str) -> None:
    assert set(propose({name: ramp(3)}, (), {})) <= {"angular_velocity_z"} - (
        {"angular_velocity_z"} if "std" in name else set()
    )


def test_a_ready_log_needs_no_profile(tmp_path: Path, log: pd.DataFrame) -> None:
    path = tmp_path / "log.csv"
    log.drop(index=range(100, 180)).to_csv(path, index=False)
    inspection = inspect(path)
    assert inspection.ready
    assert inspection.rows == 220
    assert inspection.time is not None
    assert inspection.time.spacing_50 == pytest.approx(0.01)
    assert inspection.time.gap_count == 1
    assert inspection.time.gaps[0] == pytest.approx((0.99, 0.81))
    speed = next(column for column in inspection.columns if column.name == "ground_speed")
    assert speed.noise == pytest.approx(0.02, rel=0.3)
    assert (speed.minimum, speed.maximum) == (log["ground_speed"].drop(range(100, 180)).min(), speed.maximum)
    assert any("pitch" in sentence for sentence in inspection.missing)
    assert "can be estimated as it is" in inspection.to_text()
    json.dumps(inspection.to_dict(), allow_nan=False)


@pytest.mark.parametrize(("name", "unit"), [("timestamp", "ms"), ("timestamp", "us"), ("time", "ms")])
def test_stamps_of_a_processor_are_in_the_unit_that_a_drive_allows(
    tmp_path: Path, log: pd.DataFrame, name: str, unit: str
) -> None:
    """Milliseconds or microseconds since the start, without a unit, are no seconds: a drive is not sampled every 10 s."""
    factor = {"ms": 1e3, "us": 1e6}[unit]
    stamps = (factor * log["time"] + 123_456_789).astype(np.int64)
    table = log.drop(columns="time").add_prefix("my_")
    table.insert(0, name, stamps)
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)
    inspection = inspect(path)
    assert inspection.time is not None
    assert (inspection.time.column, inspection.time.unit) == (name, unit)
    line = next(line for line in inspection.profile.splitlines() if line.startswith("time:"))
    assert line.startswith(f"time: {{from: {name}, unit: {unit}}}   # ? no unit is stated")
    assert any("no unit is stated" in warning for warning in inspection.warnings)


def test_a_second_clock_beside_the_first_is_named(tmp_path: Path, log: pd.DataFrame) -> None:
    """Groups of channels written side by side, each with its own time: the slower group's columns end early."""
    slow = log[["time", "ground_speed"]].iloc[::5].reset_index(drop=True)
    beside = pd.concat([log.drop(columns="ground_speed"), slow.add_prefix("gps/")], axis=1)
    beside.to_csv(tmp_path / "log.csv", index=False)
    assert [w for w in inspect(tmp_path / "log.csv").warnings if w.startswith("gps/time is another clock")]
    same = log.assign(**{"gps/time": log["time"] + 5, "note_time": np.nan})
    same.to_csv(tmp_path / "same.csv", index=False)
    assert not [w for w in inspect(tmp_path / "same.csv").warnings if "another clock" in w]


def test_positions_are_shown_apart_and_their_noise_is_not_that_of_their_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A field at 51 degrees: .0051 degrees, 570 m, stood as the noise, and 51 from minimum to maximum."""
    time = np.arange(0, 60, 0.2)
    noise = 3e-7 * np.random.default_rng(4).standard_normal(time.size)
    path = tmp_path / "log.csv"
    pd.DataFrame({"time": time, "wheel_speed_l": 3.0, "latitude": 51 + 2e-6 * time + noise}).to_csv(
        path, index=False
    )
    (latitude,) = [column for column in inspect(path).columns if column.name == "latitude"]
    assert latitude.noise == pytest.approx(3e-7, rel=0.3)
    assert main(["inspect", str(path)]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("latitude ")]
    assert len(set(row.split()[-5:])) == 5


def test_time_has_no_noise(tmp_path: Path, log: pd.DataFrame) -> None:
    path = tmp_path / "log.csv"
    log.to_csv(path, index=False)
    clock = next(column for column in inspect(path).columns if column.name == "time")
    assert (clock.noise, clock.rate, clock.held_period) == (None, None, None)
    assert (clock.minimum, clock.maximum) == (log["time"].min(), log["time"].max())


@pytest.mark.parametrize("rows", [0, 500])
def test_an_empty_column_of_ours_is_told_as_empty(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "log.csv"
    turning = (f"{k * 0.01},,{1 + 0.01 * np.sin(k)}" for k in range(rows))
    path.write_text("\n".join(["time,ground_speed,wheel_speed_l", *turning]) + "\n")
    inspection = inspect(path)
    kinds = {column.name: column.kind for column in inspection.columns}
    assert kinds["ground_speed"] == "empty"
    assert inspection.rows == rows
    assert "ground_speed" in inspection.to_text()
    assert ("has no rows" in inspection.refused) == (rows == 0)


def test_the_proposed_profile_works_as_it_stands(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    n = 600
    frame = pd.DataFrame(
        {
            "t_ms": np.arange(n) * 50,
            "vel_left": 30 + rng.standard_normal(n),
            "vel_right": 30 + rng.standard_normal(n),
            "left_current": 5 + rng.standard_normal(n),
            "right_current": 5 + rng.standard_normal(n),
            "pose_x": np.arange(n) * 0.03 + 0.002 * rng.standard_normal(n),
            "pose_y": 0.002 * rng.standard_normal(n),
            "yaw": 3.0 * rng.standard_normal(n),
            "terrain": "mud",
        }
    )
    log, profile = tmp_path / "log.csv", tmp_path / "profile.yaml"
    frame.to_csv(log, index=False)
    inspection = inspect(log)
    assert not inspection.ready
    assert inspection.recognised["ground_speed"] == ("pose_x", "pose_y")
    profile.write_text(inspection.profile)
    recording = read(log, profile)
    assert recording.wheels == ("l", "r")
    assert recording["soil"][0] == "mud"
    assert np.nanmedian(recording["ground_speed"]) == pytest.approx(0.6, rel=0.02)
    assert "scale" in inspection.profile
    again = inspect(log, profile)
    assert again.ready
    assert {"ground_speed", "drive_torque_l"} <= {column.name for column in again.columns}


def test_wheels_and_units_are_held_against_the_vehicle(tmp_path: Path, log: pd.DataFrame) -> None:
    path = tmp_path / "log.csv"
    log.assign(ground_speed=log["ground_speed"] * 3.6).to_csv(path, index=False)
    wheels = {"mass": 50, "wheels": ["l", "r"], "wheel": {"radius": 0.2, "inertia": 1}}
    vehicle = Vehicle.from_dict({"mass": 50, "axles": {"all": wheels}})
    assert any("km/h" in warning for warning in inspect(path, vehicle=vehicle).warnings)
    other = Vehicle.from_dict({"mass": 50, "axles": {"all": {**wheels, "wheels": ["a", "b"]}}})
    assert any(
        "no wheel l; its wheels are a, b" in warning for warning in inspect(path, vehicle=other).warnings
    )


def test_a_pull_that_is_not_measured_is_said_once_unless_the_vehicle_file_knows_it(
    tmp_path: Path, log: pd.DataFrame
) -> None:
    path = tmp_path / "log.csv"
    log.drop(columns="drawbar_force").to_csv(path, index=False)
    axles = {"all": {"mass": 50, "wheels": ["l", "r"], "wheel": {"radius": 0.2, "inertia": 1}}}
    for uncertainty, times in ({}, 1), ({"drawbar_force": 40.0}, 0):
        vehicle = Vehicle.from_dict({"mass": 50, "axles": axles, "uncertainty": uncertainty})
        assert inspect(path, vehicle=vehicle).to_text().count("assumed to tow nothing") == times


def test_nothing_is_required_but_a_table(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("a,b,c\n1,x,\n2,y,\n")
    inspection = inspect(path)
    assert (inspection.rows, inspection.time, inspection.ready) == (2, None, False)
    assert [column.kind for column in inspection.columns] == ["number", "text", "empty"]
    assert Profile.from_dict({"channels": {}}) is not None
    profile = tmp_path / "profile.yaml"
    profile.write_text(inspection.profile)
    Profile.load(profile)
    assert "needed" in inspection.to_text()
    path.write_bytes(b"\x00\x01")
    with pytest.raises(InputError, match="is not a table of text"):
        inspect(path)


def test_measured_warthog(shared: Callable[[str], Path]) -> None:
    inspection = inspect(shared("data/drive_warthog/raw20hz/warthog_wheels_grass.csv.gz"))
    assert inspection.recognised["wheel_speed_l"] == ("meas_left_vel",)
    assert inspection.recognised["drive_torque_r"] == ("right_wheel_current",)
    assert inspection.recognised["ground_speed"] == ("icp_pos_x", "icp_pos_y")
    held = {column.name: column.held_period for column in inspection.columns}
    assert held["meas_left_vel"] == pytest.approx(0.25, rel=0.02)
    assert held["imu_z"] is None
    assert "quaternion: [icp_quat_x" in inspection.profile


def test_measured_pathfinder_takes_positions_not_odometry(shared: Callable[[str], Path]) -> None:
    inspection = inspect(shared("data/pathfinder_rover/test17run_odom_gps_10hz.csv.gz"))
    assert [c for c in inspection.recognised if c.startswith("wheel_speed")] == [
        f"wheel_speed_{w}" for w in ("fl", "fr", "rl", "rr")
    ]
    assert inspection.recognised["ground_speed"] == ("gps_e", "gps_n")


def test_a_speed_that_says_nothing_is_named_and_a_shaft_is_no_ground(tmp_path: Path) -> None:
    time = np.arange(500) / 10
    path = tmp_path / "log.csv"
    frame = {
        "time": time,
        "WheelBasedVehicleSpeed": 0.0 * time,
        "RearPTOSpeed": 540 + np.sin(time),
        "Draft (lbs)": 551.4 + 0.0 * time,  # nothing is towed, was said
    }
    pd.DataFrame(frame).to_csv(path, index=False)
    inspection = inspect(path)
    assert "Draft has the name of drawbar_force, but is 551.4 throughout." in inspection.warnings
    assert "ground_speed" not in inspection.recognised
    assert any(
        "WheelBasedVehicleSpeed has the name of wheel_based_speed, but is 0 throughout" in w
        for w in inspection.warnings
    )
    assert any("nor a drive train's (wheel_based_speed)" in sentence for sentence in inspection.missing)


def test_a_unit_that_measures_something_else_is_named(tmp_path: Path, log: pd.DataFrame) -> None:
    """A pitch in N, a ground speed in A: inspect ended as "a defect of Terragrip"."""
    wrong = log.assign(pitch=0.1).rename(columns={"pitch": "pitch [N]", "ground_speed": "ground_speed [A]"})
    wrong.to_csv(tmp_path / "log.csv", index=False)
    seen = inspect(tmp_path / "log.csv")
    assert not {"pitch", "ground_speed"} & seen.proposals.keys()
    assert any("'A' measures a current, where a speed is needed" in warning for warning in seen.warnings)


@pytest.mark.parametrize("unit", ["Hz", "1/s"])
def test_a_unit_of_turns_or_radians_is_left_open(tmp_path: Path, unit: str) -> None:
    """Hz in the row of units of a wheel's speed: read as none, so that the line asks; estimate then says what to write."""
    time = np.arange(0, 60, 0.1)
    speed = 1.5 + 0.3 * np.sin(time / 5)
    log = tmp_path / "log.csv"
    rows = "".join(f"{t:.1f},{v:.4f},{v / 0.2:.4f},{v / 0.2:.4f}\n" for t, v in zip(time, speed, strict=True))
    log.write_text(f"time,ground_speed,wheel_speed_l,wheel_speed_r\ns,m/s,{unit},{unit}\n" + rows)
    seen = inspect(log)
    assert any("ambiguous" in warning for warning in seen.warnings)
    assert {"wheel_speed_l", "wheel_speed_r"} <= seen.proposals.keys()
    with pytest.raises(InputError, match=f"column wheel_speed_l: '{unit}' is ambiguous"):
        read(log)
    log.write_text(f"time,ground_speed,spin <{unit}>,n\ns,m/s,,rpm\n" + rows)
    assert "spin" not in str(inspect(log).proposals)  # was a traceback


def test_a_torque_in_pound_feet_and_a_pull_in_kilograms_are_proposed(tmp_path: Path) -> None:
    time = np.arange(0, 60, 0.1)
    speed = 1.5 + 0.3 * np.sin(time / 5)
    log = tmp_path / "log.csv"
    rows = "".join(
        f"{t:.1f},{v:.4f},{v / 0.2:.4f},{v / 0.2:.4f},{5 * v:.3f},{5 * v:.3f},{8 * v:.3f}\n"
        for t, v in zip(time, speed, strict=True)
    )
    names = "Wheel Speed L [rad/s],Wheel Speed R [rad/s],Torque L [lb-ft],Torque R [lb-ft],Drawbar Pull [kg]"
    log.write_text(f"Time [s],Ground Speed [m/s],{names}\n" + rows)
    profile = tmp_path / "p.yaml"
    profile.write_text(inspect(log).profile)
    channels = read(log, profile).channels
    assert channels["drive_torque_l"][0] == pytest.approx(5 * speed[0] * 1.35582, rel=1e-3)
    assert channels["drawbar_force"][0] == pytest.approx(8 * speed[0] * 9.80665, rel=1e-3)


@pytest.mark.parametrize("torque", [True, False])
@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("[l, r]", "[fl, fr]", "the vehicle has no wheel l; its wheels are fl, fr"),
        ("wheel: {radius: 0.2 m, inertia: 0.1 kg m^2}\n", "", "has no wheel data"),
        ("100 kg\n", "100 kg\n", ""),
    ],
)
def test_a_vehicle_that_does_not_fit_is_not_called_ready(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], torque: bool, old: str, new: str, why: str
) -> None:
    time = np.arange(0.0, 20.0, 0.1)
    table = {"time": time, "ground_speed": 1.0 + 0.3 * np.sin(time)}
    for wheel in "lr":
        table[f"wheel_speed_{wheel}"] = 5.2 * table["ground_speed"]
        table |= {f"drive_torque_{wheel}": 5.0 + np.sin(time)} if torque else {}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    vehicle = "mass: 100 kg\naxles: {only: {mass: 100 kg, wheels: [l, r]}}\nwheel: {radius: 0.2 m, inertia: 0.1 kg m^2}\n"
    (tmp_path / "v.yaml").write_text(vehicle.replace(old, new))
    words = [str(tmp_path / "log.csv"), "--vehicle", str(tmp_path / "v.yaml")]
    assert main(["inspect", *words]) == 0
    output = capsys.readouterr().out
    assert ("can be estimated as it is read" in output) == (why == "")
    assert ("The log cannot be estimated as it is" in output) == (why != "")
    assert why in output
    # estimate says the same
    out = ["-o", str(tmp_path / "e.parquet"), "--quiet"]
    assert main(["estimate", *words, *out]) == (2 if why else 0)
    assert why in capsys.readouterr().err


@pytest.mark.parametrize(
    ("driven", "expected"),
    [
        (None, "or 'driven: false' for its axle"),
        (False, ""),
        (True, "says is driven: name its column"),
    ],
)
def test_a_wheel_without_a_torque_is_held_against_the_vehicle_file(
    tmp_path: Path, driven: bool | None, expected: str
) -> None:
    wheels = ("fl", "fr", "rl", "rr")
    frame = pd.DataFrame({"time": 0.1 * np.arange(50), "ground_speed": 1.0 + 0.1 * np.sin(np.arange(50))})
    for wheel in wheels:
        frame[f"wheel_speed_{wheel}"] = 3 * frame["ground_speed"]
    for wheel in wheels[2:]:
        frame[f"drive_torque_{wheel}"] = 10 + ramp(3)
    frame.to_csv(tmp_path / "log.csv", index=False)
    vehicle = None
    if driven is not None:
        axles = {
            "front": {"mass": 50, "wheels": ["fl", "fr"], "driven": driven},
            "rear": {"mass": 50, "wheels": ["rl", "rr"]},
        }
        shape = {"wheelbase": 1.0, "center_of_gravity_height": 0.3, "wheel": {"radius": 0.3, "inertia": 0.1}}
        vehicle = Vehicle.from_dict({"mass": 100, "axles": axles, **shape})
    said = " ".join(
        one for one in inspect(tmp_path / "log.csv", vehicle=vehicle).missing if "drive torque" in one
    )
    assert expected in said
    assert bool(said) is bool(expected)


@pytest.mark.parametrize("driven", [True, False])
def test_a_driven_wheel_without_a_speed_is_held_against_the_vehicle_file(
    tmp_path: Path, driven: bool
) -> None:
    """Of a robot with two wheels in line, f and r, 'w_r' was the right wheel's speed and nothing was said of f; `estimate` refuses that."""
    frame = pd.DataFrame({"time": 0.1 * np.arange(50), "gps_speed": 1.0 + 0.1 * np.sin(np.arange(50))})
    for wheel in "fr":
        frame[f"w_{wheel}"], frame[f"T_{wheel}"] = 3 * frame["gps_speed"], 10 + ramp(3)
    frame.to_csv(tmp_path / "log.csv", index=False)
    axles = {"front": {"mass": 50, "wheels": ["f"], "driven": driven}, "rear": {"mass": 50, "wheels": ["r"]}}
    shape = {"wheelbase": 1.0, "center_of_gravity_height": 0.3, "wheel": {"radius": 0.3, "inertia": 0.1}}
    vehicle = Vehicle.from_dict({"mass": 100, "axles": axles, **shape})

    def is_named() -> bool:
        missing = inspect(tmp_path / "log.csv", vehicle=vehicle).missing
        return any(one.startswith("No wheel speed is recognised for wheel f") for one in missing)

    assert is_named() is driven
    frame.drop(columns=["T_f", "T_r"]).to_csv(tmp_path / "log.csv", index=False)
    assert not is_named()  # slip alone needs no more


def test_wheels_of_other_names_than_the_vehicle_files_are_one_sentence(tmp_path: Path) -> None:
    """Torques were asked for of wheels that the vehicle file does not have, and speeds of those that it has."""
    frame = pd.DataFrame({"time": 0.1 * np.arange(50), "gps_speed": 1.0 + 0.1 * np.sin(np.arange(50))})
    for wheel in ("rl", "rr", "fl", "fr"):
        frame[f"wheel_speed_{wheel}"] = 3 * frame["gps_speed"]
    for wheel in ("rl", "rr"):
        frame[f"drive_torque_{wheel}"] = 10 + ramp(3)
    frame.to_csv(tmp_path / "log.csv", index=False)
    axles = {
        "front": {"mass": 50, "wheels": ["1l", "1r"], "driven": False},
        "rear": {"mass": 50, "wheels": ["2l", "2r"]},
    }
    shape = {
        "wheelbase": 1.0,
        "track": 0.5,
        "center_of_gravity_height": 0.3,
        "wheel": {"radius": 0.3, "inertia": 0.1},
    }
    (note,) = inspect(
        tmp_path / "log.csv", vehicle=Vehicle.from_dict({"mass": 100, "axles": axles, **shape})
    ).missing
    assert note.startswith("The vehicle file has no wheel fl, fr, rl, rr; its wheels are 1l, 1r, 2l, 2r")


def test_a_remark_of_numbers_that_ends_in_words_is_left_alone(tmp_path: Path) -> None:
    """A block of a long file takes it for numbers, the next for texts."""
    rows = [f"{0.01 * k:.2f},1.0{k % 7},5.0{k % 9},3" for k in range(100_000)]
    text = "\n".join(["time,ground_speed,wheel_speed_fl,remark", *rows, "1000.00,1,5,slippery", ""])
    (tmp_path / "log.csv").write_text(text)
    assert "wheel_speed_fl" in inspect(tmp_path / "log.csv").proposals
