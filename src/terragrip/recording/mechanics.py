"""Torques, accelerations and angles compared with the motion: sentences for the user, never errors.

Over windows of a second, averaged over the same stretch for all, an accelerometer along the vehicle reads dv/dt + g sin(pitch), and the
wheels' thrust Σ M/r less the drawbar force is m times that plus a resistance (physics.md 1). With a wrong sign, unit, gear ratio or mass
they are proportional by a factor other than 1. Thrust and accelerometer agree best, as both include the slope; the change of ground speed
then decides which of them is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.recording.brake import braked
from terragrip.recording.forces import opposite_acceleration
from terragrip.recording.once import once
from terragrip.recording.pitch import pitch_warnings, zero_warnings
from terragrip.recording.pulls import PULL, pull_warnings, silent_cell
from terragrip.recording.ranks import median
from terragrip.recording.rolling import radius_warnings
from terragrip.recording.schema import rim_names
from terragrip.recording.window_means import window_means, windows_of
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import moment

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle


_WINDOW = 1.0  # s, at least, and two samples of the ground speed
_MOVING = 0.15  # of the speed that a twentieth of the windows exceed
_LEAST = 25  # windows
_BLOCKS = 10  # of correlated windows, for the jackknife
_SPREAD = 1e-9  # of x's: what is left without one block, less is rounding
_SURE = 3.0  # standard errors
_ALIKE = 0.7  # correlation from which two signals are proportional
_CLEAR = 0.85  # and from which another reading of the channels is the right one
_FACTOR = 1.8  # larger than an uncalibrated torque and an estimated mass change a force balance
_STRETCH = 20  # windows in which the balance leaves less than nothing (on right logs it left .036 of the weight at least)
_ROUNDING = 1e-12  # of a mean of equal values
_OFFSET = 0.4  # m/s²: .04 of the weight, two degrees of mounting (right logs: .25 at most)
_OFFSET_SURE = 4.0  # of the bias that the vehicle file states,
_OFFSET_LEAST = 0.2  # and m/s²: .02 of the weight


@dataclass(frozen=True)
class Fit:
    """Slope with its standard error, and the correlation; a slope of 0 ± inf where there are too few data."""

    slope: float = 0.0
    error: float = np.inf
    alike: float = 0.0

    def is_off(self, value: float = 1.0) -> bool:
        """Whether the slope is certainly a different one."""
        return abs(self.slope - value) > _SURE * self.error

    @property
    def is_opposite(self) -> bool:
        """Proportional, with a factor that is certainly negative."""
        return self.alike < -_ALIKE and self.slope + _SURE * self.error < 0

    @property
    def distance(self) -> float:
        """How far the slope is from 1, as a factor's logarithm."""
        return abs(float(np.log(self.slope))) if self.slope > 0 else np.inf

    @property
    def is_another_scale(self) -> bool:
        """Proportional, with a factor other than 1. The squared correlation is the flattening of a slope by noise."""
        if abs(self.alike) < _ALIKE:
            return False
        low, high = self.slope - _SURE * self.error, self.slope / self.alike**2 + _SURE * self.error
        return low > _FACTOR or high < 1 / _FACTOR


