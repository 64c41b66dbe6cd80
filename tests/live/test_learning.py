"""Live learns noise and held channels from what has come so far: it ends with a file's settings, and a restart changes no digit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import terragrip as tg
from drives import drive, robot
from machine import rows_of
from terragrip.estimation import learning
from terragrip.estimation.learning import SettingsLearner
from terragrip.live import read_record
from terragrip.live.core import Core, Settings
from terragrip.live.outputs import Event, Row
from terragrip.live.pipeline import Pipeline
from terragrip.recording.checks import NOTHING_TOWED

UNKNOWN = {"drawbar_force": 4.0, "pitch": 0.002}  # all else the log must tell


@pytest.fixture(scope="module")
def vehicle():
    return robot(sensors=UNKNOWN)


@pytest.fixture(scope="module")
def long():
    """A minute whose sensors are not as the guesses have it, and whose ground speed comes five times a second."""
    made = drive(60.0, noise=2.0, seed=3)
    recording = made.recording
    held = np.repeat(recording["ground_speed"][::20], 20)[: len(recording)]
    return replace(made, recording=recording.with_channels(ground_speed=held))


def core_of(vehicle, recording, **changes) -> Core:
    return Core(vehicle, Settings(("replay:test",), channels=tuple(recording.channels), **changes))


def played(core: Core, recording):
    """The estimates by column (n,), and the events."""
    outputs = [out for time, values in rows_of(recording) for out in core.process(time, 0, time, values)]
    outputs += core.flush()
    rows = [out.estimate for out in outputs if isinstance(out, Row)]
    columns = {name: np.array([row[name] for row in rows]) for name in core.estimator.columns}
    return columns, [out for out in outputs if isinstance(out, Event)]


@pytest.fixture(scope="module")
def learned(vehicle, long):
    """The core after the minute, its estimates by column, not to be changed, and its events."""
    core = core_of(vehicle, long.recording)
    return core, *played(core, long.recording)


@pytest.fixture(scope="module")
def guessed(vehicle, long):
    """The estimates of one that learns nothing."""
    return played(core_of(vehicle, long.recording, learn=False), long.recording)[0]


def test_it_ends_with_the_settings_of_the_file(vehicle, long, learned):
    wanted = tg.estimate(long.recording, vehicle).about["settings"]
    core, _, events = learned
    assert core.estimator.held == pytest.approx(wanted["held"], rel=0.05)
    measured = [name for name in core.estimator.noise if name in long.recording.channels]
    assert len(measured) >= 10
    for name in measured:
        assert core.estimator.noise[name] == pytest.approx(wanted["noise"][name], rel=0.15), name
    said = [event for event in events if event.kind == "learned"]
    assert 1 <= len(said) <= 6
    assert "noise of wheel_speed_fl" in said[0].text
    assert "ground_speed is held, one value in 0.2 s" in said[0].text


def test_its_intervals_hold_and_the_guesses_do_not_fit(long, learned, guessed):
    late = long.recording.time > 30
    assert not 0.5 < fit_of(guessed, late) < 2.0
    _, estimates, _ = learned
    for name in ("ground_speed", "slip_rl", "adhesion_rl"):
        off = np.abs(estimates[name] - long.truth[name])[late] / estimates[f"{name}_std"][late]
        assert np.mean(off < 1.96) > 0.9, name


def test_its_innovations_are_as_large_as_expected(long, learned):
    assert 0.7 < fit_of(learned[1], long.recording.time > 30) < 1.4


def fit_of(columns, rows) -> float:
    """Normalised innovations over their expectation."""
    return np.sum(columns["nis"][rows]) / np.sum(columns["channels"][rows])


def test_it_is_causal_and_given_settings_are_not_touched(vehicle, long, learned, guessed):
    """The rows up to the first event are those of the guesses; with the file's settings nothing is learned."""
    _, estimates, events = learned
    first = next(event.time for event in events if event.kind == "learned")
    before = long.recording.time <= first
    assert 900 < before.sum() < 1100
    for name, values in guessed.items():
        assert np.array_equal(values[before], estimates[name][before], equal_nan=True), name
    assert not np.array_equal(guessed["adhesion_fl"][~before], estimates["adhesion_fl"][~before])

    whole = tg.estimate(long.recording, vehicle)
    known = whole.about["settings"]
    again, events = played(
        core_of(vehicle, long.recording, noise=known["noise"], held=known["held"]), long.recording
    )
    assert not [event for event in events if event.kind == "learned"]
    for name, values in again.items():
        assert np.array_equal(whole.columns[name], values, equal_nan=True), name


@pytest.mark.sample(2)
@pytest.mark.parametrize("stops", [(950, 1003, 1800), (400, 2500, 4100)])
def test_a_restart_changes_no_digit(vehicle, long, learned, tmp_path, stops):
    """Broken off and gone on, before and after what was learned; snapshots and write-ahead file both hold it."""
    rows = list(rows_of(long.recording))
    begin = 0
    for stop in (*stops, len(rows)):
        pipeline = Pipeline(core_of(vehicle, long.recording), tmp_path, rows=700)
        for time, values in rows[begin:stop]:
            pipeline.process(time, 0, time, values)
        pipeline.write()
        begin = stop
        if stop < len(rows):
            pipeline.recorder.abandon()
    pipeline.flush()
    pipeline.close()
    _, estimates = read_record(tmp_path)
    for name, values in learned[1].items():
        assert np.array_equal(values, estimates.columns[name], equal_nan=True), name


