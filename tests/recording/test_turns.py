"""Wheels that are exchanged are named, by turns and by torques straight ahead; right logs are left alone (simulation)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from development_machine import machine
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.turns import _uneven, exchange_warnings, straight_rows
from terragrip.simulation import SimulationResult, families
from terragrip.vehicle import Vehicle

TURNING, WORKING = 1, 7
"""Of the development machines: one that turns, of unlike axles, and one that works straight ahead."""


def notes_on(
    result: SimulationResult, pair: tuple[str, str] = ("", ""), *quantities: str, without: str = "-"
) -> list[str]:
    """The notes on a machine's log, two wheels exchanged in it, and without some channel."""
    log, channels = result.recording, dict(result.recording.channels)
    for quantity in quantities:
        a, b = (f"{quantity}_{wheel}" for wheel in pair)
        channels[a], channels[b] = log.channels[b], log.channels[a]
    kept = {name: values for name, values in channels.items() if not name.startswith(without)}
    return unit_warnings(replace(log, channels=kept), result.vehicle)


@pytest.mark.sample(4)
@pytest.mark.parametrize("number", range(24))
def test_a_right_log_is_left_alone(number: int) -> None:
    result = machine(number)
    assert notes_on(result) == []
    assert notes_on(result, without="angular_velocity") == []


@pytest.mark.parametrize(
    ("kind", "seed", "rate"),
    [
        (families.Kind("robot", "brixius", "plain", "rigid"), 23, 10.0),
        (families.Kind("tractor", "sinkage", "plain", "rigid"), 28, None),
        (families.Kind("robot", "sinkage", "multirate", "rolling"), 22, 100.0),
    ],
)
def test_an_axle_that_slips_far_beyond_the_other_is_no_exchange_and_no_scale(
    kind: families.Kind, seed: int, rate: float | None
) -> None:
    """Straight ahead, and the last one stuck: its free wheels stand, and what they read is noise."""
    result = families.draw(kind, seed, rate=rate)
    assert unit_warnings(result.recording, result.vehicle) == []


@pytest.mark.parametrize("pair", [("1l", "1r"), ("1l", "2r"), ("2l", "1r"), ("2l", "2r")])
@pytest.mark.parametrize("quantities", [("wheel_speed",), ("wheel_speed", "drive_torque")])
def test_a_left_wheel_for_a_right_one_is_named_by_turns(
    pair: tuple[str, str], quantities: tuple[str, ...]
) -> None:
    note = notes_on(machine(TURNING), pair, *quantities)[0]
    assert note.startswith(f"wheel_speed_{pair[0]} and wheel_speed_{pair[1]} may be exchanged: in turns")


def test_without_a_gyroscope_both_pairs_that_would_do_are_named() -> None:
    notes = notes_on(machine(TURNING), ("1l", "1r"), "wheel_speed", without="angular_velocity")
    assert [n.split(" may be")[0] for n in notes] == [
        "wheel_speed_1l and wheel_speed_1r, or wheel_speed_2l and wheel_speed_2r"
    ]


@pytest.mark.parametrize("pair", [("1l", "2l"), ("1l", "2r"), ("1r", "2l"), ("1r", "2r")])
def test_torques_of_two_axles_are_named_straight_ahead(pair: tuple[str, str]) -> None:
    notes = notes_on(machine(WORKING), pair, "drive_torque")
    assert [n.split(": ")[0] for n in notes] == [
        f"drive_torque_{pair[0]} and drive_torque_{pair[1]} may be exchanged"
    ]


@pytest.mark.parametrize(("torques", "pairs"), [([4, 2, 2, 4], [(0, 2)]), ([4, 2, 6, 3], [])])
def test_an_exchange_must_make_both_axles_alike_from_side_to_side(
    torques: list[float], pairs: list[tuple[int, int]]
) -> None:
    """One that only shares the pull as the loads, 1 to 2 and nearly 8 to 7, mends nothing."""
    loads = np.array([1.0, 2.0]) if pairs else np.ones(2)
    steady = np.outer(torques, np.ones(20))
    assert _uneven(np.full((4, 20), 2.0), steady, np.ones(4), [(0, 1), (2, 3)], loads) == pairs


def test_torques_count_where_the_vehicle_pulls() -> None:
    """It coasts for most of the drive, at torques of nothing but an offset that all have."""
    torques = np.hstack([np.outer([4, 2, 2, 4], np.ones(20)), np.full((4, 60), 0.2)])
    found = _uneven(np.full((4, 80), 2.0), torques, np.ones(4), [(0, 1), (2, 3)], np.array([1.0, 2.0]))
    assert found == [(0, 2)]


