"""One sample at a time and the whole recording, against exact drives and against each other."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from drives import WHEELS, drive, robot
from terragrip.errors import InputError
from terragrip.estimation import METHODS, TractionEstimator, estimate
from terragrip.estimation.forward import run
from terragrip.recording import Recording

NUMBERS = ("adhesion_rr", "slip_fl", "soil_resistance", "net_traction_rl", "ground_speed", "efficiency_fr")


@pytest.fixture(scope="module")
def noisy():
    return drive(12.0, imu=True)


@pytest.mark.parametrize("method", METHODS)
def test_an_exact_drive_is_recovered(method):
    exact = drive(20.0, noise=0.0)
    estimates = estimate(exact.recording, robot(), method)
    late = estimates.time > 8
    for name in NUMBERS:
        error = np.abs(estimates[name] - exact.truth[name])[late]
        assert error.max() < 0.012, (name, error.max())


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", [*METHODS][::-1])
def test_noise_is_averaged_and_within_the_intervals(method):
    noisy = drive(30.0)
    estimates = estimate(noisy.recording, robot(), method)
    late = estimates.time > 5
    for name in ("adhesion_rr", "slip_rr", "soil_resistance"):
        error = np.abs(estimates[name] - noisy.truth[name])[late]
        assert error.mean() < 0.02, name
        if method != "algebraic":
            assert np.mean(error < 1.96 * estimates[f"{name}_std"][late]) > 0.9, name


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", [*METHODS][::-1])
def test_sample_by_sample_is_the_whole_recording_bit_for_bit(noisy, method):
    whole = estimate(noisy.recording, robot(), method)
    estimator = TractionEstimator.for_recording(noisy.recording, robot(), method)
    rows = [estimator.update(row) for row in noisy.recording.to_pandas().to_dict("records")]
    for name in estimator.columns:
        assert np.array_equal([row[name] for row in rows], whole[name], equal_nan=True), name
    assert [row.event for row in rows] == list(whole["event"])


def test_blocks_do_not_matter(noisy):
    whole = estimate(noisy.recording, robot())
    estimator = TractionEstimator.for_recording(noisy.recording, robot())
    cuts = [0, 1, 2, 500, 501, len(noisy.recording)]
    parts = [estimator.update_block(noisy.recording.select(slice(a, b))) for a, b in pairwise(cuts)]
    for name in whole.columns:
        assert np.array_equal(np.concatenate([part[name] for part in parts]), whole[name], equal_nan=True), (
            name
        )


def test_rows_go_to_the_kernel_in_many_calls_as_in_one(noisy, monkeypatch):
    """A log of more rows than a call takes, and a row that is refused in a later call."""
    whole, done = estimate(noisy.recording, robot()), []
    monkeypatch.setattr("terragrip.estimation.engine._BLOCK", 500)
    parts = run(
        TractionEstimator.for_recording(noisy.recording, robot()), noisy.recording, progress=done.append
    )
    rows = len(noisy.recording)
    assert done == [*range(500, rows, 500), rows]
    assert np.array_equal(parts.event_codes, whole.event_codes)
    for name in whole.columns:
        assert np.array_equal(parts[name], whole[name], equal_nan=True), name
    broken = noisy.recording["ground_speed"].copy()
    broken[900] = np.inf
    log, estimator = (
        noisy.recording.with_channels(ground_speed=broken),
        TractionEstimator.for_recording(noisy.recording, robot()),
    )
    with pytest.raises(InputError, match=r"row 901.*leave a value that was not measured empty"):
        run(estimator, log)


def test_a_sample_may_lack_channels_or_hold_none(noisy):
    rows = noisy.recording.to_pandas().to_dict("records")[:50]
    with_nan, without, with_none = (TractionEstimator(robot()) for _ in range(3))
    for k, row in enumerate(rows):
        if k % 3:
            row = {**row, "ground_speed": math.nan}
        left_out = {name: value for name, value in row.items() if value == value}
        none = {name: None if value != value else value for name, value in row.items()}
        a, b, c = with_nan.update(row), without.update(left_out), with_none.update({**none, "colour": "red"})
    assert a.to_dict() == b.to_dict() == c.to_dict()


def test_an_estimate_is_read_by_name(noisy):
    first = TractionEstimator(robot()).update(noisy.recording.to_pandas().iloc[0].to_dict())
    assert first.slip_fl == first["slip_fl"]
    assert set(first.to_dict()) == {"time", "event", *TractionEstimator(robot()).columns}
    with pytest.raises(AttributeError, match="slip_xx"):
        _ = first.slip_xx
    with pytest.raises(KeyError):
        _ = first["slip_xx"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"time": 0.5}, "does not increase"),
        ({"time": 0.4}, "does not increase"),
        ({"time": math.nan}, "time is nan"),
        ({"time": None}, "time is None"),
        ({"ground_speed": math.inf}, "ground_speed is inf"),
        ({"drive_torque_fl": -math.inf}, "drive_torque_fl is -inf"),
        ({"wheel_speed_fl": math.nan, "ground_speed": math.inf}, "ground_speed is inf"),  # NaN: not measured
        ({"ground_speed": "fast"}, "ground_speed is 'fast'"),
        ({"wheel_sped_fl": 2.0}, "knows no wheel_sped_fl; did you mean wheel_speed_fl"),
        ({"wheel_speed_fl2": 2.0}, "knows no wheel_speed_fl2; did you mean wheel_speed_fl"),
        ({"DriveTorque_RR": 2.0}, "did you mean drive_torque_rr"),
    ],
)
def test_an_unusable_sample_is_refused_and_changes_nothing(noisy, change, says):
    rows = noisy.recording.to_pandas().to_dict("records")
    untouched, tried = TractionEstimator(robot()), TractionEstimator(robot())
    for row in rows[:51]:
        untouched.update(row)
        tried.update(row)
    with pytest.raises(InputError, match=says) as refused:
        tried.update({**rows[51], **change})
    if " is " in says:
        hint = "every sample needs a time in s" if "time" in change else "give SI numbers"
        assert hint in str(refused.value)
    assert tried.update(rows[51]).to_dict() == untouched.update(rows[51]).to_dict()


def test_what_cannot_be_is_named():
    with pytest.raises(InputError, match="did you mean kalman"):
        TractionEstimator(robot(), "kalmann")
    with pytest.raises(InputError, match="did you mean wheel_speed"):
        TractionEstimator(robot(), sensors={"wheelspeed": 0.1})
    with pytest.raises(InputError, match="positive standard deviation"):
        TractionEstimator(robot(), sensors={"ground_speed": 0.0})


def test_a_named_noise_wins_over_the_vehicle_file(noisy):
    trusting = estimate(noisy.recording, robot(), sensors={"ground_speed": 0.005})
    plain = estimate(noisy.recording, robot())
    assert np.median(trusting["ground_speed_std"]) < np.median(plain["ground_speed_std"])


def test_a_row_of_itertuples_is_refused_with_the_way_to_a_dict(noisy):
    """A traceback: "'Pandas' object has no attribute 'keys'"."""
    row = next(noisy.recording.to_pandas().itertuples(index=False))
    estimator = TractionEstimator(robot())
    with pytest.raises(InputError, match=r"Pandas is no sample; give a dict .* row\._asdict\(\)"):
        estimator.update(row)
    estimator.update(row._asdict())


def test_noise_set_before_the_first_sample_is_that_of_a_new_estimator(noisy):
    changed, new = TractionEstimator(robot()), TractionEstimator(robot(), sensors={"ground_speed": 0.005})
    changed.set_noise({"ground_speed": 0.005}, {})
    for row in noisy.recording.to_pandas().to_dict("records")[:5]:
        assert changed.update(row).to_dict() == new.update(row).to_dict()
    with pytest.raises(InputError, match="must be positive"):
        changed.set_noise({}, {"ground_speed": -1.0})


def test_noise_the_file_does_not_name_comes_from_the_log(noisy):
    estimator = TractionEstimator.for_recording(noisy.recording, robot(sensors={"drive_torque": 1.0}))
    assert estimator.noise["ground_speed"] == pytest.approx(0.02, rel=0.2)
    assert estimator.noise["wheel_speed_fl"] == pytest.approx(0.03, rel=0.2)
    assert estimator.noise["drive_torque_fl"] == 1.0


def test_a_guessed_noise_is_said():
    exact = drive(5.0, noise=0.0)
    constant = exact.recording.with_channels(ground_speed=np.full(len(exact.recording), 0.6))
    estimates = estimate(constant, robot(sensors={}))
    assert any("ground_speed" in note and "guess" in note for note in estimates.notes)


def test_calibration_is_applied_before_anything_else(noisy):
    skewed = dict(noisy.recording.channels)
    skewed["drive_torque_rr"] = 1.1 * skewed["drive_torque_rr"] + 2.0
    skewed["drawbar_force"] = skewed["drawbar_force"] + 20.0
    skewed["acceleration_x"] = skewed["acceleration_x"] + 0.3
    skewed["pitch"] = skewed["pitch"] - 0.02
    vehicle = robot(
        calibration={
            "drive_torque_gain": {"rr": 1.1},
            "drive_torque_offset": {"rr": 2.0},
            "drawbar_offset": 20.0,
            "acceleration_bias_x": 0.3,
            "pitch_offset": -0.02,
        }
    )
    whole = estimate(noisy.recording, robot())
    corrected = estimate(Recording(noisy.recording.time, skewed), vehicle)
    for name in ("adhesion_rr", "soil_resistance"):
        np.testing.assert_allclose(corrected[name], whole[name], rtol=1e-8)


@pytest.mark.parametrize("wheels", [("only",), ("left", "right"), tuple(f"w{k}" for k in range(6))])
def test_one_axle_and_many(wheels):
    """A mono-axle, a skid steer and a machine of three axles."""
    axles = {"all": {"mass": MASS_OF, "wheels": list(wheels)}}
    if len(wheels) == 6:
        axles = {f"a{k}": {"mass": MASS_OF / 3, "wheels": list(wheels[2 * k : 2 * k + 2])} for k in range(3)}
    vehicle = robot(axles=axles)
    exact = drive(15.0, noise=0.0)
    channels = {
        "ground_speed": exact.recording["ground_speed"],
        "drawbar_force": exact.recording["drawbar_force"],
    }
    torque = sum(exact.recording[f"drive_torque_{w}"] for w in WHEELS)
    inertia_share = (
        0.15 * (4 - len(wheels)) * np.gradient(exact.recording["wheel_speed_fl"], exact.recording.time)
    )
    bearing_share = 0.2 * 2.0 * (4 - len(wheels)) * exact.recording["wheel_speed_fl"]
    for wheel in wheels:
        channels[f"wheel_speed_{wheel}"] = exact.recording["wheel_speed_fl"]
        channels[f"drive_torque_{wheel}"] = (torque - inertia_share - bearing_share) / len(wheels)
    estimates = estimate(Recording(exact.recording.time, channels), vehicle)
    mean = sum(estimates[f"adhesion_{w}"] * 1 for w in wheels) / len(wheels)
    late = estimates.time > 8
    if len(wheels) != 6:  # with three axles the loads differ, and with them each wheel's adhesion
        assert np.abs(mean - exact.truth["adhesion_fl"])[late].max() < 0.015
    assert np.abs(estimates["soil_resistance"] - 0.08)[late].max() < 0.015


MASS_OF = 139.0
