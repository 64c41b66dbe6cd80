"""A friction brake: its torque is in no channel, a switch or pedal says when it acts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from drives import WHEELS, Drive, drive, robot
from terragrip.errors import InputError
from terragrip.estimation.methods import METHODS
from terragrip.physics.loads import GRAVITY
from terragrip.recording.slowing import slowing_warnings
from test_engine_samples import tractor, work

PERIOD, BRAKING = 7.0, 6.0  # s: a stretch, and when in it the brake acts
GAIN, LOSS = 0.6, 3.6  # m/s²


def speed(t: Any) -> Any:
    """From .6 m/s up to 4.2 in 6 s, and down again in one."""
    phase = t % PERIOD
    return np.where(phase < BRAKING, 0.6 + GAIN * phase, 4.2 - LOSS * (phase - BRAKING))


def brakes(t: Any) -> Any:
    return (t % PERIOD) >= BRAKING


def slip(t: Any) -> Any:
    """That of a steady pull of .05 of the weight: adhesion is -.24 while it brakes."""
    mu = 0.08 + 0.05 + np.where(brakes(t), -LOSS, GAIN) / GRAVITY
    return -np.log(1 - 2 * mu) / 10


def braked_log(seconds: float = 40.0, *, switch_rate: float = 10.0, imu: bool = True, **more: Any) -> Drive:
    """A drive whose motors give no torque below 0: the brake does, on every wheel."""
    made = drive(seconds, speed=speed, slip=slip, imu=imu, **more)
    time, channels = made.recording.time, dict(made.recording.channels)
    rng = np.random.default_rng(9)
    for wheel in WHEELS:
        torque = channels[f"drive_torque_{wheel}"]
        channels[f"drive_torque_{wheel}"] = np.where(brakes(time), rng.standard_normal(len(time)), torque)
    sent = (np.arange(len(time)) + 7) % round(100 / switch_rate) == 0
    channels["brake"] = np.where(sent, brakes(time), np.nan)
    return replace(made, recording=tg.Recording(time, channels))


def held(estimates: Any, truth: Any, name: str, rows: Any) -> float:
    error = np.abs(estimates[name] - truth[name])
    return float(np.mean((error < 2 * estimates[f"{name}_std"])[rows]))


def settled(time: Any) -> Any:
    """Braked rows from .2 s after the brake's first to the last."""
    return brakes(time) & (time % PERIOD > BRAKING + 0.2)


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", [m for m in METHODS if m != "algebraic"])
@pytest.mark.parametrize("imu", [True, False])
def test_while_a_brake_acts_intervals_hold(method: str, imu: bool) -> None:
    """Adhesion was .1 too high by an SD of .01, soil resistance as much."""
    made = braked_log(imu=imu)
    time = made.recording.time
    estimates = tg.estimate(made.recording, robot(), method)
    rows = settled(time)
    for name in ("adhesion_fl", "adhesion_rr", "soil_resistance", "slip_fl"):
        assert held(estimates, made.truth, name, rows) > 0.85, name
    before = ~brakes(time) & (time % PERIOD > 1.0) & (time > PERIOD)
    assert np.median(estimates["adhesion_fl_std"][before]) < 0.05
    assert held(estimates, made.truth, "adhesion_fl", before) > 0.9
    assert np.median(estimates["adhesion_fl_std"][rows]) > 0.2


def test_smoothed_rows_before_a_slow_switch_tells_of_the_brake_are_unsure() -> None:
    """The rows behind knew it: adhesion was held in none of them, soil resistance in 7 %."""
    made = braked_log(60.0, switch_rate=4.0)
    time = made.recording.time
    estimates = tg.estimate(made.recording, robot(), smooth=True)
    first = brakes(time) & (time > PERIOD) & (time % PERIOD < BRAKING + 0.1)
    for name in ("adhesion_fl", "adhesion_rr", "soil_resistance"):
        assert held(estimates, made.truth, name, first) > 0.85, name
    before = ~brakes(time) & (time % PERIOD > 1.0) & (time % PERIOD < BRAKING - 0.3) & (time > PERIOD)
    assert np.median(estimates["adhesion_fl_std"][before]) < 0.05


@pytest.mark.parametrize("zero", [-1000.0, 1000.0])
def test_where_time_begins_changes_nothing_in_a_log_that_begins_braked(zero: float) -> None:
    """From 0 on, and below, its first smoothed rows had an SD of soil resistance of .49 instead of .01."""
    log = braked_log(20.0, switch_rate=4.0).recording
    log = log.select(log.time > PERIOD - 0.7)
    one, other = (
        tg.estimate(replace(log, time=log.time - log.time[0] + at), robot(), smooth=True)
        for at in (0.0, zero)
    )
    for name in ("adhesion_fl_std", "soil_resistance_std"):
        np.testing.assert_allclose(other[name], one[name], rtol=1e-6, equal_nan=True)


