"""The kernel's method of speeds alone against its twin in NumPy, sample by sample and smoothed."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from kernel_twin.reckoning import Reckoning
from kernel_twin.speeds import SpeedsFilter, process_noise, transition
from terragrip.units import STANDARD_GRAVITY

pytestmark = pytest.mark.usefixtures("unchecked")

RADIUS = 0.25


def machine(wheels: tuple[str, ...]) -> tg.Vehicle:
    return tg.Vehicle.from_dict(
        {"mass": 80, "axles": {"only": {"mass": 80, "wheels": list(wheels)}}, "wheel": {"radius": RADIUS, "inertia": 1}}
    )  # fmt: skip


def drive(wheels: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Instants (n,) and speeds (n, 1 + wheels) [m/s] at uneven steps, with missing samples, spikes and a leap."""
    draws = np.random.default_rng(seed)
    time = np.cumsum(draws.uniform(0.03, 0.6, 250))
    speed = 1.5 + np.sin(time / 4)
    slip = 0.1 + 0.1 * np.sin(time[:, None] / (3 + np.arange(wheels)))
    speeds = np.c_[speed, speed[:, None] / (1 - slip)] + 0.02 * draws.standard_normal((250, 1 + wheels))
    speeds[150:] += 1.0
    speeds[draws.random(speeds.shape) < 0.3] = np.nan
    speeds[[50, 90, 130], 0] = 15.0
    speeds[180:210, 0] = np.nan
    return time, speeds


@pytest.mark.sample(2)
@pytest.mark.parametrize(("wheels", "seed"), [(1, 1000), (2, 1001), (4, 1002), (8, 1003)])
def test_kernel_and_twin_agree(wheels: int, seed: int) -> None:
    names = tuple(f"w{k}" for k in range(wheels))
    time, speeds = drive(wheels, seed)
    columns = {"time": time, "ground_speed": speeds[:, 0]}
    columns |= {f"wheel_speed_{w}": speeds[:, 1 + k] / RADIUS for k, w in enumerate(names)}
    log, sensors = tg.Recording.from_frame(columns), {"ground_speed": 0.03, "wheel_speed": 0.02 / RADIUS}
    options = {"sensors": sensors, "held": {}, "gap": 1e3}
    estimates = tg.estimate(log, machine(names), **options)
    smooth = tg.estimate(log, machine(names), smooth=True, **options)

    reckoning = Reckoning(RADIUS, 0.01 * np.sqrt(STANDARD_GRAVITY * RADIUS), gap=1e3)
    twin = SpeedsFilter(np.r_[0.03, np.full(wheels, 0.02)], reckoning)
    states, covariances, densities, scores, slow, silent = [], [], [], [], [], 0
    for k in range(len(time)):
        twin.step(time[k] - time[k - 1] if k else 0.0, speeds[k])
        states.append(twin.state.copy())
        covariances.append(twin.covariance.copy())
        densities.append(twin.densities)
        slow.append(twin.slow)
        silent += twin.reckoned > 0
        scores.append((twin.nis, twin.weight.min()))
    score = np.array(scores)
    assert np.allclose(estimates["nis"], score[:, 0], rtol=1e-9, atol=1e-9)
    assert np.array_equal(estimates["event"] == "outlier", score[:, 1] < 0.5)
    assert np.sum(score[:, 1] < 0.5) >= 3
    assert silent > 20
    _same(estimates, states, covariances, slow, names)
    for k in range(len(time) - 2, -1, -1):  # Rauch, Tung and Striebel
        dt = time[k + 1] - time[k]
        move = transition(dt, wheels + 2)
        x = move @ states[k]
        ahead = move @ covariances[k] @ move.T + process_noise(x, dt, *densities[k + 1])
        gain = covariances[k] @ move.T @ np.linalg.inv(ahead)
        states[k] = states[k] + gain @ (states[k + 1] - x)
        covariances[k] = covariances[k] + gain @ (covariances[k + 1] - ahead) @ gain.T
    _same(smooth, states, covariances, slow, names, rtol=1e-7)


@pytest.mark.parametrize("off", [-6.0, 6.0])
def test_an_outlier_in_the_second_sample_weighs_as_in_the_twin(off: float) -> None:
    """No sample was off before it, so that nothing confirms it, on either side."""
    speeds = np.array([[5.0, 5.5], [5.0 + off, 5.5], [5.0, 5.5]])
    columns = {"time": [0.0, 0.1, 0.2], "ground_speed": speeds[:, 0], "wheel_speed_a": speeds[:, 1] / RADIUS}
    sensors = {"ground_speed": 0.03, "wheel_speed": 0.02 / RADIUS}
    log = tg.Recording.from_frame(columns)
    estimates = tg.estimate(log, machine(("a",)), sensors=sensors, held={}, gap=1e3)
    twin = SpeedsFilter(np.array([0.03, 0.02]))
    weights = []
    for row, dt in zip(speeds, (0.0, 0.1, 0.1), strict=True):
        twin.step(dt, row)
        weights.append(twin.weight[0])
    assert weights[1] < 0.5
    assert list(estimates["event"] == "outlier") == [weight < 0.5 for weight in weights]
    assert estimates["ground_speed"][-1] == pytest.approx(twin.state[0], rel=1e-9)


