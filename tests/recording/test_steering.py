"""An axle that steers without a word of that in the vehicle file, and a joint that bends, are named by what the rims do in turns."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.recording import Recording, unit_warnings

LENGTH, TRACK, RADIUS = 2.7, 1.8, 0.8
TIME = np.arange(0.0, 300.0, 0.1)


def machine(free: str = "", **front: bool) -> tg.Vehicle:
    axles: dict[str, dict[str, object]] = {
        "front": {"mass": 2400, "wheels": ["fl", "fr"], **front},
        "rear": {"mass": 3600, "wheels": ["rl", "rr"]},
    }
    if free:
        axles[free]["driven"] = False
    return tg.Vehicle.from_dict(
        {"mass": 6000, "wheelbase": LENGTH, "track": TRACK, "center_of_gravity_height": 1.0, "axles": axles,
         "wheel": {"radius": RADIUS, "inertia": 80}}
    )  # fmt: skip


def field(steering: str, free: str = "") -> Recording:
    """On a field with headlands of 6 m radius, where the driven wheels slip by .03, and by .13 in the field (simulated); m/s, rad/s."""
    draws = np.random.default_rng(7)
    course = np.sin(2 * np.pi * TIME / 40)
    rate = 0.33 * np.sign(np.sin(2 * np.pi * TIME / 80)) * np.clip(4 * (course - 0.5), 0, 1)
    speed, slip = 2.0 + 0.2 * np.sin(TIME / 9), np.where(np.abs(rate) > 0.05, 0.03, 0.13)
    columns = {"time": TIME, "ground_speed": speed + 0.02 * draws.standard_normal(len(TIME))}
    columns["angular_velocity_z"] = rate + 0.005 * draws.standard_normal(len(TIME))
    for wheel, side in (("fl", 0.5), ("fr", -0.5), ("rl", 0.5), ("rr", -0.5)):
        axle = "front" if wheel[0] == "f" else "rear"
        hub = np.hypot(speed - side * TRACK * rate, LENGTH * rate * (axle == steering))
        rim = hub / (1 - (0.0 if axle == free else slip))
        columns[f"wheel_speed_{wheel}"] = rim / RADIUS + 0.02 * draws.standard_normal(len(TIME))
    return Recording.from_frame(columns)


def notes(steering: str, vehicle: tg.Vehicle, free: str = "") -> list[str]:
    return [note for note in unit_warnings(field(steering, free), vehicle) if "steer" in note]


@pytest.mark.parametrize(
    ("steering", "free"), [("front", ""), ("front", "front"), ("rear", ""), ("rear", "rear")]
)
def test_an_axle_that_steers_is_named(steering: str, free: str) -> None:
    """Its slip was .09 too high in turns, stated to .01, without a word."""
    (note,) = notes(steering, machine(free), free)
    assert note.startswith(f"In turns the wheels of the axle {steering} go faster than the others")
    longest = np.hypot(1.0, LENGTH * 0.33 / 1.8)
    assert note.endswith(f"or slip is wrong there, its own by up to {1 - 1 / longest:.2f}.")


@pytest.mark.filterwarnings("error")
def test_rims_of_exactly_0_at_a_stop_leave_no_word_of_numpy() -> None:
    stop = TIME < 20
    log = field("front")
    log = log.with_channels(**{n: np.where(stop, 0.0, v) for n, v in log.channels.items()})
    assert any("steer" in note for note in unit_warnings(log, machine()))


def test_where_none_steers_or_the_file_says_so_nothing_is_named() -> None:
    assert notes("", machine()) == []
    assert notes("", machine("front"), "front") == []
    assert notes("front", machine(steered=True)) == []


def loader(*, bends: bool, slower: float = 1.0, slip: float = 0.1) -> Recording:
    """An articulated one, its joint midway (kinematic), the gyroscope on the front half: steered for 3 s, held for 7, all times as long and
    all speeds as small by ``slower``; else its rear left wheel spins at times. m/s, rad/s."""
    draws = np.random.default_rng(3)
    knots = [0, 10, 13, 20, 23, 26, 33, 36, 40], [0, 0, 0.6, 0.6, 0, -0.6, -0.6, 0, 0]
    joint = np.interp(TIME / slower % 40, *knots) if bends else 0 * TIME
    change = np.gradient(joint, TIME)
    speed = (2.0 + 0.2 * np.sin(TIME / 9)) / slower  # of the front axle
    front = (speed * np.sin(joint) + 1.5 * change) / (1.5 * np.cos(joint) + 1.5)
    behind = speed * np.cos(joint) + 1.5 * front * np.sin(joint)
    columns = {"time": TIME, "ground_speed": speed + 0.02 * draws.standard_normal(len(TIME))}
    columns["angular_velocity_z"] = front + 0.003 * draws.standard_normal(len(TIME))
    for wheel, side in (("fl", 0.5), ("fr", -0.5), ("rl", 0.5), ("rr", -0.5)):
        pace, rate = (speed, front) if wheel[0] == "f" else (behind, front - change)
        hub = pace - side * TRACK * rate
        columns[f"wheel_speed_{wheel}"] = hub / (1 - slip) / RADIUS + 0.02 * draws.standard_normal(len(TIME))
    if not bends:
        columns["wheel_speed_rl"] = columns["wheel_speed_rl"] * np.where(TIME % 20 < 5, 1.15, 1.0)
    return Recording.from_frame(columns)


def test_a_joint_that_bends_is_named() -> None:
    """The rear wheels' slip was .10 off while it bent, stated to .009, and the advice was to shift the gyroscope by .6 s."""
    bent, spun = loader(bends=True), loader(bends=False)
    vehicle = tg.Vehicle.from_dict(machine().to_dict() | {"articulated": True})
    (note,) = unit_warnings(bent, vehicle)
    assert note.startswith("In 3")
    slowest, bending = 1.8, 0.6 / 3  # m/s, rad/s
    assert float(note.split("by up to ")[1][:4]) == pytest.approx(TRACK / 2 * bending / slowest, abs=0.01)
    assert (
        "of the driving the joint bends: front and rear then turn by different rates, of which the log has one"
        in note
    )
    assert not [note for note in unit_warnings(bent, machine()) if "joint" in note]
    assert not [note for note in unit_warnings(spun, vehicle) if "joint" in note]


def test_a_joint_that_bends_makes_no_wheel_slower_than_its_hub() -> None:
    """On 8 of 8 drives of an outsider's loader a right wheel's speed, or the right gyroscope, was called wrong."""
    tree = machine().to_dict() | {"articulated": True, "uncertainty": {"wheel_radius": 0.01}}
    torques = {f"drive_torque_{wheel}": np.full(len(TIME), 2000.0) for wheel in ("fl", "fr", "rl", "rr")}
    log = Recording.from_frame(
        {"time": TIME, **loader(bends=True, slower=3.0, slip=0.02).channels, **torques}
    )
    said = {
        bends: unit_warnings(log, tg.Vehicle.from_dict(tree | {"articulated": bends}))
        for bends in (True, False)
    }
    assert not [note for note in said[True] if "slower than their hubs" in note]
    assert [note for note in said[False] if "slower than their hubs" in note], "it is looked for there"
