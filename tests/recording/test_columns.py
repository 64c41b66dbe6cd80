"""Columns of any kind of table, cell by cell."""

from __future__ import annotations

import datetime as dt
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from terragrip.errors import InputError
from terragrip.recording.checks import how_to_pivot, place
from terragrip.recording.columns import numbers, seconds, stamps_of, start_of, texts
from terragrip.recording.frames import columns_of


class Named:
    """Has what a frame has, and is none."""

    column_names = ("a",)
    columns = ("a",)

    def get_columns(self) -> list[Any]:
        return []


@pytest.mark.parametrize("table", [Named(), [1.0, 2.0], 3])
def test_what_is_no_table_is_refused_by_its_type(table: Any) -> None:
    with pytest.raises(InputError, match=f"{type(table).__name__} is not a table"):
        columns_of(table, "x.csv")


def test_a_lazy_table_is_refused_by_the_way_to_its_rows() -> None:
    import polars as pl

    with pytest.raises(InputError, match=r"LazyFrame is not a table; give what its \.collect\(\) returns"):
        columns_of(pl.LazyFrame({"time": [0.0]}), None)


def test_geopandas_and_record_batches_are_tables() -> None:
    """ "GeoDataFrame is not a table", and Arrow's own error on a batch with missing values."""
    geopandas = pytest.importorskip("geopandas")
    pa = pytest.importorskip("pyarrow")
    assert columns_of(geopandas.GeoDataFrame({"time": [0.0, 0.1]}), None)["time"].tolist() == [0.0, 0.1]
    batch = pa.record_batch({"time": [0.0, 0.1], "ground_speed": [1.0, None]})
    assert columns_of(batch, None)["ground_speed"].tolist() == pytest.approx([1.0, np.nan], nan_ok=True)


def test_columns_of_one_length_and_of_one_name_each() -> None:
    with pytest.raises(InputError, match=r"column b.*has 2 rows, the first column 3"):
        columns_of({"a": [1, 2, 3], "b": [1, 2]}, None)
    with pytest.raises(InputError, match=r"column 1.*occurs twice"):
        columns_of({1: [1.0], "1": [2.0]}, None)
    with pytest.raises(InputError, match=r"column a.*has 2 dimensions"):
        columns_of({"a": np.zeros((2, 2))}, None)
    with pytest.raises(InputError, match=r"column a.*has 0 dimensions"):
        columns_of({"a": 1.0}, None)
    table = pa.table({"a": [1.0, 2.0], "b": ["x", "y"]})
    got = columns_of(table, None)
    assert got["a"].tolist() == [1.0, 2.0]
    assert got["b"].tolist() == ["x", "y"]


def test_missing_cells_of_each_kind_are_nan_and_others_are_numbers() -> None:
    cells = [None, pd.NA, pd.NaT, "", "  ", " 2.5 ", 3, True, np.float32(0.5), "nan"]
    got = numbers("ground_speed", np.array(cells, dtype=object), None, None)
    np.testing.assert_array_equal(got, [np.nan] * 5 + [2.5, 3.0, 1.0, 0.5, np.nan])


@pytest.mark.parametrize("cell", ["two", [1.0], {"a": 1}, 10**400, "x" * 80])
def test_a_cell_that_is_no_number_is_quoted_with_its_row_and_time(cell: Any) -> None:
    column = np.empty(3, dtype=object)
    column[:] = [1.0, None, cell]
    with pytest.raises(InputError, match="is not a number") as error:
        numbers("ground_speed", column, np.array([0.0, 0.5, 1.5]), "log.csv")
    text = str(error.value)
    assert "column ground_speed, row 3 (time 1.5 s)" in text
    assert text.startswith("log.csv")
    quoted = text[: text.index(" is not a number")]
    assert quoted.endswith(repr(cell)) if len(repr(cell)) <= 30 else quoted.endswith(repr(cell)[:27] + "...")


def test_lengths_are_those_of_time() -> None:
    time = np.arange(3.0)
    with pytest.raises(InputError, match="has 2 rows, time has 3"):
        numbers("a", np.zeros(2), time, None)
    with pytest.raises(InputError, match="has 2 rows, time has 3"):
        texts("soil", np.array(["a", "b"], dtype=object), 3, None)
    with pytest.raises(InputError, match="holds complex128, not numbers"):
        numbers("a", np.zeros(3, dtype=complex), time, None)


