"""Speeds that lose their sign in reverse are named; signed ones, and turns on the spot, are left alone."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.reverse import _go_alike, reverse_warnings

TRACK, RADIUS = 0.8, 0.3
TIME = np.arange(0, 300, 0.1)


def machine() -> tg.Vehicle:
    axles = {"front": {"mass": 60, "wheels": ["fl", "fr"]}, "rear": {"mass": 60, "wheels": ["rl", "rr"]}}
    return tg.Vehicle.from_dict(
        {"mass": 120, "wheelbase": 0.8, "track": TRACK, "center_of_gravity_height": 0.3, "axles": axles,
         "wheel": {"radius": RADIUS, "inertia": 0.3}}
    )  # fmt: skip


def drive(*, backward: bool = True, on_the_spot: bool = False) -> dict[str, np.ndarray]:
    """Forward and backward by turns, with turns to either side, slip of 5 % (simulated)."""
    draws = np.random.default_rng(1000)
    gear = np.where(backward & (TIME % 60 > 40), -1.0, 1.0)
    speed = (
        gear
        * np.clip(np.abs((TIME % 20) - 10) - 1, 0, 2)
        * np.where(on_the_spot & (TIME % 40 > 30), 0.0, 0.6)
    )
    turn = 0.4 * np.sign(np.sin(TIME / 7)) * (np.abs(np.sin(TIME / 7)) > 0.6)
    columns = {
        "time": TIME,
        "ground_speed": speed + 0.01 * draws.standard_normal(len(TIME)),
        "angular_velocity_z": turn + 0.01 * draws.standard_normal(len(TIME)),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        hub = speed + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[f"wheel_speed_{wheel}"] = (hub / 0.95 + 0.01 * draws.standard_normal(len(TIME))) / RADIUS
    return columns


def unsigned(columns: dict[str, np.ndarray], beginning: str) -> dict[str, np.ndarray]:
    return {name: np.abs(v) if name.startswith(beginning) else v for name, v in columns.items()}


def said(columns: dict[str, np.ndarray]) -> str:
    return " ".join(unit_warnings(Recording.from_frame(columns), machine()))


@pytest.mark.parametrize("backward", [True, False])
@pytest.mark.parametrize("on_the_spot", [True, False])
def test_signed_speeds_say_nothing(backward: bool, on_the_spot: bool) -> None:
    assert said(drive(backward=backward, on_the_spot=on_the_spot)) == ""


def test_a_whole_drive_against_its_torques_is_named() -> None:
    """With the signs of all speeds turned, adhesion was -.41 in place of .35, without a word."""
    columns = drive(backward=False)
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"drive_torque_{wheel}"] = 20.0 + np.random.default_rng(4).standard_normal(len(TIME))
    turned = {n: -v if "speed" in n else v for n, v in columns.items()}
    vehicle = machine()
    for log, factor, expected in (
        (columns, 1, 0),
        (turned, 1, 1),
        (turned, -1, 0),
    ):  # the last drives backward
        torques = {n: factor * v if "torque" in n else v for n, v in log.items()}
        notes = reverse_warnings(Recording.from_frame(torques), vehicle)
        assert (
            sum("go backward all the way while the drive torques push forward" in one for one in notes)
            == expected
        )


def test_a_single_turn_among_noise_has_one_sign() -> None:
    """Beside most of a drive without turns the noise of two rates is large, and goes either way."""
    columns = drive(backward=False)
    draws, once = np.random.default_rng(3), (TIME > 200) & (TIME < 208)
    turn = 0.5 * once
    columns["angular_velocity_z"] = turn + 0.02 * draws.standard_normal(len(TIME))
    for wheel in ("fl", "fr", "rl", "rr"):
        hub = 1.0 + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[f"wheel_speed_{wheel}"] = (hub + 0.05 * draws.standard_normal(len(TIME))) / 0.95 / RADIUS
    columns["ground_speed"] = 1.0 + 0.01 * draws.standard_normal(len(TIME))
    assert said(columns) == ""


def test_a_ground_speed_without_a_sign_is_named() -> None:
    """A receiver's speed: the left wheel's slip was .21 and the right one's -.18 in turns backward, surely, for .01."""
    assert "ground_speed has no sign" in said(unsigned(drive(), "ground_speed"))
    assert said(unsigned(drive(backward=False), "ground_speed")) == ""


