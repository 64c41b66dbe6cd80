"""What the families' benchmarks compute, against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

pytest.importorskip("mujoco", reason="the benchmarks import the second plant: install terragrip[dev]")

from bench_families import lag, pooled_r2
from bench_warning import Course, judge, poisson, wilson
from family_intervals import interval_score
from plain_filter import INTENSITIES, plain_filter
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def test_the_interval_score_is_width_and_forty_times_what_lies_outside():
    assert interval_score(np.zeros(3), np.full(3, 0.5)) == pytest.approx(2 * 1.959964 * 0.5)
    assert interval_score(np.array([3.0]), np.array([1.0])) == pytest.approx(
        2 * 1.959964 + 40 * (3 - 1.959964)
    )


def test_bounds_are_wilsons_and_poissons():
    for hits, count in ((0, 20), (3, 40), (40, 40)):
        interval = binomtest(hits, count).proportion_ci(method="wilson")
        assert wilson(hits, count) == pytest.approx((interval.low, interval.high), abs=1e-4)
    assert poisson(0) == pytest.approx((0.0, 3.689), abs=1e-3)  # Garwood 1936
    assert poisson(10) == pytest.approx((4.795, 18.390), abs=1e-3)


def test_lag_and_r2_of_a_shifted_signal():
    signal = np.cumsum(np.random.default_rng(1).standard_normal((400, 2)), axis=0)
    rows = np.ones(400, dtype=bool)
    assert lag(signal, np.roll(signal, 3, axis=0), rows) == 3
    assert lag(signal, np.roll(signal, -2, axis=0), rows) == -2
    assert pooled_r2(signal, signal, rows) == 1.0
    assert pooled_r2(signal, np.full_like(signal, signal.mean()), rows) == pytest.approx(0.0)


def test_warnings_are_judged_by_edge_and_stop():
    time = np.arange(0.0, 30.0, 0.1)
    course = Course(edge=10.0, stop=20.0, end=30.0, time=time, travel=0.5 * time, length=2.0, speed=0.5)
    text = judge(course, [4.0, 17.0], [20.4])
    assert (text.stops, text.leads, text.late, text.false, text.seconds) == (1, [3.0], 0, 1, 10.0)
    assert text.lengths == [pytest.approx(0.75)]
    missed = judge(course, [20.1], [21.0])
    assert (missed.stops, missed.leads, missed.late, missed.false) == (1, [], 1, 0)
    healthy = judge(Course(np.inf, np.nan, 30.0, time, 0.5 * time, 2.0, 0.5), [5.0], [])
    assert (healthy.stops, healthy.false, healthy.seconds) == (0, 1, 30.0)


def test_the_plain_filter_finds_the_constants_of_a_steady_drive():
    """One wheel pulls steadily: mu = M/(r Fz) - rho_t - rho_w w/Fz, rho_s = mu - F/(m g)."""
    mass, radius, torque, pull, omega = 50.0, 0.2, 20.0, 40.0, 3.0
    vehicle = Vehicle.from_dict(
        {
            "mass": mass,
            "axles": {"only": {"mass": mass, "wheels": ["w"]}},
            "wheel": {"radius": radius, "inertia": 0.1},
            "tire_rolling_resistance": 0.02,
            "bearing_resistance": 1.5,
            "sensors": {"wheel_speed": 0.02, "ground_speed": 0.02, "drive_torque": 0.5, "drawbar_force": 2.0},
        }
    )
    n = 2000
    columns = {"wheel_speed_w": omega, "ground_speed": 0.55, "drive_torque_w": torque, "drawbar_force": pull}
    time = np.arange(n) / 50.0
    result = plain_filter(
        Recording(time, {name: np.full(n, value) for name, value in columns.items()}), vehicle
    )
    weight = mass * 9.80665
    mu = torque / (radius * weight) - 0.02 - 1.5 * omega / weight
    for q in range(1, len(INTENSITIES)):
        assert result.state[q, -1, 2] == pytest.approx(mu, abs=1e-4)
        assert result.state[q, -1, 3] == pytest.approx(mu - pull / weight, abs=2e-3)
