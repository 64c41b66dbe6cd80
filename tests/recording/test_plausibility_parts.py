"""Doubts about units: where each begins, on signals whose ratios are known."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.speed_ratios import _pairs, _straight_ahead, ratio_of
from terragrip.recording.track import Track
from terragrip.recording.turn_rates import _turn_scale, _wheel_turn
from terragrip.recording.turns import agreement, straight_rows, windows
from terragrip.vehicle import Vehicle

N = 200
TIME = np.arange(N) / 10
RADIUS = 0.2
SPEED = 1.0 + 0.2 * np.sin(TIME)


def said(vehicle: Vehicle | None = None, time: np.ndarray = TIME, **channels: np.ndarray) -> str:
    return " ".join(unit_warnings(Recording(time, channels), vehicle))


def wheels(ratio: float) -> dict[str, np.ndarray]:
    return {f"wheel_speed_{w}": ratio * SPEED / RADIUS for w in ("fl", "fr", "rl", "rr")}


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (3.6, "wheel_speed may come from km/h"),
        (30 / np.pi, "wheel_speed may be in rpm"),
        (180 / np.pi, "wheel_speed may be in deg/s"),
        (1 / 3.6, "ground_speed may be in km/h"),
        (np.pi / 30, "converted from rpm twice"),
        (0.5 / np.pi, "revolutions per second"),
        (np.pi / 180, "from degrees to radians twice"),
        (0.01, "ground_speed may be in cm/s"),
        (0.001, "ground_speed may be in mm/s"),
        (1000.0, "a factor of 1000"),
        (RADIUS, "the rim's speed in m/s"),
        (25.0, "check units, gear ratio and radius"),
        (0.05, "check units, gear ratio and radius"),
    ],
)
@pytest.mark.parametrize("slip", [0.0, 0.15])
def test_a_ratio_of_wheel_to_ground_speed_names_the_unit_at_any_usual_slip(
    vehicle: Vehicle, ratio: float, words: str, slip: float
) -> None:
    note = said(vehicle, ground_speed=SPEED, **wheels(ratio / (1 - slip)))
    assert words in note
    assert f"is {ratio / (1 - slip):.3g} times the ground speed" in note


@pytest.mark.parametrize("seed", range(4))
def test_a_vehicle_that_digs_in_after_a_short_drive_has_no_other_unit(vehicle: Vehicle, seed: int) -> None:
    """30 m at 1 m/s, then an hour in which the wheels spin and the receiver shows its noise."""
    time = np.arange(0.0, 3630.0, 0.1)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(time))
    speed = np.where(time < 30, 1.0, 0.02) + noise
    turning = {w: np.full(len(time), 1.05 / RADIUS) for w in ("fl", "fr", "rl", "rr")}
    note = said(vehicle, time, ground_speed=speed, **{f"wheel_speed_{w}": v for w, v in turning.items()})
    assert "times the ground speed" not in note
    faster = {f"wheel_speed_{w}": 30 / np.pi * v for w, v in turning.items()}
    assert "may be in rpm" in said(
        vehicle, time, ground_speed=np.where(time < 2000, 1.0, 0.02) + noise, **faster
    )


@pytest.mark.parametrize("step", [0.1, 1.0, 5.0])
def test_a_time_of_day_written_as_hhmmss_is_named(vehicle: Vehicle, step: float) -> None:
    """As receivers write it: 10:59:59 is 105959, and 11:00:00 is 110000. Seconds of the day are left alone."""
    of_day = 10 * 3600 + 57 * 60 + step * np.arange(int(240 / step))
    minute = of_day // 60
    written = minute // 60 * 10000 + minute % 60 * 100 + of_day % 60
    speed = 1 + 0.2 * np.sin(of_day)
    channels = {"ground_speed": speed} | {f"wheel_speed_{w}": speed / RADIUS for w in vehicle.wheels}
    assert "written as hhmmss" in said(vehicle, time=written, **channels)
    assert "written as hhmmss" not in said(vehicle, time=of_day, **channels)


def test_a_clock_set_to_summer_time_is_named_where_everything_goes_on(vehicle: Vehicle) -> None:
    """A logger that was off for an hour, and one whose machine meanwhile stood elsewhere, are left alone."""
    time = 0.1 * np.arange(3000)
    speed = 1 + 0.2 * np.sin(time)
    channels = {"ground_speed": speed} | {f"wheel_speed_{w}": speed / RADIUS for w in vehicle.wheels}
    later = time >= 100
    assert "set to summer time? Write times in UTC, or subtract 3600 s" in said(
        vehicle, time=time + 3600 * later, **channels
    )
    assert "summer" not in said(vehicle, time=time + 3610 * later, **channels)
    assert "summer" not in said(vehicle, time=time + 3600 * later, **channels, latitude=50 + 0.2 * later)


def test_a_clock_set_from_1970_in_the_drive_is_named_and_the_rest_is_checked(vehicle: Vehicle) -> None:
    """By positions it had no solution, by torques and speeds a thousand million windows, 12 GB."""
    time = 0.05 * np.arange(3000)
    set_there = np.where(time < 75, time, time + 1.7e9)
    speed = 1 + 0.3 * np.sin(time / 7)
    channels = {
        "ground_speed": 3.6 * speed,
        "latitude": 50 + np.cumsum(speed) * 0.05 / 111e3,
        "longitude": 11 + 1e-8 * time,
    }
    for wheel in vehicle.wheels:
        channels |= {f"wheel_speed_{wheel}": speed / RADIUS, f"drive_torque_{wheel}": 20 + np.sin(time)}
    assert "years" not in said(vehicle, time=time, **channels)
    notes = said(vehicle, time=set_there, **channels)
    assert "time leaps by 53.9 years from 74.95 s to the next row: was the clock set there" in notes
    assert "ground_speed is 3.59 times the speed of the positions: it may be in km/h" in notes


def test_where_two_units_give_one_ratio_both_are_named(vehicle: Vehicle) -> None:
    """Rims of .165 m in m/s turn as many times too slowly as rims in revolutions per second: the slip decides between them."""
    wheel = {"radius": 0.165, "inertia": 0.27}
    small = Vehicle.from_dict(vehicle.to_dict() | {"wheel": wheel})
    for slip in (0.0, 0.03, 0.15):
        rims = {f"wheel_speed_{w}": SPEED / (1 - slip) for w in small.wheels}
        note = said(small, ground_speed=SPEED, **rims)
        assert "the rim's speed in m/s" in note
        assert "revolutions per second" in note


@pytest.mark.parametrize(
    ("beside", "words"), [(1.3, "deg/s"), (1.4, "check units"), (1 / 1.3, "deg/s"), (1 / 1.4, "check")]
)
def test_a_third_beside_what_a_unit_makes_it_is_no_unit(vehicle: Vehicle, beside: float, words: str) -> None:
    assert words in said(vehicle, ground_speed=SPEED, **wheels(1.08 * 180 / np.pi * beside))


@pytest.mark.parametrize(("ratio", "doubted"), [(0.59, True), (0.61, False), (2.19, False), (2.21, True)])
def test_what_may_be_slip_is_not_doubted(vehicle: Vehicle, ratio: float, doubted: bool) -> None:
    assert bool(said(vehicle, ground_speed=SPEED, **wheels(ratio))) is doubted
    assert bool(said(ground_speed=SPEED, wheel_based_speed=ratio * SPEED)) is doubted


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (2.4, "check units"),
        (2.6, "wheel_based_speed may be in km/h, or ground_speed was converted"),
        (5.4, "wheel_based_speed may be in km/h"),
        (5.6, "check units"),
        (1 / 2.6, "ground_speed may be in km/h, or wheel_based_speed was converted"),
        (1 / 5.6, "check units"),
    ],
)
def test_a_drive_is_in_kmh_where_it_is_about_so_many_times_faster(ratio: float, words: str) -> None:
    note = said(ground_speed=SPEED, wheel_based_speed=ratio * SPEED)
    assert note.startswith(f"wheel_based_speed is {ratio:.3g} times the ground speed: {words}")


def driven(speed: float, turn: float = 0.0) -> dict[str, np.ndarray]:
    """Positions at the equator at a constant speed [m/s]."""
    time = TIME * 3
    way = speed * time
    angle = turn * time
    north, east = (way, 0 * way) if not turn else (speed / turn * np.sin(angle), speed / turn * np.cos(angle))
    return {"latitude": north / 110_574.3, "longitude": east / 111_319.5}


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (1.0, ""),
        (1.25, ""),
        (1.35, "is 1.35 times the speed of the positions: check its unit"),
        (2.8, "is 2.8 times the speed of the positions: check its unit"),
        (3.0, "is 3 times the speed of the positions: it may be in km/h"),
        (4.3, "is 4.3 times the speed of the positions: it may be in km/h"),
        (4.5, "is 4.5 times the speed of the positions: check its unit"),
        (1 / 3.0, "is 0.333 times the speed of the positions: it was converted from km/h"),
        (1 / 4.3, "is 0.233 times the speed of the positions: it was converted from km/h"),
        (1 / 1.1, ""),
        (1 / 1.852, "the positions move 1.85 times as far as ground_speed does"),
        (1 / 2.8, "the positions move 2.8 times as far as ground_speed does"),
        (1 / 4.5, "the positions move 4.5 times as far as ground_speed does"),
    ],
)
def test_ground_speed_is_held_against_positions(times: float, words: str) -> None:
    note = said(time=3 * TIME, ground_speed=np.full(N, 2.0 * times), **driven(2.0))
    assert note == "" if not words else words in note


@pytest.mark.parametrize(("turn", "outrun"), [(0.3, True), (0.4, True), (0.45, False), (2.0, False)])
def test_positions_outrun_a_slow_speed_by_half_as_much_again_in_a_straight_line(
    turn: float, outrun: bool
) -> None:
    """In 10 s on a circle at 2 m/s they come 4/ω sin(5 ω) m, 13, 9.1 and 6.9; the ground speed makes 5.6 of it."""
    note = said(time=3 * TIME, ground_speed=np.full(N, 2.0 / 3.6), **driven(2.0, turn=turn))
    assert ("converted from km/h" in note) is outrun


def test_the_straight_way_is_told_against_the_one_driven() -> None:
    time = np.arange(0.0, 121.0)
    nothing = np.zeros(121)
    track = Track(time, 3.0 * time, 4.0 * time, nothing, nothing, nothing, nothing.astype(bool))
    log = Recording(time, {"ground_speed": np.where(time % 2, -2.0, np.nan)})
    assert _straight_ahead(log, track) == pytest.approx((2.5, 2.5))
    stop = Recording(time, {"ground_speed": np.where(time < 50, 2.0, 0.1)})  # creeping windows do not count
    assert _straight_ahead(stop, track) == pytest.approx((2.5, 2.5 / 1.117))  # five windows are few
    assert _straight_ahead(Recording(time, {"ground_speed": nothing}), track) == (0.0, 0.0)
    short = Track(time[:10], *(nothing[:10] for _ in range(5)), nothing[:10].astype(bool))
    assert _straight_ahead(log, short) == (0.0, 0.0)


def test_turns_agree_by_their_correlation_about_zero_over_two_seconds() -> None:
    time = np.arange(0.0, 80.0, 0.5)
    a = np.repeat([0.3, -0.1, 0.2, 0.0], 40)
    b = np.repeat([0.1, 0.2, 0.4, 0.1], 40)
    expected = np.sum(a * b) / np.sqrt(np.sum(a**2) * np.sum(b**2))
    assert agreement(time, a, b) == pytest.approx(expected)
    noisy = a + np.tile([1.0, -1.0, 0.0, 0.0], 40)  # which two seconds cancel
    assert agreement(time, noisy, b) == pytest.approx(expected)
    gaps = np.where(np.arange(160) % 4 == 1, np.nan, b)
    assert agreement(time + 100.0, a, gaps) == pytest.approx(expected)
    assert agreement(time, a, np.full(160, np.nan)) == 0.0
    assert agreement(time, a, 0 * b) == 0.0


@pytest.mark.parametrize(("rate", "enough"), [(0.0186, False), (0.0189, True)])
def test_under_one_and_a_half_radians_of_turning_nothing_is_compared(rate: float, enough: bool) -> None:
    time = np.arange(0.0, 80.0, 0.5)
    assert (agreement(time, np.full(160, rate), np.full(160, 0.1)) != 0.0) is enough


def test_wheels_tell_a_turn_by_right_less_left(vehicle: Vehicle) -> None:
    channels = {
        "wheel_speed_fl": np.array([1.0, np.nan, 3.0]),
        "wheel_speed_fr": np.array([2.0, 3.0, 4.0]),
        "wheel_speed_rl": np.array([1.0, 1.0, 1.0]),
        "wheel_speed_rr": np.array([4.0, 4.0, 4.0]),
    }
    log = Recording(np.arange(3.0), channels)
    np.testing.assert_allclose(_wheel_turn(log, vehicle), [2.0, 2.0, 2.0])
    np.testing.assert_allclose(_wheel_turn(log, vehicle, rims=True), [0.4, 0.4, 0.4])
    front = Recording(np.arange(3.0), {n: v for n, v in channels.items() if n != "wheel_speed_rr"})
    np.testing.assert_allclose(_wheel_turn(front, vehicle), [1.0, 1.0, 1.0])
    assert np.isnan(_wheel_turn(Recording(np.arange(3.0), {}), vehicle)).all()


@pytest.mark.parametrize(
    ("times", "doubted"), [(11.5, False), (12.5, True), (57.3, True), (99.0, True), (101.0, False)]
)
def test_a_yaw_rate_in_degrees_is_known_by_its_size(vehicle: Vehicle, times: float, doubted: bool) -> None:
    track, turn = 0.8, 0.3 * np.sign(np.sin(TIME / 2))
    car = Vehicle.from_dict({**vehicle.to_dict(), "track": track})
    sides = {f"wheel_speed_{w}": (2.0 + s * track / 2 * turn) / RADIUS for w, s in
             (("fl", -1), ("fr", 1), ("rl", -1), ("rr", 1))}  # fmt: skip
    log = Recording(TIME, sides)
    note = _turn_scale(log, times * turn, car, None)
    assert (
        note.startswith(f"angular_velocity_z is {times:.2g} times the rate of turn of the wheels' speeds")
        if doubted
        else not note
    )
    assert _turn_scale(log, times * turn, vehicle, None) == ""  # without a track there is no scale


def test_positions_tell_the_size_of_a_turn_too() -> None:
    turn, nothing = 0.3 * np.sign(np.sin(TIME / 2)), np.zeros(N)
    track = Track(TIME, nothing, nothing, 1.0 + nothing, turn, nothing, nothing.astype(bool))
    log = Recording(TIME, {})
    assert _turn_scale(log, 57.3 * turn, None, track).startswith(
        "angular_velocity_z is 57 times the rate of turn of the positions"
    )
    assert _turn_scale(log, turn, None, track) == _turn_scale(log, 57.3 * turn, None, None) == ""


def test_a_ratio_is_the_median_where_both_move() -> None:
    time = np.arange(40.0)
    speed = np.where(time < 20, 2.0, 0.5)  # under three tenths of what it reaches
    other = np.where(time % 2, -3.0, 4.0)
    assert ratio_of(Recording(time, {"ground_speed": speed}), other) == pytest.approx(1.75)
    assert ratio_of(Recording(time, {"ground_speed": other}), speed) == pytest.approx((2 / 3 + 2 / 4) / 2)
    assert ratio_of(Recording(time[:10], {"ground_speed": speed[:10]}), other[:10]) == pytest.approx(1.75)
    assert ratio_of(Recording(time[:9], {"ground_speed": speed[:9]}), other[:9]) is None
    assert ratio_of(Recording(time, {"ground_speed": 0 * speed}), other) is None
    assert ratio_of(Recording(time, {"ground_speed": np.full(40, np.nan)}), other) is None


def test_of_a_long_log_four_thousand_pairs_are_enough() -> None:
    time = np.arange(40_000.0)
    speed, turning = _pairs(time, time, 2 * time) or (time, time)
    assert len(speed) == 4000
    np.testing.assert_array_equal(turning, 2 * speed)
    speed, turning = _pairs(time, np.where(time % 2, time, np.nan), np.where(time % 3, 2 * time, np.nan)) or (
        time,
        time,
    )
    assert 4000 <= len(speed) < 5000
    np.testing.assert_allclose(turning[1:-1], 2 * speed[1:-1])


def test_speeds_that_are_measured_by_turns_are_compared_within_three_samples() -> None:
    """Before a gap of more, and never beyond the last sample behind one."""
    time = np.r_[np.arange(0.0, 10.0), np.arange(20.0, 23.0)]
    result = _pairs(time, np.where(time < 21, 0.1 * time, np.nan), np.where(time % 2 == 1, time, np.nan))
    assert result is not None
    np.testing.assert_allclose(result, [[0.1, 0.3, 0.5, 0.7, 0.9], [1.0, 3.0, 5.0, 7.0, 9.0]])
    two = _pairs(np.arange(4.0), np.array([1.0, np.nan, 3.0, np.nan]), np.array([np.nan, 5.0, np.nan, 7.0]))
    assert two is not None
    np.testing.assert_allclose(two, [[2.0, 3.0], [5.0, 7.0]])
    one = np.array([1.0, np.nan, np.nan, np.nan])
    assert _pairs(np.arange(4.0), one, np.arange(4.0)) is None
    assert _pairs(np.arange(4.0), np.arange(4.0), one) is None


@pytest.mark.parametrize(
    ("channel", "value", "words"),
    [
        ("pitch", 1.5, ""),
        ("pitch", 1.7, "pitch reaches 1.7 rad: it may be in degrees."),
        ("roll", -1.7, "roll reaches 1.7 rad: it may be in degrees."),
        ("longitude", 179.0, ""),
        ("longitude", -180.5, "longitude exceeds 180: it must be in degrees."),
        ("latitude", 180.0, ""),
        ("acceleration_z", 0.91, "acceleration_z rests at 1: the accelerations may be in g."),
        ("acceleration_z", -1.09, "acceleration_z rests at 1: the accelerations may be in g."),
        ("acceleration_z", 0.89, ""),
        ("acceleration_z", 1.11, ""),
        ("acceleration_z", -7.9, ""),
        (
            "acceleration_z",
            -8.1,
            "acceleration_z rests at -g: the axes point the other way (z up, specific force); y and the turns may, too.",
        ),
    ],
)
def test_angles_and_gravity_are_doubted_by_their_size(channel: str, value: float, words: str) -> None:
    few = np.where(np.arange(N) % 3, np.nan, value)
    assert said(ground_speed=SPEED, **{channel: few}) == words
    assert said(ground_speed=SPEED, **{channel: np.full(N, np.nan)}) == ""


def test_a_mass_of_the_load_alone_is_doubted(vehicle: Vehicle) -> None:
    """A tank of 3 t of a sprayer of 11.5 t gave four times the adhesion, and half of the rows as outliers, without a word."""
    assert said(vehicle, mass=np.linspace(20.0, 65.0, N)).startswith(
        "mass reads up to 62.75 kg, under half of"
    )
    assert said(vehicle, mass=np.linspace(80.0, 139.0, N)) == ""


def test_a_payload_that_nothing_weighs_is_named(vehicle: Vehicle) -> None:
    """A sprayer whose tank of 4 t empties, with its mean mass in the file: the resistance was held in 81 % of the rows, without a word."""
    tree = vehicle.to_dict() | {"payload": {"x": 0.3, "z": 0.5}}
    tank, torque = Vehicle.from_dict(tree), {"drive_torque_fl": np.full(N, 9.0)}
    assert said(tank, **torque).startswith("The vehicle file places a payload, but the log has no mass")
    assert said(tank, **torque, mass=np.linspace(120.0, 150.0, N)) == ""
    assert said(tank) == "", "slip alone needs no mass"
    for share in (0.25, 0.0):
        uncertainty = tree.get("uncertainty", {}) | {"mass": share}
        assert said(Vehicle.from_dict(tree | {"uncertainty": uncertainty}), **torque) == ""


@pytest.mark.parametrize(
    ("step", "rows", "words"),
    [
        (4.9, 50, ""),
        (5.0, 50, "The samples are 5 s apart: time may not be in seconds."),
        (5.0, 10, "The samples are 5 s apart: time may not be in seconds."),
        (5.0, 9, ""),
        (5.0, 9000, "The samples are 5 s apart: time may not be in seconds."),
        (1.1e-4, 50, ""),
        (0.9e-4, 50, "The samples are 9e-05 s apart: time may not be in seconds."),
    ],
)
def test_samples_five_seconds_apart_may_be_in_another_unit(step: float, rows: int, words: str) -> None:
    assert said(time=step * np.arange(rows), drawbar_force=np.zeros(rows)) == words
    if step < 1.0:
        return
    first = np.r_[
        0.0, 10.0 - step + step * np.arange(rows - 1)
    ]  # a first step of the other kind changes nothing
    assert said(time=first, drawbar_force=np.zeros(rows)) == words


def test_windows_hold_the_rows_in_which_every_channel_does() -> None:
    time = 50.0 + np.arange(0.0, 8.0, 0.5)
    a, b = np.arange(16.0), np.where((np.arange(16) == 5) | (np.arange(16) > 11), np.nan, 2.0)
    np.testing.assert_allclose(windows(time, np.array([a, b])), [[1.5, 17 / 3, 9.5], [2.0, 2.0, 2.0]])
    assert windows(time, np.array([a, np.full(16, np.nan)])).shape == (2, 0)


@pytest.mark.parametrize(("rows", "few"), [(31, False), (30, True)])
def test_straight_rows_are_those_of_alike_sides_or_else_of_one_way(
    vehicle: Vehicle, rows: int, few: bool
) -> None:
    """Apart by less than a fifth of the sum: 4 beside 6 is straight no more; 30 rows are too few."""
    straight = np.arange(100) < rows
    sides = {
        "fl": np.full(100, 4.01),
        "fr": np.where(straight, 6.0, 6.1),
        "rl": np.ones(100),
        "rr": np.where(np.arange(100) > 90, -1.0, 1.0),
    }
    log = Recording(np.arange(100.0), {f"wheel_speed_{w}": v for w, v in sides.items()})
    expected = np.arange(100) <= 90 if few else straight
    np.testing.assert_array_equal(straight_rows(log, vehicle), expected)
    rig = Vehicle.from_dict(
        {"mass": 20, "axles": {"only": {"mass": 20, "wheels": ["w"]}}, "wheel": {"radius": 0.2, "inertia": 1}}
    )  # a wheel alone has no other side, and stands straight too
    assert straight_rows(Recording(np.arange(100.0), {"wheel_speed_w": np.zeros(100)}), rig).all()
