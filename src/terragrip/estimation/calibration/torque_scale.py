"""The scale of the torque columns, common to all wheels, from the forces that mass and drawbar determine.

For a log whose torque columns are only proportional to torque (from a motor current, say), and as a check on any
other. By physics.md 1, summed over the wheels and averaged over a window::

    X = K (Y + R),   X = Σ M_i/r_i,   Y = F_dx + m (dv/dt + g sinθ),
    R = Σ (J dω_i/dt)/r_i + Σ (ρ_t F_i + ρ_w ω_i) + ρ_s m g

K is raw torque over true torque. ρ_s, constant for a log, soil and direction of travel, is an intercept; a skid-steered
vehicle's resistance in turns is a term of its own. Resistance that grows with slip would pass for a larger K: windows of high
slip, where it grows fastest, do not count, and its prior is in the interval. (As a term of the regression it would absorb thrust
itself, since slip follows thrust more closely than Y does.) A slope that nothing measures is in the interval as far as it correlates
with another speed or pull. Resistance that varies with the grade (wet below, dry above) would appear as a larger K, too, the more the grade
makes of Y: it is in the interval. So is what a fit by short stretches says otherwise where no label names the soils: a tool pulls harder
where the wheels sink deeper.

Errors in Y would pull K towards 0. Where there are two measures of dv/dt + g sinθ, the accelerometer and ground speed with
pitch, each is the other's instrument: K = cov(X, (Y1 + Y2)/2)/cov(Y1, Y2), so errors of either, if unlike, do no harm. Both are of
the window alone: a change of speed over its neighbours is smooth, and where braking is short the scale would be too large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.errors import InputError
from terragrip.estimation.calibration.plausible import turns_unseen
from terragrip.estimation.calibration.result import Quantity
from terragrip.estimation.calibration.windows import Windows, windows
from terragrip.estimation.calibration.zeros import evidence
from terragrip.estimation.consistency import NORMAL_95
from terragrip.physics.loads import GRAVITY
from terragrip.physics.slip import slip
from terragrip.recording import Recording, without_held
from terragrip.vehicle import Vehicle

_SHORTEST = 1.0  # s
_HOLDS = 2.0  # a window spans so many updates of the slowest torque channel
_SLOWEST = 0.1  # m/s
_LEAST = 20  # windows
_BLOCKS = 20  # of correlated windows, for the error
_OF_SLOPES = 0.02  # relative SD where accelerations are slopes of ground speed: braking within a window made it .96 to 1.05
_SLIP_RESISTANCE = 0.1  # prior SD of dρ_s/ds: hard ground 0, Brixius 0.06 to 0.1
_MOST_SLIP = 0.2  # beyond, resistance grows faster; much less leaves out the starts of a log that has few
_WITH_PUSH = 0.3  # prior of the correlation of a slope that nothing measures with pull and acceleration
_GROUND_WITH_GRADE = 0.006  # prior SD of the part of ρ_s that varies with the grade: .02 from place to place, correlated by .3 as above
_STRETCH = 6  # windows without labels that may be a soil of their own
_HUBER = 2.5
_LABEL = "give a 'soil' column (for one soil 'soil: {constant: field}' in the profile), or change the pull every few seconds"
_ROUNDING = 1e-9  # of a nuisance term, which is of size 1


@dataclass(frozen=True)
class _Balance:
    """Rows of the force balance: X, its known losses at K = 1, both measures of Y, and what is partialled out."""

    thrust: Floats
    losses: Floats
    force: Floats
    other: Floats
    nuisance: Floats
    slip: Floats
    slope_known: bool
    climb: Floats
    """m g sinθ, 0 where no slope is measured."""
    stretch: Ints | None = None
    """Of each row the stretch that has a resistance of its own, partialled out, too."""


def identify_torque_scale(recordings: Recording | Sequence[Recording], vehicle: Vehicle) -> Quantity:
    """Scale K of the torque columns (raw over true torque), the same for all wheels, with its interval.

    Held (stale) values count only while fresh, and a window spans at least two updates of the slowest torque channel.
    K is proportional to the vehicle's mass. To use it, set ``calibration.drive_torque_gain`` of every wheel to K.

    Raises
    ------
    InputError: fewer than 20 windows of driving, or too little pull, acceleration and slope to determine K (its 95 % interval holds 0).
    """
    logs = [without_held(r) for r in ([recordings] if isinstance(recordings, Recording) else recordings)]
    table = windows(logs, vehicle, _window_length(logs))
    used = _usable(table, vehicle)
    if used.sum() < _LEAST:
        raise InputError(
            f"{int(used.sum())} windows of driving are too few to identify the torque scale, {_LEAST} are needed",
            file=logs[0].source,
            hint="use a longer log",
        )
    table = table.select(used)
    rows = _balance(table, vehicle)
    scale, residual, weight = _fit(rows)
    if scale == 0:
        raise InputError(
            "the torques are the same whatever the pull",
            file=logs[0].source,
            hint="map columns that measure them: one value throughout does not",
        )
    if not np.isfinite(scale):
        raise InputError(
            "pull, acceleration and slope do not vary, so that nothing determines the torque scale",
            file=logs[0].source,
            hint="use a log with starts, stops, slopes or a towed load",
        )
    by_soil = _by_stretches(table, rows, scale)
    error = float(np.hypot(_jackknife(rows, weight), by_soil))
    considered = np.hypot(
        _SLIP_RESISTANCE * vehicle.mass * GRAVITY * _partial_slope(rows.slip, rows, weight),
        np.hypot(_drawbar_gain(table, vehicle), _unseen_slope(vehicle, rows, weight, residual)),
    )
    sentence = "torques over radius against drawbar force and mass times acceleration and slope; proportional to the vehicle file's mass"
    by_grade = _with_grade(vehicle, rows, weight)
    if by_grade > max(error / scale, considered):
        sentence += "; a resistance that varies with the grade would look the same: pull changing loads on level ground"
    if by_soil > 0.1 * scale:
        sentence += f"; soils of unlike resistance would look the same: {_LABEL}"
    by_slopes = 0.0 if np.isfinite(table.acceleration).all() else _OF_SLOPES
    std = float(np.hypot(error, scale * np.hypot(considered, np.hypot(by_grade, by_slopes))))
    if not NORMAL_95 * std <= abs(scale):
        problem = f"the torque scale is known to {NORMAL_95 * std / abs(scale):.0%} only: an interval that includes 0 determines nothing"
        hint = "pull changing loads on level ground, or give pitch or acceleration_x"
        if by_soil > std / 2:
            problem, hint = f"{problem} (soils of unlike resistance would look the same)", _LABEL
        raise InputError(problem, file=logs[0].source, hint=hint)
    sources = [log.source or f"recording {k + 1}" for k, log in enumerate(logs)]
    rests_on = evidence(table, slice(None), sources)
    return Quantity("drive_torque_scale", float(scale), std, "1", rests_on, sentence)


def _fit(rows: _Balance) -> tuple[float, Floats, Floats]:
    """K and the residual as of `_slope`, and the weights, by iterated weighting."""
    weight = np.ones(len(rows.thrust))
    for _ in range(30):
        scale, residual = _slope(rows, weight)
        if not np.isfinite(scale):
            break
        robust = 1.4826 * float(np.median(np.abs(residual)))
        weight = np.minimum(1.0, _HUBER * max(robust, 1e-12) / np.maximum(np.abs(residual), 1e-12))
    return scale, residual, weight


def _by_stretches(table: Windows, rows: _Balance, scale: float) -> float:
    """How far ``scale`` is from that with a resistance for each short stretch of a log, where no label says which soil it is; else 0."""
    if any(table.soil):
        return 0.0
    return abs(_fit(replace(rows, stretch=np.arange(len(rows.thrust)) // _STRETCH))[0] - scale)


def _with_grade(vehicle: Vehicle, rows: _Balance, weight: Floats) -> float:
    """Relative SD of K by a resistance that varies with the grade."""
    climb = _centered(rows.climb[:, None], rows, weight)[:, 0]
    size = float(np.sqrt(np.mean(weight * climb**2)))
    if not size:
        return 0.0
    return _GROUND_WITH_GRADE * vehicle.mass * GRAVITY / size * abs(_partial_slope(rows.climb, rows, weight))


def _window_length(logs: Sequence[Recording]) -> float:
    """At least two updates of the slowest torque channel [s]."""
    longest = 0.0
    for log in logs:
        for name, values in log.channels.items():
            if name.startswith("drive_torque_") and np.isfinite(values).sum() > 1:
                longest = max(longest, float(np.median(np.diff(log.time[np.isfinite(values)]))))
    return max(_SHORTEST, _HOLDS * longest)


def _usable(table: Windows, vehicle: Vehicle) -> Bools:
    """Windows in which everything was measured and all wheels and the vehicle go one way."""
    way = np.sign(table.ground_speed)[:, None]
    moving = np.abs(table.ground_speed) > _SLOWEST
    together = np.all(table.wheel_speed * vehicle.wheel_radius * way > _SLOWEST, axis=1)
    known = np.isfinite(table.push + table.drawbar) & np.all(
        np.isfinite(table.torque + table.load + table.wheel_acceleration + table.hub_speed), axis=1
    )
    whole = table.count > 0.5 * np.median(table.count[table.count > 0])
    turning = np.where(together[:, None], table.wheel_speed, np.nan)
    slips = slip(turning, table.hub_speed, vehicle.wheel_radius, standstill_speed=0.0)
    with np.errstate(invalid="ignore"):
        usual = np.abs(slips.mean(axis=1)) < _MOST_SLIP
    return moving & together & known & whole & usual & ~turns_unseen(table, vehicle)


def _balance(table: Windows, vehicle: Vehicle) -> _Balance:
    radius, way = vehicle.wheel_radius, np.sign(table.ground_speed)
    thrust = np.sum(table.torque / radius, axis=1)
    inertia = np.sum(vehicle.wheel_inertia * table.wheel_acceleration / radius, axis=1)
    rolling = vehicle.tire_rolling_resistance * table.load * way[:, None]
    losses = inertia + np.sum(rolling + vehicle.wheel_bearing * table.wheel_speed, axis=1)
    kinematic = table.kinematic_push
    measured = np.isfinite(table.acceleration) & np.isfinite(table.pitch) & np.isfinite(kinematic)
    first = table.drawbar + vehicle.mass * table.push
    other = np.where(measured, table.drawbar + vehicle.mass * kinematic, first)
    groups = np.unique(
        np.array([f"{r}/{s}/{d:.0f}" for r, s, d in zip(table.recording, table.soil, way, strict=True)]),
        return_inverse=True,
    )[1]
    nuisance = (groups[:, None] == np.arange(groups.max() + 1)).astype(float)
    turn = np.abs(np.ptp(table.hub_speed, axis=1)) / np.abs(table.ground_speed)
    if np.ptp(turn) > 0:
        nuisance = np.column_stack([nuisance, turn * way])
    slips = slip(table.wheel_speed, table.hub_speed, radius, standstill_speed=0.0)
    known = bool(np.isfinite(table.pitch).mean() > 0.5 or np.isfinite(table.acceleration).mean() > 0.5)
    inclined = GRAVITY * np.sin(table.pitch)
    inclined = np.where(np.isfinite(inclined), inclined, table.push - kinematic)
    climb = vehicle.mass * np.where(np.isfinite(inclined), inclined, 0.0)
    return _Balance(thrust, losses, first, other, nuisance, np.mean(slips, axis=1) * way, known, climb)


def _centered(values: Floats, rows: _Balance, weight: Floats) -> Floats:
    """Values (n, k) less their weighted regression on the nuisance terms."""
    nuisance = rows.nuisance
    if (
        rows.stretch is not None
    ):  # less their means: the same as a term for each, of which a day has thousands
        values, nuisance = (_within(part, rows.stretch, weight) for part in (values, nuisance))
        nuisance = np.where(np.abs(nuisance) < _ROUNDING, 0.0, nuisance)
    root = np.sqrt(weight)[:, None]
    fit = np.linalg.lstsq(nuisance * root, values * root, rcond=None)[0]
    return values - nuisance @ fit


def _within(values: Floats, stretch: Ints, weight: Floats) -> Floats:
    """Values (n, k) less their weighted mean over their stretch."""
    sums = np.column_stack([np.bincount(stretch, weight * column) for column in values.T])
    return values - (sums / np.bincount(stretch, weight)[:, None])[stretch]


def _slope(rows: _Balance, weight: Floats) -> tuple[float, Floats]:
    """K, by the covariance of the two measures of Y, and the residual X - K (Y + losses) (n,), nuisance terms removed."""
    table = np.column_stack([rows.thrust, rows.losses, rows.force, rows.other])
    x, losses, y1, y2 = _centered(table, rows, weight).T
    instrument = (y1 + y2) / 2
    # X = K (Y + losses): the losses are known, so they are added to Y in the denominator.
    below = float(np.mean(weight * (y1 * y2 + losses * instrument)))
    scale = float(np.mean(weight * x * instrument)) / below if below else np.nan
    return scale, x - scale * (instrument + losses)


def _jackknife(rows: _Balance, weight: Floats) -> float:
    """Standard error of K, leaving out one stretch of windows at a time."""
    n = len(weight)
    count = min(_BLOCKS, n // 2)
    block = np.arange(n) * count // n
    without = [_slope(rows, np.where(block == b, 0.0, weight))[0] for b in range(count)]
    return float(np.sqrt((count - 1) * np.var(without)))


def _partial_slope(values: Floats, rows: _Balance, weight: Floats) -> float:
    """Slope of values (n,) over Y, nuisance terms removed."""
    value, y1, y2 = _centered(np.column_stack([values, rows.force, rows.other]), rows, weight).T
    return float(np.sum(weight * value * (y1 + y2) / 2) / np.sum(weight * y1 * y2))


def _unseen_slope(vehicle: Vehicle, rows: _Balance, weight: Floats, residual: Floats) -> float:
    """Relative SD of K by a slope that neither pitch nor accelerometer measures: of what the vehicle states, or of what the balance leaves,
    since on hills that is mostly slope.
    """
    slope_std = vehicle.uncertainty.assumed("slope")
    if rows.slope_known or slope_std == 0.0:
        return 0.0
    slope = vehicle.mass * GRAVITY * slope_std
    slope = max(slope, float(np.sqrt(np.mean(weight * residual**2))))
    force = _centered(rows.force[:, None], rows, weight)[:, 0]
    return _WITH_PUSH * slope / max(float(np.sqrt(np.mean(weight * force**2))), 1e-12)


def _drawbar_gain(table: Windows, vehicle: Vehicle) -> float:
    return vehicle.uncertainty.assumed("drawbar_gain") if np.any(table.drawbar) else 0.0
