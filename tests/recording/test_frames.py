"""Tables in memory: the units that they state, and what pandas, polars, Arrow, xarray and pint hold them in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import UTC, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pint
import polars as pl
import pyarrow as pa
import pytest

from terragrip.errors import InputError
from terragrip.recording import Recording
from terragrip.recording.frames import frame_of

KMH = np.array([3.6, np.nan, 7.2])
LOG = pd.DataFrame({"time": [0.0, 0.1, 0.2], "ground_speed": KMH, "wheel_speed_l": [5.0, 6.0, 7.0]})


def behind(speed: Any) -> pd.DataFrame:
    return LOG.assign(ground_speed=speed).rename(columns={"ground_speed": "ground_speed [km/h]"})


def beside() -> pd.DataFrame:
    result = LOG.copy()
    result.attrs["units"] = {"ground_speed": "km/h", "time": "s"}
    return result


class Variable(np.ndarray[Any, Any]):
    """What xarray's DataArray has of a unit."""

    attrs: Mapping[str, str] = {"units": "km/h"}


def quantities() -> dict[str, Any]:
    speed = pint.application_registry.Quantity(KMH, "km/h")
    return {"time": LOG["time"], "ground_speed": speed, "wheel_speed_l": LOG["wheel_speed_l"]}


def of_series(**others: Any) -> dict[str, Any]:
    """A mapping whose speed is a Series that states its unit itself."""
    speed = pd.Series(KMH)
    speed.attrs["units"] = "km/h"
    return {"time": LOG["time"], "ground_speed": speed, "wheel_speed_l": LOG["wheel_speed_l"], **others}


@pytest.mark.parametrize(
    "table",
    [
        behind(KMH),
        behind(pd.array([3.6, None, 7.2], dtype="Float64")),
        behind(pd.array([3.6, None, 7.2], dtype="float64[pyarrow]")),
        behind(pd.Series([3.6, None, 7.2], dtype=object)),
        behind(["3.6", "", "7.2"]),
        behind(KMH.astype(np.float32)),
        pl.from_pandas(behind(KMH)),
        pa.Table.from_pandas(behind(KMH)),
        beside(),
        pa.Table.from_pandas(beside()),
        {**LOG, "ground_speed": KMH.view(Variable)},
        quantities(),
        of_series(),
        of_series(time=LOG["time"].to_numpy(), wheel_speed_l=list(LOG["wheel_speed_l"])),
        dict(beside()),  # each Series has the units of all columns
        dict(beside()) | {"time": LOG["time"].to_numpy(), "wheel_speed_l": list(LOG["wheel_speed_l"])},
        {**LOG, "ground_speed": beside().rename(columns={"time": "v"})["ground_speed"]},
    ],
)
def test_a_unit_that_a_table_in_memory_states_is_converted(table: Any) -> None:
    """Units behind names were refused, those in attrs, of quantities and of cells that are objects dropped without a word."""
    got = Recording.from_frame(table)
    np.testing.assert_allclose(got["ground_speed"], KMH / 3.6, rtol=1e-6)


def test_blanks_around_a_name_are_no_part_of_it() -> None:
    """Of 'time, ground_speed' pandas makes ' ground_speed', which was another column than 'ground_speed'."""
    log = beside().rename(columns=lambda name: f" {name} ")
    log.attrs["units"] = {" ground_speed ": "km/h"}
    np.testing.assert_allclose(Recording.from_frame(log)["ground_speed"], KMH / 3.6)
    np.testing.assert_allclose(Recording.from_frame(pa.Table.from_pandas(log))["ground_speed"], KMH / 3.6)


def test_a_unit_behind_a_name_counts_before_one_that_attrs_kept() -> None:
    log = LOG.assign(ground_speed=1.0).rename(columns={"ground_speed": "ground_speed [km/h]"})
    log.attrs["units"] = {"ground_speed": "m/s", "ground_speed [km/h]": "m/s"}
    np.testing.assert_allclose(Recording.from_frame(log)["ground_speed"], 1 / 3.6)


@pytest.mark.parametrize("name", ["groud_speed", "Ground_Speed", "v"])
def test_a_unit_of_no_column_is_named_where_a_channel_has_none(name: str) -> None:
    """A misspelt name, or one renamed since, dropped its unit without a word: 3.6 times the speed."""
    log = LOG.copy()
    log.attrs["units"] = {name: "km/h"}
    (note,) = frame_of(log, None).notes
    assert f"states {name} in km/h, but has no such column" in note
    assert "ground_speed in m/s" in note
    log.attrs["units"] = {name: "km/h", "ground_speed": "m/s", "force": "kN", "other": "V", "angle": ""}
    assert not frame_of(log, None).notes  # a column of before, whose unit nothing else lacks


@pytest.mark.parametrize("key", ["unit", "Units"])
def test_a_unit_may_stand_under_unit_or_units(key: str) -> None:
    """Each but one of the two was dropped without a word, of an Arrow field the other."""
    log = LOG.copy()
    log.attrs[key] = {"ground_speed": "km/h"}
    field = pa.field("ground_speed", pa.float64(), metadata={key: "km/h"})
    table = pa.Table.from_pandas(LOG)
    table = table.set_column(1, field, table.column(1))
    variable = KMH.view(type("Own", (Variable,), {"attrs": {key: "km/h"}}))
    for one in (log, pa.Table.from_pandas(log), table, {**LOG, "ground_speed": variable}):
        np.testing.assert_allclose(Recording.from_frame(one)["ground_speed"], KMH / 3.6)


