"""Every fault does what it says, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.simulation import Scenario, simulate

SENSORS = {
    "wheel_speed": {"rate": 100, "noise": 0.03},
    "drive_torque": {"rate": 50, "noise": 1.0},
    "ground_speed": {"rate": 25, "noise": 0.02},
}


@pytest.fixture
def pair(quiet):
    """A sound recording and the same with faults, on the sound one's instants."""

    def make(*faults):
        base = {"sensors": SENSORS, "duration": 20}
        return simulate(quiet(**base), seed=2).recording, simulate(
            quiet(**base, faults=list(faults)), seed=2
        ).recording

    return make


def same_but(sound, faulty, *changed):
    np.testing.assert_array_equal(sound.time, faulty.time)
    for name in sound.channels:
        if name not in changed:
            np.testing.assert_array_equal(sound[name], faulty[name], err_msg=name)


def within(recording, start, end):
    return (recording.time >= start) & (recording.time < end)


def test_gap_removes_the_rows(pair):
    sound, faulty = pair({"kind": "gap", "at": 5, "duration": 2.5})
    assert not within(faulty, 5, 7.5).any()
    np.testing.assert_array_equal(faulty.time, sound.time[~within(sound, 5, 7.5)])
    np.testing.assert_array_equal(faulty["ground_speed"], sound["ground_speed"][~within(sound, 5, 7.5)])


def test_loss_leaves_the_rest(pair):
    sound, faulty = pair({"kind": "loss", "channel": "ground_speed", "at": 5, "duration": 8})
    spell = within(sound, 5, 13)
    assert np.isnan(faulty["ground_speed"][spell]).all()
    np.testing.assert_array_equal(faulty["ground_speed"][~spell], sound["ground_speed"][~spell])
    same_but(sound, faulty, "ground_speed")


def test_held_repeats_the_last_value(pair):
    sound, faulty = pair({"kind": "held", "channel": "drive_torque_rr", "at": 5, "duration": 1})
    measured = np.isfinite(sound["drive_torque_rr"])
    before = sound["drive_torque_rr"][measured & (sound.time < 5)][-1]
    assert np.all(faulty["drive_torque_rr"][measured & within(sound, 5, 6)] == before)
    np.testing.assert_array_equal(
        faulty["drive_torque_rr"][~within(sound, 5, 6)], sound["drive_torque_rr"][~within(sound, 5, 6)]
    )
    same_but(sound, faulty, "drive_torque_rr")


def test_spikes(pair):
    sound, faulty = pair({"kind": "spike", "channel": "ground_speed", "count": 12, "size": 0.8})
    off = faulty["ground_speed"] - sound["ground_speed"]
    hit = np.abs(off) > 1e-12
    assert hit.sum() == 12
    np.testing.assert_allclose(np.abs(off[hit]), 0.8)
    assert len(np.unique(np.sign(off[hit]))) == 2
    same_but(sound, faulty, "ground_speed")


def test_sign_flips_every_wheel_of_a_sensor(pair):
    sound, faulty = pair({"kind": "sign", "channel": "wheel_speed", "at": 10})
    after = sound.time >= 10
    for wheel in ("fl", "fr", "rl", "rr"):
        name = f"wheel_speed_{wheel}"
        np.testing.assert_array_equal(faulty[name], np.where(after, -sound[name], sound[name]))
    same_but(sound, faulty, *[n for n in sound.channels if n.startswith("wheel_speed")])


def test_dead_channel_reads_its_value(pair):
    sound, faulty = pair({"kind": "dead", "channel": "drive_torque_fl", "at": 3, "size": 0.0})
    measured = np.isfinite(sound["drive_torque_fl"]) & (sound.time >= 3)
    assert np.all(faulty["drive_torque_fl"][measured] == 0.0)
    same_but(sound, faulty, "drive_torque_fl")


def test_jitter_moves_stamps_not_values(pair):
    sound, faulty = pair({"kind": "jitter", "channel": "ground_speed", "size": 0.003})
    was, now = np.isfinite(sound["ground_speed"]), np.isfinite(faulty["ground_speed"])
    np.testing.assert_array_equal(sound["ground_speed"][was], faulty["ground_speed"][now])
    moved = faulty.time[now] - sound.time[was]
    assert moved.std() == pytest.approx(0.003, rel=0.15)
    assert np.all(np.diff(faulty.time) > 0)


def test_faults_by_count_lie_in_different_places(pair):
    sound, faulty = pair({"kind": "loss", "channel": "ground_speed", "duration": 0.4, "count": 3})
    lost = np.isfinite(sound["ground_speed"]) & np.isnan(faulty["ground_speed"])
    assert 20 <= lost.sum() <= 30
    assert faulty.time[lost].min() > 1
    assert faulty.time[lost].max() < 19


def test_unknown_channel_is_refused_with_the_nearest(quiet):
    scenario = quiet(sensors=SENSORS, faults=[{"kind": "loss", "channel": "ground_sped"}])
    with pytest.raises(
        InputError, match=r"faults.0.channel: no channel 'ground_sped' on board; did you mean ground_speed"
    ):
        simulate(scenario)


@pytest.mark.parametrize(
    "fault", [{"kind": "gap"}, {"kind": "spike", "channel": "ground_speed"}, {"kind": "melt"}]
)
def test_incomplete_faults_are_refused(quiet, fault):
    data = quiet().model_dump(exclude_unset=True, exclude={"faults"})
    with pytest.raises(InputError, match=r"^quiet\.yaml: faults"):
        Scenario.from_dict({**data, "faults": [fault]}, file="quiet.yaml")
