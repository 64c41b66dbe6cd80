"""Channels that a sensor's range cuts are named; a motor at its limit, and a cell that reads 0 for long, are left alone."""

from __future__ import annotations

import re

import numpy as np
import pytest

from steady_drive import TIME, log, pulling
from terragrip.recording import unit_warnings
from terragrip.recording.cut import cut_warnings


def test_a_drive_says_nothing() -> None:
    assert cut_warnings(pulling()) == []
    coarse = {name: np.round(values) for name, values in pulling().channels.items() if "torque" in name}
    assert cut_warnings(pulling(**coarse)) == [], "a channel of whole N m"


@pytest.mark.parametrize("name", ["drive_torque_l", "drawbar_force", "acceleration_x"])
def test_a_channel_that_its_range_cuts_is_named(name: str) -> None:
    """All three read on without a word before."""
    values = pulling().channels[name]
    most = float(np.quantile(values, 0.9))
    cut = pulling(**{name: np.minimum(values, most)})
    (note,) = cut_warnings(cut)
    assert re.match(rf"{name} is {most:.4g} in (9|1[0-3])% of the driving", note)
    assert "never more" in note
    assert note in unit_warnings(cut, None)
    (note,) = cut_warnings(pulling(**{name: -np.minimum(values, most)}))
    assert "never less" in note


def test_a_motor_at_its_limit_and_a_slack_bar_are_left_alone() -> None:
    """Both stay at one value for long: the noise of a force that is cut comes and goes."""
    torque = np.where((TIME > 20) & (TIME < 60), 150.0, pulling().channels["drive_torque_l"])
    pull = np.where(TIME < 90, 0.0, pulling().channels["drawbar_force"])
    assert cut_warnings(pulling(drive_torque_l=torque, drawbar_force=pull)) == []
    assert cut_warnings(log()) == []
