"""What `calibrate` claims of a machine that turns on hills: with positions the truth, without them what is missing."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation import calibrate
from terragrip.estimation.calibration.plausible import plausible
from terragrip.estimation.calibration.result import Quantity, Unknown
from terragrip.recording import Recording
from turning_log import RADIUS, machine, turning_log


def bare(log: Recording) -> Recording:
    """The log without its positions."""
    kept = {n: v for n, v in log.channels.items() if n not in ("latitude", "longitude", "altitude")}
    return Recording(log.time, kept, source=log.source)


@pytest.mark.parametrize("seed", [1000, 1001])
@pytest.mark.parametrize("soft", [0.05, 0.15])
def test_a_circling_machine_is_asked_for_a_yaw_rate(seed: int, soft: float) -> None:
    """Without it the sides came out with gains of 2.2 and .46, and the torque scale as 1.24 to 1.52 (truth: 1 and 1)."""
    calibration = calibrate(bare(turning_log(seed, soft=soft, circling=True)), machine())
    assert not [
        q.name
        for q in calibration.quantities
        if q.key in ("drive_torque_gain", "wheel_radius", "drive_torque_scale")
    ]
    text = {u.name: u.why for u in calibration.unknown}
    assert (
        "this machine turned in 100% of its driving and no signal shows how fast: give a yaw rate"
        in text["angular_velocity_z"]
    )


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", [1000, 1001])
@pytest.mark.parametrize("circling", [False, True])
@pytest.mark.parametrize("soft", [0.05, 0.15])
def test_positions_give_yaw_rate_and_slope(seed: int, circling: bool, soft: float) -> None:
    true = 0.985 * RADIUS
    calibration = calibrate(turning_log(seed, radius=true, soft=soft, circling=circling), machine())
    assert calibration.notes == (
        "The rate of turn is that of the positions; the slope is that of the altitude.",
    )
    for wheel in ("l", "r"):
        radius = calibration[f"wheel_radius {wheel}"]
        assert radius.value == pytest.approx(true, rel=0.005)
        assert radius.interval[0] < true < radius.interval[1]
    scale = calibration["drive_torque_scale"]
    assert scale.interval[0] < 1 < scale.interval[1]
    assert scale.std < 0.06  # a resistance that goes with the grade is in it
    for quantity in calibration.quantities:
        if quantity.key == "drive_torque_gain":
            assert quantity.interval[0] < 1 < quantity.interval[1]
    assert ("drive_torque_gain l" in calibration) == (not circling)


def test_an_unseen_slope_is_in_the_interval_of_the_scale() -> None:
    calibration = calibrate(bare(turning_log(1000)), machine())
    scale = calibration["drive_torque_scale"]
    assert scale.interval[0] < 1 < scale.interval[1]
    assert calibration["drive_torque_gain l"].value == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("drive_torque_gain", 0.53, "no sensor is off by more than 0.74 to 1.35"),
        ("drive_torque_gain", 1.9, "no sensor is off by more than 0.74 to 1.35"),
        ("wheel_radius", 0.17, "the vehicle file says 0.65 m"),
    ],
)
def test_what_no_machine_has_is_not_written(key: str, value: float, expected: str) -> None:
    unknown: list[Unknown] = []
    assert plausible([Quantity(key, value, 0.01, "1", (), "", wheel="l")], machine(), unknown) == []
    assert expected in unknown[0].why
    near = Quantity(key, 1.02 if key == "drive_torque_gain" else 0.64, 0.01, "1", (), "", wheel="l")
    assert plausible([near], machine(), unknown) == [near]


def test_speeds_in_kmh_make_no_radius() -> None:
    log = turning_log(1000)
    wrong = log.with_channels(ground_speed=log["ground_speed"] / 3.6)
    calibration = calibrate(wrong, machine())
    assert not [q.name for q in calibration.quantities if q.key == "wheel_radius"]
    assert any("it was converted from km/h" in note for note in calibration.notes)
    assert np.isfinite([q.value for q in calibration.quantities]).all()
