"""The set-point of slip: what it leads to, how fast, and what it does when it cannot trust what it is told."""

import numpy as np
import pytest

from advice_drives import VEHICLE
from terragrip.advice.setpoint import FOLLOW, SLOW, STOP, Limits, SlipSetpoint
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator

RADIUS, STEP = 0.7, 0.02


def row(time, slip=0.05, speed=2.0, event="", std=0.01, nis=5.0):
    columns = {"time": time, "event": event, "ground_speed": speed, "nis": nis, "channels": 5.0}
    for wheel in VEHICLE.wheels:
        columns |= {f"slip_{wheel}": slip, f"slip_{wheel}_std": std}
    return columns


def rims(setpoint, rows):
    return np.array([setpoint.update(one)["fl"] * RADIUS for one in rows])


def running(**changes):
    """A set-point of 10 % slip at 2 m/s that has come to speed, and the next instant."""
    setpoint = SlipSetpoint(VEHICLE, 0.1, 2.0)
    rims(setpoint, [row(k * STEP) for k in range(600)])
    return setpoint, 600 * STEP


def test_with_less_slip_it_goes_as_fast_as_wanted_and_no_faster():
    setpoint = SlipSetpoint(VEHICLE, 0.1, 2.0)
    rim = rims(setpoint, [row(k * STEP) for k in range(600)])
    assert rim[-1] == pytest.approx(2.0 / 0.9)
    assert (rim <= 2.0 / 0.9 + 1e-12).all()
    assert setpoint.state == FOLLOW


def test_the_rim_changes_no_faster_than_its_limits_whatever_happens():
    setpoint, t = running()
    rng = np.random.default_rng(0)
    events = ["", "gap", "outlier", "immobilization", "standstill", ""]
    rows = [
        row(t + k * STEP, slip=rng.uniform(-0.2, 0.9), speed=rng.uniform(0, 4), event=rng.choice(events), std=rng.choice([0.01, 0.3]))
        for k in range(3000)
    ]  # fmt: skip
    rim = rims(setpoint, rows)
    change = np.diff(rim) / STEP
    limits = Limits()
    assert np.isfinite(rim).all()
    assert change.max() <= limits.speed_up + 1e-9
    assert change.min() >= -limits.slow_down - 1e-9


def test_too_much_slip_leads_the_rim_to_the_ground_speed_at_the_set_slip():
    setpoint, t = running()
    rim = rims(setpoint, [row(t + k * STEP, slip=0.3, speed=1.4) for k in range(200)])
    assert rim[-1] == pytest.approx(1.4 / 0.9)
    assert 1 - 1.4 / rim[-1] == pytest.approx(0.1)


@pytest.mark.parametrize(
    "bad",
    [
        {"event": "gap", "slip": np.nan, "speed": np.nan},
        {"event": "outlier"},
        {"nis": 500.0},
        {"std": 0.2},
        {"slip": np.nan},
        {"event": "immobilization", "slip": 0.4},
        {"event": "push"},
    ],
)
def test_what_is_not_trusted_never_raises_the_speed_and_ends_in_a_crawl(bad):
    setpoint, t = running()
    rim = rims(setpoint, [row(t + k * STEP, **bad) for k in range(400)])
    assert (np.diff(rim) <= 1e-12).all()
    assert rim[-1] == pytest.approx(0.4 * 2.0)
    assert setpoint.state == SLOW
    assert setpoint.why


def test_a_lapse_of_a_moment_is_bridged():
    setpoint, t = running()
    rim = rims(setpoint, [row(t + k * STEP, event="outlier") for k in range(10)])
    assert rim == pytest.approx(np.full(10, 2.0 / 0.9))


def test_stuck_stops_the_wheels_until_it_is_resumed():
    setpoint, t = running()
    rows = [row(t + k * STEP, event="stuck", slip=0.95, speed=0.02) for k in range(300)]
    assert rims(setpoint, rows)[-1] == 0.0
    later = t + 300 * STEP
    assert rims(setpoint, [row(later + k * STEP) for k in range(300)]).max() == 0.0
    assert setpoint.state == STOP
    setpoint.resume()
    assert rims(setpoint, [row(later + 6 + k * STEP) for k in range(300)])[-1] > 0.5


def test_from_a_standstill_it_starts_at_a_crawl():
    setpoint = SlipSetpoint(VEHICLE, 0.1, 2.0)
    rim = rims(setpoint, [row(k * STEP, event="standstill", slip=np.nan, speed=0.0) for k in range(400)])
    assert rim[0] == 0.0
    assert rim[-1] == pytest.approx(0.8)


def test_time_that_jumps_or_runs_backward_makes_no_jump_of_speed():
    setpoint, t = running()
    before = setpoint.update(row(t))["fl"]
    after = setpoint.update(row(t + 60.0, slip=0.5, speed=0.1))["fl"]
    assert abs(after - before) * RADIUS <= Limits().slow_down * Limits().longest_step + 1e-9
    assert setpoint.update(row(t - 100.0))["fl"] == pytest.approx(after)


@pytest.mark.parametrize(("period", "state"), [(0.5, FOLLOW), (1.0, FOLLOW), (2.0, FOLLOW), (3.0, SLOW)])
def test_estimates_of_a_slow_bus_are_followed_and_a_hole_in_them_is_not(period, state):
    setpoint, rng = SlipSetpoint(VEHICLE, 0.1, 2.0), np.random.default_rng(0)
    times = np.arange(40) * period + rng.uniform(-0.1, 0, 40) * (period < 2)
    rims(setpoint, [row(time) for time in times])
    assert setpoint.state == state
    setpoint.update(row(times[-1] + 2.5 * period))
    assert (setpoint.state, setpoint.why) == (SLOW, "a gap in time")


def test_it_takes_what_the_estimator_gives():
    estimator, setpoint = TractionEstimator(VEHICLE), SlipSetpoint(VEHICLE, 0.1, 1.0)
    for k in range(200):
        sample = {"time": 0.02 * k, "ground_speed": 0.5, "drawbar_force": 1000.0}
        for wheel in VEHICLE.wheels:
            sample |= {f"wheel_speed_{wheel}": 0.75, f"drive_torque_{wheel}": 400.0}
        speeds = setpoint.update(estimator.update(sample))
    assert set(speeds) == set(VEHICLE.wheels)
    assert 0 < speeds["fl"] <= 1.0 / 0.9 / RADIUS


@pytest.mark.parametrize(
    ("slip", "speed"), [(0.0, 1.0), (0.9, 1.0), (float("nan"), 1.0), (0.1, -1.0), (0.1, float("inf"))]
)
def test_impossible_set_points_are_refused(slip, speed):
    with pytest.raises(InputError):
        SlipSetpoint(VEHICLE, slip, speed)
