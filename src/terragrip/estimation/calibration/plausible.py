"""Limits of a calibration: what positions add to a log, the range of plausible values, and what is missing."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.estimation.calibration.result import Quantity, Unknown
from terragrip.estimation.calibration.windows import Windows, windows
from terragrip.recording import Recording
from terragrip.recording.track import track_of
from terragrip.vehicle import Vehicle

# Times: gains of an axle's wheels, and of two axles whose loads differ by a fifth and are exchanged.
_ALIKE, _APART = 1.12, 1.4
_CALM = 4.0  # s: slips are compared to some tenths of a per cent
_MOST_GAIN = 1.35  # times, either way: what is further off is no gain but wheels that did not share a curve
_MOST_RADIUS = 0.1  # relative, from the vehicle file: tread, pressure and load together
_TURNING = 0.04  # relative difference of the rims from side to side: a turn of 25 track widths
_MUCH = 0.2  # share of the driving


def completed_by_positions(log: Recording) -> tuple[Recording, list[str]]:
    """The log with a yaw rate and a pitch by its positions where no sensor gives them, and sentences on it."""
    lacks = [name for name in ("angular_velocity_z", "pitch") if name not in log.channels]
    if not lacks or "latitude" not in log.channels:
        return log, []
    track = track_of(log, _CALM)
    if track is None:
        return log, []
    added: dict[str, Floats] = {}
    for name, column in (("angular_velocity_z", "turn"), ("pitch", "grade")):
        values = track.at(column, log.time) if name in lacks else np.empty(0)
        if np.isfinite(values).any():
            added[name] = values
    words = {
        "angular_velocity_z": "The rate of turn is that of the positions",
        "pitch": "the slope is that of the altitude",
    }
    sentence = "; ".join(words[name] for name in added)
    return log.with_channels(**added), [f"{sentence[0].upper()}{sentence[1:]}."] if sentence else []


def plausible(quantities: Sequence[Quantity], vehicle: Vehicle, unknown: list[Unknown]) -> list[Quantity]:
    """The quantities of one kind, or none where one of them is implausible for any machine; ``unknown`` then names it."""
    for quantity in quantities:
        why = _beyond(quantity, vehicle)
        if why:
            unknown.append(Unknown(quantity.key, why))
            return []
    return list(quantities)


def _beyond(quantity: Quantity, vehicle: Vehicle) -> str:
    if quantity.key == "drive_torque_gain" and abs(np.log(max(quantity.value, 1e-9))) > np.log(_MOST_GAIN):
        return (
            f"that of {quantity.wheel} would be {quantity.value:.2f}, and no sensor is off by more than {1 / _MOST_GAIN:.2f} to "
            f"{_MOST_GAIN:.2f}: the wheels did not share slip and soil (turns? other radii? a scale of its own? axles' masses exchanged?)"
        )
    if quantity.key == "wheel_radius":
        stated = vehicle.wheel_data[vehicle.wheels.index(str(quantity.wheel))].radius
        if abs(quantity.value / stated - 1) > _MOST_RADIUS:
            return (
                f"that of {quantity.wheel} would be {quantity.value:.3g} m, and the vehicle file says {stated:.3g} m: check the units of "
                "the speeds, the gear ratio and the file"
            )
    return ""


def gains_by_axle(gains: Sequence[Quantity], vehicle: Vehicle) -> list[str]:
    """A sentence where the torque gains of two axles are far apart and those of each axle's wheels alike: what an exchange leaves."""
    found = {q.wheel: float(np.log(q.value)) for q in gains if q.key == "drive_torque_gain" and q.value > 0}
    axles = [[found[w] for w in axle.wheels if w in found] for axle in vehicle.axles.values()]
    axles = [own for own in axles if own]
    if len(axles) < 2 or any(len(own) < 2 or np.ptp(own) > np.log(_ALIKE) for own in axles):
        return []
    means = [float(np.mean(own)) for own in axles]
    if np.ptp(means) < np.log(_APART):
        return []
    return [
        f"The torque gains go by axle, {np.exp(np.ptp(means)):.2f} times apart, and each axle's wheels have like ones: its sensors are of "
        "another scale, or the torques of the axles are exchanged, or their masses in the vehicle file."
    ]


def turned_unseen(logs: Sequence[Recording], vehicle: Vehicle, known: Collection[str]) -> list[Unknown]:
    """A line that asks for a yaw rate, where the machine turned at an unknown rate, and radii or gains are missing."""
    if any(name.startswith(("wheel_radius", "drive_torque_gain")) for name in known):
        return []
    table = windows(logs, vehicle, 2.0)
    moving = np.abs(table.ground_speed) > 0.2
    if not moving.any():
        return []
    share = float(np.mean(turns_unseen(table, vehicle)[moving]))
    if share < _MUCH:
        return []
    why = f"this machine turned in {share:.0%} of its driving and no signal shows how fast: give a yaw rate (or positions)"
    return [Unknown("angular_velocity_z", why)]


def turns_unseen(table: Windows, vehicle: Vehicle) -> Bools:
    """Windows (n,) in which the wheels' speeds show a turn, and no yaw rate is known."""
    rim = table.wheel_speed * vehicle.wheel_radius
    shown = np.zeros(len(table), dtype=bool)
    for axle in range(len(vehicle.axles)):
        own = np.flatnonzero(vehicle.wheel_axle == axle)
        left, right = rim[:, own[0]], rim[:, own[-1]]
        shown |= np.abs(left - right) > _TURNING * np.abs(left + right) / 2  # not where one is unknown
    return np.asarray(shown & ~np.isfinite(table.yaw_rate))