@dataclass(frozen=True, eq=False)
class Means:
    """Windows of driving forward (n,): ``place`` of each row of the log among all, when these start (``starts`` [s]), which of them are
    used (``rows``), each ``length`` [s] long, and of the used ones the ``change`` of ground speed [m/s²], the ``speed`` [m/s],
    g sin(pitch), ``climb`` [m/s²], if the log has it, and each driven wheel's share of the ``thrusts`` (`thrusts_of`), if known."""

    place: Ints
    starts: Floats
    rows: Bools
    change: Floats
    speed: Floats
    climb: Floats | None = None
    length: float = _WINDOW
    thrusts: dict[str, Floats] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Of all windows."""
        return len(self.starts)

    @property
    def middles(self) -> Floats:
        """Of the used windows (n,) [s]."""
        return self.starts[self.rows] + self.length / 2

    @property
    def thrust(self) -> Floats:
        """All thrust less the drawbar force, over the mass (n,) [m/s²]."""
        return np.asarray(np.sum(list(self.thrusts.values()), axis=0))

    @once
    def plain(self, values: Floats) -> Floats:
        """A channel (rows,) as means over all windows."""
        return window_means(values, self.place, self.count)

    def of(self, values: Floats) -> Floats:
        """A channel (rows,) as means over the stretch of ``change`` (n,)."""
        plain = self.plain(values)
        inner = (plain[:-2] + 2 * plain[1:-1] + plain[2:]) / 4
        return np.r_[np.nan, inner, np.nan][self.rows]

    def moved(self, recording: Recording) -> Floats:
        """dv/dt + g sin(pitch) (n,) [m/s²]: the accelerometer's reading, else by the ground speed and the climb that is known."""
        moved = self.change + (0.0 if self.climb is None else np.nan_to_num(self.climb))
        if "acceleration_x" not in recording.channels:
            return moved
        measured = self.of(recording.channels["acceleration_x"])
        return np.where(np.isnan(measured), moved, measured)

    def fit(self, y: Floats, x: Floats, *, beside: Floats | None = None) -> Fit:
        """y over x (n,), its error by leaving out one block of windows at a time; ``beside``: without the effect of that (n,)."""
        known = np.isfinite(y) & np.isfinite(x)
        if beside is not None:
            known &= np.isfinite(beside)
        if known.sum() < _LEAST or not np.ptp(y[known]) or not np.ptp(x[known]):
            return Fit()
        pair = np.column_stack([y, x])[known]
        common = np.column_stack([np.ones(len(pair)), *(() if beside is None else (beside[known],))])
        y, x = (pair - common @ np.linalg.lstsq(common, pair, rcond=None)[0]).T
        starts = np.searchsorted(np.arange(len(y)) * _BLOCKS // len(y), np.arange(_BLOCKS))
        sums = np.add.reduceat([np.ones(len(y)), x, y, x * x, x * y], starts, axis=1)
        count, of_x, of_y, xx, xy = sums.sum(axis=1)[:, None] - np.c_[np.zeros(len(sums)), sums]
        spread = xx - of_x**2 / count
        if not (spread > _SPREAD * spread[0]).all():
            return Fit()
        slopes = (xy - of_x * of_y / count) / spread
        error = float(np.sqrt((_BLOCKS - 1) * np.var(slopes[1:])))
        return Fit(float(slopes[0]), error, float(np.corrcoef(y, x)[0, 1]))


def motion_warnings(recording: Recording, vehicle: Vehicle | None, means: Means | None) -> list[str]:
    """Sentences on accelerations, pitch, torques, radius and mass that the motion contradicts, and on sensors that never change."""
    if means is None:
        return []
    forward = (
        means.of(recording.channels["acceleration_x"]) if "acceleration_x" in recording.channels else None
    )
    notes: list[str] = []
    if vehicle is not None and vehicle.knows_wheels:
        notes = _dead_warnings(recording, vehicle)
        notes += radius_warnings(recording, vehicle, means)
        notes = notes or pull_warnings(means, recording, vehicle)
        means = replace(means, thrusts={}) if notes else means
        notes += silent_cell(recording, vehicle)
    if forward is not None:
        found = _balance_warnings(recording, means, forward, vehicle)
        found = found or zero_warnings(means, forward)
        found = (
            found or pitch_warnings(recording, means, forward) or _offset_warnings(means, forward, vehicle)
        )
    else:
        found = _thrust_warnings(means, vehicle)
    return [*notes, *found]


def shortfall_warnings(recording: Recording, means: Means | None) -> list[str]:
    """A sentence where less than nothing is left of the thrust for `_STRETCH` windows, by the pull and what shows hills."""
    hills = "acceleration_x" in recording.channels or (means is not None and means.climb is not None)
    if means is None or not means.thrusts or not hills or "drawbar_force" not in recording.channels:
        return []
    rest = (means.thrust - means.moved(recording)) / STANDARD_GRAVITY
    known = np.flatnonzero(np.isfinite(rest))
    if len(known) < 2 * _STRETCH:
        return []
    total = np.r_[0.0, np.cumsum(rest[known])]
    low = np.flatnonzero(total[_STRETCH:] - total[:-_STRETCH] < -PULL * _STRETCH)
    if not len(low):
        return []
    first, last = low[0], low[-1] + _STRETCH - 1
    inside = rest[known[first : last + 1]]
    begin, end = means.middles[known[[first, last]]]
    return [
        f"From about {moment(begin)} to {moment(end)} s the drive torques over the wheel radius less drawbar_force are "
        f"{-np.mean(inside):.2g} of "
        "the weight too little to move the vehicle, even without resistance: the zero of drawbar_force drifts, or the scale of one of them "
        "changed. Correct these cells, or leave them empty."
    ]


def means_of(recording: Recording, vehicle: Vehicle | None = None) -> Means | None:
    """The windows of a log, with the thrusts of a ``vehicle`` whose wheels are known; None if too few of driving are left, or time
    decreases."""
    speed = recording.channels.get("ground_speed")
    known = np.flatnonzero(np.isfinite(speed)) if speed is not None else ()
    if speed is None or len(known) < _LEAST:
        return None
    length = max(_WINDOW, 2 * median(np.diff(recording.time[known])))
    place, starts = windows_of(recording.time, length)
    count = len(starts)
    if place.min() < 0 or place.max() >= count:  # time decreases: refused elsewhere
        return None
    mean = window_means(speed, place, count)
    for name in rim_names(recording.channels):  # a ground speed without a sign is positive in reverse, too
        mean[window_means(recording.channels[name], place, count) < 0] = np.nan
    if float(np.nansum(mean)) <= 0:
        return None
    change = np.r_[np.nan, (mean[2:] - mean[:-2]) / (2 * length), np.nan]
    rows = np.isfinite(change) & (np.nan_to_num(mean) > _MOVING * float(np.nanquantile(mean, 0.95)))
    braking = np.nan_to_num(window_means(braked(recording).astype(np.float64), place, count))
    rows &= braking == 0
    rows[1:] &= braking[:-1] == 0
    rows[:-1] &= braking[1:] == 0
    if rows.sum() < _LEAST:
        return None
    means = Means(place, starts, rows, change[rows], mean[rows], length=length)
    if "pitch" in recording.channels:
        means = replace(means, climb=STANDARD_GRAVITY * means.of(np.sin(recording.channels["pitch"])))
    return means if vehicle is None else replace(means, thrusts=thrusts_of(recording, vehicle, means))


def thrusts_of(recording: Recording, vehicle: Vehicle, means: Means) -> dict[str, Floats]:
    """For each driven wheel its thrust less its share of the drawbar force, over the mass (n,) [m/s²]; empty if a torque is missing."""
    radii, channels = vehicle.driven_radii, recording.channels
    if not all(f"drive_torque_{wheel}" in channels for wheel in radii):
        return {}
    pulled = means.of(channels["drawbar_force"]) / len(radii) if "drawbar_force" in channels else 0.0
    return {
        w: (means.of(channels[f"drive_torque_{w}"]) / radius - pulled) / vehicle.mass
        for w, radius in radii.items()
    }


def _balance_warnings(
    recording: Recording, means: Means, forward: Floats, vehicle: Vehicle | None
) -> list[str]:
    """acceleration_x and the torques against each other, and where they differ, each against the change of ground speed."""
    moved = means.fit(forward, means.change, beside=means.climb)
    backward = moved.is_off() and moved.slope + _SURE * moved.error < 0
    if not means.thrusts or vehicle is None:
        return [opposite_acceleration()] if backward else []
    thrust = means.thrust
    driven = means.fit(thrust, means.change, beside=means.climb)
    together = means.fit(thrust, forward)
    exchanged = _exchanged(recording, vehicle, means, forward, together)
    if exchanged:
        return [exchanged]
    if not together.is_another_scale:  # a hill or a pull that nobody knows hides the proportion, not the sign
        return [opposite_acceleration()] if backward and together.slope < 0 else []
    if moved.is_off() and moved.distance > driven.distance:
        if together.slope < 0:
            return [opposite_acceleration(", and the drive torques contradict it too")]
        return [
            f"acceleration_x is not the change of ground speed but {1 / together.slope:.2g} times what the drive torques give for "
            f"{vehicle.mass:.4g} kg: it may be in g (write 'unit: g' in the profile), or not the axis that points forward."
        ]
    if driven.is_off() and driven.distance > moved.distance:
        # A vehicle that digs in slows down the harder it is driven.
        digs = together.slope < 0 and np.nanmean(thrust) > 0
        return [] if digs else [_scale_sentence(together.slope, vehicle)]
    if moved.alike > _CLEAR and not moved.is_off():  # a resistance that rises on slopes looks so, too
        return []
    wrong = "against each other" if together.slope < 0 else f"{together.slope:.2g} times apart"
    return [
        f"The drive torques over radius and mass and acceleration_x go {wrong}, and the ground speed does not show which of them is wrong: "
        "check their signs and units, the wheel radius and the mass."
    ]


def _exchanged(recording: Recording, vehicle: Vehicle, means: Means, forward: Floats, together: Fit) -> str:
    """Whether the balance closes with the other sign of some wheels' torques, or the accelerometer's other axis."""
    # A wheel of a wrong sign also brakes on average; in changes alone, the sharing of a pull among axles looks like a sign.
    own = {
        w: means.of(recording.channels[f"drive_torque_{w}"]) / radius / vehicle.mass
        for w, radius in vehicle.driven_radii.items()
    }
    backward = [w for w, push in own.items() if np.nansum(push) < 0 and means.fit(push, forward).slope < 0]
    if len(backward) == len(own):  # the drawbar force and the scale show that
        backward = []
    plain = abs(together.alike)
    turned = abs(means.fit(means.thrust - 2 * sum(own[w] for w in backward), forward).alike)
    sideways = recording.channels.get("acceleration_y")
    other = 0.0 if sideways is None else abs(means.fit(means.thrust, means.of(sideways)).alike)
    if plain > _ALIKE or max(turned, other) < _CLEAR:
        return ""
    if other > turned:
        return "acceleration_y varies with the drive torques and acceleration_x does not: the two axes may be exchanged."
    odd = [f"drive_torque_{wheel}" for wheel in backward]
    shown = "the other wheels' torques vary with acceleration_x, and these against it"
    return WrongSign.of(odd, shown, "forward is", who=f"{', '.join(odd)}:")


def _thrust_warnings(means: Means, vehicle: Vehicle | None) -> list[str]:
    """The torques against the change of ground speed and the climb alone."""
    if not means.thrusts or vehicle is None:
        return []
    moved, thrust = means.change + (0.0 if means.climb is None else means.climb), means.thrust
    if means.climb is not None:
        uphill = means.fit(thrust - means.change, means.climb)
        if uphill.alike < -_ALIKE and np.nanmean(thrust) > 0:
            return [
                WrongSign.of(["pitch"], "falls where the wheels are driven harder at one speed", "nose up is")
            ]
    fit = means.fit(thrust, moved)
    if fit.slope < 0 and np.nanmean(thrust) > 0:
        return []
    return [_scale_sentence(fit.slope, vehicle)] if fit.is_another_scale else []


def _scale_sentence(scale: float, vehicle: Vehicle) -> str:
    if scale < 0:
        names = [f"drive_torque_{wheel}" for wheel in vehicle.driven_radii]
        shown = "fall where the vehicle is driven harder"
        return WrongSign.of(names, shown, "forward is", who="The drive torques")
    return (
        f"The drive torques over the wheel radius are {scale:.2g} times the force that moves {vehicle.mass:.4g} kg in this way: check the "
        "torques' unit and scale (at the wheel, not at the motor: the gear ratio counts), the wheel radius and the mass."
        + " A trailer whose drawbar_force is not in the log looks the same."
        * (scale > 1)
    )


def _offset_warnings(means: Means, forward: Floats, vehicle: Vehicle | None) -> list[str]:
    """The accelerometer's reading beyond the change of ground speed and the climb by the pitch, on average, less what was calibrated."""
    if means.climb is None:
        return []
    rest = forward - means.change - means.climb
    if vehicle is not None:
        found = vehicle.calibration
        rest = rest - found.acceleration_bias_x + STANDARD_GRAVITY * np.sin(found.pitch_offset)
    known = np.isfinite(rest)
    offset = median(rest[known]) if known.sum() >= _LEAST else 0.0
    stated = None if vehicle is None else vehicle.uncertainty.acceleration_bias
    most = _OFFSET if stated is None else min(_OFFSET, max(_OFFSET_SURE * stated, _OFFSET_LEAST))
    if abs(offset) < most:
        return []
    beside = "" if stated is None else f", where the vehicle file's acceleration_bias is {stated:.2g}"
    return [
        f"acceleration_x reads {offset:.2g} m/s² more than speed and pitch explain{beside}: its bias or its mounting, or the "
        "pitch sensor's, which 'terragrip calibrate' finds."
    ]


def _dead_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Wheels' channels with one value for the whole drive while other wheels' change, and torques that are all 0."""
    notes = []
    for quantity, wheels in (("wheel_speed", vehicle.wheels), ("drive_torque", tuple(vehicle.driven_radii))):
        known = {f"{quantity}_{wheel}": recording.channels.get(f"{quantity}_{wheel}") for wheel in wheels}
        held = {
            name: v[np.isfinite(v)] for name, v in known.items() if v is not None and np.isfinite(v).any()
        }
        still = {name: float(v[0]) for name, v in held.items() if np.ptp(v) <= _ROUNDING * abs(v[0])}
        lost = quantity == "drive_torque" and not any(still.values())
        if still and (len(still) < len(held) or lost):
            shown = " and ".join(f"{name} ({value:.3g})" for name, value in still.items())
            verb = "change" if len(still) > 1 else "changes"
            else_ = ", or its motor is off" if quantity == "drive_torque" and not any(still.values()) else ""
            else_ = ", or the vehicle only coasts or is towed" if lost and len(still) == len(held) else else_
            notes.append(
                f"{shown} never {verb} while the vehicle drives: the sensor is dead, or the column is wrong{else_}."
            )
    return notes
