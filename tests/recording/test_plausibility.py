"""Units that are likely wrong are reported, right ones are not."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.speed_ratios import _pairs
from terragrip.recording.turns import filled
from terragrip.vehicle import Vehicle

Columns = dict[str, np.ndarray]


def scaled(columns: Columns, prefix: str, factor: float) -> Recording:
    return Recording.from_frame({n: v * factor if n.startswith(prefix) else v for n, v in columns.items()})


@pytest.mark.parametrize(
    ("prefix", "factor", "expected"),
    [
        ("ground_speed", 3.6, "ground_speed may be in km/h"),
        ("wheel_speed", 3.6, "may come from km/h"),
        ("wheel_speed", 60 / (2 * np.pi), "rpm"),
        ("wheel_speed", 180 / np.pi, "deg/s"),
        ("wheel_speed", 1 / (2 * np.pi), "revolutions per second"),
        ("wheel_speed", 0.2, "rim's speed in m/s"),
        ("ground_speed", 100.0, "cm/s"),
        ("ground_speed", 1000.0, "mm/s"),
        ("wheel_speed", 25.0, "gear ratio"),
    ],
)
def test_a_wrong_unit_is_named(
    columns: Columns, vehicle: Vehicle, prefix: str, factor: float, expected: str
) -> None:
    notes = unit_warnings(scaled(columns, prefix, factor), vehicle)
    assert len(notes) == 1
    assert expected in notes[0]
    assert "fl, fr, rl, rr" in notes[0]


def test_a_rim_speed_in_kmh_is_named(columns: Columns, vehicle: Vehicle) -> None:
    tractor = Vehicle.from_dict({**vehicle.to_dict(), "wheel": {"radius": 0.8, "inertia": 40}})
    notes = unit_warnings(scaled(columns, "wheel_speed", 0.2 * 3.6), tractor)
    assert "rim's speed in km/h" in notes[0]


def test_one_wheel_alone_is_named(columns: Columns, vehicle: Vehicle) -> None:
    notes = unit_warnings(scaled(columns, "wheel_speed_rl", 9.549), vehicle)
    assert len(notes) == 1
    assert "wheel speed of rl times" in notes[0]


@pytest.mark.parametrize(("spins", "said"), [(False, True), (True, False)])
def test_axles_of_unlike_rims_keep_one_ratio_where_radii_are_exchanged(
    columns: Columns, vehicle: Vehicle, spins: bool, said: bool
) -> None:
    """A rear axle that spins at times is no error."""
    more = 1.3 + (0.5 * np.sin(columns["time"] / 5) if spins else 0.0)
    rear = {n: v * more if n.startswith("wheel_speed_r") else v for n, v in columns.items()}
    notes = unit_warnings(Recording.from_frame(rear), vehicle)
    assert any("The rims of the axle rear go" in note for note in notes) is said


def test_axles_of_a_drive_that_goes_straight_but_slowly_are_not_compared(vehicle: Vehicle) -> None:
    """Such a drive, a radius off by 1.3, ended as "a defect of Terragrip" (an index out of bounds)."""
    time = np.arange(0, 200, 0.1)
    speed = np.where(time < 60, 0.3, 1.5)
    log = {"time": time, "ground_speed": speed}
    for wheel in vehicle.wheels:
        side = np.where(speed > 1, 1.4 if wheel[1] == "r" else 0.6, 1.0)
        log[f"wheel_speed_{wheel}"] = speed * side / 0.2 * (1.3 if wheel[0] == "r" else 1.0)
    assert not any("rims of the axle" in note for note in unit_warnings(Recording.from_frame(log), vehicle))


@pytest.mark.parametrize("slip", [-0.2, 0.0, 0.1, 0.3, 0.5])
def test_slip_is_no_wrong_unit(columns: Columns, vehicle: Vehicle, slip: float) -> None:
    notes = unit_warnings(scaled(columns, "wheel_speed", 0.93 / (1 - slip)), vehicle)
    assert [note for note in notes if not note.startswith("While the wheels pull")] == []
    assert bool(notes) is (slip < 0)  # no wheel that pulls has such a slip


def test_standstill_and_backward_say_nothing(columns: Columns, vehicle: Vehicle) -> None:
    still = {n: 0 * v if "speed" in n else v for n, v in columns.items()}
    assert unit_warnings(Recording.from_frame(still), vehicle) == []
    (note,) = unit_warnings(scaled(columns, "ground_speed", 0.0), vehicle)
    assert "ground_speed (0) never changes while the wheels turn" in note
    backward = {n: -v if "speed" in n or "torque" in n else v for n, v in columns.items()}
    assert unit_warnings(Recording.from_frame(backward), vehicle) == []


def test_rates_that_never_share_a_row_are_compared(columns: Columns, vehicle: Vehicle) -> None:
    odd = np.arange(6000) % 2 == 1
    mixed = {
        n: np.where(odd, v * 3.6, np.nan)
        if n == "ground_speed"
        else np.where(odd, np.nan, v)
        if "speed" in n
        else v
        for n, v in columns.items()
    }
    assert "km/h" in unit_warnings(Recording.from_frame(mixed), vehicle)[0]


def test_angles_acceleration_and_time(columns: Columns, vehicle: Vehicle) -> None:
    n = len(columns["time"])
    frame = {
        **columns,
        "pitch": np.full(n, 5.0),
        "acceleration_z": np.full(n, 1.0),
        "latitude": np.full(n, 501.0),
    }
    frame["time"] = columns["time"] * 1000
    notes = " ".join(unit_warnings(Recording.from_frame(frame), vehicle))
    for expected in (
        "pitch reaches 5 rad",
        "may be in g",
        "latitude exceeds 180",
        "time may not be in seconds",
    ):
        assert expected in notes
    free_of_gravity = {**columns, "acceleration_z": np.full(n, 0.02)}
    assert unit_warnings(Recording.from_frame(free_of_gravity), vehicle) == []
    upside_down = {**columns, "acceleration_z": np.full(n, -9.8)}
    assert "other way" in unit_warnings(Recording.from_frame(upside_down), vehicle)[0]


def test_speeds_of_two_rates_are_compared_at_one_time() -> None:
    time = np.arange(0.0, 20.0, 0.1)
    speed, turning = 1.0 + 0.1 * time, 5.0 + 0.5 * time
    sparse = np.where(np.arange(200) % 10 == 0, speed, np.nan)
    ground, rim = _pairs(time, sparse, np.where(np.arange(200) % 7 == 3, turning, np.nan))
    assert len(ground) == 29
    known = rim < 5.0 + 0.5 * 19.0  # behind the last sample of the ground speed it is held
    np.testing.assert_allclose(5.0 * ground[known], rim[known])
    assert _pairs(time[:1], speed[:1], turning[:1]) is None
    assert _pairs(time, np.full(200, np.nan), turning) is None


def test_gaps_of_a_turn_are_bridged_and_nothing_stays_nothing() -> None:
    time = np.arange(5.0)
    np.testing.assert_allclose(
        filled(time, np.array([0.0, np.nan, 2.0, 3.0, np.nan])), [0.0, 1.0, 2.0, 3.0, 3.0]
    )
    assert np.isnan(filled(time, np.full(5, np.nan))).all()


@pytest.mark.parametrize(("factor", "unit"), [(0.5144, "knots"), (0.447, "miles an hour"), (0.2778, "km/h")])
def test_one_factor_of_wheels_of_unlike_radii_is_the_ground_speeds(
    columns: Columns, vehicle: Vehicle, factor: float, unit: str
) -> None:
    """The front wheels' radius is the factor of a knot: their speeds were said to be rims'."""
    data = vehicle.to_dict()
    data["axles"]["front"]["wheel"] = {**data["wheel"], "radius": 0.53}
    fast = columns | {"ground_speed": columns["ground_speed"] / factor}
    fast |= {n: v * 0.2 / 0.53 for n, v in columns.items() if n.startswith("wheel_speed_f")}
    (note,) = [
        n
        for n in unit_warnings(Recording.from_frame(fast), Vehicle.from_dict(data))
        if "times the ground speed" in n
    ]
    assert f"ground_speed may be in {unit}" in note
