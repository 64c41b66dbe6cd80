"""Objects in MATLAB files: timeseries, Simulink's Dataset and SimulationOutput, datetime.

MATLAB itself is not at hand. The files are written by mat-io's own writer, in the MCOS layout that MATLAB writes, with the
properties that MATLAB's classes have (see `terragrip.formats.matlab_objects`).
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.formats import inspect
from terragrip.formats.matlab_objects import plain
from terragrip.formats.matlab_values import Opaque
from terragrip.formats.reading import read_table
from test_damage import damaged

COUNT = 200
TIME = np.arange(COUNT) / 20
SPEED = 1 + 0.2 * np.sin(TIME)
WHEELS = ("fl", "fr", "rl", "rr")

# In a process of its own: importing mat-io changes how pandas behaves.
WRITE = """
import sys
import matio, numpy as np
from matio.utils.matclass import MatlabOpaque as Object

t = np.arange(200) / 20
speed = 1 + 0.2 * np.sin(t)

def struct(**fields):
    made = np.empty((1, 1), dtype=[(name, object) for name in fields])
    for name, value in fields.items():
        made[0, 0][name] = value
    return made

def cell(*parts):
    made = np.empty((1, len(parts)), dtype=object)
    made[0, :] = parts
    return made

def series(data, time=None, unit="", ticks="seconds", step=0.05):
    about = {"Units": ticks, "StartDate": "", "Length": float(len(t))}
    if time is None:
        about |= {"Start_": 0.0, "Increment_": step, "Time_": np.empty((0, 0))}
    else:
        about |= {"Start_": np.empty((0, 0)), "Increment_": np.empty((0, 0)), "Time_": time.reshape(-1, 1)}
    return Object({"Name": "", "Data_": data, "TimeInfo": Object(about, "tsdata.timemetadata"),
                   "DataInfo": Object({"Units": unit}, "tsdata.datametadata"), "IsTimeFirst_": True}, "timeseries")

def signal(name, values, path="car/block"):
    block = Object({"Path": cell(path)}, "Simulink.SimulationData.BlockPath")
    return Object({"Name": name, "PropagatedName": "", "BlockPath": block, "Values": values, "PortIndex": 1.0},
                  "Simulink.SimulationData.Signal")

unit = Object({"Name": "km/h"}, "Simulink.SimulationData.Unit")
bus = struct(**{f"omega_{w}": series((speed / 0.2 + k).reshape(-1, 1)) for k, w in enumerate(("fl", "fr", "rl", "rr"))})
elements = cell(
    signal("ground_speed", series((3.6 * speed).reshape(1, 1, -1), unit=unit)),
    signal("wheels", bus),
    signal("", series((100 * speed[::2]).reshape(-1, 1), t[::2]), "car/hitch/drawbar"),
)
records = []

def record(values):
    records.append(values)
    return float(len(records) - 1)

def leaf(data, time=None, unit="", kind="double", width=1, **attributes):
    clock = dict(CompressedTime=np.array([[0.0, 0.05, float(len(t))]]), TimeR2=np.empty((0, 0)))
    if time is not None:
        clock = dict(CompressedTime=np.empty((0, 0)), TimeR2=record(time))
    about = struct(Dimension=np.array([[width]], np.uint32), Complexity=np.array([[False]]), ClassName=kind, **attributes)
    return struct(LeafMarker=chr(65279), ElementType="timeseries", IsEmpty=np.array([[False]]), Name="own",
                  TimeUnits=struct(Class="char", Value="seconds"), Time=np.empty((0, 0)), DataR2=record(data),
                  DataUnits=struct(Class="Simulink.SimulationData.Unit", Value=unit), SignalAttributes=about, **clock)

def saved(name, values, path="car/block"):
    return struct(ElementType="signal", Name=name, PropagatedName="", BlockPath=cell(path), PortIndex=1.0, Values=values)

if len(sys.argv) > 3:
    fixed = struct(isSigned=np.array([[True]]), WordLength=np.array([[16]], np.int32), SlopeAdjustmentFactor=1.0,
                   Exponent=np.array([[-8]], np.int32), Bias=2.0)
    bus = struct(**{f"omega_{w}": leaf(speed / 0.2 + k) for k, w in enumerate(("fl", "fr", "rl", "rr"))})
    elements = cell(
        saved("ground_speed", leaf((3.6 * speed).astype("f4"), unit="km/h", kind="single")),
        saved("wheels", bus),
        saved("", leaf(100 * speed[::2], t[::2]), "car/hitch/drawbar"),
        saved("pair", leaf(np.c_[speed, 3 * speed], width=2)),
        saved("raw", leaf(np.arange(200, dtype="i2"), kind="fixed-point", ResolvedClassName="int16", FixedPointParameters=fixed)),
        saved("lost", leaf(speed)),
        saved("sub", leaf(speed)),
    )
    inner = cell(saved("deep", leaf(speed)))
    elements[0, -1] = struct(ElementType="dataset", Name="sub", Values=inner)
    lost = len(records) - 3
kind = "Simulink.SimulationData.Storage." + ("MatFileDatasetStorage" if len(sys.argv) > 3 else "RamDatasetStorage")
storage = Object({"any": struct(Version=2.0, Elements=elements)}, kind)
dataset = Object({"any": struct(Name="logsout", Version=3.0, Storage=storage)}, "Simulink.SimulationData.Dataset")
out = Object({"Data": struct(tout=t.reshape(-1, 1), yout=np.c_[speed, 2 * speed], logsout=dataset)}, "Simulink.SimulationOutput")
content = {
    "out": out,
    "ts": series(np.c_[speed, 5 * speed], 1000 * t, "m/s", "milliseconds"),
    "odd": Object({"x": 1.0}, "my.Vehicle"),
    "when": (np.datetime64("2026-05-01T06:00:00", "ms") + np.round(1000 * t[:50]).astype("timedelta64[ms]")).reshape(-1, 1),
}
if len(sys.argv) > 3:
    content = {"logsout": dataset, "ts": content["ts"]}
