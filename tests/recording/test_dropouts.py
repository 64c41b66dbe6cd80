"""A wheel's speed, or one wheel's torque, that alone drops to 0 is named."""

from __future__ import annotations

import numpy as np
import pytest

from steady_drive import TIME, log, pulling
from terragrip.recording.dropouts import dropout_warnings


@pytest.mark.parametrize(
    ("name", "what"),
    [("drive_torque_l", "while all other torques are not"), ("wheel_speed_l", "while the vehicle drives")],
)
def test_a_channel_that_alone_drops_to_0_is_named(name: str, what: str) -> None:
    values = np.where((TIME >= 20) & (TIME <= 30), 0.0, pulling().channels[name])
    (note,) = dropout_warnings(pulling(**{name: values}))
    assert note.startswith(f"{name} is 0 from 20 to 30 s {what}")
    assert (
        dropout_warnings(
            pulling(**{name: np.where((TIME >= 20) & (TIME <= 24), 0.0, pulling().channels[name])})
        )
        == []
    )


def test_a_drive_and_an_axle_that_is_off_say_nothing() -> None:
    rows = (TIME >= 20) & (TIME <= 30)
    assert dropout_warnings(log()) == []
    assert dropout_warnings(pulling()) == []
    off = {n: np.where(rows, 0.0, pulling().channels[n]) for n in ("drive_torque_l", "drive_torque_r")}
    assert dropout_warnings(pulling(**off)) == []