def test_an_error_that_lasts_a_few_samples_widens_the_interval_as_in_the_twin() -> None:
    draws = np.random.default_rng(1005)
    time = np.arange(400) * 0.02
    speeds = np.c_[np.full(400, 1.5), np.full(400, 1.6)] + 0.005 * draws.standard_normal((400, 2))
    speeds[:, 0] += 0.1 * np.repeat(draws.standard_normal(80), 5)
    columns = {"time": time, "ground_speed": speeds[:, 0], "wheel_speed_a": speeds[:, 1] / RADIUS}
    sensors = {"ground_speed": 0.03, "wheel_speed": 0.02 / RADIUS}
    estimates = tg.estimate(tg.Recording.from_frame(columns), machine(("a",)), sensors=sensors, held={})
    twin, spread, slow = SpeedsFilter(np.array([0.03, 0.02])), [], []
    for k in range(len(time)):
        twin.step(0.02 if k else 0.0, speeds[k])
        spread.append(twin.covariance[0, 0])
        slow.append(twin.slow)
    assert slow[-1] > 5 * slow[0]
    assert np.allclose(estimates["ground_speed_std"], np.sqrt(np.add(spread, slow)), rtol=1e-9)


def test_the_distance_is_the_way_that_was_driven() -> None:
    time = np.arange(0, 20, 0.1)
    speed = 1.5 + 0.3 * np.sin(time)
    columns = {"time": time, "ground_speed": speed, "wheel_speed_a": speed / 0.9 / RADIUS}
    estimates = tg.estimate(tg.Recording.from_frame(columns), machine(("a",)))
    assert estimates["distance"][-1] == pytest.approx(np.trapezoid(speed, time), rel=0.01)


def test_a_receiver_that_drifts_is_seen_at_stops() -> None:
    """An error of half the stated noise that stays for half a minute: slip from speeds alone was held in 63 % of these rows."""
    held = []
    for seed in range(2000, 2008):
        draws = np.random.default_rng(seed)
        time = np.arange(0, 240, 0.05)
        speed = 1.2 * np.minimum(
            1.0, np.maximum(0.0, 1.5 * np.sin(2 * np.pi * time / 40) + 0.6)
        )  # a stop each 40 s
        drift = np.interp(time, np.arange(0, 280, 30), 0.025 * draws.standard_normal(10))
        ground = speed + drift + 0.05 * draws.standard_normal(len(time))
        rim = speed / 0.9 + 0.005 * draws.standard_normal(len(time))
        columns = {"time": time, "ground_speed": ground, "wheel_speed_a": rim / RADIUS}
        vehicle = tg.Vehicle.from_dict({**machine(("a",)).to_dict(), "uncertainty": {"wheel_radius": 0.0}})
        sensors = {"ground_speed": 0.05, "wheel_speed": 0.005 / RADIUS}
        estimates = tg.estimate(tg.Recording.from_frame(columns), vehicle, sensors=sensors, held={})
        rows = (time > 80) & (speed > 1.0)
        error = estimates["slip_a"][rows] - 0.1
        held.append(np.mean(np.abs(error) <= 1.96 * estimates["slip_a_std"][rows]))
    assert np.mean(held) > 0.85


def _same(
    estimates: tg.Estimates,
    states: list[np.ndarray],
    covariances: list[np.ndarray],
    slow: list[float],
    names: tuple[str, ...],
    rtol: float = 1e-9,
) -> None:
    x, P = np.stack(states), np.stack(covariances)
    assert np.allclose(estimates["ground_speed"], x[:, 0], rtol=rtol)
    assert np.allclose(estimates["ground_speed_std"], np.sqrt(P[:, 0, 0] + slow), rtol=rtol)
    for k, name in enumerate(names):
        rim = x[:, 0] + x[:, 2 + k]
        spread = P[:, 0, 0] + 2 * P[:, 0, 2 + k] + P[:, 2 + k, 2 + k]
        assert np.allclose(estimates[f"wheel_speed_{name}"], rim / RADIUS, rtol=rtol)
        assert np.allclose(estimates[f"wheel_speed_{name}_std"], np.sqrt(spread) / RADIUS, rtol=rtol)


def test_intervals_on_simulated_slip() -> None:
    """Slip that wanders as a random walk does, seen through known noise: 95 % of the rows are in their intervals."""
    draws = np.random.default_rng(1004)
    time = np.arange(0, 200, 0.1)
    speed = 1.5 + 0.3 * np.sin(time / 8)
    slip = 0.12 + 0.08 * np.tanh(np.cumsum(0.02 * draws.standard_normal(len(time))))
    columns = {
        "time": time,
        "ground_speed": speed + 0.03 * draws.standard_normal(len(time)),
        "wheel_speed_a": (speed / (1 - slip) + 0.02 * draws.standard_normal(len(time))) / RADIUS,
    }
    vehicle = tg.Vehicle.from_dict({**machine(("a",)).to_dict(), "uncertainty": {"wheel_radius": 0.0}})
    estimates = tg.estimate(
        tg.Recording.from_frame(columns),
        vehicle,
        sensors={"ground_speed": 0.03, "wheel_speed": 0.02 / RADIUS},
        held={},
    )
    inside = np.abs(estimates["slip_a"] - slip) < 1.96 * estimates["slip_a_std"]
    assert 0.9 < inside.mean() < 0.99
    assert 0.7 < estimates["nis"].sum() / estimates["channels"].sum() < 1.2