def test_the_mean_adhesion_of_all_wheels_follows_the_motion() -> None:
    made = braked_log(switch_rate=100.0)
    estimates = tg.estimate(made.recording, robot())
    rows = settled(made.recording.time)
    mean = np.mean([estimates[f"adhesion_{w}"] for w in WHEELS], axis=0)
    assert np.sqrt(np.mean((mean - made.truth["adhesion_fl"])[rows] ** 2)) < 0.04


def test_a_brake_that_is_never_pressed_changes_no_digit() -> None:
    made = drive(10.0)
    released = made.recording.with_channels(brake=np.where(np.arange(1000) % 7, np.nan, 0.04))
    one, other = tg.estimate(made.recording, robot()), tg.estimate(released, robot())
    for name in one.columns:
        np.testing.assert_array_equal(one[name], other[name])


def test_sample_by_sample_and_restored_amid_braking_it_is_the_same() -> None:
    log = braked_log().recording.select(slice(0, 900))
    whole = tg.estimate(log, robot(), held={})
    estimator = tg.TractionEstimator(robot(), channels=tuple(log.channels), held={})
    for k, time in enumerate(log.time):
        if k == 700:
            estimator = tg.TractionEstimator.restore(estimator.snapshot())
        row = {name: float(values[k]) for name, values in log.channels.items()}
        out = estimator.update({"time": float(time), **row})
    assert out.adhesion_fl == pytest.approx(whole["adhesion_fl"][-1], rel=1e-12)
    assert out.adhesion_fl_std == pytest.approx(whole["adhesion_fl_std"][-1], rel=1e-12)


def test_by_engine_torque_braked_rows_are_unsure_too() -> None:
    log = work()
    acts = (log.time > 8.95) & (log.time < 10.05)
    known = tg.estimate(log, tractor())
    unsure = tg.estimate(log.with_channels(brake=acts.astype(float)), tractor())
    rows = np.flatnonzero(acts)[3:]
    assert (unsure["adhesion_driven_std"][rows] > 2.5 * known["adhesion_driven_std"][rows]).all()
    assert unsure["adhesion_driven_std"][-1] < 1.5 * known["adhesion_driven_std"][-1]


@pytest.mark.parametrize(
    ("values", "fix"),
    [([0, 1, 3], r"write 'invalid: \[2, 3\]'"), ([0.0, 3.1, 8.0], "of a pressure 'scale: 0.12'")],
)
def test_what_is_no_share_is_refused(values: list[float], fix: str) -> None:
    """A pressure in bar would be pressed by its noise, and so would a bus's 'not available'."""
    log = drive(3.0).recording
    brake = np.resize(np.asarray(values, dtype=float), len(log))
    with pytest.raises(InputError, match=rf"column brake: reaches [38], and is a share: .*{fix}"):
        tg.estimate(log.with_channels(brake=brake), robot())


def test_a_note_says_how_much_of_the_log_is_braked() -> None:
    made = braked_log(switch_rate=100.0)
    notes = tg.estimate(made.recording, robot()).notes
    assert sum("A brake acts in 12 % of the log" in note for note in notes) == 1
    assert not any("A brake" in note for note in tg.estimate(drive(5.0).recording, robot()).notes)


def test_checks_and_calibration_leave_braked_rows_out() -> None:
    """In stops the torques seemed too small for the mass, and calibrate scaled them to .8."""
    made = braked_log(160.0, switch_rate=100.0)
    with_brake = made.recording
    without = replace(with_brake, channels={n: v for n, v in with_brake.channels.items() if n != "brake"})
    flat = "In starts and stops the drive torques"
    assert any(flat in note for note in tg.estimate(without, robot()).notes)
    assert not any(flat in note for note in tg.estimate(with_brake, robot()).notes)
    scales = [q for q in tg.calibrate(with_brake, robot()).quantities if q.name == "drive_torque_scale"]
    assert all(scale.interval[1] > 1 for scale in scales)
    pressed = with_brake.with_channels(brake=np.ones(len(with_brake)))
    with pytest.raises(InputError, match="column brake: is pressed throughout; 0 is released"):
        tg.calibrate(pressed, robot())


@pytest.mark.parametrize("rate", [100.0, 10.0])
def test_a_brake_that_no_channel_tells_of_is_named(rate: float) -> None:
    log = braked_log(60.0, switch_rate=rate, rate=rate).recording
    unsaid = tg.Recording(log.time, {n: v for n, v in log.channels.items() if n != "brake"})
    (note,) = slowing_warnings(unsaid, robot())
    assert "In 8 stretches the vehicle slows down by 0.1" in note
    assert "Give its switch, pedal or pressure as the channel 'brake'." in note
    assert not slowing_warnings(log, robot())


def test_motors_that_brake_and_hills_are_no_friction_brake() -> None:
    """A climb slows the vehicle down without thrust, too: an accelerometer reads nothing of it."""
    by_motor = drive(60.0, speed=speed, slip=slip, imu=True).recording
    uphill = drive(
        60.0, speed=speed, slip=lambda t: np.where(brakes(t), 0.0, slip(t)), slope=lambda t: 0.37 * brakes(t), imu=True
    ).recording  # fmt: skip
    assert not slowing_warnings(by_motor, robot())
    assert not slowing_warnings(uphill, robot())