def test_what_a_standing_machine_does_not_show_stays_known(vehicle, long):
    moving = long.recording
    core = core_of(vehicle, moving)
    played(core, moving)
    before = dict(core.estimator.noise)
    rng = np.random.default_rng(0)
    for k in range(30_000):  # five minutes: no chunk of the drive but the first is kept
        time = 60.0 + 0.01 * k
        still = dict.fromkeys(moving.channels, 0.0) | {"drawbar_force": rng.normal()}
        core.process(time, 0, time, still)
    assert core.estimator.noise == pytest.approx(before, rel=0.5)
    assert core.estimator.held["ground_speed"] == pytest.approx(0.2, rel=0.05)


def test_memory_is_bounded_and_its_moments_become_rarer(vehicle, monkeypatch):
    monkeypatch.setattr(learning, "ROWS", 50)
    learner = SettingsLearner(vehicle, ("ground_speed",), {}, {})
    rng = np.random.default_rng(0)
    moments = [
        k
        for k, speed in enumerate(1 + 0.1 * rng.standard_normal(5000))
        if learner.add(0.01 * k, {"ground_speed": float(speed)}) is not None
    ]
    assert moments == [50 * n for n in (1, 2, 3, 4, 5, 7, 9, 13, 17, 25, 33, 49, 65, 97)]
    assert len(str(learner.state())) < 6 * 50 * 2 * 8 * 1.5


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        ("drive_torque_rr", "drive_torque_rr never came: without that every row is a gap; name it"),
        ("drive_torque_", "for slip alone give a profile of the speeds"),
        ("ground_speed", "ground_speed never came"),
    ],
)
@pytest.mark.parametrize("learn", [True, False], ids=["learned", "settings of an earlier log"])
def test_a_channel_that_never_comes_is_named(vehicle, long, lost, words, learn):
    """Rows go on being estimated, and all of them are gaps: nothing else shows that one name was not that of the vehicle's."""
    rows = [
        (t, {n: v for n, v in sample.items() if not n.startswith(lost)})
        for t, sample in rows_of(long.recording)
    ]
    core = Core(vehicle, Settings(("udp://test",), learn=learn))
    outputs = [out for time, values in rows[:1100] for out in core.process(time, 0, time, values)]
    assert [out.text for out in outputs if isinstance(out, Event) and words in out.text]
    assert {out.estimate.event for out in outputs if isinstance(out, Row) and out.estimate.time > 3} == {
        "gap"
    }


@pytest.mark.parametrize(
    ("lost", "limit", "said"), [("", None, 0), ("drawbar_force", None, 1), ("drawbar_force", 500.0, 0)]
)
def test_a_pull_that_is_not_measured_is_said_as_of_a_log(long, lost, limit, said):
    vehicle = robot(uncertainty={"drawbar_force": limit} if limit else {})
    core = Core(vehicle, Settings(("udp://test",)))
    rows = [(t, {n: v for n, v in sample.items() if n != lost}) for t, sample in rows_of(long.recording)]
    outputs = [out for time, values in rows[:2200] for out in core.process(time, 0, time, values)]
    assert sum(out.text == NOTHING_TOWED for out in outputs if isinstance(out, Event)) == said


def test_torques_that_are_0_while_the_machine_pulls_are_an_event(vehicle, long):
    """As 'terragrip inspect' names them; a right drive has no such event."""
    recording = long.recording
    _, events = played(core_of(vehicle, recording), recording)
    assert [event for event in events if event.kind == "contradiction"] == []
    torques = [name for name in recording.channels if name.startswith("drive_torque_")]
    lost = recording.with_channels(**dict.fromkeys(torques, np.zeros(len(recording))))
    _, events = played(core_of(vehicle, lost), lost)
    (event,) = [event for event in events if event.kind == "contradiction"]
    assert event.text.startswith(f"{torques[0]} (0) and ")
    assert "never change while the vehicle drives" in event.text
    assert event.time < 50


def test_an_implausible_number_of_the_vehicle_file_is_an_event_of_the_first_row(long):
    """As `estimate` notes it. It was one after 20 s of rows, so never of a short drive."""
    vehicle = robot(sensors={"drawbar_force": 4000.0})
    recording = long.recording
    core = core_of(vehicle, recording)
    outputs = [out for t, values in rows_of(recording) for out in core.process(t, 0, t, values)]
    said = [out for out in outputs if isinstance(out, Event) and "sensors.drawbar_force" in out.text]
    assert [(out.kind, out.time) for out in said] == [("contradiction", recording.time[0])]
    assert said[0].text in tg.estimate(recording, vehicle).notes


def test_a_contradiction_that_goes_and_comes_is_said_once(vehicle, monkeypatch):
    monkeypatch.setattr(learning, "ROWS", 50)
    found = iter([True, True, False, True, True, True, False, False, True, True, False, True, True, True])
    monkeypatch.setattr(
        "terragrip.recording.plausibility.warnings_by_check",
        lambda *_: {"masses": ["check the masses"]} if next(found) else {},
    )
    learner = SettingsLearner(vehicle, ("ground_speed",), {}, {})
    noise = np.random.default_rng(0).standard_normal(5000)
    learned = [learner.add(0.01 * k, {"ground_speed": 1 + 0.1 * float(one)}) for k, one in enumerate(noise)]
    assert [dict(one.doubts) for one in learned if one is not None and one.doubts] == [
        {"masses": ["check the masses"]}
    ]
