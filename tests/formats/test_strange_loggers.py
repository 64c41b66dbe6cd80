"""inspect on loggers of other makes: headers in five languages, traps beside the signals, units that are stated wrongly."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.formats import read
from terragrip.formats.candidates import candidates_of, columns_of
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.recognition import propose
from terragrip.formats.time_column import find_time
from terragrip.formats.vocabulary import GENERAL
from terragrip.vehicle import Vehicle

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TIME = np.arange(0.0, 120.0, 0.05)
SPEED = 2.0 + 0.4 * np.sin(TIME / 7)  # m/s
TURN = 0.3 * np.sin(TIME / 11)  # rad/s
HALF_TRACK, RADIUS = 0.9, 0.6  # m
RIMS = {"left": (SPEED - HALF_TRACK * TURN) / RADIUS, "right": (SPEED + HALF_TRACK * TURN) / RADIUS}


def _propose(columns: dict[str, np.ndarray]) -> dict[str, Proposal]:
    return propose(columns, (), {}, dict.fromkeys(columns, TIME))


def test_made_up_loggers_give_nothing_that_is_wrong_and_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import bench_inspect

    cases = bench_inspect.made_up_cases()
    sys.modules.pop("bench_inspect")
    assert len(cases) == 16
    assert [(c.file, line) for c in cases for line in c.lines if "wrong and sure" in line] == []
    right = sum(c.counts["right"] + c.counts["right, with a ?"] for c in cases)
    assert right >= 0.8 * sum(len(c.truth) for c in cases)


@pytest.mark.parametrize(("factor", "sure"), [(1.0, True), (30 / np.pi, False)])
def test_a_track_tells_wheel_speeds_whose_stated_unit_is_wrong(factor: float, sure: bool) -> None:
    """Turns a minute called rad/s make wheels of 6 cm, which a robot may have, but not on a track of 1.8 m."""
    columns = {f"wheel_speed_{side}_rads": factor * rim / 2 for side, rim in RIMS.items()}
    result = _propose(columns | {"gps_speed_mps": SPEED / 2, "yaw_rate_radps": TURN / 2})
    for side in ("l", "r"):
        assert (result[f"wheel_speed_{side}"].doubt == "") == sure


def test_rad_per_second_called_rpm_is_in_doubt_by_the_track_of_a_small_robot() -> None:
    """Wheels of .1 m would be of .95 m, which a wheel may be, but not on a track of .4 m."""
    columns = {
        f"wheel_{side}_rpm": rim
        for side, rim in {"left": SPEED - 0.2 * TURN, "right": SPEED + 0.2 * TURN}.items()
    }
    columns = {name: rim / 0.1 for name, rim in columns.items()}
    result = _propose(columns | {"gps_speed_mps": SPEED, "yaw_rate_radps": TURN})
    assert "give a track of" in result["wheel_speed_l"].doubt
    assert "give a track of" in result["wheel_speed_r"].doubt


def test_where_the_ground_speeds_unit_is_wrong_no_wheel_leans_on_it() -> None:
    place = {"lat": 45 + np.cumsum(SPEED) * 0.05 / 111_132, "lon": 11 + 1e-9 * TIME}
    rims = {f"wheel_speed_{side}_rads": SPEED / RADIUS for side in ("left", "right")}
    result = _propose(place | rims | {"gps_speed_kmh": SPEED})
    assert result["ground_speed"].doubt.startswith("stated in km/h, but")
    assert any("m follows from lat, lon" in line for line in result["wheel_speed_l"].evidence)


def test_a_speed_of_strange_words_beside_one_over_ground_keeps_its_question_mark() -> None:
    """Whatever 'onbekend' means, it may be a set value."""
    columns = {"gps_speed_kmh": 3.6 * SPEED, "snelheid_onbekend_kmh": 3.6 * SPEED * 1.1}
    assert _propose(columns)["wheel_based_speed"].doubt != ""


@pytest.mark.parametrize(
    ("true", "theoretical"),
    [
        ("Vitesse réelle (km/h)", "Vitesse théorique (km/h)"),
        ("Wahre Geschwindigkeit [km/h]", "Theoretische Geschwindigkeit [km/h]"),
        ("Velocidad real (km/h)", "Velocidad teórica (km/h)"),
        ("Velocità effettiva [km/h]", "Velocità teorica [km/h]"),
        ("Werkelijke snelheid [km/h]", "Theoretische snelheid [km/h]"),
    ],
)
@pytest.mark.parametrize("first", [0, 1])
def test_a_theoretical_speed_is_the_wheels_in_any_language(true: str, theoretical: str, first: int) -> None:
    """The one of both that stood first was proposed as the ground speed, and the other one left out."""
    pair = [(true, 3.6 * SPEED), (theoretical, 4.0 * SPEED)]
    result = _propose(dict(pair[first:] + pair[:first]))
    assert result["ground_speed"].entry["from"] == true
    assert result["wheel_based_speed"].entry["from"] == theoretical


def test_a_wheel_that_the_vehicle_does_not_have_is_in_doubt() -> None:
    wheels = {"radius": RADIUS, "inertia": 1.0}
    vehicle = Vehicle.from_dict(
        {"mass": 900.0, "axles": {"only": {"mass": 900.0, "wheels": ["l", "r"]}}, "wheel": wheels}
    )
    torques = {f"torque_{wheel}_Nm": 100 + 10 * SPEED for wheel in ("left", "right", "middle_left")}
    result = propose(torques, (), {}, dict.fromkeys(torques, TIME), vehicle=vehicle)
    assert result["drive_torque_l"].doubt == ""
    assert result["drive_torque_ml"].doubt == "the vehicle's wheels are l, r"


def test_speeds_of_numbered_drives_are_not_over_ground() -> None:
    columns = {"drivers0.measured_velocity": SPEED, "drivers1.measured_velocity": 1.1 * SPEED}
    assert "ground_speed" not in _propose(columns)


def test_kn_of_a_speed_is_knots_and_of_a_force_kilonewtons() -> None:
    """The speed was left out as a force: 'No ground speed was found'."""
    knots = 3600 / 1852
    result = _propose({"gps_speed_kn": knots * SPEED, "drawbar_kn": 2 + SPEED})
    assert result["ground_speed"].entry == {"from": "gps_speed_kn", "unit": "kn"}
    assert result["drawbar_force"].entry == {"from": "drawbar_kn", "unit": "kN"}


def test_a_receivers_velocities_in_the_plane_go_together() -> None:
    columns = {
        "gps/vel/twist/linear/x": SPEED * np.cos(TIME / 20),
        "gps/vel/twist/linear/y": SPEED * np.sin(TIME / 20),
    }
    assert _propose(columns)["ground_speed"].entry == {"norm_of": list(columns)}


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("couple roue arrière gauche (N.m)", "drive_torque_rl"),
        ("vitesse roue avant droite (tr/min)", "wheel_speed_fr"),
        ("Couple AVG (N.m)", "drive_torque_fl"),
        ("vitesse roue ARD (tr/min)", "wheel_speed_rr"),
        ("torque avg [Nm]", None),
        ("Raddrehzahl HL [U/min]", "wheel_speed_rl"),
        ("M_Rad_VR (Nm)", "drive_torque_fr"),
        ("Höhe ü. NN [m]", "altitude"),
        ("Längengrad [°]", "longitude"),
        ("velocidad rueda trasera izquierda (rpm)", "wheel_speed_rl"),
        ("velocità ruota anteriore destra (giri/min)", "wheel_speed_fr"),
        ("tangage (deg)", "pitch"),
        ("vitesse consigne (km/h)", None),
        ("Sollgeschwindigkeit [km/h]", None),
        ("Zapfwellendrehzahl [U/min]", None),
        ("Speed (GPS)", "ground_speed"),
        ("drive torque FL [Nm]", "drive_torque_fl"),
        ("/drive_torque_fl.data", "drive_torque_fl"),
        ("drive shaft torque FL", None),
        ("/gps_0/fix/latitude", "latitude"),
        ("Effort de traction (daN)", "drawbar_force"),
        ("GPS [km/h]", "ground_speed"),
        ("Radar (m/s)", "ground_speed"),
        ("GPS accuracy [m/s]", None),
        ("GPS down [m/s]", None),
        ("GPS [m]", None),
        ("effort traction roue AVG (N.m)", "drive_torque_fl"),
        ("Forza di traino [kN]", "drawbar_force"),
        ("Draught force [kN]", "drawbar_force"),
        ("Force attelage (daN)", "drawbar_force"),
        ("ground speed doppler [km/h]", "ground_speed"),
        ("Radumfangsgeschwindigkeit [km/h]", "wheel_based_speed"),
        ("Getriebegeschwindigkeit [km/h]", None),
        ("Front axle torque [Nm]", None),
        ("WS_FL [rpm]", "wheel_speed_fl"),
        ("n_Motor_re [1/min]", "wheel_speed_r"),
        ("I_Motor_li [A]", "drive_torque_l"),
        ("p_FL [bar]", None),
        ("Drehzahl hinten links in 1/min", "wheel_speed_rl"),
        ("Drehzahl VR, min-1", "wheel_speed_fr"),
        ("Gierrate / °/s", "angular_velocity_z"),
        ("wheel speed FL <1/min>", "wheel_speed_fl"),
        ("Akku in V", None),
    ],
)
def test_names_in_other_languages_and_paths(name: str, channel: str | None) -> None:
    column = columns_of((name,), {}, {}, GENERAL)[name]
    made = [c.channel for c in candidates_of(column)]
    assert made[:1] == ([channel] if channel else [])


def test_labviews_files_are_refused_with_what_makes_a_table_of_them(tmp_path: Path) -> None:
    """The header of a .lvm has a row for each property of its channels (NI's "Specification for the LabVIEW Measurement File")."""
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "***End_of_Header***\t", "\t"]
    head += ["Channels\t3\t\t\t", "Samples\t50\t50\t50\t", "Y_Unit_Label\tm/s\trad/s\trad/s\t"]
    head += ["***End_of_Header***\t\t\t\t", "X_Value\tground_speed\twheel_speed_l\twheel_speed_r\tComment"]
    rows = [f"{k / 10:.6f}\t{1 + k / 100:.6f}\t{5 + k / 20:.6f}\t{5 + k / 20:.6f}" for k in range(50)]
    path = tmp_path / "log.lvm"
    path.write_text("\r\n".join([*head, *rows, ""]), newline="")
    with pytest.raises(InputError) as refused:
        read(path)
    assert refused.value.problem.startswith("is a LabVIEW measurement file")
    assert refused.value.hint == (
        "delete the lines above 'X_Value', write time for it, and delete 'Comment' at that line's end"
    )
    header = head[-1].replace("X_Value", "time").removesuffix("\tComment")
    path.write_text("\r\n".join([header, *rows, ""]), newline="")
    assert read(path)["ground_speed"][-1] == pytest.approx(1.49)
    (tmp_path / "log.tdms").write_bytes(b"TDSm\x0e\0\0\0" + bytes(100))
    with pytest.raises(InputError, match="is a LabVIEW TDMS file; export it as CSV"):
        read(tmp_path / "log.tdms")