def test_labels_are_text_and_missing_ones_empty() -> None:
    cells = np.array(["clay", " clay ", None, pd.NA, np.nan, 3, "clay", "clay"], dtype=object)
    got = texts("soil", cells, 8, None)
    assert got.tolist() == ["clay", "clay", "", "", "", "3", "clay", "clay"]
    assert got[0] is got[6] is got[7]
    assert texts("soil", np.full(2, np.nan), 2, None).tolist() == ["", ""]
    assert texts("soil", np.array([], dtype=object), 0, None).tolist() == []
    assert texts("soil", np.array([1.0, np.nan, 2.0]), 3, None).tolist() == ["1", "", "2"]
    assert texts("soil", np.array(["a"], dtype=object), 1, None).tolist() == ["a"]
    odd = np.empty(3, dtype=object)
    odd[:] = ["a", ["b"], "c"]
    with pytest.raises(InputError, match=r"column soil, row 2.*holds a list"):
        texts("soil", odd, 3, None)


def test_dates_and_durations_are_seconds() -> None:
    zero = np.datetime64("2024-05-01T12:00:00.000")
    dates = np.array([zero, zero + np.timedelta64(1500, "ms"), np.datetime64("NaT")])
    got, notes = seconds(dates, None)
    np.testing.assert_array_equal(got, [0.0, 1.5, np.nan])
    assert len(notes) == 1
    got, notes = seconds(dates - zero, None)
    np.testing.assert_array_equal(got, [0.0, 1.5, np.nan])
    assert notes == []
    assert len(seconds(dates[:0], None)[0]) == 0
    got, notes = seconds(np.array([3.0, 4.0]), None)
    assert (got.tolist(), notes) == ([3.0, 4.0], [])


def test_when_time_was_zero() -> None:
    dates = np.array(["2024-05-01T12:00:00.250", "2024-05-01T12:00:01"], dtype="datetime64[ms]")
    calendar = dt.datetime(2024, 5, 1, 12, 0, 0, 250_000, tzinfo=dt.UTC).timestamp()
    assert start_of(dates, np.array([0.0, 0.75])) == calendar
    assert start_of(np.array(["NaT"], dtype="datetime64[s]"), np.array([0.0])) is None
    stamps = np.array([1.7e9, 1.7e9 + 1])
    assert start_of(stamps, stamps) == 0.0
    for own in (np.array([12.0, 13.0]), np.array([1e8, 1e8 + 1]), np.array([])):
        assert start_of(own, own) is None
    assert start_of(dates[:0], np.array([])) is None


def test_where_a_cell_stands() -> None:
    time = np.array([0.25, np.nan])
    assert place("a", 0) == "column a, row 1"
    assert place("a", 0, time) == "column a, row 1 (time 0.25 s)"
    assert place("a", 1, time) == "column a, row 2"
    assert place("a", 0, time, first_row=100) == "column a, row 101 (time 0.25 s)"


def test_a_table_is_long_where_names_stand_beside_values() -> None:
    assert "columns='Signal name', values='value'" in (how_to_pivot(["t", "Signal name", "value"]) or "")
    for columns in (["t", "Signal name"], ["t", "value"], ["t", "speed"]):
        assert how_to_pivot(columns) is None
    influx = [*("result", "table", "_start", "_stop", "_time", "_value", "_field", "_measurement", "host")]
    assert "(index='_time', columns='_field', values='_value')" in (how_to_pivot(influx) or "")


def test_an_index_named_time_is_the_time_and_no_other_is() -> None:
    for name, columns in (("time", ["time", "a"]), ("row", ["a"]), ("zone", ["a"])):
        frame = pd.DataFrame({"a": [1.0, 2.0]}, index=pd.Index([0.0, 0.5], name=name))
        assert list(columns_of(frame, None)) == columns


def test_a_level_of_an_index_named_time_is_the_time() -> None:
    """'column time: is missing', of a table set_index(['machine', 'time'])."""
    frame = pd.DataFrame({"machine": ["a", "a"], "time": [0.0, 0.5], "ground_speed": [1.0, 2.0]})
    columns = columns_of(frame.set_index(["machine", "time"]), None)
    assert columns["time"].tolist() == [0.0, 0.5]


def test_cells_with_colons_that_are_no_times_are_named_where_they_begin() -> None:
    with pytest.raises(InputError, match="'noon:ish' is not a time") as error:
        stamps_of(np.array(["", "noon:ish", "noon:late"], dtype=object), "log.csv")
    assert "row 2" in str(error.value)


def test_a_point_that_may_part_thousands_is_named_with_both_readings() -> None:
    with pytest.raises(InputError, match=r"'1\.234' may be 1234 or 1\.234") as error:
        numbers("drawbar_force", np.array(["800", "1.234"], dtype=object), np.array([0.0, 0.5]), "log.csv")
    assert "row 2 (time 0.5 s)" in str(error.value)
    assert "without a thousands separator" in str(error.value)
