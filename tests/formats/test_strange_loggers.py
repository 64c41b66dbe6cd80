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