@pytest.mark.parametrize(("share", "pairs"), [(0.55, []), (1.0, [(0, 2)])])
def test_what_a_chassis_shifts_for_half_of_the_drive_is_no_exchange(
    share: float, pairs: list[tuple[int, int]]
) -> None:
    rows = np.arange(40) < 40 * share
    torques = np.where(rows, np.array([[4.0], [2.0], [2.0], [4.0]]), 3.0)
    assert (
        _uneven(np.full((4, 40), 2.0), torques, np.ones(4), [(0, 1), (2, 3)], np.array([1.0, 2.0])) == pairs
    )


def test_of_wheels_of_unlike_radii_the_pulls_are_compared_with_the_loads() -> None:
    """Torques of a steady tractor, in closed form: front left and rear right exchanged, which front right and rear left
    would mend too, were the torques compared."""
    wheels, radii, loads = ("fl", "fr", "rl", "rr"), (0.5, 0.5, 0.8, 0.8), (4000.0, 3600.0)
    axles = {
        name: {
            "mass": loads[k],
            "wheels": list(wheels[2 * k :][:2]),
            "wheel": {"radius": radii[2 * k], "inertia": 1},
        }
        for k, name in enumerate(("front", "rear"))
    }
    vehicle = Vehicle.from_dict(
        {"mass": sum(loads), "wheelbase": 2.8, "center_of_gravity_height": 1, "axles": axles}
    )
    columns = {"time": np.arange(0.0, 60.0, 0.5), "ground_speed": np.full(120, 1.8)}
    for wheel, radius, load in zip(wheels, radii, np.repeat(loads, 2), strict=True):
        columns[f"wheel_speed_{wheel}"] = np.full(120, 2.0 / radius)
        columns[f"drive_torque_{wheel}"] = np.full(120, load * radius)
    columns["drive_torque_fl"], columns["drive_torque_rr"] = (
        columns["drive_torque_rr"],
        columns["drive_torque_fl"],
    )
    (note,) = exchange_warnings(Recording.from_frame(columns), vehicle, None)
    assert note.startswith("drive_torque_fl and drive_torque_rr may be exchanged: straight ahead")


@pytest.mark.parametrize("gyroscope", [True, False])
def test_gains_and_radii_that_are_off_are_no_exchange(gyroscope: bool) -> None:
    result = machine(TURNING)
    channels = {n: v for n, v in result.recording.channels.items() if gyroscope or "angular" not in n}
    for k, wheel in enumerate(result.vehicle.wheels):
        channels[f"drive_torque_{wheel}"] = channels[f"drive_torque_{wheel}"] * (0.9, 1.1, 1.1, 0.9)[k]
        channels[f"wheel_speed_{wheel}"] = channels[f"wheel_speed_{wheel}"] * (0.98, 1.02, 1.02, 0.98)[k]
    assert unit_warnings(replace(result.recording, channels=channels), result.vehicle) == []


def test_turning_on_the_spot_and_a_silent_ground_speed_are_no_wrong_unit() -> None:
    """A robot that drives straight, then turns on the spot for most of the log, its pose missing in between."""
    result = machine(WORKING)
    time = np.arange(0, 300, 0.05)
    spin = (time > 60) & (time < 260)
    speed = np.where(spin, 0.02, 1.0)
    radius = result.vehicle.wheel_radius
    columns = {"time": time, "ground_speed": np.where((time > 100) & (time < 200), np.nan, speed)}
    for k, wheel in enumerate(result.vehicle.wheels):
        columns[f"wheel_speed_{wheel}"] = np.where(spin, -0.5 if k % 2 else 0.5, 1.02) / radius[k]
    assert unit_warnings(Recording.from_frame(columns), result.vehicle) == []


@pytest.mark.parametrize("about", [1.5, 3.0, 6.0])
def test_rows_are_straight_while_a_steered_wheel_goes_hardly_further_than_the_vehicle(about: float) -> None:
    """By the circle that it drives, of whatever length and track: 1 % further at 8 degrees, by which the rear rims still differ little."""
    vehicle = Vehicle.from_dict(
        {
            "mass": 5000.0,
            "wheelbase": about,
            "track": 1.6,
            "center_of_gravity_height": 0.8,
            "axles": {
                "front": {"mass": 2000.0, "wheels": ["fl", "fr"], "steered": True},
                "rear": {"mass": 3000.0, "wheels": ["rl", "rr"]},
            },
            "wheel": {"radius": 0.5, "inertia": 20.0},
        }
    )
    steered = np.repeat(np.radians([0.0, 4.0, 8.0, 14.0, 25.0]), 100)
    turn = 2.0 * np.tan(steered) / about  # rad/s at 2 m/s
    columns = {"time": 0.1 * np.arange(500), "ground_speed": np.full(500, 2.0)}
    columns |= {f"wheel_speed_{w}": (2.0 + s * 0.8 * turn) / 0.5 for w, s in (("rl", -1), ("rr", 1))}
    straight = straight_rows(Recording.from_frame(columns), vehicle)
    further = 1 / np.cos(steered) - 1  # of the front axle's middle
    assert straight[further < 0.01].all()
    assert not straight[further > 0.02].any()
