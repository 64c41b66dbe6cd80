"""Held channels are distinguished from fresh, quantised and standing ones, on made-up signals and on measured ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.recording import Recording, fresh_samples, held_periods, sensor_noise, without_held
from terragrip.recording.held import held_period, quantum

SEEDS = range(5)


def motion(time: np.ndarray, seed: int) -> np.ndarray:
    """A wheel speed [rad/s] that wanders, with white noise of 0.03."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 6.28, 3)
    smooth = 3 + 0.8 * np.sin(0.3 * time + phase[0]) + 0.3 * np.sin(1.7 * time + phase[1])
    return smooth + 0.03 * rng.standard_normal(len(time))


def held(time: np.ndarray, period: float, seed: int, *, jitter: float = 0.0) -> np.ndarray:
    """The same motion, fresh once a period and repeated in between."""
    rng = np.random.default_rng(seed)
    updates = np.arange(-period, time[-1] + period, period)
    updates = np.sort(updates + jitter * period * rng.uniform(-0.5, 0.5, len(updates)))
    return motion(updates, seed)[np.searchsorted(updates, time, side="right") - 1]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("rate", "period", "jitter"),
    [
        (20, 0.25, 0),
        (20, 1.0, 0),
        (20, 1 / 9, 0),
        (20, 1 / 15, 0),
        (100, 0.1, 0.3),
        (100, 1.5, 0.6),
        (50, 0.021, 0),
    ],
)
def test_held_channels_are_found(rate: int, period: float, jitter: float, seed: int) -> None:
    time = np.arange(0, 60, 1 / rate)
    result = held_period(time, held(time, period, seed, jitter=jitter))
    if period * rate < 1.1:  # one row in twenty repeats: hardly held, either answer serves
        assert result is None or result == pytest.approx(period, rel=0.1)
    else:
        assert result == pytest.approx(period, rel=0.05 + 0.2 * jitter)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("resolution", [0.001, 0.01, 0.1, 0.5])
def test_quantised_channels_are_fresh(resolution: float, seed: int) -> None:
    time = np.arange(0, 60, 0.01)
    assert held_period(time, np.round(motion(time, seed) / resolution) * resolution) is None
    smooth = 3 + 2 * np.sin(
        0.2 * time + seed
    )  # a slow ramp without noise: long regular runs of one step each
    assert held_period(time, np.round(smooth / resolution) * resolution) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_coarse_and_held_is_held(seed: int) -> None:
    time = np.arange(0, 60, 0.05)
    assert held_period(time, np.round(held(time, 0.5, seed) / 0.1) * 0.1) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("seed", SEEDS)
def test_standing_and_spikes_are_not_held(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 120, 0.01)
    stops = motion(time, seed)
    for start in range(10, 110, 10):
        stops[(time > start) & (time < start + 5)] = 0.0
    assert held_period(time, stops) is None
    spikes = np.zeros(len(time))
    spikes[rng.choice(len(time), 60, replace=False)] = rng.uniform(1, 5, 60)
    assert held_period(time, spikes) is None
    assert held_period(time, np.zeros(len(time))) is None
    steps = np.repeat([0.0, 1.0, 0.3, 2.0], 3000)  # commands, not updates
    assert held_period(time, steps) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_fresh_samples_are_the_updates(seed: int) -> None:
    time = np.arange(0, 60, 0.05)
    values = held(time, 0.25, seed)
    values[(time > 20) & (time <= 30)] = 0.0  # a standstill, still measured
    fresh = fresh_samples(time, values, 0.25)
    moving = (time < 20) | (time > 30.3)
    changed = np.r_[True, np.diff(values) != 0]
    np.testing.assert_array_equal(fresh[moving], changed[moving])
    standing = np.diff(time[fresh & (time > 20) & (time <= 30)])
    assert np.median(standing) == pytest.approx(0.25, abs=0.01)
    frozen = np.where(time > 40, 3.14159, values)  # a sensor that fell silent
    assert not fresh_samples(time, frozen, 0.25)[time > 40.1].any()


def test_without_held_keeps_updates_and_other_channels() -> None:
    time = np.arange(0, 60, 0.05)
    recording = Recording(time, {"wheel_speed_l": held(time, 0.25, 0), "ground_speed": motion(time, 1)})
    assert list(held_periods(recording)) == ["wheel_speed_l"]
    thinned = without_held(recording)
    assert np.isfinite(thinned["wheel_speed_l"]).mean() == pytest.approx(0.2, abs=0.01)
    np.testing.assert_array_equal(thinned["ground_speed"], recording["ground_speed"])


@pytest.mark.parametrize("step", [1.0, 0.1, 1e-5, 0.0625, np.pi / 1800])
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_quantum_is_the_resolution(step: float, kind: type) -> None:
    noise = np.random.default_rng(0).standard_normal(5000)
    values = (np.round(30 * noise) * step).astype(kind).astype(float)
    assert quantum(values) == pytest.approx(step, rel=1e-3)


