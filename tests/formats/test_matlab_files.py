"""MATLAB files as people save them: names that differ in case, structs below their time vector, and files by MATLAB itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read, read_table
from terragrip.formats.matlab_objects import plain
from test_matlab_exports import write_hdf5

TIME = np.arange(200) / 20
SPEED = 1 + 0.2 * np.sin(TIME)
HOT = 40 - 0.01 * TIME


def saved(path: Path, version: str, content: dict[str, object]) -> Path:
    if version == "5":
        scipy.io.savemat(path, content)
        return path
    return write_hdf5(path, content)


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize(("first", "second"), [("t", "T"), ("T", "t"), ("Time", "TIME")])
def test_of_names_that_differ_in_case_the_one_that_runs_forward_is_time(
    tmp_path: Path, version: str, first: str, second: str
) -> None:
    table = read_table(saved(tmp_path / "log.mat", version, {first: TIME, second: HOT, "v": SPEED}))
    assert np.allclose(table.columns["time"], TIME)
    assert np.allclose(table.columns["v"], SPEED)
    assert np.allclose(table.columns[second], HOT)
    assert any(f"{first} is used as time; {second} is a signal" in note for note in table.notes)


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_a_time_vector_serves_the_structs_below_it(tmp_path: Path, version: str) -> None:
    log = {
        "t": TIME,
        "front": {"v": SPEED, "deep": {"w": 2 * SPEED}},
        "other": {"t": TIME[::2], "u": SPEED[::2]},
    }
    table = read_table(saved(tmp_path / "log.mat", version, {"log": log}))
    assert np.allclose(table.columns["log.front.v"], SPEED)
    assert np.allclose(table.columns["log.front.deep.w"], 2 * SPEED)
    assert np.allclose(table.columns["log.other.u"][::2], SPEED[::2])  # its own time comes first


@pytest.mark.parametrize("packed", [False, True])
def test_numbers_of_any_class_agree_with_scipy(tmp_path: Path, packed: bool) -> None:
    kinds = ("int8", "uint16", "int32", "uint64", "float32", "float64")
    content = {"t": TIME, "text": "hällo", "empty": np.empty((0, 3)), "flag": np.array([[True]])}
    content |= {kind: np.arange(len(TIME)).astype(kind) for kind in kinds}
    content["matrix"] = np.arange(600.0).reshape(-1, 3)
    scipy.io.savemat(tmp_path / "log.mat", content, do_compression=packed)
    oracle, columns = scipy.io.loadmat(tmp_path / "log.mat"), read_table(tmp_path / "log.mat").columns
    for kind in kinds:
        assert np.array_equal(columns[kind], oracle[kind].ravel().astype(np.float64))
    assert np.array_equal(columns["matrix[2]"], oracle["matrix"][:, 2])
    assert set(columns) == {"time", *kinds, *(f"matrix[{k}]" for k in range(3))}


@pytest.mark.parametrize("version", ["v7", "v73"])
def test_tables_and_timetables_that_matlab_wrote(shared: Callable[[str], Path], version: str) -> None:
    table = read_table(shared("data/ingest_samples/matlab") / f"test_tables_{version}.mat")
    expected = {"timetable_duration.data1": [1, 2, 3], "timetable_datetime.data1": [1, 2, 3]}
    for name, values in expected.items():
        column = table.columns[name]
        assert column[np.isfinite(column)].tolist() == values
    left_out = next(note for note in table.notes if "There is no time vector" in note)
    assert "table_numeric.Var1" in left_out
    assert not any("MATLAB alone" in note for note in table.notes)


@pytest.mark.parametrize("version", ["v7", "v73"])
def test_one_span_of_the_calendar_does_not_hide_the_other_variables(
    shared: Callable[[str], Path], version: str
) -> None:
    table = read_table(shared("data/ingest_samples/matlab") / f"test_time_{version}.mat")
    assert "dt_vector" in table.columns
    assert any("calendarDuration" in note for note in table.notes)


def test_plain_arrays_that_matlab_wrote(shared: Callable[[str], Path]) -> None:
    table = read_table(shared("data/ingest_samples/matlab") / "test_basic_v7.mat")
    (text,) = table.notes
    assert "complex_array (complex)" in text  # its real part alone would be silently wrong
    assert "struct" not in text.partition(":")[2].partition(";")[0]
    with pytest.raises(InputError, match="has no numeric column"):
        read_table(shared("data/ingest_samples/matlab") / "test_string_v7.mat")


def test_a_vector_of_another_length_than_time_is_named(tmp_path: Path) -> None:
    """Left out in silence, the pull of a log is a vehicle that tows nothing."""
    time = np.arange(50) / 10
    content = {"t": time, "v": 1 + time, "gains": np.ones(3)}
    scipy.io.savemat(tmp_path / "log.mat", {**content, "drawbar_force": np.ones(51)})
    table = read_table(tmp_path / "log.mat")
    assert "drawbar_force" not in table.columns
    assert any("(50) were left out: drawbar_force (51)." in note for note in table.notes)
    scipy.io.savemat(tmp_path / "log.mat", {"t": time, "v": np.ones(51)})
    with pytest.raises(InputError, match=r"time vector beside them \(50\) were left out: v \(51\)"):
        read_table(tmp_path / "log.mat")


@pytest.mark.parametrize("word", ["Unit", "units", "DataUnits"])
def test_the_unit_of_a_struct_with_time_and_data_is_used(tmp_path: Path, word: str) -> None:
    series = {"Time": np.arange(50) / 10, "Data": np.full(50, 7.2), word: "km/h"}
    scipy.io.savemat(tmp_path / "log.mat", {"ground_speed": series})
    assert read_table(tmp_path / "log.mat").units == {"ground_speed": "km/h"}


def test_our_own_names_in_a_struct_are_proposed(tmp_path: Path) -> None:
    time = np.arange(300) / 10
    speed = 1 + 0.3 * np.sin(time)
    names = ("wheel_speed_l", "wheel_speed_r", "drive_torque_l", "drive_torque_r", "drawbar_force")
    content = {"time": time, "ground_speed": speed, **dict.fromkeys(names, 5 * speed)}
    scipy.io.savemat(tmp_path / "log.mat", {"log": {"run": content}})
    proposals = inspect(tmp_path / "log.mat").proposals
    assert {name: proposals[name].entry["from"] for name in names} == {
        name: f"log.run.{name}" for name in names
    }


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_a_matrix_may_have_its_signals_in_rows_and_time_along_its_last_axis(
    tmp_path: Path, version: str
) -> None:
    """MATLAB's row vectors; Simulink's signals of two dimensions. Left out in silence, they were no wheels."""
    both = np.stack([SPEED, HOT])
    content = {
        "t": TIME.reshape(1, -1),
        "rows": both,
        "wide": np.tile(SPEED[:, None], 40),
        "cube": both.reshape(2, 1, -1),
    }
    table = read_table(saved(tmp_path / "log.mat", version, content | {"image": np.ones((300, len(TIME)))}))
    for name in ("rows", "cube"):
        assert np.array_equal([table.columns[f"{name}[{k}]"] for k in range(2)], both)
    assert np.array_equal(table.columns["wide[39]"], SPEED)
    assert any("image has 300 numbers for each instant" in note for note in table.notes)


@pytest.mark.parametrize("columns", [False, True])
def test_simulinks_to_file_block_writes_time_as_the_first_row(tmp_path: Path, columns: bool) -> None:
    matrix = np.stack([TIME, SPEED, HOT])
    scipy.io.savemat(
        tmp_path / "log.mat", {"ans": matrix.T if columns else matrix, "K": np.ones(3)}, format="4"
    )
    table = read_table(tmp_path / "log.mat")
    assert set(table.columns) == {"time", "ans[1]", "ans[2]"}
    assert np.array_equal(table.columns["ans[2]"], HOT)
    assert np.allclose(table.columns["time"], TIME)
    assert any("of ans is used as time" in note for note in table.notes)


@pytest.mark.parametrize("main", ["t", "t_wheels"])
def test_vectors_at_two_rates_beside_two_time_vectors(tmp_path: Path, main: str) -> None:
    content = {main: TIME, "w": SPEED, "t_gps": TIME[::4], "v_gps": SPEED[::4]}
    scipy.io.savemat(tmp_path / "log.mat", content)
    table = read_table(tmp_path / "log.mat")
    assert np.allclose(table.columns["w"], SPEED)
    assert np.array_equal(table.columns["v_gps"][::4], SPEED[::4])
    assert np.isfinite(table.columns["v_gps"]).sum() == len(TIME[::4])


def test_vectors_of_another_length_are_named_where_nothing_is_time(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "log.mat", {"w": SPEED, "x": HOT, "v": SPEED[::4], "K": np.ones(3)})
    (note,) = read_table(tmp_path / "log.mat").notes
    assert "others were left out: v (50)" in note


OURS = {"ground_speed": 3.6 * SPEED, "wheel_speed_l": 5 * SPEED, "wheel_speed_r": 5 * SPEED}


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("nested", [False, True], ids=["beside", "around"])
def test_a_struct_of_units_beside_the_signals_is_used(tmp_path: Path, version: str, nested: bool) -> None:
    """km/h were m/s without a word, and milliseconds seconds."""
    units = {"units": {"ground_speed": "km/h", "t": "ms", "wheel_speed_l": ""}}
    signals = {"t": 1000 * TIME, **OURS}
    path = saved(
        tmp_path / "log.mat", version, {"log": signals, **units} if nested else {"log": {**signals, **units}}
    )
    table = read_table(path)
    assert table.units == {"log.ground_speed": "km/h"}
    assert np.allclose(table.columns["time"], TIME)
    names = {name: f"log.{name}" for name in OURS}
    assert np.allclose(read(path, Profile.from_dict({"channels": names}))["ground_speed"], SPEED)


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_a_struct_of_units_counts_for_series_with_time_and_data(tmp_path: Path, version: str) -> None:
    series = {"ground_speed": {"Time": TIME, "Data": 3.6 * SPEED}}
    table = read_table(saved(tmp_path / "log.mat", version, {**series, "units": {"ground_speed": "km/h"}}))
    assert table.units == {"ground_speed": "km/h"}


@pytest.mark.parametrize("version", ["v7", "v73"])
def test_the_units_of_a_tables_variables_are_used(shared: Callable[[str], Path], version: str) -> None:
    table = read_table(shared("data/ingest_samples/matlab") / f"test_tables_{version}.mat")
    assert table.units == {"timetable_with_attrs.data1": "m/s"}


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("kind", ["cell", "char", "one text"])
def test_labels_are_read(tmp_path: Path, version: str, kind: str) -> None:
    """They were left out without a word, and the log was unlabelled."""
    soil = ["grass"] * 100 + ["sand"] * 98 + ["", "clay"]
    content: dict[str, object] = {"t": TIME, **OURS}
    path = tmp_path / "log.mat"
    if kind == "one text":
        soil = ["grass"] * len(TIME)
        saved(path, version, {**content, "soil": "grass"})
    elif version == "5":
        scipy.io.savemat(path, {**content, "soil": np.array(soil, dtype=object if kind == "cell" else "U")})
    else:
        write_hdf5(path, content)
        with h5py.File(path, "a") as file:
            codes = [np.array([[ord(c)] for c in text.ljust(5)], dtype=np.uint16) for text in soil]
            if kind == "char":
                dataset = file.create_dataset("soil", data=np.hstack(codes))
                dataset.attrs["MATLAB_class"] = np.bytes_("char")
            else:
                refs = file.create_dataset("soil", (1, len(soil)), dtype=h5py.ref_dtype)
                refs.attrs["MATLAB_class"] = np.bytes_("cell")
                for k, one in enumerate(codes):
                    text = file.create_dataset(f"#refs#/s{k}", data=one)
                    text.attrs["MATLAB_class"] = np.bytes_("char")
                    refs[0, k] = text.ref
    assert (
        read(path, Profile.from_dict({"time": {"from": "time"}, "channels": {n: n for n in (*OURS, "soil")}}))
        .labels["soil"]
        .tolist()
        == soil
    )


def test_labels_of_a_categorical_and_of_a_tables_column_are_read() -> None:
    labels = pd.Categorical(["grass", None, "sand"])
    frame = pd.DataFrame({"v": [1.0, 2, 3], "soil": labels, "w": ["a", "b", "c"]})
    frame.attrs["VariableUnits"] = ["km/h", "", ""]
    table = plain(frame)
    assert (table["soil"], table["w"]) == (["grass", "", "sand"], ["a", "b", "c"])
    assert table["units"] == {"v": "km/h", "soil": "", "w": ""}
    assert plain(labels) == ["grass", "", "sand"]


@pytest.mark.sample(5)
@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize(
    ("channel", "length"), [("ground_speed", 199), ("wheel_speed_r", 199), ("drawbar_force", 40)]
)
def test_a_channel_of_another_length_than_time_is_refused(
    tmp_path: Path, version: str, channel: str, length: int
) -> None:
    """It was 'missing', and a torque or a pull was none, with a note."""
    content = {"t": TIME, **OURS, channel: SPEED[:length], "gains": np.ones(3)}
    path = saved(tmp_path / "log.mat", version, content)
    with pytest.raises(
        InputError, match=f"signal {channel}: has {length} samples, and the time vector besid"
    ):
        read(path)


def test_a_signal_whose_name_has_its_unit_is_hinted_at(tmp_path: Path) -> None:
    own = {("ground_speed_kmh" if n == "ground_speed" else n): values for n, values in OURS.items()}
    scipy.io.savemat(tmp_path / "log.mat", {"t": TIME, **own})
    with pytest.raises(InputError, match=r"'ground_speed: \{from: ground_speed_kmh, unit: kmh\}'"):
        read(tmp_path / "log.mat")


def test_our_own_estimates_are_no_log(tmp_path: Path) -> None:
    names = ("time", "ground_speed", "ground_speed_std", "distance", "event")
    scipy.io.savemat(tmp_path / "e.mat", {"estimates": dict.fromkeys(names, SPEED), "units": {"time": "s"}})
    for reader in (read, inspect):
        with pytest.raises(InputError, match=r"e\.mat: holds estimates, not a log"):
            reader(tmp_path / "e.mat")


@pytest.mark.parametrize("unit", [np.array(["km/h"], dtype=h5py.string_dtype()), np.array([b"km/h"])])
def test_a_unit_may_be_an_array_of_one_text(tmp_path: Path, unit: np.ndarray) -> None:
    """As netCDF's library writes a string: km/h were m/s without a word."""
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in {"time": TIME, **OURS}.items():
            file.create_dataset(name, data=values)
        file["ground_speed"].attrs["units"] = unit
    assert read_table(tmp_path / "log.h5").units == {"ground_speed": "km/h"}


