"""A sensor's lag within one log is set right, whatever the blocks, and slip is then what it is without it (simulation)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas.testing
import pytest
from scipy.signal import lfilter

from development_machine import machine
from terragrip.estimation import estimate
from terragrip.estimation.noise import DELAY
from terragrip.recording import Recording, alignment, survey
from terragrip.recording.alignment import _Shift, aligned
from terragrip.recording.lag import Lag, delay_of, lag_within
from terragrip.recording.survey import LogBlocks, survey_of
from terragrip.simulation import simulate
from terragrip.vehicle import Vehicle


def late(recording: Recording, seconds: float) -> Recording:
    ground, time = recording.channels["ground_speed"], recording.time
    known = np.isfinite(ground)
    moved = np.full(len(time), np.nan)
    moved[known] = np.interp(time[known] - seconds, time[known], ground[known])
    return replace(recording, channels={**recording.channels, "ground_speed": moved})


@pytest.mark.sample(2)
@pytest.mark.parametrize("number", [14, 17])
def test_slip_of_a_log_with_a_lag_is_that_of_the_log_without(number: int) -> None:
    result = machine(number)
    moving = np.abs(result.truth["true_ground_speed"].to_numpy()) > 0.05

    def judged(recording: Recording) -> tuple[float, float]:
        """Error of slip (RMS), and share of rows held, over all wheels."""
        estimates = estimate(recording, result.vehicle)
        rows = moving & (np.asarray(estimates["event"]) != "standstill")
        errors, held = [], []
        for wheel in result.vehicle.wheels:
            error = (estimates[f"slip_{wheel}"] - result.truth[f"true_slip_{wheel}"].to_numpy())[rows]
            known = np.isfinite(error)
            errors.append(error[known])
            held.append(np.abs(error[known]) < 1.96 * estimates[f"slip_{wheel}_std"][rows][known])
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))), float(np.mean(np.concatenate(held)))

    right, wrong = result.recording, late(result.recording, 0.2)
    (mended,) = aligned([wrong])
    assert [note for note in mended.notes if "behind the wheel speeds" in note]
    assert judged(wrong)[0] > 3 * judged(right)[0]
    assert judged(wrong)[1] > 0.92  # by an interval that counts the lag, .84 before
    assert judged(mended)[0] < 1.5 * judged(right)[0]
    assert judged(mended)[1] > 0.92


@pytest.mark.parametrize("rows", [37, 2399])  # the last block of one row
@pytest.mark.parametrize("seconds", [0.3, -0.3])
@pytest.mark.parametrize("every", [1, 4])
def test_blocks_are_moved_as_the_whole_is(
    monkeypatch: pytest.MonkeyPatch, rows: int, seconds: float, every: int
) -> None:
    for module in (alignment, survey):
        monkeypatch.setattr(module, "BEGINNING", 1500)
    time = np.arange(0, 120, 0.05)
    speed = 1.2 + 0.5 * np.sin(time / 5) + 0.2 * np.sin(time * 0.9)
    log = late(
        Recording.from_frame({"time": time, "ground_speed": speed, "wheel_speed_l": 5 * speed}), seconds
    )
    log.channels["ground_speed"][np.arange(len(time)) % every > 0] = np.nan
    (whole,) = aligned([log])
    parts = list(aligned(LogBlocks.of(log, rows).blocks()))
    for name in ("ground_speed", "wheel_speed_l"):
        np.testing.assert_array_equal(np.concatenate([p[name] for p in parts]), whole[name])
    assert {part.notes for part in parts} == {whole.notes}
    known = np.isfinite(whole["ground_speed"])
    assert np.isnan(whole["ground_speed"][known.nonzero()[0][-1] + 1 :]).all()
    np.testing.assert_allclose(whole["ground_speed"][known][20:-20], speed[known][20:-20], atol=0.02)


@pytest.mark.parametrize("held", [False, True])
def test_a_moved_channel_is_on_lines_or_held_within_its_samples_and_short_gaps(held: bool) -> None:
    time, values = np.array([0.0, 0.5, 1.5, 4.0, 4.5]), np.array([1.0, 2.0, 3.0, 4.0, 6.0])
    shift = _Shift(Lag(0.3, 0.01, 1.0, (0.0, 0.0)), ("ground_speed",), longest=1.0, held=held, noise={})
    when = np.array([-0.1, 0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 4.25, 4.5])
    lines, last = (
        [np.nan, 1.0, 1.5, 2.0, 2.5, np.nan, np.nan, 5.0, np.nan],
        [np.nan, 1.0, 1.0, 2.0, 2.0, np.nan, np.nan, 4.0, np.nan],
    )
    np.testing.assert_allclose(shift._at(when, time, values), last if held else lines)


def test_a_log_without_a_lag_stays_as_it_is() -> None:
    log = machine(9).recording
    (same,) = aligned([log])
    pandas.testing.assert_frame_equal(same.to_pandas(), log.to_pandas())
    assert same.notes == log.notes


def test_soil_that_gives_way_is_no_late_sensor() -> None:
    """A simulated run without any delay, on soft soil: the ground speed follows .16 ± .05 s late, by the soil."""
    log = simulate("grass-04", seed=0).recording
    (block,) = aligned([log])
    np.testing.assert_array_equal(block.channels["ground_speed"], log.channels["ground_speed"])
    assert [n for n in block.notes if "too uncertain to correct" in n]


@pytest.mark.parametrize("every", [1, 5])
def test_a_moved_channel_keeps_the_noise_of_its_samples(every: int) -> None:
    """Halfway between two samples white noise is smaller, and looked four times smaller still: slip's interval held 90 % of rows."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 300.0, 0.1)
    speed = 1.2 + 0.5 * np.sin(time / 5) + 0.2 * np.sin(time * 0.9)
    ground = np.interp(time - 0.25, time, speed) + 0.02 * rng.standard_normal(len(time))
    ground[np.arange(len(time)) % every > 0] = np.nan
    log = Recording.from_frame({"time": time, "ground_speed": ground, "wheel_speed_l": 5 * speed})
    (moved,) = aligned([log])
    assert [n for n in moved.notes if "it was shifted by" in n]
    assert moved.noise["ground_speed"] == pytest.approx(0.02, rel=0.12)


