"""Values that no machine can have and that come again and again: a logger's code for "not measured"; sentences for the user."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.schema import split_channel
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FASTEST = 100.0  # m/s
_LIMITS = {
    "pitch": 7.0,
    "roll": 7.0,  # rad: more than a turn
    **{f"acceleration_{axis}": 500.0 for axis in "xyz"},
    **{f"angular_velocity_{axis}": 50.0 for axis in "xyz"},
}
_SMALLEST = 0.02  # m, the radius of a wheel
_WEIGHTS = 5.0  # a force over the weight
_CODES, _TIMES = 3, 3  # different values, and how often each is there at least
_BEYOND = 5.0  # times all others
_MOST = 0.5  # of a channel: where more is impossible, its unit is wrong


def without_codes(recording: Recording, vehicle: Vehicle | None) -> tuple[Recording, list[str]]:
    """The recording with such values missing, and a sentence on each channel that had some."""
    channels, notes = {}, []
    for name, values in recording.channels.items():
        limit = _limit(name, vehicle)
        codes = () if limit is None else _codes(values, limit)
        if not len(codes):
            continue
        bad = np.isin(values, codes)
        channels[name] = np.where(bad, np.nan, values)
        shown = " and ".join(f"{code:.6g}" for code in codes)
        notes.append(
            f"{name} is {shown} in {bad.sum()} rows and at most {np.nanmax(np.abs(channels[name])):.3g} in all others: a code for "
            f"'not measured', it seems. Leave these cells empty, or write 'invalid: [...]' in the profile, in the log's own numbers."
        )
    return (replace(recording, channels={**recording.channels, **channels}) if channels else recording), notes


def _limit(name: str, vehicle: Vehicle | None) -> float | None:
    """What no machine, or not this one, can exceed, in the channel's unit; None where nothing is known."""
    if name in _LIMITS:
        return _LIMITS[name]
    if name in ("ground_speed", "wheel_based_speed"):
        return _FASTEST
    quantity, wheel = split_channel(name) or ("", "")
    radius = 1.0 if quantity == "drive_torque" else _SMALLEST
    if vehicle is not None and vehicle.knows_wheels:
        radius = vehicle.radii.get(wheel, radius)
    if quantity == "wheel_speed":
        return _FASTEST / radius
    if vehicle is None:
        return None
    weight = _WEIGHTS * vehicle.mass * STANDARD_GRAVITY
    return {"drive_torque": weight * radius}.get(quantity, weight if name == "drawbar_force" else None)


def _codes(values: Floats, limit: float) -> Floats:
    """Values beyond a limit that come again, of a channel (n,); none where there are many different ones, or hardly others."""
    none = np.empty(0)
    if not len(values) or not max(np.fmax.reduce(values), -np.fmin.reduce(values)) > limit:
        return none
    known = values[np.isfinite(values)]
    beyond = known[np.abs(known) > limit]
    codes, counts = np.unique(beyond, return_counts=True)
    rest = np.abs(known[np.abs(known) <= limit])
    if len(codes) > _CODES or counts.min() < _TIMES or len(beyond) > _MOST * len(known):
        return none
    return codes if _BEYOND * float(rest.max(initial=0.0)) < float(np.abs(codes).min()) else none
