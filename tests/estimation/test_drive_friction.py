"""Friction of motor and gears in a torque that is worked out from the motor's current: against the wheel's turning, whichever way."""

from __future__ import annotations

import numpy as np
import pytest

from drives import WHEELS, drive, robot
from terragrip.estimation import estimate
from terragrip.estimation.calibration.windows import windows
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

FRICTION = 4.0  # N m: .06 of adhesion


def by_current(log: Recording) -> Recording:
    """The log with torques of the motors' currents, which hold their friction."""
    torques = {
        f"drive_torque_{w}": log[f"drive_torque_{w}"] + FRICTION * np.sign(log[f"wheel_speed_{w}"])
        for w in WHEELS
    }
    return log.with_channels(**torques)


@pytest.mark.parametrize("method", ["bank", "algebraic", "ukf"])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_current_gives_what_a_torque_at_the_wheel_does(method: str, direction: int) -> None:
    log = drive(10.0, direction=direction, imu=True).recording
    right, current = (
        estimate(log, robot(), method),
        estimate(by_current(log), robot(drive_friction=FRICTION), method),
    )
    for name in ("adhesion_fl", "adhesion_rr", "soil_resistance", "net_traction_rl", "adhesion_fl_std"):
        np.testing.assert_allclose(current[name], right[name], atol=1e-9, err_msg=name)


def test_at_rest_nothing_is_taken_off() -> None:
    """A motor without current holds by its friction."""
    log = drive(
        10.0, noise=0.0, speed=lambda t: 0.6 * np.clip(t - 5, 0, 1) + 1e-9, slip=lambda t: 0 * t
    ).recording
    torques = {f"drive_torque_{w}": np.where(log.time < 5, 0.0, log[f"drive_torque_{w}"]) for w in WHEELS}
    log = log.with_channels(**torques)
    right, current = estimate(log, robot()), estimate(log, robot(drive_friction=FRICTION))
    rest = log.time < 4.9
    np.testing.assert_allclose(current["adhesion_fl"][rest], right["adhesion_fl"][rest], atol=1e-6)


def test_calibration_works_on_torques_without_it() -> None:
    for direction in (1, -1):
        log = drive(10.0, direction=direction).recording
        table = windows([by_current(log)], robot(drive_friction=FRICTION), 1.0)
        np.testing.assert_allclose(table.torque, windows([log], robot(), 1.0).torque, atol=1e-12)


def test_an_axle_has_its_own_and_a_free_one_none() -> None:
    axles = robot().to_dict()["axles"]
    own = robot(drive_friction="3 N m", axles=axles | {"rear": {**axles["rear"], "drive_friction": 5.0}})
    assert own.wheel_friction.tolist() == [3.0, 3.0, 5.0, 5.0]
    free = robot(drive_friction=3.0, axles=axles | {"rear": {**axles["rear"], "driven": False}})
    assert free.wheel_friction.tolist() == [3.0, 3.0, 0.0, 0.0]