saved_classes = ["Simulink.SimulationData.Dataset", kind]
matio.save_to_mat(sys.argv[1], content, version=sys.argv[2], saveobj_classes=saved_classes)
if records:
    import h5py
    with h5py.File(sys.argv[1], "a") as file:
        stream = file.create_group("#sigstream#")
        stream["#nRecords#"] = np.array([len(records)], np.uint64)
        for number, values in enumerate(records):
            if number != lost:
                one = stream.create_group(str(number))
                one["#data#"] = np.frombuffer(values.tobytes(), np.uint8)
                one["#length#"] = np.array([len(values)], np.uint64)
                one["#sampleSize#"] = np.array([values.nbytes // len(values)], np.uint64)
"""


def write(path: Path, version: str, *records: str) -> Path:
    subprocess.run([sys.executable, "-W", "ignore", "-c", WRITE, str(path), version, *records], check=True)
    return path


@pytest.fixture(scope="module", params=["v7", "v7.3"])
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("matlab") / "run.mat", request.param)


def test_a_dataset_and_a_timeseries_are_read_as_such(log: Path) -> None:
    table = read_table(log)
    columns = table.columns
    assert np.allclose(known(columns["out.logsout.ground_speed"]), 3.6 * SPEED)
    assert table.units["out.logsout.ground_speed"] == "km/h"
    for k, wheel in enumerate(WHEELS):
        assert np.allclose(known(columns[f"out.logsout.wheels.omega_{wheel}"]), SPEED / 0.2 + k)
    assert np.allclose(known(columns["out.logsout.drawbar"]), 100 * SPEED[::2])  # by its block's name
    assert np.allclose(known(columns["out.yout[1]"]), 2 * SPEED)
    assert np.allclose(known(columns["ts[1]"]), 5 * SPEED)
    assert table.units["ts[1]"] == "m/s"
    assert np.allclose(columns["time"], TIME)
    assert any("left out: odd" in note for note in table.notes)


def test_the_shipped_profile_makes_a_recording_of_it(log: Path) -> None:
    recording = tg.read(log, "simulink")
    assert recording.wheels == WHEELS
    assert np.allclose(recording["ground_speed"], SPEED)
    assert np.allclose(recording["wheel_speed_rr"], SPEED / 0.2 + 3)
    assert np.allclose(recording["drawbar_force"][::2], 100 * SPEED[::2])
    assert inspect(log).fitting == ("simulink",)


def test_a_dataset_saved_with_v73_is_read_from_its_records(tmp_path: Path) -> None:
    log = write(tmp_path / "run.mat", "v7.3", "records")
    table = read_table(log)
    columns = table.columns
    assert np.allclose(known(columns["logsout.ground_speed"]), 3.6 * SPEED, rtol=1e-6)  # of single precision
    assert table.units["logsout.ground_speed"] == "km/h"
    for k, wheel in enumerate(WHEELS):
        assert np.allclose(known(columns[f"logsout.wheels.omega_{wheel}"]), SPEED / 0.2 + k)
    assert np.allclose(
        columns["logsout.drawbar"][::2], 100 * SPEED[::2]
    )  # by its block's name, on a clock of its own
    assert np.isnan(columns["logsout.drawbar"][1::2]).all()
    assert np.allclose(columns["logsout.pair[1]"], 3 * SPEED)
    assert np.allclose(columns["logsout.raw"], np.arange(COUNT) / 256 + 2)
    assert np.allclose(columns["logsout.sub.deep"], SPEED)
    assert np.allclose(columns["ts[1]"], 5 * SPEED)  # an object beside it
    assert np.allclose(columns["time"], TIME)
    assert len(table.notes) == 1  # of the record that is not there
    assert "The samples of logsout.lost are in records that cannot be read here" in table.notes[0]
    assert "save('log.mat', 'logsout', '-v7')" in table.notes[0]
    recording = tg.read(log, "simulink")
    assert np.allclose(recording["ground_speed"], SPEED, rtol=1e-6)


def test_damaged_objects_are_read_or_refused_in_one_line(log: Path, tmp_path: Path) -> None:
    whole, refusals = log.read_bytes(), []
    for seed in (1, 3):  # each starts a process
        target = tmp_path / "damaged.mat"
        target.write_bytes(damaged(whole, seed))
        try:
            read_table(target)
        except InputError as error:
            refusals.append(str(error))
    assert not any("\n" in text for text in refusals)


def test_a_regular_clock_asks_for_no_more_than_the_data_have() -> None:
    data = np.ones((3, 1))
    for count, expected in ((3.0, True), (4e9, False), (np.nan, False)):
        about = {"Start_": np.zeros((1, 1)), "Increment_": np.ones((1, 1)), "Length": np.array([[count]])}
        result = plain(thing("timeseries", {"Data_": data, "TimeInfo": thing("tsdata.timemetadata", about)}))
        assert (result == Opaque("timeseries")) is not expected


def test_objects_that_refer_to_each_other_end() -> None:
    first: dict[str, Any] = {}
    second = {"a": thing("h", first), "b": thing("h", first)}
    first |= {"a": thing("h", second), "b": thing("h", second), "c": thing("h", second)}
    assert isinstance(plain(thing("h", first)), dict)


def thing(classname: str, properties: dict[str, Any]) -> Any:
    return SimpleNamespace(classname=classname, properties=properties)


def known(column: Any) -> Any:
    return column[np.isfinite(column)]
