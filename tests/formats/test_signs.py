"""Signs that inspect proposes: of what counts backward by the motion, never on a right log, and a doubt where the data do not decide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.formats import Inspection, inspect, read
from terragrip.vehicle import Vehicle

TIME = np.arange(0.0, 200.0, 0.1)
SIDES = ("left", "right")
SPEEDS = [f"{end} {side} wheel speed [rad/s]" for end in ("front", "rear") for side in SIDES]
TORQUES = [name.replace("speed [rad/s]", "torque [N m]") for name in SPEEDS]
RIGHT = [name for name in (*SPEEDS, *TORQUES) if "right" in name]
PULL, YAW = "drawbar force [N]", "yaw rate [rad/s]"
VEHICLE = {
    "mass": 140,
    "wheelbase": 0.7,
    "track": 0.6,
    "center_of_gravity_height": 0.3,
    "hitch_height": 0.25,
    "axles": {
        "front": {"mass": 60, "wheels": ["fl", "fr"]},
        "rear": {"mass": 80, "wheels": ["rl", "rr"]},
    },
    "wheel": {"radius": 0.2, "inertia": 0.15},
}


def drive() -> dict[str, np.ndarray]:
    """Forward with turns to both sides, four equal wheels that slip 5 % and tow a plough (made up)."""
    draws = np.random.default_rng(8)
    speed = 1.0 + 0.3 * np.sin(TIME / 7)
    yaw = 0.3 * np.sin(TIME / 9) * (np.sin(TIME / 23) > 0)
    pull = 200 + 60 * np.sin(TIME / 5)
    thrust = pull + 60 + 140 * np.gradient(speed, TIME)
    columns = {"time": TIME, "GPS speed [m/s]": speed, PULL: pull, YAW: yaw}
    for name, torque in zip(SPEEDS, TORQUES, strict=True):
        columns[name] = (speed + (0.3 if "right" in name else -0.3) * yaw) / 0.95 / 0.2
        columns[torque] = 0.2 * thrust / 4
    return {n: v + 0.01 * draws.standard_normal(len(TIME)) * (n != "time") for n, v in columns.items()}


def inspected(folder: Path, columns: dict[str, np.ndarray], *, known: bool) -> Inspection:
    """What inspect says of a log, with or without the vehicle file."""
    pd.DataFrame(columns).to_csv(folder / "log.csv", index=False)
    return inspect(folder / "log.csv", vehicle=Vehicle.from_dict(VEHICLE) if known else None)


def turned(found: Inspection) -> set[str]:
    """The columns that get a sign."""
    proposals = found.proposals.values()
    return {column for p in proposals if p.entry.get("sign") == -1 for column in p.columns}


@pytest.mark.sample(3)  # all but the third and the sixth, which two others hold
@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("odd", [[], RIGHT, RIGHT[:2], [PULL], TORQUES, [*RIGHT, YAW], [YAW], TORQUES[:1]])
def test_what_counts_backward_gets_a_sign_and_the_profile_reads_the_right_log(
    tmp_path: Path, odd: list[str], known: bool
) -> None:
    right = drive()
    found = inspected(tmp_path, {n: -v if n in odd else v for n, v in right.items()}, known=known)
    assert turned(found) == {name.split(" [")[0] for name in odd}
    assert not any("sign" in proposal.doubt for proposal in found.proposals.values())
    (tmp_path / "profile.yaml").write_text(found.profile)
    channels = read(tmp_path / "log.csv", tmp_path / "profile.yaml").channels
    read_back = [
        channels[c] for c in ("wheel_speed_fr", "drive_torque_rr", "drawbar_force", "angular_velocity_z")
    ]
    for values, name in zip(read_back, (SPEEDS[1], TORQUES[3], PULL, YAW), strict=True):
        np.testing.assert_allclose(values, right[name])


def test_a_sign_says_why_in_its_line(tmp_path: Path) -> None:
    text = inspected(
        tmp_path, {n: -v if n in RIGHT else v for n, v in drive().items()}, known=False
    ).to_text()
    line = next(line for line in text.splitlines() if "wheel_speed_fr <-" in line)
    assert "with 'sign: -1': against the ground speed" in line
    assert "wheel_speed_fr: {from: front right wheel speed, sign: -1}" in text


def test_motor_currents_of_a_mirrored_side_get_a_sign_though_their_scale_is_unknown(tmp_path: Path) -> None:
    columns = {n.replace("torque [N m]", "motor current [A]"): v for n, v in drive().items() if n != PULL}
    mirrored = {n: -v if "right" in n else v for n, v in columns.items()}
    found = inspected(tmp_path, mirrored, known=True)
    assert turned(found) == {n.split(" [")[0] for n in columns if "right" in n}


@pytest.mark.parametrize("odd", [SPEEDS, TORQUES])
def test_where_the_data_do_not_decide_a_doubt_is_named_and_no_sign(tmp_path: Path, odd: list[str]) -> None:
    """All wheels against the ground speed (or it is the one), and all torques negative with nothing that shows the pull."""
    right = {n: v for n, v in drive().items() if n not in (PULL, YAW)}
    sure = inspected(tmp_path, right, known=False).proposals
    found = inspected(tmp_path, {n: -v if n in odd else v for n, v in right.items()}, known=False)
    assert turned(found) == set()
    names = [n.split(" [")[0] for n in odd]
    doubtful = {c: p for c, p in found.proposals.items() if set(p.columns) & set(names)}
    assert len(doubtful) == 4
    for channel, proposal in doubtful.items():
        assert "'sign: -1'" in proposal.doubt
        assert proposal.confidence < 0.7 < sure[channel].confidence


def test_where_it_brakes_as_much_as_it_pulls_no_torque_says_which_side_counts_backward(
    tmp_path: Path,
) -> None:
    """A robot on hills: the left torque, negative by chance on average, got the sign of the right one (simulated, seed 7127)."""
    columns = {n: v for n, v in drive().items() if n not in (PULL, YAW)}
    columns |= dict.fromkeys(TORQUES, 10 * np.sin(TIME / 5) - 1)
    columns |= {n: -columns[n] for n in TORQUES if "right" in n}
    proposals = inspected(tmp_path, columns, known=False).proposals
    for wheel in ("fl", "fr", "rl", "rr"):
        assert "sign" not in proposals[f"drive_torque_{wheel}"].entry
        assert "one falls where the other rises" in proposals[f"drive_torque_{wheel}"].doubt


def test_torques_that_the_pull_leaves_nothing_of_are_in_doubt_with_it(tmp_path: Path) -> None:
    """Currents that a driver calls efforts were torques in N m, without a question mark."""
    right = drive()
    found = inspected(tmp_path, {n: v / 5 if n in TORQUES else v for n, v in right.items()}, known=True)
    for channel in ("drive_torque_fl", "drive_torque_rr", "drawbar_force"):
        assert found.proposals[channel].doubt.endswith("the units of both?")
    assert not any(
        "the units of both" in p.doubt for p in inspected(tmp_path, right, known=True).proposals.values()
    )


@pytest.mark.parametrize("down", [True, False])
def test_accelerations_of_a_frame_with_z_down_are_asked_for(tmp_path: Path, down: bool) -> None:
    """An autopilot's IMU (x forward, y right, z down) was sure: 'the three sum up to gravity'."""
    noise = 0.05 * np.random.default_rng(1).standard_normal((3, len(TIME)))
    rest = {"x": 0.0, "y": 0.0, "z": -9.81 if down else 9.81}
    imu = {f"IMU.Acc{a.upper()}": rest[a] + noise[k] for k, a in enumerate("xyz")}
    found = inspected(tmp_path, drive() | imu, known=True).proposals
    assert [bool(found[f"acceleration_{a}"].doubt) for a in "yz"] == [down, down]
    assert ("z rests at -g" in found["acceleration_y"].doubt) is down


