"""Slip from speeds alone: against a dense oracle, against truth, and on measured logs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.estimation import zero_slip
from terragrip.estimation.slip_filter import Walks, run
from terragrip.formats.reading import read_table
from terragrip.formats.signals import Signal, SignalLog


def robot(radius: float = 0.2, **more: object) -> tg.Vehicle:
    axles = {
        "front": {"mass": 30, "wheels": ["fl", "fr"]},
        "rear": {"mass": 30, "wheels": ["rl", "rr"]},
    }
    base = {"mass": 60, "wheelbase": 0.6, "center_of_gravity_height": 0.3, "axles": axles}
    return tg.Vehicle.from_dict({**base, "wheel": {"radius": radius, "inertia": 0.1}, **more})


def test_filter_and_smoother_agree_with_one_dense_regression() -> None:
    draws = np.random.default_rng(1000)
    time = np.cumsum(draws.uniform(0.02, 0.2, 40))
    speeds = np.c_[1 + 0.1 * time, 1.2 + 0.1 * time, 1.1 + 0.1 * time] + 0.05 * draws.standard_normal((40, 3))
    speeds[draws.random((40, 3)) < 0.4] = np.nan
    noise, walks = np.array([0.05, 0.03, 0.02]), Walks(0.2, 0.01)
    anew = np.zeros(40, dtype=bool)
    smooth = run(time, speeds, noise, anew, walks, smooth=True)
    forward = run(time, speeds, noise, anew, walks)
    # All states of all rows as one Gaussian: prior precision of the walk, then measurements.
    size, rows = 4, 40
    precision, shift = np.zeros((size * rows, size * rows)), np.zeros(size * rows)
    precision[:size, :size] = np.diag(1 / np.square([10.0, 3.0, 3.0, 3.0]))
    for k in range(1, rows):
        dt = time[k] - time[k - 1]
        move, spread = np.eye(size), np.zeros((size, size))
        move[0, 1] = dt
        spread[:2, :2] = 0.2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        spread[2, 2] = spread[3, 3] = 0.01 * dt
        both = np.hstack([-move, np.eye(size)])
        part = slice(size * (k - 1), size * (k + 1))
        precision[part, part] += both.T @ np.linalg.inv(spread) @ both
    rows_of = ([1, 0, 0, 0], [1, 0, 1, 0], [1, 0, 0, 1])
    for k in range(rows):
        for c in range(3):
            if np.isfinite(speeds[k, c]):
                row = np.zeros(size * rows)
                row[size * k : size * (k + 1)] = rows_of[c]
                precision += np.outer(row, row) / noise[c] ** 2
                shift += row * speeds[k, c] / noise[c] ** 2
    covariance = np.linalg.inv(precision)
    mean = (covariance @ shift).reshape(rows, size)
    assert np.allclose(smooth.state, mean, atol=1e-6)
    assert np.allclose(forward.state[-1], mean[-1], atol=1e-6)
    for k in (0, 17, 39):
        part = slice(size * k, size * (k + 1))
        assert np.allclose(smooth.covariance[k], covariance[part, part], rtol=1e-5, atol=1e-9)


def test_zero_slip_is_found_under_load_and_noise() -> None:
    draws = np.random.default_rng(1001)
    true = np.where(draws.random(200) < 0.4, 0.97, draws.uniform(0.8, 0.95, 200))
    found = zero_slip.lightest(true + 0.004 * draws.standard_normal(200), 0.004)
    assert found is not None
    assert found.value == pytest.approx(0.97, abs=max(3 * found.std, 0.004))
    assert zero_slip.lightest(true[:10], 0.004) is None


def speeds_of(slip: float, seed: int = 1000, gap: bool = False) -> tg.Recording:
    draws = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.05)
    v = np.clip(np.minimum(time - 5, 0.8), 0, None)
    columns = {"time": time, "ground_speed": v + 0.01 * draws.standard_normal(len(time))}
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = v / (1 - slip) / 0.2 + 0.03 * draws.standard_normal(len(time))
    if gap:
        hole = (time > 30) & (time < 34)
        columns = {k: c if k == "time" else np.where(hole, np.nan, c) for k, c in columns.items()}
    return tg.Recording.from_frame(columns)


def test_wheels_standstill_gap_and_intervals() -> None:
    estimates = tg.estimate(speeds_of(0.1, gap=True), robot(uncertainty={"wheel_radius": 0.001}))
    assert estimates.wheels == ("fl", "fr", "rl", "rr")
    event = estimates["event"]
    assert set(event[estimates.time < 4]) == {"standstill"}
    assert np.isnan(estimates["slip_fl"][estimates.time < 4]).all()
    assert np.sum(event == "gap") >= 2
    moving = (estimates.time > 8) & (event == "")
    for wheel in estimates.wheels:
        error, spread = estimates[f"slip_{wheel}"][moving] - 0.1, estimates[f"slip_{wheel}_std"][moving]
        assert np.sqrt(np.mean(error**2)) < 0.02
        assert 0.85 < np.mean(np.abs(error) < 1.96 * spread) <= 1.0


def test_gaps_are_found_block_by_block_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    log = speeds_of(0.1, gap=True)
    whole = tg.estimate(log, robot())
    for rows in (40, 641):  # the gap begins in row 601 and ends in row 680
        monkeypatch.setattr("terragrip.estimation.slip_only._BLOCK", rows)
        assert tg.estimate(log, robot())["event"].tolist() == whole["event"].tolist()


def test_an_outlier_is_flagged_and_a_leap_is_followed() -> None:
    log = speeds_of(0.0)
    speed = log["ground_speed"].copy()
    speed[700] = 5.0
    speed[900:] += 2.0
    wheels = {
        f"wheel_speed_{w}": log[f"wheel_speed_{w}"] + np.where(np.arange(1200) >= 900, 10.0, 0.0)
        for w in ("fl", "fr", "rl", "rr")
    }
    estimates = tg.estimate(log.with_channels(ground_speed=speed, **wheels), robot())
    assert estimates["event"][700] == "outlier"
    assert estimates["ground_speed"][700] == pytest.approx(0.8, abs=0.1)
    assert estimates["ground_speed"][-1] == pytest.approx(2.8, abs=0.1)


def test_hub_speeds_in_a_turn() -> None:
    time = np.arange(0, 30, 0.05)
    v, yaw, track = np.full(600, 1.0), np.full(600, 0.4), 0.6
    rims = {
        w: (v - yaw * side * track / 2) / 0.2 for w, side in (("fl", 1), ("fr", -1), ("rl", 1), ("rr", -1))
    }
    columns = {"time": time, "ground_speed": v, "angular_velocity_z": yaw}
    log = tg.Recording.from_frame(columns | {f"wheel_speed_{w}": rim for w, rim in rims.items()})
    estimates = tg.estimate(log, robot(track=track), sensors={"ground_speed": 0.01, "wheel_speed": 0.01})
    for wheel in estimates.wheels:
        assert estimates[f"slip_{wheel}"][-1] == pytest.approx(0, abs=1e-3)


def test_some_torques_missing_is_an_error_not_slip() -> None:
    log = speeds_of(0.1)
    with pytest.raises(InputError, match="drive_torque_fr: is missing, but the wheel fr is driven"):
        tg.estimate(log.with_channels(drive_torque_fl=np.ones(len(log))), robot())
    with pytest.raises(InputError, match="the vehicle has no wheel fl"):
        tg.estimate(
            log,
            tg.Vehicle.from_dict(
                {
                    "mass": 9,
                    "axles": {"a": {"mass": 9, "wheels": ["x"]}},
                    "wheel": {"radius": 0.2, "inertia": 1},
                }
            ),
        )


def test_measured_car_on_a_road_does_not_slip(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/comma2k19_example")

    def load(name: str) -> np.ndarray:
        return np.load(folder / f"{name}.npy")

    time, speeds = load("processed_log__CAN__wheel_speed__t"), load("processed_log__CAN__wheel_speed__value")
    velocity = load("global_pose__frame_velocities")
    signals = {
        f"wheel_speed_{w}": Signal(time, speeds[:, k] / 0.33) for k, w in enumerate(("fl", "fr", "rl", "rr"))
    }
    signals["ground_speed"] = Signal(load("global_pose__frame_times"), np.linalg.norm(velocity, axis=1))
    log = tg.Recording.from_frame(SignalLog(tuple(signals), signals).table().columns)
    estimates = tg.estimate(log, robot(0.33))
    for wheel in estimates.wheels:
        assert np.nanmedian(estimates[f"slip_{wheel}"]) == pytest.approx(0, abs=0.01)
        # The car's speeds in m/s carry its own radius, which is about 1 % small.
        assert estimates.about["zero_slip"][wheel]["ratio"] == pytest.approx(1.01, abs=0.005)


def test_measured_rover(shared: Callable[[str], Path]) -> None:
    """By the radius of the rover's own odometry, GNSS covers 7 % more than the wheels roll (PROVENANCE)."""
    excess = 1.07
    log = shared("data/pathfinder_rover/test17run_odom_gps_10hz.csv.gz")
    wheels = ("fl", "fr", "rl", "rr")
    table = read_table(log).columns
    turning = np.mean([np.abs(table[f"w_{w}"]) for w in wheels], axis=0)
    straight = (np.abs(table["odom_wz"]) < 0.02) & (turning > 1)
    radius = float(np.median(np.abs(table["odom_vx"])[straight] / turning[straight]))
    path = {"derivative_of": ["gps_e", "gps_n"], "unit": "m", "window": "2 s"}
    speeds = {f"wheel_speed_{w}": {"from": f"w_{w}", "sign": -1 if w in ("fl", "rl") else 1} for w in wheels}
    profile = tg.Profile.from_dict({"time": {"from": "time_s"}, "channels": {**speeds, "ground_speed": path}})
    estimates = tg.estimate(profile.apply(read_table(log)), robot(radius))
    moving = estimates["event"] == ""
    covered = np.sum(estimates["ground_speed"][moving])
    rolled = np.sum(np.mean([np.abs(estimates[f"wheel_speed_{w}"][moving]) for w in wheels], axis=0)) * radius
    assert covered / rolled == pytest.approx(excess, abs=0.03)
    slips = np.concatenate([estimates[f"slip_{w}"][moving] for w in wheels])
    assert np.nanmedian(slips) == pytest.approx(1 / excess - 1, abs=0.04)
    turned = {"channels": {**{f"wheel_speed_{w}": f"w_{w}" for w in wheels}, "ground_speed": path}}
    told = tg.estimate(
        tg.Profile.from_dict({"time": {"from": "time_s"}, **turned}).apply(read_table(log)), robot(radius)
    )
    assert any("fl, rl is against the travel" in note for note in told.notes)