def test_an_autopilots_log_is_refused_with_what_makes_a_table_of_it(tmp_path: Path) -> None:
    """'row 5 has 4 cells, the header 6; give every row the same number of cells'."""
    path = tmp_path / "rover.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nGPS, 1, 3, 48.1\n")
    with pytest.raises(
        InputError, match=r"is an ArduPilot log; make a CSV table by pymavlink: mavlogdump\.py"
    ):
        read(path)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_xml_is_no_table(tmp_path: Path, mark: str) -> None:
    """'column time: is missing; map the log's columns in a profile' was said of ISOXML."""
    path = tmp_path / "TASKDATA.XML"
    path.write_text(f'{mark}<?xml version="1.0"?>\n<ISO11783_TaskData/>\n', encoding="utf-8")
    with pytest.raises(InputError, match="is XML; export it as CSV, ISOXML's TASKDATA by the terminal's"):
        read(path)


@pytest.mark.parametrize("of_wheels", [True, False])
def test_odometry_is_the_wheels_beyond_doubt_where_it_follows_from_them(of_wheels: bool) -> None:
    """A camera's odometry of an unknown name was the wheels' own speed, without a question mark."""
    rims = {
        f"/joint_states.velocity.{s}_wheel": rim / (0.9 + 0.08 * np.sin(TIME / 5)) for s, rim in RIMS.items()
    }
    speed = RADIUS * np.mean(list(rims.values()), axis=0) if of_wheels else SPEED
    result = _propose({**rims, "/zed/odom.twist.twist.linear.x": speed})
    assert "ground_speed" not in result  # it may be smoothed: slip would be hidden
    assert ("ground_speed?" in result["wheel_based_speed"].doubt) != of_wheels
    assert result["wheel_based_speed"].is_doubtful != of_wheels


