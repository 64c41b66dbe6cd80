"""Codes for "not measured", a clock in another unit, a ground speed that is the wheels' own: on a made drive (Newton)."""

from __future__ import annotations

import re
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.clock import clock_times
from terragrip.vehicle import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, G = 800.0, 0.35, 9.80665
Columns = dict[str, np.ndarray]


def machine(**rear: object) -> Vehicle:
    axles = {
        "front": {"mass": 350, "wheels": ["fl", "fr"]},
        "rear": {"mass": 450, "wheels": ["rl", "rr"], **rear},
    }
    base = {
        "mass": MASS,
        "wheelbase": 1.3,
        "track": 1.1,
        "center_of_gravity_height": 0.5,
        "hitch_height": 0.3,
    }
    return Vehicle.from_dict({**base, "axles": axles, "wheel": {"radius": RADIUS, "inertia": 4}})


def drive(rate: float = 20.0) -> Columns:
    """Five minutes at 0 to 2 m/s with a stop each minute, a changing pull, positions."""
    draws = np.random.default_rng(7)
    time = np.arange(0, 300, 1 / rate)
    speed = np.interp(time % 60, [0, 4, 25, 45, 49, 52], [0, 1.6, 1.2, 2.0, 1.9, 0])
    change = np.gradient(speed, time)
    pull = np.where(speed > 0.1, 900 + 500 * np.sin(time / 9), 0.0)
    thrust = pull + MASS * (change + 0.06 * G * (speed > 0))
    north = np.cumsum(speed) / rate
    result = {
        "time": time,
        "ground_speed": speed + 0.01 * draws.standard_normal(len(time)),
        "drawbar_force": pull + 10 * draws.standard_normal(len(time)),
        "latitude": 51 + north / 111_250,
        "longitude": 13 + 1e-7 * draws.standard_normal(len(time)),
    }
    for wheel in WHEELS:
        turning = speed / (1 - thrust / (MASS * G) / 5) / RADIUS
        result[f"wheel_speed_{wheel}"] = turning + 0.02 * draws.standard_normal(len(time))
        result[f"drive_torque_{wheel}"] = thrust / 4 * RADIUS + 2 * draws.standard_normal(len(time))
    return result


def notes_on(columns: Columns, vehicle: Vehicle | None = None) -> list[str]:
    return unit_warnings(Recording.from_frame(columns), vehicle or machine())


def spoilt(name: str, code: float, share: float = 0.01) -> Columns:
    columns = drive()
    rows = np.random.default_rng(3).random(len(columns["time"])) < share
    return columns | {name: np.where(rows, code, columns[name])}


@pytest.mark.parametrize("rate", [1.0, 20.0, 100.0])
def test_a_right_log_says_nothing(rate: float) -> None:
    assert notes_on(drive(rate)) == []


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("ground_speed", 9999.0),
        ("ground_speed", -9999 / 3.6),
        ("wheel_speed_fl", 65535.0),
        ("drive_torque_rr", -99999.0),
        ("drawbar_force", 1e6),
    ],
)
def test_a_code_for_no_value_is_named_alone(name: str, code: float) -> None:
    """Scale, sign and slip are judged without it."""
    (note,) = notes_on(spoilt(name, code))
    assert note.startswith(f"{name} is {code:.6g} in ")
    assert "'invalid: [...]' in the profile" in note


def test_one_code_in_many_channels_is_one_sentence() -> None:
    """A logger's -9999 in all 17 channels gave 17 lines, and two on a latitude and a longitude that 'must be in degrees'."""
    sound = drive()
    rows = np.random.default_rng(3).random(len(sound["time"])) < 0.01
    (note,) = notes_on({n: v if n == "time" else np.where(rows, -9999.0, v) for n, v in sound.items()})
    first = [name for name in sound if name != "time"][:6]
    assert note.startswith(", ".join(first))
    assert "and 6 more are -9999 in some rows: a code for 'not measured'" in note


@pytest.mark.parametrize(
    ("name", "value"), [("drive_torque_rr", 300.0), ("drawbar_force", 6000.0), ("ground_speed", 12.0)]
)
def test_what_a_machine_can_have_is_no_code(name: str, value: float) -> None:
    assert not any("a code for" in note for note in notes_on(spoilt(name, value)))


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("ground_speed", 65.535),
        ("ground_speed", 65.535 / 3.6),
        ("drive_torque_fl", 655.35),
        ("drive_torque_fl", -1.0),
        ("wheel_speed_fl", 255.0),
        *(
            ("drive_torque_fl", code)
            for code in (655.34, -655.35, 327.67, -327.67, -327.68, 999.9, -999.9, -999.99, 999.99)
        ),
    ],
)
def test_a_code_that_a_machine_could_have_is_named_where_single_samples_leap_to_it(
    name: str, code: float
) -> None:
    """65535 after its scale, and -1: no other channel is accused for them."""
    (note,) = notes_on(spoilt(name, code))
    assert note.startswith(f"{name} is {code:.6g} in ")
    assert "leaps there and back: a code for 'not measured'" in note


