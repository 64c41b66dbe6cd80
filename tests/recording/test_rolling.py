"""Rims that go slower than the ground while they pull are named: radii that are too small; right ones, and noise, are not (simulation)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from development_machine import machine
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.mechanics import means_of
from terragrip.recording.rolling import light_warnings, slower_warnings
from terragrip.simulation import SimulationResult, families
from terragrip.vehicle import Vehicle


def notes_on(result: SimulationResult, factor: float) -> list[str]:
    """The notes with the vehicle file's radii times a factor."""
    data = result.vehicle.to_dict()
    for part in (data, *data["axles"].values()):
        if part.get("wheel"):
            part["wheel"]["radius"] *= factor
    return unit_warnings(result.recording, Vehicle.from_dict(data))


@pytest.mark.sample(3)
@pytest.mark.parametrize("chassis", ["sprung", "rigid", "rolling"])
def test_radii_that_are_too_small_by_8_percent_are_named(chassis: families.Chassis) -> None:
    """On most machines: one that slips by more in its work hides it."""
    named = 0
    for number in (0, 3, 5, 7, 10):
        result = machine(number, chassis)
        assert notes_on(result, 1.0) == []
        named += any(
            note.startswith("While the wheels pull, straight ahead") for note in notes_on(result, 0.92)
        )
    assert named >= 3


@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (0.95, False), (0.9, True)])
def test_a_slip_of_7_percent_less_than_none_is_named(
    columns: dict[str, np.ndarray], vehicle: Vehicle, factor: float, said: bool
) -> None:
    data = vehicle.to_dict()
    data["wheel"]["radius"] *= factor
    notes = unit_warnings(Recording.from_frame(columns), Vehicle.from_dict(data))
    assert any("their rims go 3.2% slower than the ground" in note for note in notes) is said


def test_without_torques_nothing_says_that_the_wheels_pull() -> None:
    result = machine(0)
    speeds = {n: v for n, v in result.recording.channels.items() if "torque" not in n}
    bare = replace(result, recording=replace(result.recording, channels=speeds))
    assert not any(note.startswith("While the wheels pull") for note in notes_on(bare, 0.92))


@pytest.mark.parametrize(("ratio", "said"), [(1.0, False), (8.0, False), (25.0, True)])
def test_torques_with_which_nothing_rolls_are_named(
    columns: dict[str, np.ndarray], vehicle: Vehicle, ratio: float, said: bool
) -> None:
    """Of a motor behind a gear, at a steady speed without a drawbar force: nothing else told."""
    small = {
        n: v / ratio if n.startswith("drive_torque") else v
        for n, v in columns.items()
        if n != "drawbar_force"
    }
    notes = unit_warnings(Recording.from_frame(small), vehicle)
    assert any("with which no vehicle starts or rolls on ground" in note for note in notes) is said


def test_a_radius_that_is_right_to_a_per_cent_is_left_alone() -> None:
    """On hard ground the wheels slip by less than their radii are off."""
    result = families.draw(families.Kind("tractor", "saturating", "uncoupled"), 36001, rate=50.0)
    assert notes_on(result, 1.0) == []


@pytest.mark.parametrize(
    ("names", "gain", "offset", "rims"),
    [
        (("wheel_speed_rr",), 0.5, 0.0, "rr"),
        (("wheel_speed_fr", "wheel_speed_rr"), 0.5, 0.0, "fr, rr"),
        (("ground_speed",), 1.0, 0.15, "fl, fr, rl, rr"),
    ],
)
def test_a_speed_that_is_wrong_in_a_part_of_the_drive_is_named(
    columns: dict[str, np.ndarray],
    vehicle: Vehicle,
    names: tuple[str, ...],
    gain: float,
    offset: float,
    rims: str,
) -> None:
    """With a gyroscope at rest no turn excuses it: slip was .55 and .22 off, within .04, without a word. It pulls by its torque."""
    straight = columns | {"angular_velocity_z": 0.01 * np.random.default_rng(4).standard_normal(6000)}
    late = straight["time"] >= 30
    wrong = {name: np.where(late, gain * straight[name] + offset, straight[name]) for name in names}
    (note,) = (n for n in unit_warnings(Recording.from_frame(straight | wrong), vehicle) if "go slower" in n)
    assert note.startswith("From 30.52 to 58.52 s the rims of " + rims + " go slower than their hubs")
    off = {n: np.where(late, -v if n.startswith("drive_torque") else v, v) for n, v in straight.items()}
    assert not any("go slower" in n for n in unit_warnings(Recording.from_frame(off | wrong), vehicle))


@pytest.mark.parametrize(("shared", "said"), [(True, False), (False, True)])
def test_the_outer_rim_of_a_locked_axle_is_no_error_in_a_turn(
    columns: dict[str, np.ndarray], vehicle: Vehicle, shared: bool, said: bool
) -> None:
    """It brakes there, and the inner one pulls for both; of one torque for both 'the rims of rr go slower than their hubs' came on a right
    log of an outsider's tractor. With a torque of its own, a wheel that pulls has no slower rim."""
    turn = np.where((columns["time"] > 20) & (columns["time"] < 40), 0.2 * columns["ground_speed"], 0.0)
    hub = {w: columns["ground_speed"] + (turn if w.endswith("r") else -turn) for w in vehicle.wheels}
    moved = {
        f"wheel_speed_{w}": columns[f"wheel_speed_{w}"] * hub[w] / columns["ground_speed"]
        for w in ("fl", "fr")
    }
    moved["angular_velocity_z"] = 2 * turn / 0.6
    if shared:
        moved["drive_torque_rr"] = columns["drive_torque_rl"]
    tracked = Vehicle.from_dict(vehicle.to_dict() | {"track": 0.6})
    recording = Recording.from_frame(columns | moved)
    notes = slower_warnings(recording, tracked, means_of(recording, tracked), moved["angular_velocity_z"])
    assert any("rims of rr go slower" in note for note in notes) is said