def test_both_velocities_of_a_message_that_are_great_are_over_ground() -> None:
    """Its x alone, which is the speed to the east, was proposed."""
    way = 0.3 + TIME / 15
    columns = {f"/fix_velocity.twist.linear.{a}": SPEED * f(way) for a, f in (("x", np.cos), ("y", np.sin))}
    found = _propose(columns)["ground_speed"]
    assert found.entry == {"norm_of": list(columns)}
    assert found.doubt
    along = {name: SPEED if name.endswith("x") else 0.01 * SPEED for name in columns}
    assert _propose(along)["ground_speed"].columns == ("/fix_velocity.twist.linear.x",)


def _car(radius: float) -> Vehicle:
    axle = {"mass": 500.0, "wheel": {"radius": radius, "inertia": 1.0}}
    axles = {"front": {**axle, "wheels": ["fl", "fr"]}, "rear": {**axle, "wheels": ["rl", "rr"]}}
    return Vehicle.model_validate(
        {"mass": 1000.0, "wheelbase": 2.5, "center_of_gravity_height": 0.5, "axles": axles}
    )


def _of_car(columns: dict[str, np.ndarray], vehicle: Vehicle | None = None) -> dict[str, Proposal]:
    return propose(columns, (), {}, dict.fromkeys(columns, TIME), vehicle=vehicle)


