"""The stamps of messages against the times at which the recorder received them."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.formats.messages import Topic

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


def test_messages_that_waited_on_their_way_keep_their_stamps() -> None:
    """A network that was away for 6 s: what was SENT meanwhile comes at once."""
    late = (AFTER > 20) & (AFTER < 26)
    receipts = np.where(late, SENT[520] + 1e-4 * AFTER, SENT) + 0.003
    time, notes = topic(SENT, receipts)
    assert np.array_equal(time, SENT)
    assert notes == []
