"""Arrays of structs in MATLAB files, each a drive of its own, of both versions: one is read, and the notes say so."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from terragrip.formats import Profile, inspect, read
from terragrip.formats.matlab_hdf5 import _of_hdf5
from terragrip.formats.matlab_signals import Contents, walk

FIELDS = ("time", "ground_speed", "wheel_speed_fl", "wheel_speed_fr")


def run(number: int) -> dict[str, np.ndarray]:
    time = 0.1 * np.arange(400 + number)
    speed = 1 + 0.3 * np.sin(time / 5 + number)
    return dict(zip(FIELDS, (time, speed, 3.5 * speed, 3.5 * speed), strict=True))


def version_5(path: Path) -> None:
    runs = np.zeros((1, 3), dtype=[(name, object) for name in FIELDS])
    for k in range(3):
        for name, values in run(k).items():
            runs[0, k][name] = values
    savemat(path, {"runs": runs})


def version_73(path: Path) -> None:
    """As MATLAB writes it: a dataset of references for each field."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group, kept = file.create_group("runs"), file.create_group("#refs#")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name in FIELDS:
            field = group.create_dataset(name, (3, 1), dtype=h5py.ref_dtype)
            for k in range(3):
                one = kept.create_dataset(f"{name}{k}", data=run(k)[name][None, :])
                one.attrs["MATLAB_class"] = np.bytes_("double")
                field[k, 0] = one.ref
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


@pytest.mark.parametrize("write", [version_5, version_73])
def test_of_several_drives_the_first_is_proposed_whole_and_another_can_be_named(
    tmp_path: Path, write
) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "runs.mat"
    write(path)
    seen = inspect(path)
    assert {name for columns in seen.recognised.values() for name in columns} == {
        f"runs[0].{n}" for n in FIELDS[1:]
    }
    (note,) = [one for one in seen.warnings if "runs holds 3 drives" in one]
    assert "Save each in a file of its own" in note
    channels = {name: {"from": f"runs[2].{name}"} for name in FIELDS[1:]}
    second = read(path, Profile.from_dict({"time": {"from": "time"}, "channels": channels}))
    np.testing.assert_allclose(second.channels["ground_speed"], run(2)["ground_speed"])
    assert any("runs holds 3 drives" in one for one in second.notes)


@pytest.mark.parametrize(
    ("parts", "runs"),
    [
        ([run(0), run(1)], {"all": 2}),
        ([run(0)], {}),
        ([{"time": run(k)["time"], "values": run(k)["ground_speed"]} for k in range(2)], {}),  # signals
        ([{name: run(k)[name] for name in FIELDS[1:]} for k in range(2)], {}),  # without times
        ([run(0), {**run(1), "yaw": run(1)["time"]}], {}),  # of unlike sensors
        ([{**run(k), "name": f"sensor {k}"} for k in range(2)], {}),
    ],
)
def test_only_structs_with_a_time_and_the_same_signals_are_drives(
    parts: list[dict], runs: dict[str, int]
) -> None:
    contents = Contents()
    walk({"all": parts}, "", contents, 0)
    assert contents.runs == runs


@pytest.mark.parametrize("kinds", [("cell", "cell"), ("cell", None), (None, None)])
@pytest.mark.parametrize("counts", [(2, 2), (2, 3)])
def test_cells_of_a_struct_are_no_array_of_structs(
    tmp_path: Path, kinds: tuple[str | None, ...], counts: tuple[int, ...]
) -> None:
    """Of version 7.3: only the class tells a struct of two cells from an array of two structs."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        group, kept = file.create_group("s"), file.create_group("#refs#")
        for name, kind, count in zip("ab", kinds, counts, strict=True):
            field = group.create_dataset(name, (count, 1), dtype=h5py.ref_dtype)
            if kind:
                field.attrs["MATLAB_class"] = np.bytes_(kind)
            for k in range(count):
                one = kept.create_dataset(f"{name}{k}", data=np.arange(5.0)[None, :])
                one.attrs["MATLAB_class"] = np.bytes_("double")
                field[k, 0] = one.ref
        found = _of_hdf5(file, group, 0, h5py)
    assert isinstance(found, list) is (kinds == (None, None) and counts == (2, 2))


def test_numbers_that_name_no_class_are_no_array_of_structs(tmp_path: Path) -> None:
    """As other programs than MATLAB write them."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        group = file.create_group("s")
        for name in "ab":
            group.create_dataset(name, data=np.arange(5.0)[None, :])
        found = _of_hdf5(file, group, 0, h5py)
    assert isinstance(found, dict)
