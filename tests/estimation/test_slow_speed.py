"""Errors of the receiver that do not average out: of half a minute, which stops tell, and of seconds, which neighbouring innovations
tell; and a speed whose samples are half an interval late."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drives import robot
from terragrip.estimation import Estimates, TractionEstimator, estimate
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import Kind, draw, machines

pytestmark = pytest.mark.usefixtures("unchecked")

RATE, MEMORY = 50.0, 30.0  # 1/s, s


def drifting(result: SimulationResult, share: float, seed: int, memory: float = MEMORY) -> SimulationResult:
    """The ground speed with a first-order Gauss-Markov error of this share of its noise on top."""
    log, noise = result.recording, result.vehicle.sensors.ground_speed
    assert noise is not None
    keep = np.exp(-1 / (RATE * memory))
    rng = np.random.default_rng(seed)
    start, drive = share * noise * rng.standard_normal(), np.sqrt(1 - keep**2) * share * noise
    error = lfilter([1.0], [1.0, -keep], drive * rng.standard_normal(len(log.time)), zi=[keep * start])[0]
    channels = dict(log.channels) | {"ground_speed": log["ground_speed"] + error}
    return replace(result, recording=replace(log, channels=channels))


def share_held(result: SimulationResult, found: Estimates) -> float:
    """Share of moving rows and driven wheels whose 95 % interval holds the slip."""
    speed = np.abs(result.truth["true_ground_speed"].to_numpy())
    moving = speed > min(0.05, 0.1 * float(np.median(speed[speed > 0.01])))
    inside = []
    for wheel, driven in zip(result.vehicle.wheels, result.vehicle.driven, strict=True):
        error = np.abs(found[f"slip_{wheel}"] - result.truth[f"true_slip_{wheel}"].to_numpy())
        rows = moving & np.isfinite(error) & driven
        inside.append((error <= 1.96 * found[f"slip_{wheel}_std"])[rows])
    return float(np.mean(np.concatenate(inside)))


def test_slip_intervals_hold_a_slow_error_of_the_ground_speed():
    held = []
    for kind, seed in machines("development", 8):
        result = drifting(draw(kind, seed, rate=RATE), 0.5, seed)
        held.append(share_held(result, estimate(result.recording, result.vehicle)))
    assert np.mean(held) > 0.88  # .77 before anything stood for it


def test_a_sensor_that_reads_nothing_at_rest_gets_narrower_intervals_than_one_that_does():
    result = draw(Kind("light", "brixius", "plain"), 45, rate=RATE)  # stands for the first second
    log, noise = result.recording, result.vehicle.sensors.ground_speed
    rest = result.truth["true_ground_speed"].abs().to_numpy() < 0.003
    assert rest.sum() > RATE
    off = log["ground_speed"] + np.where(rest, 0.8 * noise, 0.0)
    wide = estimate(replace(log, channels=dict(log.channels) | {"ground_speed": off}), result.vehicle)
    usual = estimate(log, result.vehicle)
    rows = ~rest & np.isfinite(log["ground_speed"])
    assert np.median(wide["ground_speed_std"][rows]) > 1.15 * np.median(usual["ground_speed_std"][rows])


def sampled(result: SimulationResult, period: float, late: float) -> SimulationResult:
    """The ground speed at so few instants [s apart], each of this long [s] before."""
    log = result.recording
    count = round(period * RATE)
    speed = np.interp(log.time - late, log.time, log["ground_speed"])
    speed[np.arange(len(speed)) % count != 0] = np.nan
    return replace(result, recording=replace(log, channels=dict(log.channels) | {"ground_speed": speed}))


def shares(change: Callable[[SimulationResult, int], SimulationResult]) -> list[float]:
    """Share held on each of six machines whose logs are changed so."""
    held = []
    for kind, seed in machines("development", 6, 40):
        result = change(draw(kind, seed, rate=RATE), seed)
        held.append(share_held(result, estimate(result.recording, result.vehicle)))
    return held


def test_slip_intervals_hold_an_error_of_seconds():
    held = shares(lambda result, seed: drifting(result, 1.0, seed, memory=2.0))
    assert np.mean(held) > 0.84  # .80 before neighbouring innovations were looked at


def test_slip_intervals_hold_speeds_of_before():
    assert min(shares(lambda result, _: sampled(result, 0.4, 0.2))) > 0.9  # .85 before a sample had an age


def test_a_sample_after_an_age_has_a_finite_interval() -> None:
    """Found by the fuzzer: the age of a sample counts, and an interval of 1e200 s made the interval of the ground speed infinite."""
    vehicle = robot()
    estimator = TractionEstimator(vehicle)
    for time in (0.0, 0.01, 0.02, 1e200):
        values = {f"wheel_speed_{w}": 3.0 + time % 1 for w in vehicle.wheels}
        out = estimator.update({"time": time, "ground_speed": 0.9 + time % 1, **values})
    assert not np.isinf(out.ground_speed_std)


def test_forces_that_predict_badly_are_not_taken_for_an_error_of_the_receiver():
    """At 2 Hz the filter's gain is nearly 1: its error is about that of a sample, and so must be the one it states."""
    result = draw(Kind("robot", "saturating", "plain"), 3, rate=2.0, duration=120.0)
    found = estimate(result.recording, result.vehicle)
    speed = result.truth["true_ground_speed"].to_numpy()
    moving = found["ground_speed"] > 0.1
    error = np.abs(found["ground_speed"] - speed)[moving] / found["ground_speed_std"][moving]
    assert np.sqrt(np.mean(error**2)) > 0.7  # .63 before the gain counted
    assert np.mean(error <= 1.96) > 0.9