@pytest.mark.parametrize(("unit", "factor"), [("km/h", 3.6 * 0.3), ("rad/s", 1.0)])
def test_rim_speeds_in_kmh_by_our_own_names_are_asked_for_by_a_cars_radius(unit: str, factor: float) -> None:
    """By .3 m rad/s are only 8 % off: 'in no other unit near it' was said of a car's wheels in km/h, and slip was .08 too high."""
    names = [f"wheel_speed_{wheel}" for wheel in ("fl", "fr", "rl", "rr")]
    columns = dict.fromkeys(names, factor * SPEED / 0.3) | {"gps_speed_mps": SPEED}
    for name in names:
        one = _of_car(columns, _car(0.3))[name]
        assert ("1.00 times (in km/h) or 1.08 times (in rad/s)" in one.doubt) == (unit == "km/h")
        assert bool(one.doubt) == (unit == "km/h")
        assert one.unit == "rad/s"


def test_gyros_without_a_unit_have_that_of_their_own_sensor() -> None:
    """Beside a chassis' yaw rate in deg/s gyros in rad/s were proposed in deg/s, surely."""
    rng = np.random.default_rng(1)
    gyros = {f"gyro_{axis}": 0.05 * rng.standard_normal(len(TIME)) for axis in "xy"}
    heading = np.degrees(np.cumsum(TURN) * 0.05)
    columns = {"heading": heading, "yaw_rate": np.degrees(TURN), **gyros, "gyro_z": TURN}
    result = _propose(columns)
    assert {axis: result[f"angular_velocity_{axis}"].unit for axis in "xyz"} == {
        "x": "rad/s",
        "y": "rad/s",
        "z": "deg/s",
    }
    del columns["gyro_z"]
    assert _propose(columns)["angular_velocity_x"].unit == "deg/s"  # nothing else shows it


