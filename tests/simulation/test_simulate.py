"""A whole simulation: the truth's own consistency, seeds, files, the campaign, and the paper's stuck spell."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from terragrip.physics.slip import slip
from terragrip.simulation import Scenario, simulate, simulate_campaign
from terragrip.simulation.campaign import run_seed
from terragrip.simulation.truth import stuck
from terragrip.vehicle import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
G = 9.80665


@pytest.fixture(scope="module")
def clean():
    return simulate("accuracy-clean", seed=1001)


@pytest.fixture(scope="module")
def multi2():
    return simulate("multi2", run_seed(0, "multi2"), machine_seed=0)


def test_truth_obeys_the_papers_equation_of_motion(clean, multi2):
    """Eq. 3 with the slope and the operator's push, row by row, stuck or not."""
    for result in (clean, multi2):
        t = result.truth
        pull = sum(t[f"true_adhesion_{w}"] * t[f"true_vertical_load_{w}"] for w in WHEELS)
        resistance = t.true_soil_resistance * 139 * G * np.cos(t.true_slope)
        force = (
            pull - t.true_drawbar_force - resistance - 139 * G * np.sin(t.true_slope) + t.true_assist_force
        )
        on_a_row = np.abs(t.time * 200 - np.rint(t.time * 200)) < 1e-6
        forward = t.true_ground_speed > 0.03
        residual = (139 * t.true_acceleration - force)[on_a_row & forward]
        assert len(residual) > 10000
        assert np.abs(residual).max() < 1e-6


def test_truth_obeys_the_wheels_equation(clean):
    """Eq. 2 from the truth's own columns, wheel acceleration by differences."""
    t = clean.truth
    for w in WHEELS:
        load, omega = t[f"true_vertical_load_{w}"], t[f"true_wheel_speed_{w}"]
        rate = np.gradient(omega, t.time)
        torque = 0.15 * rate + 0.2 * ((t[f"true_adhesion_{w}"] + 0.02) * load + 2.0 * omega)
        moving = t.time > 5
        error = (torque - t[f"true_drive_torque_{w}"])[moving]
        assert error.abs().median() < 0.01
        assert (
            np.sqrt((error**2).mean()) < 0.2
        )  # on clods, differences over 20 ms miss some of the acceleration


def test_slip_and_ratios_follow_their_definitions(clean):
    t = clean.truth
    for w in WHEELS:
        expected = slip(t[f"true_wheel_speed_{w}"], t.true_ground_speed, 0.2, standstill_speed=0.03)
        np.testing.assert_allclose(t[f"true_slip_{w}"], expected, atol=1e-12)
        np.testing.assert_allclose(
            t[f"true_net_traction_{w}"], t[f"true_adhesion_{w}"] - t.true_soil_resistance, atol=1e-12
        )
    rest = t.time < 2.9
    assert t.standstill[rest].all()
    assert t.true_slip_rr[rest].isna().all()
    assert t.true_slip_rr[t.time > 5].notna().all()
    assert t.true_slip_rr.max() <= 1.0


def test_adhesion_lies_on_the_soils_curve(clean):
    """Away from borders the scatter about each soil's curve is the soil's own variation."""
    t = clean.truth[(clean.truth.time > 5) & ~clean.truth.transition & ~clean.truth.stuck]
    for soil, part in t.groupby("soil"):
        spec = clean.scenario.soils[soil]
        a, s = spec.curve["a"], part.true_slip_rr
        ratio = part.true_adhesion_rr / (a * (1 - 0.52 * np.exp(0.01 * s) - 0.48 * np.exp(-11.36 * s)))
        assert ratio.mean() == pytest.approx(1.0, abs=2 * spec.adhesion_variation)
        assert ratio.std() < 2 * spec.adhesion_variation


def test_recording_and_truth_share_their_rows(clean):
    np.testing.assert_array_equal(clean.recording.time, clean.truth.time)
    assert set(clean.recording.wheels) == set(WHEELS)
    assert list(clean.recording.labels["soil"]) == list(clean.truth.soil)
    error = clean.recording["ground_speed"] - clean.truth.true_ground_speed
    assert error.std() == pytest.approx(0.02, rel=0.03)


def test_accuracy_drive_moves_nearly_always_and_visits_every_soil(clean, drive):
    t = clean.truth
    assert set(t.soil) == {"hard", "fine", "wet", "coarse", "grass"}
    assert t.true_drawbar_force.quantile(0.99) > 350
    assert t.time.iloc[-1] == 240
    shares = [stuck(drive(clean.scenario, seed, stride=20)).mean() for seed in range(1000, 1012)]
    assert np.mean(shares) < 0.03
    assert np.median(shares) == 0


def test_faults_scenario_is_the_same_drive(clean):
    other = simulate("accuracy-faults", seed=1001)
    assert other.true_parameters["calibration"] == clean.true_parameters["calibration"]
    common, k, m = np.intersect1d(clean.truth.time, other.truth.time, return_indices=True)
    assert len(common) > 20000
    for name in ("true_adhesion_rr", "true_slip_fl", "true_soil_resistance", "true_drawbar_force"):
        np.testing.assert_allclose(clean.truth[name].iloc[k], other.truth[name].iloc[m], atol=1e-9)
    speed = other.recording["ground_speed"]
    lost = other.recording.time[np.isfinite(speed)]
    assert np.diff(lost).max() == pytest.approx(8.0, abs=0.2)


