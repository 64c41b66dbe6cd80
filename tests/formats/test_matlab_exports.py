"""MATLAB: arrays, structs, exported series and tables, written with SciPy and h5py, give back what was put in."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from terragrip.formats import inspect, read
from terragrip.formats.matlab_signals import Contents, walk
from terragrip.formats.reading import read_table
from test_logs import COUNT, SPEED, TIME


def matlab_content() -> dict[str, Any]:
    return {
        "tout": TIME[:, None],
        "v": SPEED[:, None],
        "omega": np.c_[SPEED, 2 * SPEED, 3 * SPEED],
        "vehicle_name": "tractor",
        "log": {
            "time": TIME[:50],
            "ground_speed": SPEED[:50],
            "nested": {"t": TIME[:20], "pull": SPEED[:20]},
        },
        "series": {"Time": TIME[:30], "Data": 5 * SPEED[:30]},
        "single": 4.0,
    }


EXPECTED = {
    "v": SPEED,
    "omega[1]": 2 * SPEED,
    "log.ground_speed": SPEED[:50],
    "log.nested.pull": SPEED[:20],
    "series": 5 * SPEED[:30],
}


def write_hdf5(path: Path, content: dict[str, Any]) -> Path:
    """As MATLAB 7.3 writes: columns as rows, classes as attributes, a block of 512 bytes before."""

    def put(group: Any, name: str, value: Any) -> None:
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, part in value.items():
                put(inner, key, part)
        elif isinstance(value, list):  # an array of structs: for each field references to its values
            inner, kept = group.create_group(name), group.file.require_group("#refs#")
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key in value[0]:
                field = inner.create_dataset(key, (len(value), 1), dtype=h5py.ref_dtype)
                for k, one in enumerate(value):
                    put(kept, f"{name}{key}{k}", one[key])
                    field[k, 0] = kept[f"{name}{key}{k}"].ref
        elif isinstance(value, str):
            item = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            item.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            array = np.atleast_2d(np.asarray(value, dtype=float))
            array = array if array.shape[0] != 1 or array.size == 1 else array.T
            group.create_dataset(name, data=array.T).attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in content.items():
            put(file, name, value)
    with path.open("r+b") as stream:
        stream.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<HH", 0x0200, 0x4D49)
        )
    return path


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_matlab_arrays_structs_and_exported_series(tmp_path: Path, version: str) -> None:
    path = tmp_path / "log.mat"
    if version == "5":
        scipy.io.savemat(path, matlab_content())
    else:
        write_hdf5(path, matlab_content())
    columns = read_table(path).columns
    for name, values in EXPECTED.items():
        known = columns[name][np.isfinite(columns[name])]
        assert np.allclose(known, values), name
    assert np.allclose(columns["time"], TIME)
    assert "single" not in columns


def test_matlab_structure_with_time_and_a_dataset_as_exported(tmp_path: Path) -> None:
    signals = [
        {"values": SPEED, "dimensions": 1.0, "label": "ground_speed", "blockName": "car/v"},
        *({"values": SPEED / 0.2 + k, "dimensions": 1.0, "label": f"omega_{w}", "blockName": ""}
          for k, w in enumerate(("fl", "fr", "rl", "rr"))),
    ]  # fmt: skip
    elements = [{"Name": "drawbar", "Values": {"Time": TIME[::2], "Data": 100 * SPEED[::2]}}]
    scipy.io.savemat(
        tmp_path / "run.mat", {"yout": {"time": TIME, "signals": signals}, "logsout": {"elements": elements}}
    )
    recording = read(tmp_path / "run.mat", "simulink")
    assert np.allclose(recording["ground_speed"], SPEED)
    assert np.allclose(recording["wheel_speed_rl"], SPEED / 0.2 + 2)
    assert np.allclose(recording["drawbar_force"][::2], 100 * SPEED[::2])


TABLES = """
import sys
import matio, numpy as np, pandas as pd
t, v = np.arange(200) / 20, np.arange(200.0)
spans = pd.Index(pd.to_timedelta(t, unit="s").as_unit("ms"), name="Time")
run = pd.DataFrame({"ground_speed": v, "gear": np.arange(200) % 3}, index=spans)
table = pd.DataFrame({"t": t[:50], "pull": 2 * v[:50]})
matio.save_to_mat(sys.argv[1], {"run": run, "table": table}, version=sys.argv[2])
"""


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_matlab_tables_and_timetables(tmp_path: Path, version: str) -> None:
    # In a process of its own: importing mat-io changes how pandas behaves.
    path = tmp_path / "log.mat"
    subprocess.run([sys.executable, "-W", "ignore", "-c", TABLES, str(path), version], check=True)
    table = read_table(path)
    assert np.array_equal(table.columns["run.ground_speed"], np.arange(COUNT))
    assert np.allclose(table.columns["time"], TIME)
    pull = table.columns["table.pull"]
    assert np.array_equal(pull[np.isfinite(pull)], 2 * np.arange(50))
    assert not table.notes


def test_matlab_objects_are_named_with_the_way_out(tmp_path: Path) -> None:
    path = write_hdf5(tmp_path / "log.mat", {"t": TIME, "v": SPEED})
    with h5py.File(path, "r+") as file:
        item = file.create_dataset("tt", data=np.zeros((1, 6), np.uint32))
        item.attrs["MATLAB_class"] = np.bytes_("timetable")
        item.attrs["MATLAB_object_decode"] = np.int32(3)
    table = read_table(path)
    assert "v" in table.columns
    assert any("left out: tt (timetable); save it from MATLAB" in note for note in table.notes)


def test_a_matrix_with_a_column_for_each_wheel_is_asked_about(tmp_path: Path) -> None:
    time = np.arange(0, 60, 0.1)
    log = {
        "time": time,
        "vGround": 2 + np.sin(time),
        "omega": np.column_stack([4 + np.sin(time + k) for k in range(4)]),
    }
    scipy.io.savemat(tmp_path / "run.mat", {"log": log})
    (sentence,) = (s for s in inspect(tmp_path / "run.mat").missing if "log.omega" in s)
    assert "'wheel_speed_fl: {from: \"log.omega[0]\"}'" in sentence


@pytest.mark.parametrize("inside", [False, True])
def test_the_columns_of_importdata_have_their_names(tmp_path: Path, inside: bool) -> None:
    """data[1], data[2] ... 'nothing that Terragrip knows', though their names stood beside them."""
    heads = np.array(["Time (s)", "GroundSpeed (mph)", "WheelSpeedRL (rpm)"], dtype=object)
    content = {"data": np.c_[TIME, SPEED, 10 * SPEED], "colheaders": heads, "textdata": heads}
    scipy.io.savemat(tmp_path / "log.mat", {"log": content} if inside else content)
    inspection = inspect(tmp_path / "log.mat")
    own = "log." * inside
    assert inspection.recognised["ground_speed"] == (f"{own}GroundSpeed",)
    assert inspection.recognised["wheel_speed_rl"] == (f"{own}WheelSpeedRL",)
    assert inspection.proposals["ground_speed"].unit == "mph"


def test_of_two_columns_of_importdata_with_one_name_none_is_used(tmp_path: Path) -> None:
    """The second was, without a word."""
    heads = np.array(
        ["Time (s)", "GroundSpeed (m/s)", "GroundSpeed (m/s)", "WheelSpeedRL (rpm)"], dtype=object
    )
    content = {"data": np.c_[TIME, SPEED, 2 * SPEED, 10 * SPEED], "colheaders": heads}
    scipy.io.savemat(tmp_path / "log.mat", content)
    inspection = inspect(tmp_path / "log.mat")
    assert "ground_speed" not in inspection.recognised
    assert sum("occur twice are left out: GroundSpeed" in one for one in inspection.warnings) == 1


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_the_export_of_dspace_controldesk(tmp_path: Path, version: str) -> None:
    """``X`` are time vectors, ``Y`` signals, each with the number of its own, counted from 1 (data.X.Data, data.Y(k).Name, .XIndex)."""
    clocks = [TIME, TIME[::10]]
    signals = [
        ("Model Root/Wheels/wheel_speed_l/Out1", 30 * SPEED, "rpm", 1),
        ('"Model Root"/"Wheels"/"wheel_speed_r"', 31 * SPEED, "rpm", 1),
        ("Model Root/GNSS/ground_speed/Out1", 3.6 * SPEED[::10], "km/h", 2),
        ("Model Root/broken/Out1", SPEED[:7], "", 1),
    ]
    x = [{"Name": "", "Data": clock} for clock in clocks]
    y = [{"Name": n, "Data": d, "Unit": u, "XIndex": np.array([i])} for n, d, u, i in signals]
    path = tmp_path / "rec.mat"
    if version == "5":
        scipy.io.savemat(path, {"rec": {"X": structs(x), "Y": structs(y), "Capture": "c"}})
    else:
        write_hdf5(path, {"rec": {"X": x, "Y": y, "Capture": "c"}})
    seen = inspect(path)
    assert {c: p.entry for c, p in seen.proposals.items()} == {
        "wheel_speed_l": {"from": "rec.Model Root/Wheels/wheel_speed_l", "unit": "rpm"},
        "wheel_speed_r": {"from": "rec.Model Root/Wheels/wheel_speed_r", "unit": "rpm"},
        "ground_speed": {"from": "rec.Model Root/GNSS/ground_speed", "unit": "km/h"},
    }
    assert any(
        "another length than the time vector" in n and "rec.Model Root/broken" in n for n in seen.warnings
    )
    (tmp_path / "p.yaml").write_text(seen.profile)
    recording = read(path, tmp_path / "p.yaml")
    known = np.isfinite(recording["ground_speed"])
    np.testing.assert_allclose(recording.time[known], TIME[::10] - TIME[0])
    np.testing.assert_allclose(recording["ground_speed"][known], SPEED[::10])
    np.testing.assert_allclose(recording["wheel_speed_l"], SPEED * np.pi)


@pytest.mark.parametrize(
    "beside",
    [
        {"X": [{"Data": TIME}]},
        {"X": [{"Data": TIME}], "Y": SPEED},
        {"X": [{"Data": SPEED[0]}], "Y": [{"Name": "y", "Data": SPEED, "XIndex": np.array([1])}]},
    ],
)
def test_structs_that_only_resemble_controldesks_are_read_as_any_other(beside: dict[str, Any]) -> None:
    contents = Contents()
    walk({"rec": {"t": TIME, "v": SPEED, **beside}}, "", contents, 0)
    assert "rec.v" in contents.signals


@pytest.mark.parametrize(("index", "clock"), [(None, 0), (1, 0), (2, 1), (0, None), (3, None)])
def test_the_time_vector_of_a_controldesk_signal_is_that_of_its_number_or_the_first(
    index: int | None, clock: int | None
) -> None:
    contents, clocks = Contents(), [TIME, TIME + 0.05]
    signal = {"Data": SPEED} | ({} if index is None else {"XIndex": np.array([index])})
    walk({"rec": {"X": [{"Data": one} for one in clocks], "Y": [signal]}}, "", contents, 0)
    assert list(contents.signals) == ([] if clock is None else ["rec.Y[0]"])
    given = [contents.signals[name][0] for name in contents.signals]
    assert [id(one) for one in given] == ([] if clock is None else [id(clocks[clock])])
    left = [f"rec.Y[0] was left out: its XIndex is {index}, and there are 2 time vectors in X."]
    assert contents.notes == (left if clock is None else [])


def structs(parts: list[dict[str, Any]]) -> np.ndarray:
    """An array of structs, as SciPy writes one."""
    result = np.zeros((1, len(parts)), dtype=[(name, object) for name in parts[0]])
    for k, part in enumerate(parts):
        for name, value in part.items():
            result[0, k][name] = value
    return result


@pytest.mark.parametrize("names", ["varNames", "headers"])
def test_a_cell_of_names_names_the_columns_of_a_matrix_and_one_of_units_their_units(
    tmp_path: Path, names: str
) -> None:
    """data[1], data[2]: 'nothing that Terragrip knows', though names and units stood beside them."""
    content = {
        "M": np.c_[TIME, 3.6 * SPEED, 10 * SPEED],
        names: np.array(["time", "vGround", "omega_RL"], dtype=object),
        "varUnits": np.array(["s", "km/h", "rad/s"], dtype=object),
    }
    scipy.io.savemat(tmp_path / "log.mat", content)
    found = inspect(tmp_path / "log.mat").proposals
    assert found["ground_speed"].entry == {"from": "vGround", "unit": "km/h"}
    assert found["wheel_speed_rl"].columns == ("omega_RL",)


def test_wheels_names_name_the_columns_of_several_matrices_either_way_round(tmp_path: Path) -> None:
    wheels = np.array(["FL", "FR", "RL", "RR"], dtype=object)
    speeds = np.column_stack([SPEED + k for k in range(4)])
    content = {"t": TIME, "v_x": SPEED, "omega": speeds, "torque": 9 * speeds.T, "wheels": wheels}
    scipy.io.savemat(tmp_path / "log.mat", content)
    found = inspect(tmp_path / "log.mat").recognised
    assert found["wheel_speed_fr"] == ("omega_FR",)
    assert found["drive_torque_rl"] == ("torque_RL",)


def test_a_label_for_each_instant_names_no_columns(tmp_path: Path) -> None:
    content = {"t": TIME, "omega": np.c_[SPEED, SPEED + 1], "soil": np.array(["clay"] * COUNT, dtype=object)}
    scipy.io.savemat(tmp_path / "log.mat", content)
    table = read_table(tmp_path / "log.mat")
    assert {"omega[0]", "omega[1]", "soil"} <= set(table.columns)


def test_texts_beside_a_matrix_that_are_no_names_of_columns_leave_it_as_it_is(tmp_path: Path) -> None:
    """Rims became clay and sand; and under names that are those of vectors the rims were time."""
    pair = np.c_[SPEED, 2 * SPEED]
    for key, texts, expected in (
        ("soils", ["clay", "sand"], {"omega[0]", "omega[1]"}),
        ("wheels", ["v", "t"], {"omega_v", "omega_t"}),
    ):
        content = {"t": TIME, "v": SPEED, "omega": pair, key: np.array(texts, dtype=object)}
        scipy.io.savemat(tmp_path / "log.mat", content)
        table = read_table(tmp_path / "log.mat")
        assert set(table.columns) == {"time", "v", *expected}
        assert np.allclose(table.columns["time"], TIME)


def test_a_clock_of_seconds_since_a_start_a_week_ago_is_no_datenum(tmp_path: Path) -> None:
    """At 200 Hz seconds were read as days."""
    time = 735_000 + np.arange(400) / 200
    scipy.io.savemat(tmp_path / "log.mat", {"t": time, "v": np.ones(400)})
    assert np.ptp(read_table(tmp_path / "log.mat").columns["time"]) == pytest.approx(399 / 200)
