"""The windows that calibration works on, of a log whose every number is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from terragrip.estimation.calibration.windows import track_blocks, wheel_loads, windows
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def test_each_axle_is_where_it_is_on_the_track(drive: Callable[..., Recording], vehicle: Vehicle) -> None:
    log = drive(60.0)
    table = windows([log], vehicle, 1.0)
    travelled = np.trapezoid(log.channels["ground_speed"], log.time)
    front, rear = table.position[:, 0], table.position[:, 2]
    np.testing.assert_allclose(front - rear, vehicle.wheelbase)  # the rear axle follows
    assert abs(front[-1] - travelled) < 0.02 * travelled


def test_stretches_of_track_are_of_one_log_and_follow_each_other(
    drive: Callable[..., Recording], vehicle: Vehicle
) -> None:
    """Two logs of some 63 m: 40 stretches in all would be shorter than 4 m, so each log has 16 of 4 m."""
    table = windows([drive(120.0), drive(120.0, seed=1)], vehicle, 1.0)
    blocks = track_blocks(table)
    first, second = blocks[table.recording == 0], blocks[table.recording == 1]
    way = [table.position[table.recording == k, 0] for k in (0, 1)]
    assert first.tolist() == np.floor(way[0] / 4.0).astype(int).tolist()
    assert second.tolist() == (first[-1] + 1 + np.floor(way[1] / 4.0)).astype(int).tolist()


@pytest.mark.parametrize("axle", [0, 1])
def test_where_one_axle_is_measured_the_other_takes_the_rest(axle: int, vehicle: Vehicle) -> None:
    """In the other rows nothing is measured: the static loads of 30, 30, 40 and 40 kg."""
    none = np.zeros(3)
    measured = np.full((3, 2), np.nan)
    measured[0, axle] = 50.0 * GRAVITY
    load = wheel_loads(
        vehicle, drawbar=none, push=none, slope=none, spin_torque=none, lateral=none, measured=measured
    )
    rest = [25.0, 25.0, 45.0, 45.0] if axle == 0 else [45.0, 45.0, 25.0, 25.0]
    np.testing.assert_allclose(load / GRAVITY, [rest, *[[30.0, 30.0, 40.0, 40.0]] * 2])


def test_a_steered_axle_goes_further_in_turns_and_a_receiver_ahead_too(vehicle: Vehicle) -> None:
    """A tractor's radii came out 2.5 % too small where its only way without a pull was the headland, and no interval said so."""
    told = vehicle.to_dict()
    told["axles"]["front"]["steered"] = True
    steered = Vehicle.from_dict(told | {"antenna": {"x": 0.5, "y": 0.1, "z": 1.0}})
    time = np.arange(0.0, 20.0, 0.02)
    turn = 0.4 * np.sin(time / 3)
    along = 1.0 - turn[:, None] * steered.wheel_side
    hubs = np.hypot(along, turn[:, None] * [0.6, 0.6, 0.0, 0.0])
    channels = {f"wheel_speed_{w}": hubs[:, i] / 0.2 for i, w in enumerate(steered.wheels)}
    channels |= {f"drive_torque_{w}": np.zeros(len(time)) for w in steered.wheels}
    channels |= {"ground_speed": np.hypot(1.0 - 0.1 * turn, 0.5 * turn), "angular_velocity_z": turn}
    table = windows([Recording(time=time, channels=channels)], steered, 2.0)
    expected = hubs.reshape(10, 100, 4).mean(axis=1)
    np.testing.assert_allclose(table.hub_speed, expected, rtol=2e-3)
