"""Recording: what it takes, without copies, and what it refuses with column, row and hint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.recording import Recording, unit_of, wheel_names_in
from terragrip.recording.checks import remarks
from terragrip.recording.clock import LATEST
from terragrip.vehicle import Vehicle

Columns = dict[str, np.ndarray]


def spoilt(columns: Columns, name: str, row: int, value: float) -> Columns:
    changed = columns[name].copy()
    changed[row] = value
    return {**columns, name: changed}


@pytest.mark.parametrize(
    "frame_of", [dict, pd.DataFrame, pl.DataFrame, pa.table], ids=["dict", "pandas", "polars", "arrow"]
)
def test_every_kind_of_table_gives_the_same(columns: Columns, frame_of: Callable[[Columns], Any]) -> None:
    labels = np.array(["grass", ""] * 3000, dtype=object)
    recording = Recording.from_frame(frame_of({**columns, "soil": labels}), source="log.csv")
    assert recording.wheels == ("fl", "fr", "rl", "rr")
    assert list(recording.channels) == [name for name in columns if name != "time"]
    for name in columns:
        np.testing.assert_array_equal(recording[name], columns[name])
        assert recording[name].dtype == np.float64
    assert list(recording["soil"][:2]) == ["grass", ""]
    assert (len(recording), recording.source, recording.notes) == (6000, "log.csv", ())


@pytest.mark.parametrize("frame_of", [dict, pd.DataFrame, pl.DataFrame], ids=["dict", "pandas", "polars"])
def test_float64_is_not_copied(columns: Columns, frame_of: Callable[[Columns], Any]) -> None:
    frame = frame_of(columns)
    recording = Recording.from_frame(frame)
    for name in columns:
        assert np.shares_memory(recording[name], np.asarray(frame[name]))
    assert np.shares_memory(recording.select(slice(10, 20)).time, recording.time)


def test_missing_values_of_any_kind_become_nan(columns: Columns) -> None:
    frame = pd.DataFrame(columns)
    frame["ground_speed"] = frame["ground_speed"].astype("Float64").where(frame.index != 3)
    frame["drawbar_force"] = frame["drawbar_force"].astype(object).where(frame.index != 5, None)
    frame["wheel_speed_fl"] = frame["wheel_speed_fl"].astype("float32")
    recording = Recording.from_frame(frame)
    assert np.flatnonzero(np.isnan(recording["ground_speed"])).tolist() == [3]
    assert np.flatnonzero(np.isnan(recording["drawbar_force"])).tolist() == [5]


def test_dates_become_seconds_with_a_note(columns: Columns) -> None:
    stamps = pd.to_datetime("2021-05-04T10:00:00Z") + pd.to_timedelta(columns["time"], unit="s")
    recording = Recording.from_frame(pd.DataFrame({**columns, "time": stamps}))
    np.testing.assert_allclose(recording.time, columns["time"], atol=1e-9)
    assert any("date" in note for note in recording.notes)


def test_notes_name_what_is_not_used_and_what_is_not_towed(columns: Columns) -> None:
    del columns["drawbar_force"]
    frame = {**columns, "drive_torqe_fl": columns["time"], "pitch": np.full(6000, np.nan)}
    notes = " ".join(Recording.from_frame(frame).notes)
    assert "not used: drive_torqe_fl" in notes
    assert "tow nothing" in notes
    assert "pitch has no value and is left out" in notes


def test_references_pass_through(columns: Columns) -> None:
    frame = {**columns, "true_adhesion_fl": columns["time"], "wheel_force_x_rr": columns["time"]}
    assert Recording.from_frame(frame).references == ("true_adhesion_fl", "wheel_force_x_rr")


def test_selecting_and_adding(columns: Columns) -> None:
    recording = Recording.from_frame({**columns, "soil": np.full(6000, "hard", dtype=object)})
    part = recording.select(recording.time < 1.0).with_channels(pitch=np.zeros(100)).with_notes("a", "a")
    assert (len(part), part.notes, "pitch" in part, "pitch" in recording) == (100, ("a",), True, False)
    assert len(part["soil"]) == 100
    again = Recording.from_frame(part.to_pandas())
    np.testing.assert_array_equal(again["drive_torque_rl"], columns["drive_torque_rl"][:100])
    with pytest.raises(InputError, match="column pitch: has 3 rows, time has 100"):
        part.with_channels(pitch=np.zeros(3))


def test_schema() -> None:
    assert wheel_names_in(
        ["wheel_speed_l", "drive_torque_rear_2", "vertical_load_front", "wheel_speed_"]
    ) == ("l", "rear_2")
    assert unit_of("vertical_load_front") == "N"
    assert unit_of("latitude") == "deg"
    assert unit_of("soil") is None


def _without(name: str) -> Callable[[Columns], Columns]:
    return lambda columns: {k: v for k, v in columns.items() if k != name}


def _as_object(name: str, row: int, cell: object) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        cells = columns[name].astype(object)
        cells[row] = cell
        return {**columns, name: cells}

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda c: {("groundspeed" if k == "ground_speed" else k): v for k, v in c.items()},
            "column ground_speed: is missing; the nearest column is 'groundspeed': rename it, or map it in a profile",
        ),
        (_without("time"), "column time: is missing; map"),
        (lambda c: {k: v for k, v in c.items() if "wheel" not in k}, "column wheel_speed_<wheel>: is missing; map"),
        (_as_object("ground_speed", 16, "fast"), "column ground_speed, row 17 (time 0.16 s): 'fast' is not a number"),
        (lambda c: {**c, "time": c["time"][::-1]}, "column time, row 2 (time 59.98 s): time goes back from 59.99 s"),
        (lambda c: spoilt(c, "time", 16, 0.15), "column time, row 17 (time 0.15 s): time repeats"),
        (lambda c: spoilt(c, "time", 16, np.nan), "column time, row 17: time is not a finite number"),
        (lambda c: spoilt(c, "time", 5999, np.inf), "column time, row 6000: time is not a finite number"),
        (
            lambda c: {**c, "time": 1.7e12 + 1e3 * c["time"]},
            "column time: is 1.7e+12 s, past the year 5000: since 1970 in ms?; write 'time: {from: time, unit: ms, zero: first}'",
        ),
        (lambda c: {**c, "time": 1.7e15 + 1e6 * c["time"]}, "column time: is 1.7e+15 s, past the year 5000: since 1970 in us?"),
        (lambda c: spoilt(c, "drawbar_force", 16, -np.inf), "column drawbar_force, row 17 (time 0.16 s): is infinite"),
        (lambda c: {**c, "ground_speed": np.full(6000, np.nan)}, "column ground_speed: has no value"),
        (lambda c: {**c, "drawbar_force": np.full(6000, np.nan)}, "column drawbar_force: has no value"),
        (
            lambda c: {**c, "latitude": np.round(48e7 + 30 * c["time"])},
            "column latitude: is 480000000, and most of its values are no latitude in degrees; give it in degrees: whole numbers of 1e-7",
        ),
        (
            lambda c: {**c, "latitude": np.where(c["time"] < 5, 0, np.round(48e7 + 30 * c["time"]))},  # no fix yet
            "column latitude: is 48000",
        ),
        (
            lambda c: {**c, "longitude": 1130.02 + 1e-4 * c["time"]},
            "column longitude: is 1130.02, and most of its values are no longitude in degrees; give it in degrees: degrees and minutes",
        ),
        (
            lambda c: {**c, "latitude": np.where(np.arange(6000) % 20, -9999.0, 48 + 1e-6 * c["time"])},
            "column latitude: is -9999, and most of its values are no latitude in degrees; if it stands for 'not measured', leave",
        ),
        (lambda c: {k: v[:0] for k, v in c.items()}, "the table is empty"),
        (lambda c: {}, "there are no columns"),
        (lambda c: {**c, "pitch": np.zeros(3)}, "column pitch: has 3 rows, the first column 6000"),
        (lambda c: {**c, "pitch": np.zeros((6000, 2))}, "column pitch: has 2 dimensions"),
        (lambda c: {**c, "pitch": c["time"] + 1j}, "column pitch: holds complex128, not numbers"),
        (lambda c: [1, 2], "list is not a table"),
        (lambda c: pd.concat([pd.DataFrame(c)] * 2, axis=1), "column time: occurs twice"),
    ],
)  # fmt: skip
def test_refusal(columns: Columns, change: Callable[[Columns], Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Recording.from_frame(change(columns), source="log.csv")
    assert str(caught.value).startswith(f"log.csv: {message}")
    assert caught.value.hint


def test_rows_without_a_fix_have_no_position(columns: Columns) -> None:
    """A receiver's 0, 0 was 5600 km from the field: 'time may not be in seconds', and a map reached to Africa."""
    fix = columns["time"] > 5
    places = {"latitude": np.where(fix, 51.0, 0.0), "longitude": np.where(fix, 13.0, 0.0)}
    recording = Recording.from_frame({**columns, **places})
    assert np.isnan(recording["latitude"][~fix]).all()
    assert (recording["longitude"][fix] == 13.0).all()
    assert (
        "Rows whose latitude and longitude are both 0 are without a fix: they have no position."
        in recording.notes
    )
    assert np.count_nonzero(places["latitude"]) == fix.sum()  # the user's table is as it was
    alone = {"latitude": np.zeros(6000)}
    assert (Recording.from_frame({**columns, **alone})["latitude"] == 0.0).all()
    on_the_equator = {"latitude": np.zeros(6000), "longitude": np.full(6000, 13.0)}
    assert (Recording.from_frame({**columns, **on_the_equator})["latitude"] == 0.0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda c: {k.replace("speed_fl", "speed_xx"): v for k, v in c.items()},
            "column wheel_speed_xx: the vehicle has no wheel xx; its wheels are fl, fr, rl, rr",
        ),
        (_without("wheel_speed_rr"), "column wheel_speed_rr: is missing; the log has wheel speeds for fl, fr, rl"),
        (_without("drive_torque_rr"), "column drive_torque_rr: is missing, but the wheel rr is driven"),
        (
            lambda c: {k.replace("wheel_speed_rr", "wheel_sped_rr"): v for k, v in c.items()},
            "column wheel_speed_rr: is missing; the nearest column is 'wheel_sped_rr'",
        ),
        (
            lambda c: {k.replace("torque_rr", "torqe_rr"): v for k, v in c.items()},
            "column drive_torque_rr: is missing, but the wheel rr is driven; the nearest column is 'drive_torqe_rr'",
        ),
        (lambda c: {**c, "vertical_load_middle": c["time"]}, "column vertical_load_middle: the vehicle has no axle middle"),
    ],
)  # fmt: skip
def test_log_and_vehicle_must_match(
    columns: Columns, vehicle: Vehicle, change: Callable[[Columns], Columns], message: str
) -> None:
    Recording.from_frame(columns).check_against(vehicle)
    with pytest.raises(InputError) as caught:
        Recording.from_frame(change(columns), source="log.csv").check_against(vehicle)
    assert str(caught.value).startswith(f"log.csv: {message}")


