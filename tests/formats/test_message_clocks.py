"""The stamps of messages against the times at which the recorder received them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.formats.messages import Topic
from terragrip.formats.signals import Signal, SignalLog

sys.path.insert(0, str(Path(__file__).parents[1] / "estimation"))  # for drives.py
from drives import drive, robot

AFTER = np.arange(0, 60, 0.05)
SENT = 1.7e9 + AFTER


def topic(stamps: np.ndarray, receipts: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The instants and the notes of a topic of messages with a stamp and a number."""
    one = Topic("/odom")
    for stamp, receipt in zip(stamps, receipts.tolist(), strict=True):
        one.push(receipt, stamp.tobytes(), lambda sent: (float(np.frombuffer(sent)[0]), {"/odom.speed": 1.0}))
    signals, notes = one.signals()
    return signals["/odom.speed"].time, notes


def test_stamps_of_the_same_clock_count() -> None:
    time, notes = topic(SENT, SENT + 0.003)
    assert np.array_equal(time, SENT)
    assert notes == []


def test_stamps_of_another_clock_are_moved() -> None:
    time, notes = topic(SENT - 5000.0, SENT)
    np.testing.assert_allclose(time, SENT, atol=1e-3)
    assert "stamped 5000.000 s off the recorder's clock" in notes[0]


@pytest.mark.parametrize(
    "stamps",
    [
        SENT + 18.0 * (AFTER > 30),
        SENT - 3600.0 * (AFTER > 45),
        np.full(len(SENT), SENT[0]),
        SENT[0] + 0.5 * AFTER,
    ],
    ids=["set right in mid-drive", "set wrong near the end", "never renewed", "at half speed"],
)
def test_stamps_that_wander_are_left_out_and_said(stamps: np.ndarray) -> None:
    time, notes = topic(stamps, SENT + 0.003)
    np.testing.assert_allclose(time, SENT + 0.003)
    assert notes[0].startswith("/odom: its stamps drift by ")


def test_simulated_time_that_begins_at_zero_is_said_to_run_apart() -> None:
    """A simulation at half speed: its first stamp, 0, counted as none, so that all were dropped without a word."""
    _, notes = topic(0.5 * AFTER, SENT)
    assert "They run 0.5 times as fast, as simulated time does" in notes[0]
    time, notes = topic(AFTER, SENT)  # at full speed
    np.testing.assert_allclose(time, SENT, atol=1e-3)
    assert "stamped" in notes[0]
    for other in (SENT + 18.0 * (AFTER > 30), np.full(len(SENT), SENT[0])):  # set, never renewed
        _, (wandered,) = topic(other, SENT)
        assert "times as fast" not in wandered


def test_messages_that_waited_on_their_way_keep_their_stamps() -> None:
    """A network that was away for 6 s: what was SENT meanwhile comes at once."""
    late = (AFTER > 20) & (AFTER < 26)
    receipts = np.where(late, SENT[520] + 1e-4 * AFTER, SENT) + 0.003
    time, notes = topic(SENT, receipts)
    assert np.array_equal(time, SENT)
    assert notes == []


def test_messages_of_a_cycle_are_one_row_and_late_ones_in_a_burst_are_kept() -> None:
    """A bus carries them one after another: rows of their own would hold a torque back for a cycle (docs/decisions/0167)."""
    rng, cycle = np.random.default_rng(1), np.arange(0.0, 20.0, 0.1)
    signals = {
        name: Signal(cycle + rng.uniform(0.0, 0.004, len(cycle)), cycle + k)
        for k, name in enumerate(("speed", "torque", "pull"))
    }
    table = SignalLog(tuple(signals), signals).table()
    assert len(table.columns["time"]) == len(cycle)
    for name, signal in signals.items():
        np.testing.assert_array_equal(table.columns[name], signal.values)
    late = signals["torque"].time.copy()
    late[50:60] = late[60] - 1e-3 * np.arange(10, 0, -1)  # the receiver hung for a second
    table = SignalLog(("speed", "torque"), {**signals, "torque": Signal(late, cycle)}).table()
    assert np.isfinite(table.columns["torque"]).sum() == len(cycle)


def test_adhesion_of_a_log_whose_messages_are_stamped_apart_is_that_of_one_row_a_cycle() -> None:
    """A bus at 10 Hz, each channel up to 4 ms later than the wheels before it."""
    whole = drive(60.0, rate=10.0, slip=lambda t: 0.10 + 0.06 * np.sin(2.0 * t))
    time, channels = whole.recording.time, whole.recording.channels
    rng = np.random.default_rng(1)
    signals = {
        name: Signal(time + rng.uniform(0.0, 0.004, len(time)), values) for name, values in channels.items()
    }
    columns = SignalLog(tuple(signals), signals).table().columns
    log = tg.Recording(columns["time"], {name: columns[name] for name in channels})
    apart = tg.estimate(log, robot())["adhesion_rr"]
    assert len(apart) == len(time)
    errors = [
        np.std(found[30:] - whole.truth["adhesion_rr"][30:])
        for found in (apart, tg.estimate(whole.recording, robot())["adhesion_rr"])
    ]
    assert errors[0] < 1.1 * errors[1]