def test_packed_numbers_of_netcdf_are_unpacked_and_fill_values_are_missing(tmp_path: Path) -> None:
    """A speed packed into 16 bits was 30 000 km/h, in the unit beside it; a fill value of -1 was a speed."""
    stored = np.round(SPEED / 3e-4).astype(np.int16)
    stored[5] = -32768
    with h5py.File(tmp_path / "log.nc", "w") as file:
        for name, values in {"time": TIME, **OURS}.items():
            file.create_dataset(name, data=stored if name == "ground_speed" else values)
        speed, wheel = file["ground_speed"], file["wheel_speed_l"]
        speed.attrs.update(
            scale_factor=3e-4, add_offset=np.array([2.0]), _FillValue=np.array([-32768], np.int16)
        )
        wheel.attrs["missing_value"] = wheel[7]
    found = read_table(tmp_path / "log.nc").columns
    assert np.flatnonzero(np.isnan(found["ground_speed"])).tolist() == [5]
    assert np.allclose(np.delete(found["ground_speed"], 5), np.delete(SPEED + 2, 5), atol=2e-4)
    assert np.isnan(found["wheel_speed_l"][7])


@pytest.mark.parametrize(
    ("attribute", "missing"), [(-999.9, [3, 9]), (np.array([-999.9, -888.8]), [3, 5, 9])], ids=["one", "two"]
)
def test_fill_values_beside_single_numbers_are_missing(
    tmp_path: Path, attribute: float | np.ndarray, missing: list[int]
) -> None:
    """-999.9, which a script writes as a double, is no single number: it was a speed; so were several missing values."""
    stored = SPEED.astype(np.float32)
    stored[[3, 9]], stored[5] = -999.9, -888.8
    with h5py.File(tmp_path / "log.nc", "w") as file:
        for name, values in {"time": TIME, **OURS}.items():
            file.create_dataset(name, data=stored if name == "ground_speed" else values)
        file["ground_speed"].attrs["missing_value"] = attribute
    found = read_table(tmp_path / "log.nc").columns["ground_speed"]
    assert np.flatnonzero(np.isnan(found)).tolist() == missing


