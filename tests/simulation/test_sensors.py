"""Every property of a sensor, seen in what it reads."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.simulation import simulate

STEADY = {"speed": [[0, 0], [1, 0.6]], "duration": 40}


def sensed(quiet, **sensors):
    return simulate(quiet(**STEADY, sensors={"wheel_speed": {"rate": 100}, **sensors}), seed=11)


def samples(result, name):
    """Instants and values of a channel, settled motion only."""
    values = result.recording[name]
    keep = np.isfinite(values) & (result.recording.time > 8)
    return result.recording.time[keep], values[keep]


def test_an_exact_sensor_reads_the_truth(quiet):
    result = simulate(quiet(**STEADY))
    for name, truth in (
        ("ground_speed", "true_ground_speed"), ("drawbar_force", "true_drawbar_force"),
        ("wheel_speed_rr", "true_wheel_speed_rr"), ("drive_torque_fl", "true_drive_torque_fl"),
    ):  # fmt: skip
        np.testing.assert_allclose(result.recording[name], result.truth[truth], atol=1e-9)


def test_a_torque_by_the_motor_holds_the_drives_friction(quiet):
    plain, own = simulate(quiet(**STEADY)), quiet(**STEADY)
    geared = own.model_copy(update={"vehicle": own.vehicle | {"drive_friction": 1.5}})
    more = simulate(geared).recording["drive_torque_fl"] - plain.recording["drive_torque_fl"]
    np.testing.assert_allclose(more[plain.recording.time > 8], 1.5, atol=1e-9)


def test_noise_offset_gain(quiet):
    result = sensed(quiet, ground_speed={"rate": 100, "noise": 0.02, "offset": 0.1, "gain": 1.05})
    _, values = samples(result, "ground_speed")
    true = result.truth.true_ground_speed.iloc[-1]
    error = values - 1.05 * true - 0.1
    assert abs(error.mean()) < 4 * 0.02 / np.sqrt(len(error))
    assert error.std() == pytest.approx(0.02, rel=0.06)
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 0.06


def test_spread_of_gains_is_drawn_per_wheel_and_told(quiet):
    gains = []
    for seed in range(40):
        scenario = quiet(
            duration=1.5, sensors={"wheel_speed": {"rate": 10}, "drive_torque": {"rate": 10, "gain_sd": 0.02}}
        )
        result = simulate(scenario, seed=seed)
        calibration = result.true_parameters["calibration"]["drive_torque_gain"]
        wheel = [
            result.recording[f"drive_torque_{w}"][-1] / result.truth[f"true_drive_torque_{w}"].iloc[-1]
            for w in calibration
        ]
        np.testing.assert_allclose(wheel, list(calibration.values()), rtol=1e-9)
        gains.append(wheel)
    assert np.std(gains) == pytest.approx(0.02, rel=0.2)
    assert np.abs(np.corrcoef(np.array(gains).T) - np.eye(4)).max() < 0.5


def test_rates_make_a_union_of_instants(quiet):
    result = sensed(quiet, ground_speed={"rate": 25}, drawbar_force={"rate": 40})
    time = result.recording.time
    assert np.all(np.diff(time) > 0)
    for name, rate in (("ground_speed", 25), ("drawbar_force", 40), ("wheel_speed_fl", 100)):
        at = time[np.isfinite(result.recording[name])]
        np.testing.assert_allclose(np.diff(at), 1 / rate, atol=1e-6)
    np.testing.assert_array_equal(result.truth.time, time)


def test_delay_shows_the_past_and_a_declared_delay_is_taken_off(quiet):
    ramp = {"speed": [[0, 0], [1, 0], [21, 1.0]], "duration": 18, "tools": []}
    for declared, lag in ((0.0, 0.2), (0.2, 0.0), (0.15, 0.05)):
        sensors = {
            "wheel_speed": {"rate": 100},
            "ground_speed": {"rate": 20, "delay": 0.2, "declared_delay": declared},
        }
        result = simulate(quiet(**ramp, sensors=sensors))
        time, values = samples(result, "ground_speed")
        np.testing.assert_allclose(
            values, np.interp(time - lag, result.truth.time, result.truth.true_ground_speed), atol=2e-4
        )


def test_resolution(quiet):
    _, values = samples(
        sensed(quiet, ground_speed={"rate": 50, "noise": 0.02, "resolution": 0.05}), "ground_speed"
    )
    np.testing.assert_allclose(values / 0.05, np.round(values / 0.05), atol=1e-9)
    assert len(np.unique(np.round(values, 6))) > 1


def test_dropouts_take_their_share_in_spells(quiet):
    scenario = {"rate": 100, "dropout": 0.2, "dropout_length": 0.1}
    lost = []
    for seed in range(6):
        result = simulate(
            quiet(**STEADY, sensors={"wheel_speed": {"rate": 100}, "ground_speed": scenario}), seed=seed
        )
        lost.append(np.isnan(result.recording["ground_speed"]))
    lost = np.array(lost)
    assert lost.mean() == pytest.approx(0.2, abs=0.04)
    starts = (np.diff(lost.astype(int), axis=1) == 1).sum()
    assert lost.sum() / starts == pytest.approx(10, rel=0.2)


def test_drift_is_slow_and_of_its_size(quiet):
    drifts = []
    for seed in range(30):
        sensor = {"rate": 10, "drift": 0.1, "drift_time": 4.0}
        result = simulate(
            quiet(
                **STEADY | {"duration": 20},
                log_rate=50,
                sensors={"wheel_speed": {"rate": 10}, "ground_speed": sensor},
            ),
            seed=seed,
        )
        drifts.append(result.recording["ground_speed"] - result.truth.true_ground_speed)
    drifts = np.array(drifts)
    assert drifts.std() == pytest.approx(0.1, rel=0.15)
    lag = (drifts[:, 20:] * drifts[:, :-20]).mean() / drifts.var()
    assert lag == pytest.approx(np.exp(-2.0 / 4.0), abs=0.12)


def test_bandwidth_delays_a_step_as_a_first_order_lag(quiet):
    scenario = quiet(speed=[[0, 0], [1, 0], [11, 1.0]], duration=9, tools=[],
                     sensors={"wheel_speed": {"rate": 100, "bandwidth": 0.5}})  # fmt: skip
    result = simulate(scenario)
    late = result.truth.true_wheel_speed_fl.iloc[-1] - result.recording["wheel_speed_fl"][-1]
    assert late == pytest.approx(
        0.5 / (2 * np.pi * 0.5), rel=0.02
    )  # ramp of 0.5 rad/s² times the time constant


def test_accelerometer_and_pitch_on_a_slope_at_rest_and_in_motion(quiet):
    slope = 0.05
    route = {"segments": [{"soil": "even", "length": 60}], "slope": {"mean": slope}}
    result = simulate(quiet(route=route, tools=[], speed=[[0, "off"], [4, 0], [6, 0.8]], duration=14))
    rest = (result.recording.time > 2) & (result.recording.time < 3.9)
    squat = result.recording["pitch"][rest].mean() - slope
    assert abs(squat) < 0.01
    assert result.recording["acceleration_x"][rest].mean() == pytest.approx(
        9.80665 * np.sin(slope + squat), rel=1e-3
    )
    assert result.recording["acceleration_z"][rest].mean() == pytest.approx(
        9.80665 * np.cos(slope + squat), rel=1e-3
    )
    # physics.md 1: a_x = sum(mu F_z)/m - rho g cos, to within the body's squat
    truth, last = result.truth.iloc[-1], -1
    push = (
        sum(truth[f"true_adhesion_{w}"] * truth[f"true_vertical_load_{w}"] for w in ("fl", "fr", "rl", "rr"))
        / 139
    )
    expected = push - 0.12 * 9.80665 * np.cos(slope) + 9.80665 * (result.recording["pitch"][last] - slope)
    assert result.recording["acceleration_x"][last] == pytest.approx(expected, abs=1e-3)


def test_gyro_in_a_turn_matches_the_wheels_hub_speeds(quiet):
    route = {"path": [[0, 0], [6, 0], [6, 12]], "around": "even", "turn_radius": 3}
    result = simulate(quiet(route=route, tools=[], duration=14))
    turn = result.recording["angular_velocity_z"]
    assert turn.max() == pytest.approx(result.truth.true_ground_speed[turn.argmax()] / 3, rel=1e-6)
    k = int(np.median(np.flatnonzero(turn > 0.1)))  # the controllers hold all wheels at one speed again
    slip = result.truth.iloc[k]
    rim = 0.2 * result.recording["wheel_speed_rl"][k]
    hub = result.recording["ground_speed"][k] - 0.277 * turn[k]
    assert slip.true_slip_rl == pytest.approx(1 - hub / rim, abs=1e-6)
    assert slip.true_slip_rl > slip.true_slip_rr + 0.1


def test_wheel_force_is_the_papers_axle_force(quiet):
    """F_h - F_s - m_w dv/dt over the load without the wheel's weight (paper eq. 1)."""
    result = simulate(quiet(speed=[[0, 0], [1, 0.0], [5, 1.0]], duration=4.5))
    truth, k = result.truth.iloc[-1], -1
    load = truth.true_vertical_load_rr
    rolling = truth.true_soil_resistance_rear * load
    expected = truth.true_adhesion_rr * load - rolling - 5.4 * truth.true_acceleration
    assert result.recording["wheel_force_x_rr"][k] == pytest.approx(expected, abs=0.5)
    assert result.recording["wheel_force_z_rr"][k] == pytest.approx(load - 5.4 * 9.80665, abs=0.5)
    assert "wheel_force_x_fl" not in result.recording


def test_a_sensor_more_or_less_leaves_the_others_as_they_are(quiet):
    few = sensed(quiet, ground_speed={"rate": 50, "noise": 0.02})
    more = sensed(
        quiet,
        ground_speed={"rate": 50, "noise": 0.02},
        pitch={"rate": 100, "noise": 0.01},
        drawbar_force={"rate": 20},
    )
    np.testing.assert_array_equal(few.recording["ground_speed"], more.recording["ground_speed"])
