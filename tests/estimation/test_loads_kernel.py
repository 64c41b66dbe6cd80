"""The kernel's vertical loads against physics.loads, and a measured load that wins."""

from __future__ import annotations

import numpy as np
import pytest

from drives import drive, robot
from terragrip.estimation import Estimates, estimate
from terragrip.physics.loads import GRAVITY, axle_loads, lateral_shares
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")


def steady(seconds: float = 12.0, **channels: float) -> Recording:
    """Constant signals, no noise."""
    time = np.arange(0, seconds, 0.01)
    values = {"ground_speed": 0.6, "drawbar_force": 0.0, **channels}
    for wheel in ("fl", "fr", "rl", "rr"):
        values |= {f"wheel_speed_{wheel}": 3.2, f"drive_torque_{wheel}": 15.0}
    return Recording(time, {name: np.full(len(time), value) for name, value in values.items()})


@pytest.mark.parametrize("imu", [True, False])
def test_loads_follow_pull_acceleration_and_slope(imu):
    moved = drive(
        30.0,
        noise=0.0,
        imu=imu,
        speed=lambda t: 0.8 + 0.3 * np.sin(t / 4),
        slope=lambda t: 0.1 * np.sin(t / 9) * imu,
    )
    estimates = estimate(moved.recording, robot())
    late = estimates.time > 10
    swing = np.ptp(moved.truth["vertical_load_front"][late])
    assert swing > 40
    for axle in ("front", "rear"):
        off = np.abs(estimates[f"vertical_load_{axle}"] - moved.truth[f"vertical_load_{axle}"])[late]
        assert off.max() < 0.15 * swing


def test_the_formula_at_rest_on_a_slope_and_under_a_pull():
    """A steady state: the specific force is g sin(slope), nothing spins up."""
    slope, pull = 0.1, 200.0
    recording = steady(drawbar_force=pull, pitch=slope, acceleration_x=GRAVITY * np.sin(slope))
    estimates = estimate(recording, robot(), held={})
    wanted = axle_loads(
        (54.0, 85.0),
        (0.638, 0.0),
        center_of_gravity_height=0.30,
        hitch_height=0.25,
        drawbar=pull,
        slope=slope,
    )
    assert estimates["vertical_load_front"][-1] == pytest.approx(wanted[0], rel=1e-3)
    assert estimates["vertical_load_rear"][-1] == pytest.approx(wanted[1], rel=1e-3)


@pytest.mark.parametrize("axles", [1, 2, 3, 4])
def test_the_formula_holds_on_any_number_of_axles(axles):
    masses = np.linspace(40.0, 70.0, axles)
    names = [f"a{k}" for k in range(axles)]
    layout = {
        name: {"mass": float(m), "wheels": [f"{name}l", f"{name}r"]}
        for name, m in zip(names, masses, strict=True)
    }
    vehicle = robot(axles=layout, mass=float(masses.sum()), **({} if axles > 1 else {"wheelbase": None}))
    slope, pull = 0.1, 100.0
    wheels = {f"wheel_speed_{w}": 3.2 for w in vehicle.wheels} | {
        f"drive_torque_{w}": 15.0 for w in vehicle.wheels
    }
    given = {
        "ground_speed": 0.6,
        "drawbar_force": pull,
        "pitch": slope,
        "acceleration_x": GRAVITY * np.sin(slope),
        **wheels,
    }
    time = np.arange(0, 12, 0.01)
    found = estimate(Recording(time, {k: np.full(len(time), v) for k, v in given.items()}), vehicle, held={})
    wanted = axle_loads(
        vehicle.axle_mass,
        vehicle.axle_to_rear,
        center_of_gravity_height=0.30,
        hitch_height=0.25,
        drawbar=pull,
        slope=slope,
    )
    got = [found[f"vertical_load_{name}"][-1] for name in names]
    np.testing.assert_allclose(got, wanted, rtol=1e-3)


def test_a_measured_load_wins_and_the_other_axle_takes_the_rest():
    estimates = estimate(steady(vertical_load_front=400.0), robot(), held={})
    assert estimates["vertical_load_front"][-1] == 400.0
    assert estimates["vertical_load_rear"][-1] == pytest.approx(139 * GRAVITY - 400.0, rel=1e-9)