def test_an_undriven_wheel_needs_no_torque(columns: Columns, vehicle: Vehicle) -> None:
    data = vehicle.to_dict()
    data["axles"]["rear"]["driven"] = False
    del columns["drive_torque_rl"], columns["drive_torque_rr"]
    Recording.from_frame(columns).check_against(Vehicle.from_dict(data))


def test_a_pull_needs_the_hitch_height(columns: Columns, vehicle: Vehicle) -> None:
    data = vehicle.to_dict()
    del data["hitch_height"]
    with pytest.raises(InputError, match="the vehicle has no hitch_height"):
        Recording.from_frame(columns).check_against(Vehicle.from_dict(data))
    del columns["drawbar_force"]
    Recording.from_frame(columns).check_against(Vehicle.from_dict(data))


_names = st.sampled_from(
    [
        "time",
        "ground_speed",
        "wheel_speed_a",
        "wheel_speed_",
        "drive_torque_a",
        "drawbar_force",
        "soil",
        "true_x",
        "junk",
    ]
)
_cells = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=3)
    | st.binary(max_size=2)
    | st.dates()
)
_columns = (
    st.lists(_cells, max_size=5)
    | st.lists(st.floats(), max_size=5).map(np.array)
    | st.lists(st.integers(-(2**70), 2**70), max_size=4)
    | st.just(np.arange(4.0))
    | st.lists(st.datetimes(), max_size=4).map(lambda d: np.array(d, dtype="datetime64[us]"))
    | _cells
)


