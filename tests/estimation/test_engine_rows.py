"""The last known value of each row, against a loop over the rows before it."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation.engine_torque import EngineTorque, driveline_torque, earlier, held
from terragrip.vehicle_parts import Driveline


def loop(time: np.ndarray, values: np.ndarray, row: int, least: float, most: float) -> float:
    """The last value known at least ``least`` seconds before a row, NaN where it is older than ``most``."""
    for k in range(row, -1, -1):
        if np.isfinite(values[k]) and time[row] - time[k] >= least - 1e-9:
            return float(values[k]) if time[row] - time[k] <= most else np.nan
    return np.nan


@pytest.mark.parametrize("seed", range(6))
def test_values_stand_two_seconds_and_are_compared_over_three(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # quarters of a second, so that values of exactly the limit's age are among them
    time = np.cumsum(rng.integers(1, 6, 120)) / 4.0
    values = np.where(rng.random(120) < 0.6, np.nan, rng.normal(size=120))
    rows = range(len(time))
    np.testing.assert_array_equal(held(time, values), [loop(time, values, k, 0.0, 2.0) for k in rows])
    for lag in (0.5, 1.0):
        np.testing.assert_array_equal(
            earlier(time, values, lag), [loop(time, values, k, lag, 3.0) for k in rows]
        )


def test_nothing_known_is_nothing() -> None:
    time, nothing = np.arange(4.0), np.full(4, np.nan)
    assert np.isnan(held(time, nothing)).all()
    assert np.isnan(earlier(time, nothing, 0.5)).all()


def test_a_fixed_ratio_has_the_sign_of_the_travel_and_needs_no_wheel() -> None:
    """Forward, in reverse, and at rest, where no wheel says which way; the engine off."""
    driveline = Driveline.model_validate({"efficiency": 0.8, "accessory_power": 1500.0, "ratio": 20.0})
    time = np.arange(4.0) * 10
    channels = {"engine_speed": np.array([150.0, 150.0, 150.0, 0.0]), "engine_torque": np.full(4, 210.0)}
    wheels = np.array([7.5, -7.5, 0.0, 7.5])
    got = driveline_torque(driveline, EngineTorque(None, 5.0), time, channels, wheels, 0.8)
    # 1500 W at 150 rad/s are 10 N m
    np.testing.assert_allclose(got.torque, [3200.0, -3200.0, 3200.0, np.nan])
    np.testing.assert_allclose(got.std, [0.8 * 20 * np.hypot(5.0, 5.0)] * 3 + [np.nan])
    assert not got.shift.any()


def test_a_share_is_of_the_reference_less_friction() -> None:
    time = np.arange(3.0)
    share = {
        "engine_torque_share": np.array([0.5, 0.2, 0.0]),
        "engine_friction_share": np.array([0.1, np.nan, np.nan]),
    }
    assert EngineTorque(800.0, 1.0).at(share, time).tolist() == pytest.approx([320.0, 80.0, -80.0])
    del share["engine_friction_share"]
    assert EngineTorque(800.0, 1.0).at(share, time).tolist() == pytest.approx([336.0, 96.0, -64.0])


def test_an_engine_that_gains_speed_keeps_torque_for_itself() -> None:
    """A ramp of 10 rad/s² at 1.5 kg m² takes 15 N m, by the change from row to row."""
    driveline = Driveline(efficiency=0.8, accessory_power=0.0, engine_inertia=1.5, ratio=20.0)
    time = np.arange(0.0, 5.0, 0.25)
    speed = 150.0 + 10.0 * np.clip(time - 1.0, 0.0, 2.0)
    channels = {"engine_speed": speed, "engine_torque": np.full(len(time), 210.0)}
    got = driveline_torque(driveline, EngineTorque(None, 5.0), time, channels, speed / 20.0, 0.8)
    gained = np.interp(time, [1.0, 1.25, 3.0, 3.25], [0.0, 10.0, 10.0, 0.0])
    np.testing.assert_allclose(got.torque, 0.8 * 20.0 * (210.0 - 1.5 * gained), rtol=1e-9)


def test_what_turns_the_engine_faster_does_not_reach_the_wheels() -> None:
    """A speed that swings by 10 rad/s within 3 s takes 500 N m at the wheels; of its change over half a second 260 were left."""
    driveline = Driveline.model_validate(
        {"efficiency": 0.8, "accessory_power": 0.0, "ratio": 20.0, "engine_inertia": 1.5}
    )
    time = 0.1 * np.arange(300)
    phase = 2 * np.pi * time / 3
    speed, change = 180 + 10 * np.sin(phase), 2 * np.pi / 3 * 10 * np.cos(phase)
    channels = {"engine_speed": speed, "engine_torque": 100 + 1.5 * change}
    got = driveline_torque(driveline, EngineTorque(None, 5.0), time, channels, speed / 20, 0.8)
    assert np.abs(got.torque[10:] - 1600).max() < 60