def test_four_values_that_leap_are_no_code_and_a_slow_log_may_stop_and_go() -> None:
    columns = drive()
    columns["drive_torque_fl"][[500, 1500, 2500, 3500]] = 9999.0
    assert not any("a code for" in note for note in notes_on(columns))
    slow = {name: values[::8] for name, values in spoilt("drive_torque_fl", -1.0).items()}
    assert np.count_nonzero(slow["drive_torque_fl"] == -1.0) > 5
    assert not any("a code for" in note for note in notes_on(slow))


def test_torques_in_whole_units_may_be_minus_1() -> None:
    columns = drive()
    whole = {name: np.round(columns[name]) for name in columns if name.startswith("drive_torque")}
    assert np.count_nonzero(whole["drive_torque_fl"] == -1.0) > 20
    assert not any("a code for" in note for note in notes_on(columns | whole))


def test_a_free_cell_in_whole_units_may_be_0_or_minus_1() -> None:
    columns = spoilt("drawbar_force", -1.0)
    columns["drawbar_force"] = np.where(columns["drawbar_force"] == -1.0, -1.0, 0.0)
    assert not any("a code for" in note for note in notes_on(columns))


def test_spikes_that_differ_are_no_code_and_a_wrong_unit_is_none() -> None:
    columns = drive()
    rows = np.arange(0, len(columns["time"]), 100)
    spikes = columns["ground_speed"].copy()
    spikes[rows] = 5000.0 + rows
    assert not any("a code for" in note for note in notes_on(columns | {"ground_speed": spikes}))
    assert not any(
        "a code for" in note for note in notes_on(columns | {"ground_speed": 1e3 * columns["ground_speed"]})
    )


@pytest.mark.parametrize(
    ("rate", "factor", "unit"),
    [(20.0, 60.0, "min"), (1.0, 60.0, "min"), (20.0, 3600.0, "h"), (20.0, 86400.0, "d")],
)
@pytest.mark.parametrize("placed", [True, False])
def test_time_in_minutes_hours_or_days_is_named_alone(
    rate: float, factor: float, unit: str, placed: bool
) -> None:
    columns = drive(rate) | {"time": drive(rate)["time"] / factor}
    if not placed:
        columns = {n: v for n, v in columns.items() if n not in ("latitude", "longitude")}
    (note,) = notes_on(columns)
    assert re.search(
        r"change their speed by .* more than any ground allows: time may not be in seconds", note
    )
    assert f"unit: {unit}}}" in note


def test_speeds_in_thousandths_are_no_clock_in_minutes() -> None:
    """850 m/s: 'give the unit of time, min'."""
    notes = notes_on({n: v * (1e3 if "speed" in n else 1.0) for n, v in drive().items()})
    assert any("they reach" in note and "'ground_speed: {from: ..., unit: mm/s}'" in note for note in notes)
    assert not any("time may not be" in note for note in notes)


def test_a_drive_of_two_starts_tells_of_its_clock() -> None:
    """Of 300 s it changes its speed in 4: of 192 simulated drives in minutes, 51 were left alone."""
    columns = drive()
    draws = np.random.default_rng(2)
    speed = np.interp(columns["time"], [0, 10, 12, 150, 152, 300], [0, 0, 1.6, 1.6, 1.1, 1.1])
    columns = {"time": columns["time"] / 60, "ground_speed": speed + 0.01 * draws.standard_normal(len(speed))}
    columns |= {f"wheel_speed_{w}": speed / RADIUS + 0.02 * draws.standard_normal(len(speed)) for w in WHEELS}
    assert any("time may not be in seconds" in note for note in notes_on(columns))


@pytest.mark.parametrize("first", [45415.4, 739376.4])
def test_days_of_a_spreadsheet_or_of_matlab_are_known_by_their_number(first: float) -> None:
    """The shortest unit that explains such changes was hours: with it, the drive is 24 times too fast."""
    columns = drive()
    assert any("unit: d}" in note for note in notes_on(columns | {"time": first + columns["time"] / 86400}))


def test_positions_that_outrun_the_way_of_a_gentle_drive_tell_of_the_clock() -> None:
    """It changes its speed by .003 m/s²: a sixtieth of the time makes that no impossible one."""
    time = np.arange(0, 1200, 0.1)
    speed = 1.5 + 0.3 * np.sin(time / 100)
    draws = np.random.default_rng(1)
    columns = {"time": time / 60, "ground_speed": speed + 0.01 * draws.standard_normal(len(time))}
    columns |= {f"wheel_speed_{w}": speed / RADIUS + 0.01 * draws.standard_normal(len(time)) for w in WHEELS}
    columns |= {"latitude": 51 + np.cumsum(speed) * 0.1 / 111_250, "longitude": np.full(len(time), 13.0)}
    (note,) = notes_on(columns)
    assert re.match(
        r"The positions lie 1633 m apart, where ground and wheels drove 30\.07 m: time may not be in seconds",
        note,
    )
    assert "unit: min}" in note