@settings(max_examples=400)
@given(st.dictionaries(_names, _columns, max_size=6))
def test_any_table_is_a_recording_or_refused(table: dict[str, Any]) -> None:
    try:
        recording = Recording.from_frame(table)
    except InputError as error:
        message = str(error)
        assert "\n" not in message
        return
    assert np.all(np.diff(recording.time) > 0)
    assert all(len(values) == len(recording) > 0 for values in recording.channels.values())
    assert not any(np.isinf(values).any() for values in recording.channels.values())


def test_dates_in_words_give_the_clock_as_dates_do() -> None:
    stamps = pd.date_range(
        "2026-03-29 00:59:59", periods=4, freq="500ms", tz="Europe/Berlin"
    )  # summer time begins
    speeds = {"ground_speed": [1.0] * 4, "wheel_speed_fl": [2.0] * 4}
    dates, words = (
        Recording.from_frame(pd.DataFrame({"time": time, **speeds}))
        for time in (stamps, [one.isoformat() for one in stamps])
    )
    assert words.start == dates.start == stamps[0].timestamp()
    assert words.time.tolist() == dates.time.tolist() == [0.0, 0.5, 1.0, 1.5]


def test_a_clock_that_would_leave_its_range_within_the_recording_has_no_zero() -> None:
    def zero(start: float, *time: float) -> float | None:
        return Recording(np.array(time), {"ground_speed": np.ones(len(time))}, start=start).clock_zero

    assert zero(LATEST - 10.0, 0.0, 5.0) == LATEST - 10.0
    assert zero(LATEST - 10.0, 0.0, 5.0, 10.0) is None
    assert zero(-4.0, 5.0, 6.0) == -4.0  # its first row is after 1970
    assert zero(-4.0, 4.0, 6.0) is None
    assert zero(-4.0, 3.0, 6.0) is None
    assert zero(LATEST - 10.0) is None  # without a row no clock has been read


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (2, "a, b."),
        (8, "a, b, c, d, e, f, g, h."),
        (9, "a, b, c, d, e, f, g, h and 1 more."),
        (12, "a, b, c, d, e, f, g, h and 4 more."),
    ],
)
def test_columns_without_use_are_named_up_to_eight(count: int, expected: str) -> None:
    (note,) = [
        one for one in remarks(["time", "drawbar_force", *"abcdefghijkl"[:count]]) if "not used" in one
    ]
    assert note == f"Columns that are not used: {expected}"


def test_the_table_of_a_notebook_says_how_long_the_recording_is() -> None:
    recording = Recording(np.array([100.0, 100.5, 107.5]), {"ground_speed": np.ones(3)})
    assert "3 rows, 7.5 s" in recording._repr_html_()