IN_MOST = "negative in most of the drive"


@pytest.mark.parametrize(
    ("negative", "ahead", "asked"),
    [(1.0, 1.0, True), (0.8, 1.0, True), (0.7, 1.0, False), (0.0, 1.0, False), (1.0, -1.0, False)],
)
def test_a_drawbar_force_is_asked_for_where_most_large_values_are_negative_in_a_drive_ahead(
    tmp_path: Path, negative: float, ahead: float, asked: bool
) -> None:
    """No torque decides; what hangs idle in the other half of the log reads little, of the other sign, and does not count."""
    pulls = np.arange(len(TIME)) % 2 == 0
    sign = np.where(np.arange(len(TIME)) % 20 < round(20 * negative), -1.0, 1.0)
    columns = {n: v * (ahead if n in ("GPS speed [m/s]", *SPEEDS) else 1.0) for n, v in drive().items()}
    columns = {n: v for n, v in columns.items() if n not in TORQUES}
    columns[PULL] = np.where(pulls, sign * columns[PULL], -0.2 * sign * columns[PULL])
    proposal = inspected(tmp_path, columns, known=False).proposals["drawbar_force"]
    assert (IN_MOST in proposal.doubt) is asked


def test_a_drawbar_force_is_asked_for_however_small_it_is_beside_the_torques(tmp_path: Path) -> None:
    """A torque that is small beside the others' may be a free wheel's offset; and the force's size says nothing of the torques'."""
    unlike = 8 + np.sin(TIME / 3)  # so that none of the two shows the sign of the other
    negative = drive() | dict.fromkeys(TORQUES, -unlike) | {TORQUES[0]: -0.1 * unlike}
    for size in (0.1, 300.0):
        found = inspected(tmp_path, negative | {PULL: -size * unlike[::-1]}, known=False).proposals
        asked = {channel for channel, proposal in found.items() if IN_MOST in proposal.doubt}
        assert asked == {"drawbar_force", *(f"drive_torque_{w}" for w in ("fr", "rl", "rr"))}
