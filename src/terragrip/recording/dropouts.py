"""A wheel's speed, or one wheel's torque, that drops to 0 while the others go on: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import known_part
from terragrip.recording.stretches import DRIVING, is_one_value, longest, may_last

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


def dropout_warnings(recording: Recording) -> list[str]:
    """A sentence on each wheel that reads 0 for long while ground speed and other wheels go on, and on each torque that alone does."""
    return _wheels(recording) + _torques(recording)


def _wheels(recording: Recording) -> list[str]:
    """A sentence on each wheel that reads 0 for long while the ground speed, and other wheels, go on."""
    rims = [n for n in recording.channels if n == "wheel_based_speed" or n.startswith("wheel_speed_")]
    ground, notes = recording.channels.get("ground_speed"), []
    if ground is None or len(rims) < 2 or not np.isfinite(ground).any():
        return []
    if not any(may_last(*known_part(recording.time, recording.channels[name])) for name in rims):
        return []
    zero = {name: recording.channels[name] == 0.0 for name in rims}
    driving = np.abs(ground) > DRIVING * float(np.nanquantile(np.abs(ground), 0.95))
    for name in rims:
        if not zero[name].any() or is_one_value(recording.channels[name]):
            continue
        alone = zero[name] & driving & ~np.logical_and.reduce(list(zero.values()))
        stretch = longest(recording.time, alone, np.isfinite(recording.channels[name]) & np.isfinite(ground))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while the vehicle drives: the wheel is locked, or its sensor "
                "lost the signal. If it did, leave these cells empty."
            )
    return notes


def _torques(recording: Recording) -> list[str]:
    """A sentence on each torque that alone is 0 for long: an axle that is switched off has two of them."""
    time, notes = recording.time, []
    torques = {n: v for n, v in recording.channels.items() if n.startswith("drive_torque_")}
    for name, values in torques.items():
        others = [other for one, other in torques.items() if one != name]
        if not others or not may_last(*known_part(time, values)) or is_one_value(values):
            continue
        alone = (values == 0.0) & np.logical_and.reduce([other != 0.0 for other in others])
        stretch = longest(time, alone, np.isfinite(values))
        if stretch:
            notes.append(
                f"{name} is 0 from {stretch[0]:.4g} to {stretch[1]:.4g} s while all other torques are not: its sensor lost the signal, "
                "or its motor is off. If the sensor did, leave these cells empty."
            )
    return notes