def test_a_log_says_what_its_ground_speed_may_be_late_by() -> None:
    time = np.arange(0.0, 300.0, 0.1)
    speed = 1.2 + 0.5 * np.sin(time / 5) + 0.2 * np.sin(time * 0.9)

    def delay(seconds: float) -> float:
        columns = {"ground_speed": np.interp(time - seconds, time, speed), "wheel_speed_l": 5 * speed}
        columns["wheel_speed_l"] += 0.01 * np.sin(7 * time)
        return survey_of(LogBlocks.of(Recording.from_frame({"time": time, **columns}), 700)).sample.delay

    explained = 1.7 / (2 * 9.80665)  # of which any part may be the vehicle's own
    assert delay(0.0) == pytest.approx(explained / np.sqrt(3), rel=0.3)
    assert delay(0.3) == pytest.approx(0.3 - explained / 2, rel=0.2)


@pytest.mark.parametrize("seconds", [0.0, 0.3])
def test_a_lag_is_searched_once(seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(0.0, 300.0, 0.1)
    speed = 1.2 + 0.5 * np.sin(time / 5) + 0.2 * np.sin(time * 0.9)
    columns = {"ground_speed": np.interp(time - seconds, time, speed), "wheel_speed_l": 5 * speed}
    log = Recording.from_frame({"time": time, **columns})
    tried = []

    def counted(*arguments: Any) -> Lag | None:
        tried.append(lag_within(*arguments))
        return tried[-1]

    for module in (alignment, survey):
        monkeypatch.setattr(module, "lag_within", counted)
    (moved,) = aligned([log])
    assert any("it was shifted by" in note for note in moved.notes) == (seconds > 0)
    known = survey_of(LogBlocks.of(moved, 700)).sample.delay
    (found,) = tried
    assert known == (found.delay_left if seconds and found else delay_of(found))
    assert moved.with_channels(ground_speed=speed).delay is None


def test_starts_are_held_where_a_receiver_filters() -> None:
    """A filter of first order is late, but no mere delay: shifted by its lag, it errs where a change begins and ends."""
    rng, time, filtered = np.random.default_rng(4), np.arange(0.0, 240.0, 0.05), 0.3
    speed = np.clip(3.0 * np.sin(time / 3), 0.0, 1.5)
    ground = lfilter([1 - np.exp(-0.05 / filtered)], [1, -np.exp(-0.05 / filtered)], speed)
    columns = {
        "ground_speed": ground + 0.02 * rng.standard_normal(len(time)),
        **{f"wheel_speed_{w}": 5 * speed + 0.02 * rng.standard_normal(len(time)) for w in "lr"},
    }
    (moved,) = aligned([Recording.from_frame({"time": time, **columns})])
    assert [n for n in moved.notes if "it was shifted by" in n]
    axles = {"only": {"mass": 100, "wheels": ["l", "r"]}}
    vehicle = {"mass": 100, "axles": axles, "wheel": {"radius": 0.2, "inertia": 0.1}}
    told = estimate(moved, Vehicle.from_dict({"name": "cart", **vehicle}))
    starts = (speed > 0.1) & (speed < 1.5) & (np.gradient(speed) > 0) & (time > 30)
    off = np.abs(told["ground_speed"] - speed) / told["ground_speed_std"]
    assert np.mean(off[starts] < 1.96) > 0.9


def test_a_delay_that_is_stated_counts_before_what_the_log_tells() -> None:
    result = machine(9)
    log, data = result.recording, result.vehicle.to_dict()

    def spread(**sensors: float) -> float:
        data["sensors"] = {**result.vehicle.to_dict()["sensors"], **sensors}
        return float(np.nanmean(estimate(log, Vehicle.from_dict(data))["ground_speed_std"]))

    assert spread(ground_speed_delay=0.0) < spread() < spread(ground_speed_delay=0.3)


def test_slip_from_speeds_alone_counts_the_delay() -> None:
    result = machine(9)
    speeds = {n: v for n, v in result.recording.channels.items() if "torque" not in n}
    log = replace(result.recording, channels=speeds)
    sure, late = (estimate(log, result.vehicle, sensors={DELAY: s}) for s in (0.0, 0.3))
    wider = late["ground_speed_std"] - sure["ground_speed_std"]
    assert np.nanmax(wider) > 0.01
    assert np.nanmin(wider) >= 0.0


def test_of_a_long_log_no_more_is_read_ahead_than_shows_its_lag(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "BEGINNING", 100)
    read = []

    def blocks() -> Iterator[Recording]:
        for k in range(5):
            read.append(k)
            time = 40.0 * k + 0.1 * np.arange(400)
            yield Recording.from_frame(
                {"time": time, "ground_speed": 1 + 0.01 * time, "wheel_speed_l": 3 + 0.03 * time}
            )

    assert len(next(aligned(blocks()))) == 400
    assert read == [0]
