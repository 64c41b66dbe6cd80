"""Noise estimated from the log, against noise that was put in."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, rounding_noise, sensor_noise
from terragrip.recording.noise import white_noise


def smooth(time: np.ndarray) -> np.ndarray:
    return 3 + 0.8 * np.sin(0.5 * time) + 0.2 * np.sin(2 * time)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [0.003, 0.03, 0.3])
@pytest.mark.parametrize("rate", [20, 100])
def test_white_noise_is_found(rate: int, sigma: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 60, 1 / rate)
    values = smooth(time) + sigma * rng.standard_normal(len(time))
    assert white_noise(time, values) == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize("seed", range(3))
def test_uneven_stamps_and_spikes_do_no_harm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.01, 0.03, 5000))
    time[2500:] += 20.0
    values = smooth(time) + 0.03 * rng.standard_normal(5000)
    values[rng.choice(5000, 50, replace=False)] += 10.0
    assert white_noise(time, values) == pytest.approx(0.03, rel=0.12)


@pytest.mark.parametrize("seed", range(3))
def test_standstill_does_not_hide_the_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.01)
    values = np.where(time < 45, 0.0, smooth(time) + 0.03 * rng.standard_normal(6000))
    assert white_noise(time, values) == pytest.approx(0.03, rel=0.12)


def test_resolution_is_the_floor() -> None:
    time = np.arange(0, 60, 0.01)
    values = np.round(smooth(time) / 0.1) * 0.1  # no noise but the rounding
    assert white_noise(time, values) == pytest.approx(0.1 / np.sqrt(12), rel=0.5)
    assert (white_noise(time, values) or 0) >= 0.1 / np.sqrt(12) * (1 - 1e-9)


def test_a_counter_has_the_noise_of_its_resolution() -> None:
    assert white_noise(np.arange(100.0), 0.1 * np.arange(100)) == pytest.approx(0.1 / np.sqrt(12))


def test_what_cannot_be_told_is_absent() -> None:
    time = np.arange(0, 60, 0.01)
    noisy = smooth(time) + 0.05 * np.random.default_rng(0).standard_normal(6000)
    channels = {
        "ground_speed": noisy,
        "drawbar_force": np.zeros(6000),
        "pitch": np.where(np.arange(6000) < 10, noisy, np.nan),
        "true_ground_speed": noisy,
        "latitude": noisy,
    }
    assert list(sensor_noise(Recording(time, channels))) == ["ground_speed"]
    known = Recording(time, channels, noise={"ground_speed": 0.2})
    assert sensor_noise(known) == {"ground_speed": 0.2}


def test_a_union_of_rates_is_judged_on_what_was_measured() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0, 120, 0.01)
    values = np.full(12000, np.nan)
    values[::5] = smooth(time[::5]) + 0.02 * rng.standard_normal(2400)
    assert sensor_noise(Recording(time, {"ground_speed": values}))["ground_speed"] == pytest.approx(
        0.02, rel=0.12
    )


def test_the_error_of_rounding_is_found_in_a_slow_channel_too() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(0, 300, 0.01)
    values = np.round((smooth(time) + 0.02 * rng.standard_normal(len(time))) / 0.05) * 0.05
    values[np.arange(len(time)) % 50 != 7] = np.nan
    assert rounding_noise(values) == pytest.approx(0.05 / np.sqrt(12))


def test_few_steps_are_off_by_half_of_one() -> None:
    """Pulses counted in each row, three or four: the error is one more or less, not that of rounding."""
    angle = np.cumsum(np.full(4000, 3.4))
    assert rounding_noise(0.7 * np.diff(np.floor(angle))) == pytest.approx(0.35)
    assert rounding_noise(0.7 * np.diff(np.floor(angle)), 0.35) == pytest.approx(0.7 / np.sqrt(12))


def test_what_is_not_rounded_and_set_points_have_no_error_of_rounding() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(0, 60, 0.01)
    assert rounding_noise(smooth(time) + 0.02 * rng.standard_normal(len(time))) < 1e-6
    assert rounding_noise(np.repeat([0.0, 40.0, 80.0, 40.0], 500)) == 0
    assert rounding_noise(np.full(100, np.nan)) == 0


def test_a_spoiled_value_is_no_resolution() -> None:
    """Beside 1e30 all other values are one, so that its steps alone passed for the resolution."""
    values = np.random.default_rng(7).standard_normal(2000)
    values[::32] = 1e30
    assert rounding_noise(values) == 0.0
    assert rounding_noise(np.round(values, 1)) == pytest.approx(0.1 / np.sqrt(12.0))
