"""The table of estimates: columns, file, summary; and the same file from blocks."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from drives import WHEELS, drive, robot
from terragrip.errors import InputError
from terragrip.estimation import Estimates, RunOptions, estimate, estimated
from terragrip.estimation.export import KINDS
from terragrip.estimation.writing import write_parts
from terragrip.formats import Profile
from terragrip.recording import LogBlocks, Recording
from terragrip.vehicle import Vehicle


def labelled(seconds: float = 8.0) -> Recording:
    """A recording with position, soil, references and a gap of 3 s."""
    base = drive(seconds, imu=True).recording
    time = np.where(base.time < 5, base.time, base.time + 3)
    soil = np.where(base.time < 4, "fine", "").astype(object)
    return Recording(
        time,
        {**base.channels, "latitude": 51 + 0 * time, "longitude": 13 + 0 * time, "true_adhesion_rr": 0.3 + 0 * time,
         "wheel_force_x_rr": 70 + 0 * time},
        {"soil": soil},
        source="log.csv",
        sha256="ab" * 32,
        notes=("A note of the reader.",),
    )  # fmt: skip


@pytest.fixture(scope="module")
def estimates():
    return estimate(labelled(), robot())


def test_the_columns_of_the_contract(estimates):
    table = estimates.to_pandas()
    quantities = ("wheel_speed", "adhesion", "slip", "net_traction", "efficiency")
    wanted = {
        "time",
        "ground_speed",
        "ground_speed_std",
        "soil_resistance",
        "soil_resistance_std",
        "distance",
        "nis",
    }
    wanted |= {
        "supervisor",
        "event",
        "soil",
        "vertical_load_front",
        "vertical_load_rear",
        "latitude",
        "longitude",
    }
    wanted |= {f"{q}_{w}{end}" for q in quantities for w in WHEELS for end in ("", "_std")}
    wanted |= {"true_adhesion_rr", "wheel_force_x_rr"}
    assert wanted <= set(table)
    assert np.array_equal(table["time"], labelled().time)
    assert set(table["event"]) == {"", "gap"}
    assert set(table["soil"]) == {"fine", ""}


def test_a_file_gives_back_the_table(estimates, tmp_path):
    path = tmp_path / "e.parquet"
    estimates.write(path)
    back = Estimates.read(path)
    pd.testing.assert_frame_equal(back.to_pandas(), estimates.to_pandas())
    pd.testing.assert_frame_equal(pd.read_parquet(path), estimates.to_pandas())
    assert back.about == estimates.about
    assert back.notes == estimates.notes
    assert back.vehicle.to_dict() == robot().to_dict()
    assert back.about["recording"] == {"source": "log.csv", "sha256": "ab" * 32}
    assert back.method == "bank"
    assert [p.name for p in tmp_path.iterdir()] == ["e.parquet"]


def test_another_order_of_columns_is_the_same_table(estimates):
    table = estimates.to_arrow()
    back = Estimates.from_arrow(table.select(table.column_names[::-1]))
    pd.testing.assert_frame_equal(back.to_pandas()[estimates.to_pandas().columns], estimates.to_pandas())


def test_a_folder_that_is_not_there_is_refused(estimates, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        estimates.write(tmp_path / "no" / "e.parquet")


def test_the_suffix_says_how_a_table_is_written(estimates, tmp_path):
    path = tmp_path / "x.csv"
    estimates.write(path)
    result = pd.read_csv(path, keep_default_na=False, na_values=["nan"])
    assert list(result) == list(estimates)
    for name in estimates:
        if name in ("event", "soil"):
            assert result[name].tolist() == estimates[name].tolist()
        else:
            assert np.array_equal(result[name], estimates[name], equal_nan=True), name


@pytest.mark.parametrize("name", ["x.doc", "x"])
def test_what_cannot_be_written_is_refused_by_its_suffix(estimates, tmp_path, name):
    with pytest.raises(InputError, match=r"x\.parquet") as refused:
        estimates.write(tmp_path / name)
    assert all(suffix in str(refused.value) for suffix in KINDS)
    assert not list(tmp_path.iterdir())


def test_what_is_no_table_of_estimates_is_refused(tmp_path):
    path = tmp_path / "x.parquet"
    path.write_bytes(b"PAR1 not really")
    with pytest.raises(InputError, match="Parquet"):
        Estimates.read(path)
    pd.DataFrame({"time": [0.0]}).to_parquet(path)
    with pytest.raises(InputError, match="not a table of estimates"):
        Estimates.read(path)
    with pytest.raises(InputError, match="no such file"):
        Estimates.read(tmp_path / "none.parquet")


def test_the_summary_says_what_was_met(estimates):
    text = estimates.summary()
    assert "800 rows" in text
    assert "m in 11.0 s" in text
    assert "gap 1 (2 rows)" in text  # the row before the gap and the one after
    assert "expected 1" in text
    assert "Note: A note of the reader." in text
    assert "by wheel" in text


def test_held_channels_are_in_the_summary():
    recording = drive(20.0).recording
    held = np.repeat(recording["ground_speed"][::5], 5)[: len(recording)]
    result = estimate(recording.with_channels(ground_speed=held), robot())
    assert result.about["settings"]["held"]["ground_speed"] == pytest.approx(0.05, rel=0.05)
    assert "ground_speed (20 Hz)" in result.summary()


def test_distance_is_the_way_travelled(estimates):
    driven = drive(20.0)
    result = estimate(driven.recording, robot())
    way = np.trapezoid(driven.truth["ground_speed"], result.time)
    assert result["distance"][-1] == pytest.approx(way, rel=0.01)
    assert (np.diff(result["distance"]) >= 0).all()


@pytest.mark.parametrize("cuts", [(0, 800), (0, 1, 250, 500, 800), (0, 499, 501, 800)])
def test_a_file_from_blocks_is_the_whole_file(estimates, tmp_path, cuts):
    """The gap lies between rows 499 and 500, so one cut falls on it."""
    recording, path, seen = labelled(), tmp_path / "e.parquet", []
    log = in_blocks([recording.select(slice(a, b)) for a, b in pairwise(cuts)])
    write_parts(estimated(log, robot(), progress=lambda done, of: seen.append((done, of))), path)
    result = Estimates.read(path)
    pd.testing.assert_frame_equal(result.to_pandas(), estimates.to_pandas(), check_exact=True)
    assert (result.about, result.notes) == (estimates.about, estimates.notes)
    assert seen[-1] == (800, 800)


def in_blocks(blocks):
    return LogBlocks(sum(map(len, blocks)), lambda: iter(blocks), lambda: blocks[0])


def test_a_failing_block_leaves_no_file(tmp_path):
    recording = labelled()
    backwards = in_blocks([recording.select(slice(400, 800)), recording.select(slice(0, 400))])
    with pytest.raises(InputError, match="does not increase"):
        write_parts(estimated(backwards, robot()), tmp_path / "e.parquet")
    with pytest.raises(InputError, match="no row"):
        write_parts(estimated(in_blocks([]), robot()), tmp_path / "e.parquet")
    assert not list(tmp_path.iterdir())


def test_progress_reaches_the_end():
    seen = []
    estimate(drive(3.0).recording, robot(), progress=lambda done, rows: seen.append((done, rows)))
    assert seen[-1] == (300, 300)


def test_wheels_that_do_not_fit_are_refused():
    recording = drive(3.0).recording
    channels = {name.replace("_fl", "_xx"): values for name, values in recording.channels.items()}
    with pytest.raises(InputError, match="xx"):
        estimate(Recording(recording.time, channels), robot())


def test_paths_in_place_of_a_log_and_a_vehicle_are_told_what_to_give() -> None:
    with pytest.raises(InputError, match=r"str is no vehicle; give what Vehicle\.load\(path\) returns"):
        estimate(labelled(2.0), "robot.yaml")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"str is not a table; give what tg\.read\(path\) returns"):
        estimate("log.csv", robot())


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ({"sensors": {"ground_speed": "0.1 m/s"}}, "the noise of ground_speed is '0.1 m/s'; give a positive"),
        ({"sensors": {"ground_speed": None}}, "the noise of ground_speed is None; give a positive"),
        ({"gap": -1}, "gap is -1; give a positive number of seconds"),
        ({"gap": "1 s"}, "gap is '1 s'; give a positive number of seconds"),
        ({"standstill_speed": np.nan}, "standstill_speed is nan; give a positive number of m/s"),
        ({"held": {"ground_speed": "0.2 s"}}, "held of ground_speed is '0.2 s'; give the period"),
        ({"held": {"ground": 0.2}}, "held names 'ground', which is no channel"),
        ({"method": None}, "there is no method 'None'; choose one of"),
    ],
)
def test_a_setting_that_cannot_be_used_is_one_line(words: dict[str, object], expected: str) -> None:
    """It was a TypeError, blamed on the vehicle file, or ignored."""
    with pytest.raises(InputError, match=expected):
        estimate(labelled(2.0), robot(), **words)  # type: ignore[arg-type]


@pytest.mark.parametrize("reader", [Vehicle.load, Profile.load, Estimates.read])
def test_what_is_no_path_is_named(reader: Callable[[object], object]) -> None:
    for wrong in ({"mass": 1.0}, None):
        with pytest.raises(InputError, match=rf"{type(wrong).__name__} is no path; give the path of a"):
            reader(wrong)


def test_unchecked_a_log_is_estimated_alike_without_notes_on_its_faults() -> None:
    log = drive(20.0, rate=20.0).recording
    in_km_h = Recording(log.time, {**log.channels, "ground_speed": 3.6 * log["ground_speed"]})
    (checked,), (bare,) = (
        list(estimated(LogBlocks.of(in_km_h), robot(), RunOptions(checked=each))) for each in (True, False)
    )
    assert any("ground_speed" in note for note in checked.notes)
    assert bare.notes == ()
    np.testing.assert_array_equal(bare["adhesion_rr"], checked["adhesion_rr"])