@pytest.mark.parametrize(
    "attrs", [{"ground_speed": "km/h"}, {"units": ["s", "km/h", "rad/s"]}, {"units": "km/h"}]
)
def test_units_that_attrs_state_otherwise_than_by_column_are_refused(attrs: dict[str, object]) -> None:
    """They were dropped without a word."""
    log = LOG.copy()
    log.attrs = attrs
    with pytest.raises(InputError, match="attrs states units otherwise than by column; write attrs"):
        Recording.from_frame(log)
    log.attrs = {"ground_speed": "from a radar", "units": None}
    Recording.from_frame(log)


@pytest.mark.parametrize("empty", [None, {}, ""])
def test_an_empty_entry_hides_no_units(empty: object) -> None:
    """With attrs['units'] left empty those under 'unit' were dropped without a word."""
    log = LOG.copy()
    log.attrs = {"units": empty, "unit": {"ground_speed": "km/h"}}
    np.testing.assert_allclose(Recording.from_frame(log)["ground_speed"], KMH / 3.6)


def test_what_attrs_say_of_a_label_is_no_unit() -> None:
    """A soil 'A' was refused as a current."""
    log = LOG.assign(soil="A")
    log.attrs = {"soil": "A", "units": []}
    np.testing.assert_allclose(Recording.from_frame(log)["ground_speed"], KMH)


def test_a_unit_of_another_quantity_is_refused() -> None:
    log = LOG.copy()
    log.attrs["units"] = {"ground_speed": "N"}
    with pytest.raises(
        InputError, match="column ground_speed: 'N' measures a force, where a speed is needed"
    ):
        Recording.from_frame(log)


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (
            {"ground_speed": "ground_speed_kmh"},
            r"'ground_speed_kmh': rename it 'ground_speed \[kmh\]', or map",
        ),
        ({"ground_speed": "Speed (km/h)"}, r"'Speed': rename it 'ground_speed \[km/h\]', or map"),
    ],
)
def test_who_is_told_to_rename_a_column_keeps_its_unit(columns: dict[str, str], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        Recording.from_frame(LOG.rename(columns=columns))


def test_an_index_of_several_levels_gives_time_and_label() -> None:
    """The label was lost without a word."""
    log = LOG.assign(soil="grass", time=1e3 * LOG["time"]).rename(columns={"time": "time [ms]"})
    got = Recording.from_frame(log.set_index(["soil", "time [ms]"]))
    np.testing.assert_allclose(got.time, LOG["time"])
    assert set(got["soil"]) == {"grass"}


def test_an_index_of_dates_is_time_and_has_its_own_name_too() -> None:
    """A profile with 'time: {from: when}' had no such column."""
    index = pd.DatetimeIndex(
        pd.Timestamp("2026-05-11", tz=UTC) + pd.to_timedelta(LOG["time"], unit="s"), name="when"
    )
    log = LOG.drop(columns="time").set_index(index)
    columns = frame_of(log, None).columns
    np.testing.assert_array_equal(columns["when"], columns["time"])
    assert "when" not in log


def test_series_of_unlike_indices_are_taken_by_place_with_a_note() -> None:
    later = LOG.set_index(pd.RangeIndex(5, 8))
    assert not any("indices" in note for note in frame_of(dict(later), None).notes)
    mixed = {**LOG, "ground_speed": later["ground_speed"]}
    assert any("rows are taken by their place" in note for note in frame_of(mixed, None).notes)


def test_labels_that_pandas_made_floats_are_those_of_whole_numbers() -> None:
    """'2' of a run and '2.0' of another, which has rows without a label, were two soils."""
    whole = Recording.from_frame(LOG.assign(soil=[1, 2, 2]))["soil"]
    beside_missing = Recording.from_frame(LOG.assign(soil=[np.nan, 2, 2]))["soil"]
    assert list(whole) == ["1", "2", "2"]
    assert list(beside_missing) == ["", "2", "2"]
    assert list(Recording.from_frame(LOG.assign(soil=["2.0", "2.5", "v2.0"]))["soil"]) == ["2", "2.5", "v2.0"]


@pytest.mark.parametrize("empty", ["", np.nan, "Unnamed: 3_level_1"])  # as pandas reads headers of two lines
def test_names_of_several_levels_are_joined_as_those_of_files_are(empty: object) -> None:
    """Refused, though the same frame in a CSV or a Parquet file was read."""
    levels = [tuple(name.rsplit("_", 1)) if name.startswith("wheel") else (name, empty) for name in LOG]
    frame = LOG.set_axis(pd.MultiIndex.from_tuples(levels), axis=1)
    assert list(Recording.from_frame(frame)) == list(Recording.from_frame(LOG))
    with pytest.raises(InputError, match="robot_"):
        Recording.from_frame(pd.concat({"robot": LOG}, axis=1))


@pytest.mark.parametrize("of", [lambda stamp: stamp, lambda stamp: stamp.time()])
def test_cells_that_are_datetimes_or_times_of_day_are_times(of: Callable[[Any], Any]) -> None:
    first = pd.Timestamp("2026-05-11 08:00:59.95", tz=UTC).to_pydatetime()
    cells = pd.Series([of(first + timedelta(seconds=t)) for t in LOG["time"]], dtype=object)
    got = Recording.from_frame(LOG.assign(time=cells)).time
    np.testing.assert_allclose(got - got[0], LOG["time"], atol=1e-9)


@pytest.mark.parametrize("unit", ["V", "furlong"])
def test_a_column_that_is_none_of_ours_may_have_any_unit(unit: str) -> None:
    other = LOG.assign(battery=[24.0, 24.1, 24.2])
    other.attrs["units"] = {"battery": unit}
    np.testing.assert_array_equal(Recording.from_frame(other).time, LOG["time"])