def test_attributes_that_nothing_reads_are_left_alone(tmp_path: Path) -> None:
    """One of a kind that h5py does not have made a file 'damaged'."""
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in {"time": TIME, **OURS}.items():
            file.create_dataset(name, data=values)
        scalar = h5py.h5s.create(h5py.h5s.SCALAR)
        h5py.h5a.create(file["ground_speed"].id, b"when", h5py.h5t.UNIX_D32LE, scalar)
    assert np.array_equal(read_table(tmp_path / "log.h5").columns["ground_speed"], OURS["ground_speed"])


@pytest.mark.parametrize(
    ("nested", "key"), [("", "units"), ("log/", "units"), ("", "unit"), ("log/", "Unit")]
)
def test_units_among_the_attributes_of_hdf5_are_used(tmp_path: Path, nested: str, key: str) -> None:
    """As netCDF and xarray write them; km/h were m/s and milliseconds seconds without a word. A test bench has 'unit'."""
    path = tmp_path / "log.h5"
    units = {"ground_speed": "km/h", "time": np.bytes_("ms"), "latitude": "degrees_north"}
    with h5py.File(path, "w") as file:
        for name, values in {"time": 1000 * TIME, **OURS, "latitude": 50 + 0 * TIME}.items():
            dataset = file.create_dataset(nested + name, data=values)
            if name in units:
                dataset.attrs[key] = units[name]
    table = read_table(path)
    prefix = nested.replace("/", ".")
    assert table.units == {f"{prefix}ground_speed": "km/h", f"{prefix}latitude": "degrees"}
    assert np.allclose(table.columns["time"], TIME)
    if not nested:
        assert np.allclose(read(path)["ground_speed"], SPEED)
