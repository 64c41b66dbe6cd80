"""The backward pass: better than the filter, never surer than it should be, whatever the blocks."""

from __future__ import annotations

import numpy as np
import pytest

from drives import drive, robot
from terragrip.errors import InputError
from terragrip.estimation import Estimates, TractionEstimator, estimate
from terragrip.estimation.methods import method_named
from terragrip.estimation.smoothing import smoothed
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

SMOOTHABLE = ("kalman", "ukf", "aukf", "aukf-fs", "bank")
QUANTITIES = ("adhesion_rr", "slip_fl", "soil_resistance", "ground_speed")


def with_a_gap(recording: Recording) -> Recording:
    return Recording(np.where(recording.time < 10, recording.time, recording.time + 4), recording.channels)


@pytest.mark.parametrize("method", SMOOTHABLE)
def test_smoothing_is_better_than_filtering(method):
    noisy = drive(30.0, slip=lambda t: 0.1 + 0.06 * np.sin(t))
    filtered = estimate(noisy.recording, robot(), method)
    smoothed = estimate(noisy.recording, robot(), method, smooth=True)
    inner = (filtered.time > 2) & (filtered.time < 28)
    for name in QUANTITIES:
        rms = [np.sqrt(np.mean((e[name] - noisy.truth[name])[inner] ** 2)) for e in (filtered, smoothed)]
        assert rms[1] < rms[0], (name, rms)
        assert (smoothed[f"{name}_std"] > 0).all()
    assert np.median(smoothed["adhesion_rr_std"] / filtered["adhesion_rr_std"]) < 1
    assert smoothed.about["smooth"]


def test_intervals_of_the_smoother_hold_the_truth():
    noisy = drive(40.0, seed=5)
    smoothed = estimate(noisy.recording, robot(), "kalman", smooth=True)
    for name in ("adhesion_rr", "slip_rr", "soil_resistance"):
        inside = np.abs(smoothed[name] - noisy.truth[name]) < 1.96 * smoothed[f"{name}_std"]
        assert inside.mean() > 0.9, name


def smoothed_in(recording: Recording, estimator: TractionEstimator, rows: int, step: int = 8192) -> Estimates:
    """The smoothed estimates of a recording by an estimator, in blocks of so many rows, put together."""
    blocks = (recording.select(slice(k, k + rows)) for k in range(0, len(recording), rows))
    parts = list(smoothed(estimator, blocks, tuple, step=step))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0].columns}
    codes = np.concatenate([part.event_codes for part in parts])
    labels = {name: np.concatenate([part[name] for part in parts]) for name in parts[0].labels}
    return Estimates(np.concatenate([part.time for part in parts]), columns, codes, labels)


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", ["bank", "kalman", "aukf-fs"])
def test_the_block_length_does_not_matter(method):
    """Rows 999 and 1000 lie on either side of the gap."""
    recording = with_a_gap(drive(20.0, imu=True).recording)
    recording.labels["soil"] = np.where(recording.time < 12, "fine", "").astype(object)
    results = [
        smoothed_in(recording, TractionEstimator.for_recording(recording, robot(), method), rows, step)
        for rows, step in ((2000, 8192), (2000, 97), (1000, 300), (123, 50))
    ]
    for other in results[1:]:
        assert np.array_equal(results[0].time, other.time)
        assert np.array_equal(results[0].event_codes, other.event_codes)
        assert results[0]["soil"].tolist() == other["soil"].tolist() == recording["soil"].tolist()
        for name in results[0].columns:
            assert np.array_equal(results[0][name], other[name], equal_nan=True), name


def test_the_last_row_is_the_filters():
    recording = drive(5.0).recording
    filtered, smoothed = (estimate(recording, robot(), "kalman", smooth=s) for s in (False, True))
    for name in QUANTITIES:
        assert smoothed[name][-1] == pytest.approx(filtered[name][-1], rel=1e-9)
    assert np.array_equal(smoothed["nis"], filtered["nis"])
    assert np.array_equal(smoothed.event_codes, filtered.event_codes)


def test_the_estimator_stands_at_the_end():
    recording = drive(5.0).recording
    one, other = (TractionEstimator.for_recording(recording, robot()) for _ in range(2))
    smoothed_in(recording, one, 100)
    other.update_block(recording)
    assert one.snapshot() == other.snapshot()


def test_nothing_is_smoothed_over_a_gap_in_the_motion():
    """What follows a gap tells nothing of the speeds before it, but of the ground it does."""
    recording = with_a_gap(drive(20.0).recording)
    smoothed = estimate(recording, robot(), "kalman", smooth=True)
    assert np.isfinite(smoothed["slip_rr"]).all()
    assert set(smoothed["event"]) == {"", "gap"}


def test_algebraic_cannot_smooth():
    assert method_named("algebraic").name == "algebraic"
    with pytest.raises(InputError, match="the method algebraic cannot smooth; use another"):
        method_named("algebraic", smooth=True)
    with pytest.raises(InputError, match="cannot smooth"):
        estimate(drive(3.0).recording, robot(), "algebraic", smooth=True)


def test_rows_done_are_told_forwards_and_backwards():
    log, ahead, back = drive(1.0).recording, [], []
    sizes = [40, 40, len(log) - 80]
    blocks = (log.select(slice(k, k + 40)) for k in range(0, len(log), 40))
    estimator = TractionEstimator.for_recording(log, robot())
    parts = list(smoothed(estimator, blocks, tuple, forward=ahead.append, backward=back.append))
    assert [len(part) for part in parts] == sizes
    assert ahead == np.cumsum(sizes).tolist()
    assert back == np.cumsum(sizes[::-1]).tolist()
