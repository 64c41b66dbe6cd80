"""Columns `curve_a`, `curve_a_<wheel>`: the adhesion curve that the estimator carries along."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.physics.adhesion import CURVES

pytestmark = pytest.mark.usefixtures("unchecked")

WHEELS = ("fl", "fr", "rl", "rr")
COLUMNS = [f"curve_a{end}{std}" for end in ("", *(f"_{w}" for w in WHEELS)) for std in ("", "_std")]


def g(slip):
    return CURVES["exponential"].value(slip, {"a": 1.0})


@pytest.fixture(scope="module")
def drive():
    """One soil, seed 3000 (no threshold was chosen on it)."""
    return tg.simulate("fine-03", seed=3000)


@pytest.fixture(scope="module")
def estimates(drive):
    return tg.estimate(drive.recording, drive.vehicle)


def test_the_columns_are_there_and_numbers(estimates):
    for name in COLUMNS:
        assert np.isfinite(estimates[name]).all(), name
    assert (estimates["curve_a_std"] > 0).all()


def test_the_interval_starts_wide_and_narrows(estimates):
    assert estimates["curve_a"][0] == 0.85
    assert estimates["curve_a_std"][0] == 0.5
    assert np.median(estimates["curve_a_std"][len(estimates) // 2 :]) < 0.2


def truth_of(drive, wheel):
    slip, adhesion = (drive.truth[f"true_{q}_{wheel}"].to_numpy() for q in ("slip", "adhesion"))
    h = np.where((slip > 0.05) & (slip < 0.6), g(slip), 0.0)
    return float(h @ np.nan_to_num(adhesion) / (h @ h))


def test_a_comes_near_the_truth_within_its_interval(drive, estimates):
    late = (estimates["event"] == "") & (estimates.time > 8)
    for wheel in WHEELS:
        off = estimates[f"curve_a_{wheel}"][late] - truth_of(drive, wheel)
        assert np.mean(np.abs(off) < 1.96 * estimates[f"curve_a_{wheel}_std"][late]) > 0.85
        assert abs(np.mean(off)) < 0.12


def test_one_sample_at_a_time_gives_the_same_bits(drive, estimates):
    part = drive.recording.select(np.arange(len(drive.recording)) < 1500)
    estimator = tg.TractionEstimator.for_recording(part, drive.vehicle)
    whole = tg.estimate(part, drive.vehicle)
    result = [estimator.update(row) for row in part.to_pandas().to_dict("records")]
    for name in COLUMNS:
        single = np.array([row[name] for row in result])
        if name == "curve_a":
            assert np.ptp(single) > 0.01
        np.testing.assert_array_equal(single, whole[name])


def test_a_snapshot_carries_the_curve(drive):
    rows = drive.recording.to_pandas().head(1500).to_dict("records")
    one = tg.TractionEstimator(drive.vehicle)
    for row in rows[:1000]:
        one.update(row)
    other = tg.TractionEstimator.restore(one.snapshot())
    for row in rows[1000:]:
        mine, theirs = one.update(row), other.update(row)
        assert [mine[name] for name in COLUMNS] == [theirs[name] for name in COLUMNS]


def test_nothing_is_learned_at_standstill_and_in_a_gap(drive):
    estimates = tg.estimate(drive.recording, drive.vehicle)
    idle = np.isin(estimates["event"], ["standstill", "gap"])
    idle[0] = False
    later = np.flatnonzero(idle)
    assert later.size > 50  # the run begins with 3 s at rest
    for name in ("curve_a", "curve_a_rr"):
        np.testing.assert_array_equal(estimates[name][later], estimates[name][later - 1])


def test_smoothing_leaves_the_curve_as_it_was_then(drive, estimates):
    smooth = tg.estimate(drive.recording, drive.vehicle, smooth=True)
    np.testing.assert_array_equal(smooth["curve_a"], estimates["curve_a"])


def test_the_vehicle_lies_between_its_wheels(estimates):
    late = (estimates["event"] == "") & (estimates.time > 8)
    wheels = np.array([estimates[f"curve_a_{w}"][late] for w in WHEELS])
    inside = (estimates["curve_a"][late] > wheels.min(axis=0) - 0.05) & (
        estimates["curve_a"][late] < wheels.max(axis=0) + 0.05
    )
    assert inside.mean() > 0.95


@pytest.mark.parametrize("method", ["algebraic", "bank", "aukf-fs"])
def test_every_method_carries_it(drive, method):
    part = drive.recording.select(np.arange(len(drive.recording)) < 1200)
    estimated = tg.estimate(part, drive.vehicle, method)
    assert np.isfinite(estimated["curve_a"]).all()
    assert estimated["curve_a_std"][-1] < 0.4


def test_a_new_ground_by_hand_forgets(drive):
    estimator = tg.TractionEstimator(drive.vehicle)
    rows = drive.recording.to_pandas().head(1200).to_dict("records")
    for row in rows[:-1]:
        known = estimator.update(row)
    estimator.new_ground()
    assert estimator.update(rows[-1])["curve_a_std"] > 1.5 * known["curve_a_std"]