def test_both_measured_loads_are_taken():
    estimates = estimate(steady(vertical_load_front=400.0, vertical_load_rear=1000.0), robot(), held={})
    assert estimates["vertical_load_rear"][-1] == 1000.0


def test_lateral_acceleration_moves_load_to_the_outer_wheels():
    """Through the adhesion: the same torque over another load. Of a side's wheels together; of diagonals half is told (0144)."""
    sideways = 2.0
    estimates = estimate(steady(acceleration_y=sideways), robot(), held={})
    straight = estimate(steady(), robot(), held={})
    left, right = lateral_shares(2, sideways, center_of_gravity_height=0.30, track=0.554)
    front, rear = (straight[f"vertical_load_{axle}"][-1] for axle in ("front", "rear"))

    def gross(table: Estimates, side: str) -> float:
        adhesion = front * table[f"adhesion_f{side}"][-1] + rear * table[f"adhesion_r{side}"][-1]
        return float(adhesion / (front + rear) + 0.02)

    plain = gross(straight, "l")
    assert gross(estimates, "l") == pytest.approx(plain * 0.5 / left, rel=0.02)
    assert gross(estimates, "r") == pytest.approx(plain * 0.5 / right, rel=0.02)


def test_roll_stands_in_for_a_missing_accelerometer():
    by_roll = estimate(steady(roll=0.2), robot(), held={})
    by_force = estimate(
        steady(acceleration_y=GRAVITY * np.sin(0.2), angular_velocity_z=0.0), robot(), held={}
    )
    assert by_roll["adhesion_rl"][-1] == pytest.approx(by_force["adhesion_rl"][-1], rel=1e-6)


@pytest.mark.parametrize("shown", ["roll", "acceleration_y"])
def test_across_a_slope_the_axles_carry_the_weight_times_the_cosine(shown):
    """A hillside mower at 25 degrees: 9 % less."""
    lean = np.radians(25)
    more = (
        {"roll": lean}
        if shown == "roll"
        else {"acceleration_y": GRAVITY * np.sin(lean), "angular_velocity_z": 0.0}
    )
    found = estimate(steady(**more), robot(), held={})
    carried = found["vertical_load_front"][-1] + found["vertical_load_rear"][-1]
    assert carried == pytest.approx(139 * GRAVITY * np.cos(lean), rel=1e-3)


def test_a_roll_between_whose_samples_are_other_rows_leans_all_of_them():
    """Ten rows a sample: between them no load went to the lower side."""
    log = steady(roll=0.2)
    slow = log.with_channels(roll=np.where(np.arange(len(log)) % 10 == 0, log["roll"], np.nan))
    found, whole = (estimate(each, robot(), held={})["adhesion_rl"][-5] for each in (slow, log))
    assert found == pytest.approx(whole, rel=1e-3)


def test_a_wheel_never_floats():
    """A pull that would lift the front: the adhesion stays a number."""
    estimates = estimate(steady(drawbar_force=2000.0), robot(), held={})
    assert estimates["vertical_load_front"][-1] < 100
    assert np.isfinite(estimates["adhesion_fl"]).all()


def test_a_turn_stands_in_for_a_missing_accelerometer():
    """v psi' to the inner side, and with it what a roll adds."""
    turning = {"angular_velocity_z": 0.3, "roll": 0.1}
    by_turn = estimate(steady(**turning), robot(), held={})
    sideways = by_turn["ground_speed"][-1] * 0.3 + GRAVITY * np.sin(0.1)
    by_force = estimate(steady(acceleration_y=sideways, angular_velocity_z=0.3), robot(), held={})
    assert by_turn["adhesion_rl"][-1] == pytest.approx(by_force["adhesion_rl"][-1], rel=1e-4)


