"""Means over windows, on values that are known."""

from __future__ import annotations

import numpy as np

from terragrip.recording import Recording
from terragrip.recording.window_means import averaged, window_means, windows_of


def test_rows_of_a_window_become_their_mean_and_a_window_without_a_value_is_missing() -> None:
    time = 7.0 + np.array([0.00, 0.01, 0.02, 0.06, 0.08, 0.21])
    speed = np.array([1.0, 2.0, 6.0, 4.0, 8.0, 5.0])
    torque = np.array([np.nan, 3.0, 5.0, np.nan, np.nan, 7.0])
    result = averaged(Recording(time, {"ground_speed": speed, "drive_torque_l": torque}), 0.05)
    np.testing.assert_allclose(result.time, 7.0 + np.array([0.01, 0.07, 0.21]))
    np.testing.assert_allclose(result.channels["ground_speed"], [3.0, 6.0, 5.0])
    np.testing.assert_allclose(result.channels["drive_torque_l"], [4.0, np.nan, 7.0])


def test_a_log_with_hardly_two_rows_in_a_window_stays_as_it_is() -> None:
    log = Recording(np.arange(9) / 10, {"ground_speed": np.arange(9.0)})
    assert averaged(log, 0.05) is log
    assert averaged(Recording(np.empty(0), {}), 0.05).time.size == 0


def test_means_of_a_dead_sensor_are_equal_but_for_rounding() -> None:
    value = 0.123456789
    log = Recording(np.arange(700) / 700, {"wheel_speed_l": np.full(700, value)})
    found = averaged(log, 0.05).channels["wheel_speed_l"]
    assert len(found) == 20
    assert np.ptp(found) <= 1e-12 * value


def test_of_a_pause_of_years_few_windows_are_left_and_those_after_it_start_when_they_do() -> None:
    time = np.r_[7.0 + np.arange(9) / 2, 1.7e9 + np.arange(9) / 2]
    place, starts = windows_of(time, 2.0)
    assert len(starts) < 30
    within = time - starts[place]
    assert np.all((within >= 0) & (within < 2.0))
    assert np.isnan(
        window_means(time, place, len(starts))[3:6]
    ).all()  # none has neighbours on both sides of the pause
