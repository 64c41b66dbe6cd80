"""While the joint of an articulated machine bends, its halves turn by different rates, of which a gyroscope shows one."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

LENGTH, TRACK, RADIUS, MASS, SLIP, MU = 2.7, 1.8, 0.8, 6000.0, 0.03, 0.12
SIDES = {"fl": 0.5, "fr": -0.5, "rl": 0.5, "rr": -0.5}


def machine(*, articulated: bool = True) -> tg.Vehicle:
    axles = {
        "front": {"mass": MASS / 2, "wheels": ["fl", "fr"]},
        "rear": {"mass": MASS / 2, "wheels": ["rl", "rr"]},
    }
    return tg.Vehicle.from_dict(
        {"mass": MASS, "wheelbase": LENGTH, "track": TRACK, "center_of_gravity_height": 0.0, "axles": axles,
         "articulated": articulated, "wheel": {"radius": RADIUS, "inertia": 80},
         "uncertainty": {"drawbar_force": 0}}
    )  # fmt: skip


def drive(gyroscope: str) -> tuple[Recording, np.ndarray]:
    """A loader that steers to and fro at 1.2 m/s (kinematic, joint midway), its wheels at one torque, load and slip; and where its joint
    bends. ``gyroscope``: on which half, or none."""
    draws, time = np.random.default_rng(5), np.arange(0.0, 200.0, 0.05)
    joint = np.interp(time % 30, [0, 8, 12, 19, 23, 30], [0, 0, 0.5, 0.5, 0, 0])
    change, arm, speed = np.gradient(joint, time), LENGTH / 2, 1.2
    front = (speed * np.sin(joint) + arm * change) / (arm * np.cos(joint) + arm)
    behind = speed * np.cos(joint) + arm * front * np.sin(joint)
    rates = {"front": front, "rear": front - change}
    channels = {"ground_speed": speed + 0.02 * draws.standard_normal(len(time))}
    if gyroscope:
        channels["angular_velocity_z"] = rates[gyroscope] + 0.005 * draws.standard_normal(len(time))
    for wheel, side in SIDES.items():
        pace, rate = (speed, rates["front"]) if wheel[0] == "f" else (behind, rates["rear"])
        hub = pace - side * TRACK * rate
        noise = 0.01 * draws.standard_normal(len(time))
        channels[f"wheel_speed_{wheel}"] = hub / (1 - SLIP) / RADIUS + noise
        torque = MU * MASS * 9.80665 / 4 * RADIUS
        channels[f"drive_torque_{wheel}"] = torque + 20 * draws.standard_normal(len(time))
    return Recording(time, channels), (np.abs(change) > 0.05) & (time > 20)


@pytest.mark.parametrize("gyroscope", ["front", "rear", ""])
def test_slips_of_the_half_whose_turn_nothing_shows_are_in_their_interval(gyroscope: str) -> None:
    """The other half's slips were .05 off, stated to .02, in the rows in which the joint bends."""
    log, bends = drive(gyroscope)
    found = tg.estimate(log, machine())
    error, spread = (
        np.array([found[f"slip_{wheel}{end}"][bends] for wheel in SIDES]) - true
        for end, true in (("", SLIP), ("_std", 0))
    )
    assert np.max(np.sqrt(np.mean(error**2, axis=1))) > 0.04, "no signal shows them"
    assert np.min(np.mean(np.abs(error) <= 1.96 * spread, axis=1)) > 0.9


@pytest.mark.parametrize("gyroscope", ["front", "rear"])
def test_a_joint_that_bends_shifts_no_adhesion(gyroscope: str) -> None:
    """Slips that differ by diagonal passed for loads: adhesions of equal torques and loads came out .05 apart."""
    log, bends = drive(gyroscope)
    found = tg.estimate(log, machine())
    error = np.array([found[f"adhesion_{wheel}"][bends] for wheel in SIDES]) - MU
    assert np.sqrt(np.mean(error**2)) < 0.05 * MU


@pytest.mark.parametrize("spins", [False, True])
def test_a_joint_that_bends_while_the_machine_stands_is_no_digging_in(spins: bool) -> None:
    """Its wheels roll against each other, and slip as it starts again: that was called stuck. One that ``spins`` digs in, though another
    is turned back."""
    draws, time = np.random.default_rng(6), np.arange(0.0, 90.0, 0.05)
    speed = np.interp(time, [5, 8, 30, 33, 36, 38], [0, 1.2, 1.2, 0, 0, 0 if spins else 1.2])
    start = np.interp(time, [35, 35.3, 36, 36.4], [0, 0.2, 0.2, 0]) * (not spins)
    joint = 0.5 * np.sin(2 * np.pi * (time - 33) / 14) * (time > 33)
    change, arm = np.gradient(joint, time), LENGTH / 2
    front = (speed * np.sin(joint) + arm * change) / (arm * np.cos(joint) + arm)
    behind = speed * np.cos(joint) + arm * front * np.sin(joint)
    channels = {"ground_speed": speed + 0.02 * draws.standard_normal(len(time)), "angular_velocity_z": front}
    for wheel, side in SIDES.items():
        pace, rate = (speed, front) if wheel[0] == "f" else (behind, front - change)
        spin = start + 4 * ((time > 61) & spins & (wheel == "fl"))
        noise = 0.01 * draws.standard_normal(len(time))
        channels[f"wheel_speed_{wheel}"] = ((pace - side * TRACK * rate) / (1 - SLIP) + spin) / RADIUS + noise
        torque = MU * MASS * 9.80665 / 4 * RADIUS * ((speed > 0) | (spin > 0))
        channels[f"drive_torque_{wheel}"] = torque + 20 * draws.standard_normal(len(time))
    found = tg.estimate(Recording(time, channels), machine())
    stuck = np.isin(found["event"], ["stuck", "immobilization"])
    assert not np.any(stuck[time < (61 if spins else 90)])
    assert np.all(stuck[(time > 65) & (time < 89)]) == spins