def test_on_hills_without_a_roll_the_side_slope_may_be_as_steep():
    """The share of its gross traction that a wheel's load of one SD more or less makes; on level ground, and with a roll, none."""
    slope = 0.1
    hilly = {"pitch": slope, "acceleration_x": GRAVITY * np.sin(slope)}
    blind, seeing = (estimate(steady(**hilly, **more), robot(), held={}) for more in ({}, {"roll": 0.0}))
    level = [estimate(steady(pitch=0.0, **more), robot(), held={}) for more in ({}, {"roll": 0.0})]
    left, _ = lateral_shares(2, GRAVITY * slope, center_of_gravity_height=0.30, track=0.554)
    added = np.sqrt(blind["adhesion_rl_std"][-1] ** 2 - seeing["adhesion_rl_std"][-1] ** 2)
    assert added == pytest.approx((seeing["adhesion_rl"][-1] + 0.02) * abs(1 - 2 * left), rel=0.05)
    for whole in ("soil_resistance_std", "curve_a_std"):  # what one side has more, the other has less
        assert blind[whole][-1] == pytest.approx(seeing[whole][-1], rel=1e-6)
    np.testing.assert_allclose(level[0]["adhesion_rl_std"], level[1]["adhesion_rl_std"], rtol=1e-9)


def test_a_slope_that_nothing_measures_moves_load_off_the_front():
    """By as much as it weighs on the lever of the centre of gravity; an accelerometer reads it, and loads follow that."""
    slope = 0.03
    off = {"center_of_gravity_height": 0.30, "hitch_height": 0.25}
    level, tilted = (axle_loads((54.0, 85.0), (0.638, 0.0), **off, slope=k) for k in (0.0, slope))
    for more in ({}, {"acceleration_x": 0.0}):
        sure, blind = (
            estimate(steady(roll=0.0, **more), robot(uncertainty={"slope": sd}), held={})
            for sd in (0.0, slope)
        )
        for k, wheel in enumerate(("fl", "rl")):
            added = blind[f"adhesion_{wheel}_std"][-1] ** 2 - sure[f"adhesion_{wheel}_std"][-1] ** 2
            share = 0.0 if more else abs(tilted[k] / level[k] - 1) * (sure[f"adhesion_{wheel}"][-1] + 0.02)
            assert np.sqrt(max(added, 0.0)) == pytest.approx(share, rel=0.1, abs=1e-3)


def test_a_torque_that_two_wheels_share_is_theirs_but_for_the_differential():
    """Each wheel's adhesion is less sure, and what both do together is not."""
    noise = np.random.default_rng(3).normal(0, 0.2, (1200, 2))
    log = steady()

    def seen(right: int) -> Estimates:
        torque = {f"drive_torque_r{side}": 15.0 + noise[:, k] for side, k in (("l", 0), ("r", right))}
        return estimate(log.with_channels(**torque), robot(), held={})

    shared, own = seen(0), seen(1)
    added = np.sqrt(shared["adhesion_rl_std"][-1] ** 2 - own["adhesion_rl_std"][-1] ** 2)
    assert added == pytest.approx(0.05 * (own["adhesion_rl"][-1] + 0.02), rel=0.2)
    assert shared["soil_resistance_std"][-1] == pytest.approx(own["soil_resistance_std"][-1], rel=0.05)


def test_an_accelerometer_that_falls_silent_holds_no_load_back_for_longer_than_a_second():
    """It speeds up by 1 m/s² until .2 s after the accelerometer's last value, then drives steadily: 65 N come back to the front."""
    moved = drive(12.0, rate=50.0, imu=True, speed=lambda t: 0.3 + np.clip(t - 9, 0, 0.8))
    log, time = moved.recording, moved.recording.time
    silent = np.where(time < 9.6, log["acceleration_x"], np.nan)
    estimates = estimate(log.with_channels(acceleration_x=silent), robot())
    off = np.abs(estimates["vertical_load_front"] - moved.truth["vertical_load_front"])
    assert off[(time > 10.9) & (time < 11.5)].max() < 30


def test_a_roll_that_falls_silent_leans_nothing_after_a_gap():
    """It was held for ever: a robot that had leaned by 23 degrees once weighed 8 % less for the rest of the drive."""
    log = steady()
    leaned = log.with_channels(roll=np.where(np.arange(len(log)) < 20, 0.4, np.nan))
    found, level = (estimate(each, robot(), held={}) for each in (leaned, log))
    assert log.time[-1] - log.time[19] > 5
    assert found["vertical_load_rear"][-1] == pytest.approx(level["vertical_load_rear"][-1], rel=0.01)
    assert found["adhesion_rl"][-1] == pytest.approx(level["adhesion_rl"][-1], rel=0.02)