def test_a_machine_that_was_carried_away_while_the_logger_was_off_is_no_clock_in_another_unit() -> None:
    """Nor is one whose receiver gave no speed between two rests."""
    columns = drive()
    later = columns["time"] >= 150
    away = columns | {"time": columns["time"] + 3600.0 * later, "latitude": columns["latitude"] + 0.2 * later}
    assert notes_on(away) == []
    blind = np.where((columns["time"] > 2) & (columns["time"] < 298), np.nan, columns["ground_speed"])
    assert not any("time may not be" in note for note in notes_on(columns | {"ground_speed": blind}))


def test_rows_counted_for_seconds_are_told_where_wheels_go_with_the_ground_speed() -> None:
    columns = drive()
    notes = notes_on(columns | {"time": np.arange(len(columns["time"]), dtype=float)})
    assert any(note.endswith("The wheel speeds agree with it: time may not be in seconds.") for note in notes)
    assert not any(
        "time may not be" in note
        for note in notes_on(columns | {"ground_speed": 3.6 * columns["ground_speed"]})
    )


@pytest.mark.parametrize(
    ("back", "hint"),
    [(3.0, "sort the rows, or split the log there"), (150.0, "split the log there: another one seems to begin"),
     (3600.0, "was the clock set to winter time[?] Write times in UTC, or add 3600 s from there on")],
)  # fmt: skip
def test_a_time_that_runs_back_says_what_to_do(back: float, hint: str) -> None:
    columns = drive()
    time = columns["time"] - back * (columns["time"] >= 150)
    with pytest.raises(
        InputError, match=rf"column time, row 3001 \(time .* s\): time goes back from 149.95 s; {hint}"
    ):
        Recording.from_frame(columns | {"time": time})


def test_rows_in_no_order_are_to_be_sorted() -> None:
    """'split the log there: another one seems to begin', of a table that was shuffled."""
    columns, order = drive(), np.random.default_rng(0).permutation(4000)
    with pytest.raises(InputError, match=r"sort the rows by time, in pandas: table.sort_values\('time'\)"):
        Recording.from_frame({name: values[:4000][order] for name, values in columns.items()})


def test_a_ground_speed_that_is_the_wheels_own_is_named() -> None:
    columns = drive()
    own = RADIUS * np.mean([columns[f"wheel_speed_{w}"] for w in WHEELS], axis=0)
    assert any(
        "ground_speed is made of the wheels' speeds" in note
        for note in notes_on(columns | {"ground_speed": own})
    )


def test_a_free_wheel_that_was_made_of_the_ground_speed_is_none() -> None:
    """docs/vehicle.md asks for it."""
    columns = {n: v for n, v in drive().items() if n not in ("drive_torque_rl", "drive_torque_rr")}
    columns |= {f"wheel_speed_{w}": columns["ground_speed"] / RADIUS for w in ("rl", "rr")}
    assert not any("odometry" in note for note in notes_on(columns, machine(driven=False)))


@pytest.mark.parametrize(("factor", "unit"), [(0.1, "daN"), (1 / G, "daN"), (1 / 4.448, "lbf")])
def test_a_drawbar_force_in_another_unit_is_named(factor: float, unit: str) -> None:
    columns = drive()
    (note,) = notes_on(columns | {"drawbar_force": factor * columns["drawbar_force"]})
    assert f"it may be in {unit}: write 'unit: {unit}' for it in the profile" in note


@pytest.mark.parametrize(
    "stamps", [np.round(np.arange(200) / 50, 1), np.float32(1.7e9) + np.zeros(200, dtype=np.float32)]
)
def test_rounded_stamps_are_told_from_a_row_that_stands_twice(stamps: np.ndarray) -> None:
    columns = {name: values[:200] for name, values in drive().items()}
    with pytest.raises(
        InputError, match=r"row 2 .*: time repeats, as \d+% of the stamps here do: they are rounded"
    ):
        Recording.from_frame(columns | {"time": stamps.astype(np.float64)})
    once = columns["time"].copy()
    once[100] = once[99]
    with pytest.raises(InputError, match=r"row 101 .*: time repeats; keep one row per instant"):
        Recording.from_frame(columns | {"time": once})


def test_clock_times_are_those_of_the_calendar_in_utc() -> None:
    start = datetime(2026, 3, 1, 0, 30, tzinfo=timezone(timedelta(hours=2)))
    dates = clock_times(np.array([0.0, 1.25, 86400.0]), start)
    assert dates.astype(str).tolist() == [
        "2026-02-28T22:30:00.000000",
        "2026-02-28T22:30:01.250000",
        "2026-03-01T22:30:00.000000",
    ]


@pytest.mark.parametrize(
    ("time", "why"),
    [
        (np.floor(np.arange(20) / 2), "rounded, stored with too few digits, or of several machines"),
        (np.r_[0:10, 9:20], "keep one row per instant"),
    ],
)
def test_stamps_that_repeat_are_rounded_where_many_do(time: np.ndarray, why: str) -> None:
    speeds = {"ground_speed": np.ones(len(time)), "wheel_speed_l": np.ones(len(time))}
    with pytest.raises(InputError, match=why):
        Recording.from_frame({"time": time, **speeds})
