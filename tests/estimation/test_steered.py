"""Wheels that steer point along their own way, which is longer than the vehicle's in a turn: their slip is against that (made log)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation import Estimates, estimate
from terragrip.physics.slip import hub_speed
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("unchecked")

WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, TRACK, LENGTH, G = 5000.0, 0.8, 1.8, 2.6, 9.80665
SLIP = 0.05


def tractor(*, steered: bool = True, rear: bool = False) -> Vehicle:
    front, back = {"mass": 2000, "wheels": ["fl", "fr"]}, {"mass": 3000, "wheels": ["rl", "rr"]}
    axles = {"front": {**front, "steered": steered}, "rear": {**back, "steered": rear}}
    base = {
        "mass": MASS,
        "wheelbase": LENGTH,
        "track": TRACK,
        "center_of_gravity_height": 1.0,
        "axles": axles,
    }
    return Vehicle.from_dict({**base, "wheel": {"radius": RADIUS, "inertia": 40}})


def headlands(direction: int = 1) -> Recording:
    """At 1.5 m/s straight on and round curves of 4 m to either side, every wheel at a slip of 5 %, 20 Hz."""
    rng, time = np.random.default_rng(2), np.arange(0, 90, 0.05)
    yaw = np.convolve(
        np.where(time % 30 > 18, 0.375 * np.where(time % 60 > 30, 1, -1), 0.0), np.ones(40) / 40, "same"
    )
    columns = {
        "time": time,
        "ground_speed": direction * 1.5 + 0.01 * rng.standard_normal(len(time)),
        "angular_velocity_z": yaw,
    }
    for wheel in WHEELS:
        side = TRACK / 2 if wheel.endswith("l") else -TRACK / 2
        ahead = LENGTH if wheel.startswith("f") else 0.0
        hub = np.hypot(direction * 1.5 - side * yaw, ahead * yaw)
        load = (2000 if wheel.startswith("f") else 3000) * G / 2
        columns[f"wheel_speed_{wheel}"] = direction * hub / (1 - SLIP) / RADIUS + 0.005 * rng.standard_normal(
            len(time)
        )
        columns[f"drive_torque_{wheel}"] = direction * RADIUS * load * 0.06 + 10 * rng.standard_normal(
            len(time)
        )
    return Recording.from_frame(columns)


def worst_in_turns(log: Recording, told: Estimates) -> float:
    turning = (np.abs(log.channels["angular_velocity_z"]) > 0.3) & (log.time > 10)
    return max(abs(float(np.median(told[f"slip_{w}"][turning])) - SLIP) for w in WHEELS)


@pytest.mark.parametrize("torques", [True, False])
@pytest.mark.parametrize("direction", [1, -1])
def test_slip_of_steered_wheels_is_that_of_their_own_way(torques: bool, direction: int) -> None:
    log = headlands(direction)
    if not torques:
        log = replace(log, channels={n: v for n, v in log.channels.items() if "torque" not in n})
    assert worst_in_turns(log, estimate(log, tractor())) < 0.01
    assert worst_in_turns(log, estimate(log, tractor(steered=False))) > 0.1


def test_a_turn_shifts_no_adhesion_from_one_diagonal_to_the_other() -> None:
    """All wheels pull alike, in the turn too; the inner front wheel had 1.6 times that, the outer .4, by four SDs (0144)."""
    log = headlands()
    told, turning = (
        estimate(log, tractor()),
        (np.abs(log.channels["angular_velocity_z"]) > 0.3) & (log.time > 10),
    )
    for wheel in WHEELS:
        assert np.max(np.abs(told[f"adhesion_{wheel}"][turning] - 0.06)) < 0.01


def test_what_a_vehicle_turns_about() -> None:
    np.testing.assert_array_equal(tractor().wheel_ahead, [LENGTH, LENGTH, 0, 0])
    np.testing.assert_array_equal(tractor(steered=False).wheel_ahead, np.zeros(4))
    np.testing.assert_array_equal(tractor(steered=False, rear=True).wheel_ahead, [0, 0, -LENGTH, -LENGTH])
    np.testing.assert_array_equal(tractor(rear=True).wheel_ahead, np.array([1, 1, -1, -1]) * LENGTH / 2)
    assert Vehicle.from_dict(tractor().to_dict()).axles["front"].steered


def test_the_speed_of_a_hub_has_the_sign_of_the_travel() -> None:
    np.testing.assert_allclose(hub_speed([3.0, -3.0, 2.0], [4.0, 4.0, 0.0]), [5.0, -5.0, 2.0])


def without_gyroscope(log: Recording, torques: bool) -> Recording:
    lost = ("angular_velocity_z",) if torques else ("angular_velocity_z", "drive_torque")
    return replace(log, channels={n: v for n, v in log.channels.items() if not n.startswith(lost)})


@pytest.mark.parametrize("torques", [True, False])
@pytest.mark.parametrize("direction", [1, -1])
def test_slips_interval_holds_a_turn_that_no_sensor_shows(torques: bool, direction: int) -> None:
    """Turns were outside of it; straight on it stays as narrow as with a gyroscope."""
    log = headlands(direction)
    seen = estimate(
        without_gyroscope(log, torques).with_channels(angular_velocity_z=log.channels["angular_velocity_z"]),
        tractor(),
    )
    blind = estimate(without_gyroscope(log, torques), tractor())
    yaw = np.abs(log.channels["angular_velocity_z"])
    turning, straight = (
        (yaw > 0.3) & (log.time > 10),
        (yaw < 1e-9) & (log.time % 30 > 5) & (log.time % 30 < 16),
    )
    off = np.array([np.abs(blind[f"slip_{w}"] - SLIP) / blind[f"slip_{w}_std"] for w in WHEELS])
    assert np.mean(off[:, turning] < 1.96) > 0.95
    assert np.mean(off[:, straight] < 1.96) > 0.95
    for wheel in WHEELS:
        ratio = blind[f"slip_{wheel}_std"][straight] / seen[f"slip_{wheel}_std"][straight]
        assert np.median(ratio) < 1.05


@pytest.mark.parametrize("torques", [True, False])
def test_a_wheel_that_spins_alone_is_no_turn(torques: bool) -> None:
    """A turn shows on every axle."""
    log = headlands()
    yaw, time = log.channels["angular_velocity_z"], log.time
    straight, spins = (yaw == 0) & (time > 40) & (time < 47), (time > 40) & (time < 44)
    faster = log.channels["wheel_speed_fl"] * np.where(spins, 1.5, 1.0)
    spun = estimate(without_gyroscope(log, torques).with_channels(wheel_speed_fl=faster), tractor())
    calm = estimate(without_gyroscope(log, torques), tractor())
    late = straight & (time > 42) & (time < 44)
    assert np.median(spun["slip_rl_std"][late] / calm["slip_rl_std"][late]) < 1.3