def test_a_ground_speed_without_a_sign_is_no_wrong_pull() -> None:
    """Backward without the tool thrust counted as forward, and its changes as the pull's: 'unit: lbf' was advised for a right cell."""
    draws = np.random.default_rng(3)
    speed = np.clip(3 * np.sin(TIME / 5), -1.0, 1.0)
    pull = 120 * 9.81 * np.clip(speed, 0.0, None) * (0.05 + 0.02 * np.sin(TIME / 3))
    thrust = 120 * np.gradient(speed, TIME) + pull + 70 * np.tanh(speed / 0.05)

    def noisy(values: np.ndarray, size: float) -> np.ndarray:
        return values + size * draws.standard_normal(len(TIME))

    columns = {"time": TIME, "ground_speed": noisy(speed, 0.01), "drawbar_force": noisy(pull, 2.0)}
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = noisy(speed / 0.97 / RADIUS, 0.02)
        columns[f"drive_torque_{wheel}"] = noisy(RADIUS * thrust / 4, 0.3)
    assert said(columns) == ""
    assert said(unsigned(columns, "ground_speed")).startswith("ground_speed has no sign")


def test_speeds_without_a_sign_are_named_by_the_gyroscope() -> None:
    both = unsigned(unsigned(drive(), "ground_speed"), "wheel_speed")
    assert "contradicts the wheels' speeds: if these have no sign" in said(both)
    assert said({name: v for name, v in both.items() if name != "angular_velocity_z"}) == ""


def test_two_minutes_in_reverse_without_signs_are_no_wheel_that_goes_too_slowly() -> None:
    """Its turns made wheels that pull slower than their hubs: "write where the antenna is" was the only advice."""
    draws, back = np.random.default_rng(0), (TIME > 100) & (TIME < 220)
    speed = np.where(back, -1.0, 1.0) * (1.0 + 0.2 * np.sin(TIME / 9))
    course = np.sin(2 * np.pi * TIME / 30)
    turn = 0.3 * course * (np.abs(course) > 0.5)
    columns = {"time": TIME, "ground_speed": np.abs(speed), "angular_velocity_z": turn}
    for wheel in ("fl", "fr", "rl", "rr"):
        hub = speed + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[f"wheel_speed_{wheel}"] = np.abs(hub) / 0.95 / RADIUS
        columns[f"drive_torque_{wheel}"] = 31 + 9 * np.gradient(np.abs(speed), TIME)
    noise = {"time": 0.0, "ground_speed": 0.01, "angular_velocity_z": 0.01}
    columns = {n: v + noise.get(n, 0.02) * draws.standard_normal(len(TIME)) for n, v in columns.items()}
    (note,) = unit_warnings(Recording.from_frame(columns), machine())
    assert "of the turns angular_velocity_z contradicts the wheels' speeds: if these have no sign" in note


WHEELS = tuple(f"wheel_speed_{w}" for w in ("fl", "fr", "rl", "rr"))


def pulled() -> dict[str, np.ndarray]:
    """A drive ahead of 5 % slip whose torques pull, without a gyroscope (simulated)."""
    columns = drive(backward=False)
    del columns["angular_velocity_z"]
    draws = np.random.default_rng(4)
    for wheel in WHEELS:
        columns[wheel.replace("wheel_speed", "drive_torque")] = (
            20 + 10 * np.gradient(columns["ground_speed"], TIME) + draws.standard_normal(len(TIME))
        )
    return columns


@pytest.mark.parametrize("odd", [WHEELS, WHEELS[1::2], WHEELS[3:]])
def test_wheels_against_the_ground_speed_are_named(odd: tuple[str, ...]) -> None:
    """With torques and all wheels turned, adhesion was -.35 for .35 and efficiency 0, without a word."""
    columns = pulled()
    assert "direction of travel" not in said(columns)
    note = said({name: -v if name in odd else v for name, v in columns.items()})
    other = " (or for ground_speed, if the vehicle drove backward)" if odd == WHEELS else ""
    assert (
        note
        == f"Against the direction of travel: {', '.join(odd)}. In the profile write 'sign: -1' for each{other}."
    )


def test_a_ground_speed_of_two_rows_contradicts_no_wheel() -> None:
    """A receiver was lost after its first values, noise at rest: all wheels were said to need 'sign: -1'."""
    columns = pulled()
    columns["ground_speed"] = np.where(np.arange(len(TIME)) < 2, -0.01, np.nan)
    assert "direction of travel" not in said(columns)
    assert not reverse_warnings(Recording.from_frame(columns), machine())


