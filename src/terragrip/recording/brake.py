"""Rows in which a friction brake acts: what it does to the wheels is in no drive torque."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_PRESSED = 0.05  # as the kernel's TG_PRESSED
_LEAST = 10  # rows
_MOST = 1.5  # a share that exceeds its full scale; beyond, it is none


def braked(recording: Recording) -> Bools:
    """Rows (n,) from the sample before one of a pressed brake to the sample after it; none where no channel says so."""
    rows = np.arange(len(recording.time))
    share = recording.channels.get("brake", np.empty(0))
    known = np.flatnonzero(np.isfinite(share))
    if not len(known):
        return np.zeros(len(rows), dtype=bool)
    pressed = share[known] > _PRESSED
    last = np.searchsorted(known, rows, side="right") - 1
    following = np.searchsorted(known, rows)
    return np.asarray(pressed[np.maximum(last, 0)] | pressed[np.minimum(following, len(known) - 1)])


def without_braked_torques(recording: Recording) -> Recording:
    """The recording without drive torques in braked rows: there they are not what turns the wheels."""
    rows = braked(recording)
    if not rows.any():
        return recording
    torques = [name for name in recording.channels if name.startswith("drive_torque_")]
    return recording.with_channels(
        **{name: np.where(rows, np.nan, recording.channels[name]) for name in torques}
    )


def unbraked(recording: Recording) -> Recording:
    """The recording's rows in which no brake acts; raises InputError if there are hardly any."""
    rows = ~braked(recording)
    if not rows.all() and rows.sum() < _LEAST:
        raise InputError(
            "is pressed throughout",
            file=recording.source,
            place="column brake",
            hint="0 is released, 1 pressed: check its sense in the profile, or leave it out",
            page="vehicle#brakes",
        )
    return recording if rows.all() else recording.select(rows)


def refuse_no_share(channels: Mapping[str, Floats], source: str | None = None) -> None:
    """Raise InputError if a brake's channel is no share of its whole way or pressure."""
    share = channels.get("brake", np.empty(0))
    most = float(np.max(share[np.isfinite(share)], initial=0.0))
    if most <= _MOST:
        return
    codes = set(np.unique(share[np.isfinite(share)])) <= {0.0, 1.0, 2.0, 3.0}
    raise InputError(
        f"reaches {most:.4g}, and is a share: 0 released, 1 pressed",
        file=source,
        place="column brake",
        hint="2 and 3 are a bus's error and not available: write 'invalid: [2, 3]' for it in the profile"
        if codes
        else f"write 'unit: \"%\"' for it in the profile, or of a pressure 'scale: {1 / most:.2g}', so that 1 is full braking",
        page="vehicle#brakes",
    )