def test_accelerations_in_capital_g_are_in_g() -> None:
    """They were in doubt: 'stated in G, but the three sum up to gravity, in g'."""
    rng = np.random.default_rng(2)
    sizes = {"Long": 0.1 * np.sin(TIME), "Lat": SPEED * TURN / 9.8, "Vert": np.ones(len(TIME))}
    columns = {f"G Force {n} [G]": x + 0.01 * rng.standard_normal(len(TIME)) for n, x in sizes.items()}
    bare = {name.partition(" [")[0]: values for name, values in columns.items()}
    units = dict.fromkeys(bare, "G")
    result = propose(bare, (), units, dict.fromkeys(bare, TIME))
    assert [result[f"acceleration_{axis}"].doubt for axis in "xyz"] == ["", "", ""]


@pytest.mark.parametrize("known", [True, False])
def test_a_ground_speed_that_is_made_of_the_wheels_is_not_taken_for_one(known: bool) -> None:
    """MoTeC's channel 'Ground Speed' is the mean of wheels: it came before the receiver's, surely, and slip was 0 by construction."""
    rng = np.random.default_rng(3)
    rims = {
        f"Wheel Speed {wheel} [m/s]": SPEED * (1.03 + 0.004 * rng.standard_normal(len(TIME)))
        for wheel in ("FL", "FR", "RL", "RR")
    }
    front = list(rims.values())[:2]
    columns = {**rims, "Ground Speed [m/s]": np.mean(front, axis=0)}
    vehicle = _car(0.3) if known else None
    assert _of_car(columns, vehicle)["ground_speed"].doubt == "is made of the wheels' speeds: odometry?"
    gps = SPEED + 0.02 * rng.standard_normal(len(TIME))
    result = _of_car({**columns, "GPS Speed [m/s]": gps}, vehicle)["ground_speed"]
    assert (result.columns, result.doubt) == (("GPS Speed [m/s]",), "")
    place = {"latitude": 45.0 + np.cumsum(SPEED) * 0.05 / 111_132.0, "longitude": 11.0 + 1e-6 * TIME}
    by_place = _of_car(columns | place, vehicle)["ground_speed"]
    assert by_place.columns == (("latitude", "longitude") if known else ("Ground Speed [m/s]",))


def test_a_time_in_milliseconds_comes_before_a_receivers_that_repeats() -> None:
    """VESC Tool writes ms_today, and the receiver's time of the last fix: that one was proposed, and 'estimate' refused it."""
    whole = np.floor(TIME)
    columns = {"ms_today": 36e6 + 1000 * TIME, "erpm": 100 * SPEED, "gnss_posTime": 36e6 + 1000 * whole}
    found = find_time(columns, (), {})
    assert found is not None
    assert (found.name, found.unit, found.doubt) == ("ms_today", "ms", "")
    us_left = 50 + 10 * np.sin(TIME)  # an ultrasonic sensor
    assert find_time({"us_left": us_left}, (), {}) is None


def test_signals_of_a_bus_are_proposed_in_the_order_of_the_profile_of_tractors() -> None:
    """Which message came first in the log decided: of one drive the 1 Hz receiver's speed, or the radar's."""
    speeds = {"NavigationBasedVehicleSpeed": 3.6 * SPEED, "GroundBasedMachineSpeed": SPEED}
    speeds |= {"WheelBasedVehicleSpeed": 3.7 * SPEED, "WheelBasedMachineSpeed": 1.03 * SPEED}
    units = {name: "km/h" if "Vehicle" in name else "m/s" for name in speeds}
    for columns in (speeds, dict(reversed(speeds.items()))):
        result = propose(columns, (), units, dict.fromkeys(columns, TIME))
        assert result["ground_speed"].columns == ("GroundBasedMachineSpeed",)
        assert result["wheel_based_speed"].columns == ("WheelBasedMachineSpeed",)