def test_a_drive_train_against_the_ground_speed_is_named() -> None:
    columns = pulled()
    table = {
        "time": TIME,
        "ground_speed": columns["ground_speed"],
        "wheel_speed_fl": columns["wheel_speed_fl"],
    }
    table["wheel_based_speed"] = -columns["ground_speed"]
    assert "Against the direction of travel: wheel_based_speed." in said(table)


def test_the_noise_of_a_short_standstill_has_no_direction() -> None:
    """The first rows of a log, before it drives: a wheel whose noise had the other sign by chance was to be turned."""
    for seed in range(50):
        draws = np.random.default_rng(seed)
        columns = {name: 0.01 * draws.standard_normal(20) for name in ("ground_speed", *WHEELS)}
        assert "Against" not in said(columns | {"time": TIME[:20]}), seed


def test_a_ground_speed_that_changes_its_sign_for_a_part_is_named() -> None:
    """Backward at the speed that it drove forward, and not a word."""
    right = drive(backward=False)
    wrong = right | {"ground_speed": np.where(TIME > 200, -1.0, 1.0) * right["ground_speed"]}
    assert unit_warnings(Recording.from_frame(right), machine()) == []
    (note,) = unit_warnings(Recording.from_frame(wrong), machine())
    assert note.startswith("ground_speed is negative from ")
    assert "its sign is wrong there" in note


@pytest.mark.parametrize(("rim", "ground"), [(1.0, -0.05), (-0.05, 1.0)])
def test_wheels_that_spin_as_it_slips_back_or_lock_as_it_slides_have_no_wrong_sign(
    rim: float, ground: float
) -> None:
    """In four fifths of the log; m/s."""
    ahead = TIME > 240
    columns = {"time": TIME, "ground_speed": np.where(ahead, 1.0, ground)}
    columns |= {wheel: np.where(ahead, 1.05, rim) / RADIUS for wheel in WHEELS}
    assert "Against" not in said(columns)


def test_wheels_against_a_receiver_that_measures_in_rows_of_its_own_are_named() -> None:
    columns, own = pulled(), np.arange(len(TIME)) % 5 == 0
    columns["ground_speed"] = np.where(own, columns["ground_speed"], np.nan)
    columns |= {wheel: np.where(own, np.nan, -columns[wheel]) for wheel in WHEELS}
    assert "Against the direction of travel" in said(columns)


def test_a_machine_of_a_fifth_of_a_metre_a_second_is_judged_as_a_fast_one() -> None:
    slow = unsigned({n: v if n == "time" else 0.15 * v for n, v in drive().items()}, "ground_speed")
    (note,) = reverse_warnings(Recording.from_frame(slow), machine())
    assert note.startswith("ground_speed has no sign")


def test_one_axle_that_is_measured_tells_of_speeds_without_a_sign() -> None:
    both = unsigned(unsigned(drive(), "ground_speed"), "wheel_speed")
    rear = {n: v for n, v in both.items() if n not in ("wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl")}
    assert said(rear) == ""
    assert "contradicts the wheels' speeds" in said({**rear, "wheel_speed_rl": both["wheel_speed_rl"]})


def test_a_machine_that_never_moves_says_nothing() -> None:
    still = {n: v if n == "time" else np.zeros(len(TIME)) for n, v in drive().items()}
    assert reverse_warnings(Recording.from_frame(still), machine()) == []


def test_wheels_without_a_sign_beside_a_ground_speed_with_one_are_named() -> None:
    """It goes back for four seconds at a time, in turns."""
    columns = drive()
    draws, back = np.random.default_rng(5), TIME % 16 > 12
    speed, turn = np.where(back, -1.0, 1.0), 0.4 * np.sin(TIME / 7)
    columns["ground_speed"] = speed + 0.01 * draws.standard_normal(len(TIME))
    columns["angular_velocity_z"] = turn + 0.01 * draws.standard_normal(len(TIME))
    for wheel in WHEELS:
        hub = speed + (-1 if wheel.endswith("l") else 1) * TRACK / 2 * turn
        columns[wheel] = np.abs(hub) / 0.95 / RADIUS
    (note,) = reverse_warnings(Recording.from_frame(columns), machine())
    assert "of the turns angular_velocity_z contradicts the wheels' speeds" in note


def test_sizes_go_alike_where_both_vary_together() -> None:
    draws = np.random.default_rng(6)
    a, other = np.abs(draws.standard_normal((2, 40)))
    assert _go_alike(a, 3.0 * a + 0.3 * other)
    assert not _go_alike(a, other)
    assert not _go_alike(a, np.ones(40))
    assert not _go_alike(a[:5], a[:5])
