"""What is learned row by row is what the functions for whole logs tell of the same rows."""

from __future__ import annotations

import json

import numpy as np
import pytest

from drives import drive, robot
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.learning import ROWS, SECONDS, Learned, SettingsLearner
from terragrip.estimation.noise import settings_in
from terragrip.recording import Recording

UNKNOWN = {"drawbar_force": 4.0, "pitch": 0.002}


@pytest.fixture(scope="module")
def log() -> Recording:
    """65 s at 100 Hz, whose ground speed comes five times a second."""
    recording = drive(65.0, noise=2.0, seed=3).recording
    held = np.repeat(recording["ground_speed"][::20], 20)[: len(recording)]
    return recording.with_channels(ground_speed=held)


def learned_by(learner: SettingsLearner, log: Recording, begin: int = 0) -> dict[int, Learned]:
    """What was reported, by the row that came in."""
    columns = {name: values.tolist() for name, values in log.channels.items()}
    out = {}
    for row in range(begin, len(log)):
        learned = learner.add(float(log.time[row]), {name: values[row] for name, values in columns.items()})
        if learned is not None:
            out[row] = learned
    return out


def test_chunks_of_ten_seconds_are_learned_from_as_a_log_is(log: Recording) -> None:
    vehicle = robot(sensors=UNKNOWN)
    out = learned_by(SettingsLearner(vehicle, tuple(log.channels), {}, {}), log)
    chunk = int(SECONDS * 100)
    # after 1, 2, 3, 4 and 5 chunks; with five, every second one is kept: 0, 2 and 4
    assert list(out) == [chunk * k for k in (1, 2, 3, 4, 5)]
    for row, learned in out.items():
        kept = np.arange(row) if row < 5 * chunk else np.flatnonzero(np.arange(row) // chunk % 2 == 0)
        part = log.select(kept)
        noise, held = settings_in(Recording(part.time, part.channels), vehicle)
        assert learned.noise == noise
        assert learned.held == held
        assert "ground_speed" in learned.held
        assert learned.seconds == pytest.approx(len(np.unique(kept // chunk)) * (SECONDS - 0.01))


def test_a_chunk_of_many_rows_ends_early(log: Recording) -> None:
    learner = SettingsLearner(robot(sensors=UNKNOWN), ("ground_speed",), {}, {})
    rng = np.random.default_rng(0)
    ends = [k for k in range(2 * ROWS + 2) if learner.add(1e-4 * k, {"ground_speed": 1 + 0.1 * rng.normal()})]
    assert ends == [ROWS, 2 * ROWS]


def test_what_is_given_is_not_learned_and_a_channel_that_never_came_is_absent(log: Recording) -> None:
    learner = SettingsLearner(
        robot(sensors=UNKNOWN), (*log.channels, "roll"), {"wheel_speed": 0.5}, {"ground_speed": 0.4}
    )
    learned = learned_by(learner, log.select(slice(0, 1100)))[1000]
    assert learned.held["ground_speed"] == 0.4
    assert not any(name.startswith("wheel_speed") and sd != 0.5 for name, sd in learned.noise.items())
    assert "roll" not in learned.noise


def test_only_noise_that_differs_by_a_tenth_is_worth_a_word() -> None:
    vehicle = robot(sensors=UNKNOWN)
    known = {"ground_speed": 0.02, "wheel_speed": 0.05}
    estimator = TractionEstimator(vehicle, sensors=known, held={"wheel_speed_fl": 0.2})
    learned = Learned(
        {"ground_speed": 0.0215, "wheel_speed_fl": 0.03}, {"wheel_speed_fl": 0.21, "ground_speed": 0.1}, 60.0
    )
    assert learned.changes(estimator) == [
        "noise of wheel_speed_fl 0.03 (was 0.05)",
        "ground_speed is held, one value in 0.1 s",
    ]


def test_it_goes_on_from_its_state_to_the_last_digit(log: Recording) -> None:
    vehicle, channels = robot(sensors=UNKNOWN), tuple(log.channels)
    whole = learned_by(SettingsLearner(vehicle, channels, {}, {}), log)
    for row in (1, 999, 1000, 1001, 5300):
        first, second = (SettingsLearner(vehicle, channels, {}, {}) for _ in range(2))
        before = learned_by(first, log.select(slice(0, row)))
        second.restore(json.loads(json.dumps(first.state())))
        assert before | learned_by(second, log, row) == whole


@pytest.mark.parametrize(
    ("factor", "said", "row"),
    [(1.0, "", 0), (3.6, "ground_speed may be in km/h", 2000), (0.1047, "in rpm", 3000)],
)
def test_a_ground_speed_in_another_unit_is_named_once_it_was_found_twice(
    log: Recording, factor: float, said: str, row: int
) -> None:
    """By a tenth of the speed the first ten seconds bring the vehicle less than a wheel's turn: it might be dug in."""
    wrong = log.with_channels(ground_speed=factor * log["ground_speed"])
    out = learned_by(SettingsLearner(robot(sensors=UNKNOWN), tuple(log.channels), {}, {}), wrong)
    doubts = {at: learned.doubts for at, learned in out.items() if learned.doubts}
    assert list(doubts) == ([row] if said else [])
    for texts in doubts.values():
        assert list(texts) == ["rims"]
        assert all(said in text for text in texts["rims"])