def test_calibration_block_undoes_the_machines_errors(clean):
    calibration = clean.true_parameters["calibration"]
    for w in WHEELS:
        raw = clean.recording[f"drive_torque_{w}"]
        corrected = (raw - calibration["drive_torque_offset"][w]) / calibration["drive_torque_gain"][w]
        error = corrected - clean.truth[f"true_drive_torque_{w}"]
        assert abs(error.mean()) < 0.03
        assert abs(np.polyfit(clean.truth[f"true_drive_torque_{w}"], error, 1)[0]) < 0.003
    offset = clean.recording["drawbar_force"] - clean.truth.true_drawbar_force
    assert offset.mean() == pytest.approx(calibration["drawbar_offset"], abs=0.15)
    Vehicle.from_dict({**clean.vehicle.to_dict(), "calibration": calibration})


def test_seeds():
    scenario = Scenario.load("fine-09")
    one, same, other = (simulate(scenario, seed) for seed in (5, 5, 6))
    for name in one.recording.channels:
        np.testing.assert_array_equal(one.recording[name], same.recording[name])
        assert not np.array_equal(one.recording[name], other.recording[name], equal_nan=True)
    pd.testing.assert_frame_equal(one.truth, same.truth)
    machine = simulate(scenario, 6, machine_seed=5)
    assert machine.true_parameters == one.true_parameters != other.true_parameters
    pd.testing.assert_series_equal(machine.truth.soil_front, other.truth.soil_front)


def test_nominal_vehicle_knows_no_errors():
    result = simulate("fine-09", 5)
    assert result.vehicle == Vehicle.from_dict(Scenario.load("fine-09").vehicle)
    assert result.true_parameters["wheel_radius"]["rr"] != 0.2
    assert result.vehicle.wheel_radius[3] == 0.2


def test_runs_begin_with_a_torque_and_drawbar_zero():
    result = simulate("coarse-10", 3, machine_seed=4)
    rest = (result.recording.time < 2.8) & np.isfinite(result.recording["drive_torque_rr"])
    assert result.truth.motors_off[rest].all()
    torque = result.recording["drive_torque_rr"][rest]
    assert torque.mean() == pytest.approx(
        result.true_parameters["offset"]["drive_torque_rr"], abs=4 / np.sqrt(rest.sum())
    )
    assert result.truth.true_drawbar_force[rest].abs().max() == 0


def test_save_and_read_back(tmp_path):
    result = simulate("grass-03", 1)
    result.save(tmp_path / "run")
    frame = pd.read_parquet(tmp_path / "run" / "recording.parquet")
    np.testing.assert_array_equal(frame["wheel_speed_fl"], result.recording["wheel_speed_fl"])
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "run" / "truth.parquet"), result.truth)
    assert Vehicle.load(tmp_path / "run" / "vehicle.yaml") == result.vehicle
    assert json.loads((tmp_path / "run" / "true_parameters.json").read_text()) == result.true_parameters
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == [
        "recording.parquet", "true_parameters.json", "truth.parquet", "vehicle.yaml",
    ]  # fmt: skip


def test_campaign_runs_are_the_same_alone_and_among_others():
    names, notes = ["hard-02", "grass-05", "wet-01"], []
    among = dict(simulate_campaign(names, seed=9, workers=2, progress=lambda *a: notes.append(a)))
    assert list(among) == names
    assert notes == [(1, 3, "hard-02"), (2, 3, "grass-05"), (3, 3, "wet-01")]
    ((_, alone),) = simulate_campaign(["grass-05"], seed=9, workers=1)
    pd.testing.assert_frame_equal(among["grass-05"].truth, alone.truth)
    assert among["hard-02"].true_parameters == alone.true_parameters


def test_multi2_gets_stuck_on_coarse_and_its_tools_push(multi2):
    """The paper's outlier: 245-255 s, torque high, the wheel sensor small or negative, tool run up; then it goes on."""
    t, r = multi2.truth, multi2.recording
    spell = t.time.between(245.5, 250)
    assert t.stuck[spell].all()
    assert (t.soil[spell] == "coarse").all()
    assert not t.stuck[t.time.between(258, 282)].any()
    assert t.true_drawbar_force[t.time.between(244.5, 247)].min() < -50
    assert t.push[t.time.between(244.5, 247)].any()
    sensor = r["wheel_force_x_rr"][spell.to_numpy()]
    assert np.nanmean(sensor) < 20
    assert t.true_adhesion_rr[spell].mean() > 0.25
    later = t.stuck & ~t.time.between(243, 258)
    assert (later & t.time.between(280, 312)).any()
    assert (later & t.time.between(445, 460)).any()
    assert t.true_distance.iloc[-1] > 180