def test_the_inner_rims_of_a_bend_that_only_the_rims_show_are_no_error(
    columns: dict[str, np.ndarray], vehicle: Vehicle
) -> None:
    """Without a gyroscope: both axles differ by 2 x 17 % for 20 s. One axle that does is named, for a turn shows on every one."""
    bends = (columns["time"] > 20) & (columns["time"] < 40)
    turned = {n: v for n, v in columns.items() if n.startswith("wheel_speed")}
    turned = {n: np.where(bends, (0.83 if n.endswith("l") else 1.17) * v, v) for n, v in turned.items()}
    assert not any("go slower" in n for n in unit_warnings(Recording.from_frame(columns | turned), vehicle))
    front = {n: v for n, v in turned.items() if "_f" in n}
    assert any(
        "rims of fl go slower" in n for n in unit_warnings(Recording.from_frame(columns | front), vehicle)
    )


@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (1.06, True), (1.15, True), (0.98, False)])
def test_rims_that_are_faster_than_their_hubs_while_they_brake_are_named(
    columns: dict[str, np.ndarray], vehicle: Vehicle, factor: float, said: bool
) -> None:
    """A brake makes them slower: the radius is too large, or the gear ratio wrong. Slip was .05 too large, without a word."""
    braked = {n: -0.2 * v if n.startswith("drive_torque") else v for n, v in columns.items()}
    braked |= {n: 0.92 * v for n, v in columns.items() if n.startswith("wheel_speed")}
    braked["drawbar_force"] = -0.2 * columns["drawbar_force"]
    data = vehicle.to_dict()
    data["wheel"]["radius"] *= factor
    notes = unit_warnings(Recording.from_frame(braked), Vehicle.from_dict(data))
    assert any("With hardly a torque the wheels fl, fr, rl, rr slip by" in note for note in notes) is said


@pytest.mark.parametrize("torque", [0.5, 0.0, -2.0])
def test_rims_that_go_slower_by_a_torque_of_hardly_anything_are_no_error(
    columns: dict[str, np.ndarray], vehicle: Vehicle, torque: float
) -> None:
    """It is towed, or rolls down a slope: the torque of .5 N m, of which 7 are a twentieth of the weight, is a sensor's offset."""
    towed = {n: np.full(6000, torque) if n.startswith("drive_torque") else v for n, v in columns.items()}
    towed |= {n: 0.85 * v for n, v in columns.items() if n.startswith("wheel_speed")}
    assert not any("slower" in note for note in unit_warnings(Recording.from_frame(towed), vehicle))


@pytest.mark.parametrize(("size", "said"), [(1.0, False), (1.2, True)])
def test_a_tractors_front_wheels_go_further_in_a_headland_turn(size: float, said: bool) -> None:
    """They hardly pull there, and by the vehicle's speed they slip by .06 in a turn of 5.5 m: right radii were to be checked."""
    draws, time = np.random.default_rng(5), np.arange(0, 600, 0.1)
    bend = np.convolve(
        np.where(time % 60 > 45, np.where(time % 120 > 60, 1, -1) / 5.5, 0.0), np.ones(20) / 20, "same"
    )
    v = np.where(np.abs(bend) > 0.01, 1.1, 2.2)
    v = np.convolve(np.pad(v, 15, "edge"), np.ones(31) / 31, "valid")
    front = np.where(np.abs(bend) > 0.01, -0.02, 0.15) + 0.05 * np.sin(time / 3)
    columns = {"time": time, "ground_speed": v + 0.01 * draws.standard_normal(len(time))}
    for wheel, side, ahead, radius, load in (
        ("fl", 0.9, 2.6, 0.62, 10e3), ("fr", -0.9, 2.6, 0.62, 10e3), ("rl", 0.9, 0.0, 0.8, 15e3), ("rr", -0.9, 0.0, 0.8, 15e3)
    ):  # fmt: skip
        mu = front if ahead else 0.2 + 0.0 * time
        rim = np.hypot(v * (1 - side * bend), ahead * v * bend) / (1 - mu / 4) / radius
        columns[f"wheel_speed_{wheel}"] = rim + 0.01 * draws.standard_normal(len(time))
        columns[f"drive_torque_{wheel}"] = radius * load * (mu + 0.02) + 20 * draws.standard_normal(len(time))
    tractor = Vehicle.from_dict(
        {
            "mass": 5100,
            "wheelbase": 2.6,
            "track": 1.8,
            "center_of_gravity_height": 0.9,
            "axles": {
                "front": {"mass": 2040, "wheels": ["fl", "fr"], "steered": True, "wheel": {"radius": 0.62 * size, "inertia": 30}},
                "rear": {"mass": 3060, "wheels": ["rl", "rr"], "wheel": {"radius": 0.8, "inertia": 120}},
            },
        }
    )  # fmt: skip
    log = Recording.from_frame(columns)
    assert bool(light_warnings(log, tractor, means_of(log, tractor))) is said
