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
from terragrip.formats.mat5 import Opaque
from terragrip.formats.matlab_objects import plain
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
if len(sys.argv) > 3:
    elements[0, 0] = struct(ElementType="signal", Name="v", Values=struct(DataR2=7.0, TimeR2=8.0))
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
saved = ["Simulink.SimulationData.Dataset", kind]
matio.save_to_mat(sys.argv[1], content, version=sys.argv[2], saveobj_classes=saved)
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
    assert len(table.notes) == 1
    assert "left out: odd (without a series)" in table.notes[0]


def test_the_shipped_profile_makes_a_recording_of_it(log: Path) -> None:
    recording = tg.read(log, "simulink")
    assert recording.wheels == WHEELS
    assert np.allclose(recording["ground_speed"], SPEED)
    assert np.allclose(recording["wheel_speed_rr"], SPEED / 0.2 + 3)
    assert np.allclose(recording["drawbar_force"][::2], 100 * SPEED[::2])
    assert inspect(log).fitting == ("simulink",)


def test_a_dataset_in_records_of_its_own_is_named_with_the_way_out(tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "run.mat", "v7.3", "records"))
    assert "ts[0]" in table.columns
    assert any("save it there by save('log.mat', 'logsout', '-v7')" in note for note in table.notes)


def test_damaged_objects_are_read_or_refused_in_one_line(log: Path, tmp_path: Path) -> None:
    whole, refusals = log.read_bytes(), []
    for seed in (1, 3):  # each starts a process
        target = tmp_path / "damaged.mat"
        target.write_bytes(damaged(whole, seed))
        try:
            read_table(target)
        except InputError as error:
            refusals.append(str(error))
    assert not any("\n" in said for said in refusals)


def test_a_regular_clock_asks_for_no_more_than_the_data_have() -> None:
    data = np.ones((3, 1))
    for count, expected in ((3.0, True), (4e9, False), (np.nan, False)):
        about = {"Start_": np.zeros((1, 1)), "Increment_": np.ones((1, 1)), "Length": np.array([[count]])}
        found = plain(thing("timeseries", {"Data_": data, "TimeInfo": thing("tsdata.timemetadata", about)}))
        assert (found == Opaque("timeseries")) is not expected


def test_objects_that_refer_to_each_other_end() -> None:
    first: dict[str, Any] = {}
    second = {"a": thing("h", first), "b": thing("h", first)}
    first |= {"a": thing("h", second), "b": thing("h", second), "c": thing("h", second)}
    assert isinstance(plain(thing("h", first)), dict)


def thing(classname: str, properties: dict[str, Any]) -> Any:
    return SimpleNamespace(classname=classname, properties=properties)


def known(column: Any) -> Any:
    return column[np.isfinite(column)]