def test_continuous_values_have_no_quantum() -> None:
    rng = np.random.default_rng(0)
    assert quantum(rng.standard_normal(5000)) == 0.0
    assert quantum(np.cumsum(rng.uniform(0.5, 1.5, 5000))) == 0.0
    assert quantum(np.full(10, 3.0)) == 0.0


RUNS = (
    "warthog_wheels_grass.csv.gz",
    "warthog_wheels_grass_2024_7_29_14h46s15.csv.gz",
    "warthog_wheels_grass_2024_7_29_14h4s53.csv.gz",
)


@pytest.mark.parametrize("run", RUNS)
def test_measured_log(shared: Callable[[str], Path], run: str) -> None:
    log = pd.read_csv(shared(f"data/drive_warthog/raw20hz/{run}"))
    time = log["time_s"].to_numpy()
    periods = {
        name: held_period(time, log[name].to_numpy(float))
        for name in log.columns
        if log[name].dtype.kind == "f"
    }
    for side in ("left", "right"):  # the figures that the data's own notes give
        assert periods[f"meas_{side}_vel"] == pytest.approx(0.25, rel=0.02)
        assert periods[f"{side}_wheel_current"] == pytest.approx(1.0, rel=0.05)
    assert periods["icp_pos_x"] == pytest.approx(1 / 9, rel=0.15)
    for name in ("imu_x", "imu_z", "imu_acceleration_x", "imu_acceleration_z"):
        assert periods[name] is None


def test_noise_of_a_held_channel_comes_from_its_updates() -> None:
    time = np.arange(0, 300, 0.05)
    recording = Recording(time, {"wheel_speed_l": held(time, 0.25, 3)})
    assert sensor_noise(recording)["wheel_speed_l"] == pytest.approx(0.03, rel=0.15)


@pytest.mark.parametrize(("strays", "expected"), [(1, 0.1), (9, 0.05)])
def test_one_step_in_a_hundred_may_miss_the_resolution(strays: int, expected: float) -> None:
    steps = np.concatenate([0.1 * np.arange(1, 201), 0.1 * np.arange(1, strays + 1) + 0.05])
    assert quantum(np.cumsum(np.r_[0.0, steps])) == pytest.approx(expected, rel=1e-6)


def test_a_value_held_at_zero_counts_once_a_period_and_any_other_once() -> None:
    time = np.arange(0.0, 5.0, 0.125) + 100.0
    at_rest = fresh_samples(time, np.zeros(40), 1.0)
    np.testing.assert_array_equal(time[at_rest] - 100.0, [0.0, 1.5, 2.5, 3.5, 4.5])
    np.testing.assert_array_equal(np.flatnonzero(fresh_samples(time, np.ones(40), 1.0)), [0])


SPOILED = 1e30


def spoiled(values: np.ndarray, every: int = 50) -> np.ndarray:
    """One value in so many as a bus error leaves it: beside it all others are alike."""
    return np.where(np.arange(len(values)) % every == 7, SPOILED, values)


def test_a_spoiled_value_is_no_resolution() -> None:
    values = motion(np.arange(0, 60, 0.05), 1)
    assert quantum(spoiled(values)) == 0.0
    assert quantum(spoiled(np.round(values, 1))) == pytest.approx(0.1)


def test_a_held_channel_is_held_beside_spoiled_values() -> None:
    time = np.arange(0, 60, 0.05)
    values = held(time, 0.5, 2)
    assert held_period(time, spoiled(values, 400)) == pytest.approx(0.5, rel=0.1)
    frozen = np.where(time > 40, 3.14159, values)
    assert not fresh_samples(time, spoiled(frozen, 400), 0.5)[time > 41].any()


@pytest.mark.parametrize("every", [15, 50])
def test_noise_beside_spoiled_values_is_that_of_the_others(every: int) -> None:
    """A fifteenth spoils every fourth third difference; the median of all is then 1.5 times that of the others."""
    time = np.arange(0, 60, 0.05)
    recording = Recording(time, {"wheel_speed_l": spoiled(motion(time, 4), every)})
    assert 0.025 < sensor_noise(recording)["wheel_speed_l"] < 0.055


def rounded_with_spikes(seed: int, share: float) -> np.ndarray:
    """A channel of a coarse sensor, .2 a step, and a share of spikes that are no multiples of it."""
    rng = np.random.default_rng(seed)
    values = 0.2 * np.round((3 + np.sin(np.arange(600) / 40) + 0.1 * rng.standard_normal(600)) / 0.2)
    hit = rng.choice(600, round(share * 600), replace=False)
    values[hit] += rng.choice([-1, 1], len(hit)) * 0.7175431718
    return values


@pytest.mark.parametrize("share", [0.005, 0.02, 0.05])
def test_spikes_hide_neither_the_resolution_nor_that_a_channel_is_fresh(share: float) -> None:
    for seed in range(5):
        values = rounded_with_spikes(seed, share)
        assert quantum(values) == pytest.approx(0.2)
        assert held_period(np.arange(600) / 10, values) is None
