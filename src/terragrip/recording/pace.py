"""A clock in another unit, and a ground speed that is the wheels' own: what speeds show of both; sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.physics.geodesy import metres_of
from terragrip.recording.columns import SPREADSHEET_1970
from terragrip.recording.held import measured_part
from terragrip.recording.lag import Lag, lag_within
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import speed_names
from terragrip.recording.stretches import gaps
from terragrip.recording.turns import filled_channel
from terragrip.units import factor_to

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

GRIP = 15.0  # m/s²: no tyre or track on the ground gives as much
_FASTEST = 150.0  # m/s: no vehicle on ground, as in proposals
_LAGS = (4, 16, 64)  # rows over which a speed changes
_OFTEN = 0.99  # of the changes are slower (right logs: by 2.5 m/s² at most, comma2k19's car among them)
_ENOUGH = 4000  # rows that are examined
_OUTRUN = 3.0  # the positions' spread over the way driven
_SPREAD = 20.0  # m
_LONGER = ("min", "h", "d")

_PART = 1200.0  # s of the log at most, in which the speeds' lag counts as one
# s, and standard errors, by which the last part's lag differs from the first one's.
_DRIFT, _CERTAIN = 0.2, 4.0
_EVENLY = 0.25  # of that difference: how far the middle part's lag is from the mean of both

_SHARED, _COPY = 1e-3, 2e-4  # of the speed: noise of the ground speed, and how nearly the wheels have it too
_DRIVEN = 0.1  # of the greatest speed: more is motion


def clock_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where the speeds of ground and rims both change faster than any ground can make them, or where the positions lie
    further apart than ground and rims drove in the time of the log."""
    ground, rims = recording.channels.get("ground_speed"), _rims(recording, vehicle)
    if ground is None or not rims or len(recording) < 2 * _LAGS[-1]:
        return []
    time, speed = recording.time, filled_channel(recording, "ground_speed")
    changes = _changes(time, speed, rims)
    if changes > GRIP:
        fastest = quantile(np.abs(speed[np.isfinite(speed)]), _OFTEN)
        cause = (
            f"they reach {fastest:.3g} m/s: give the units of both in a profile, as 'ground_speed: {{from: ..., unit: mm/s}}'"
            if fastest > _FASTEST
            else _clock(changes / GRIP, time)
        )
        return [
            f"ground and wheels change their speed by {changes:.3g} m/s², more than any ground allows: {cause}."
        ]
    rows = _longest_stretch(time)  # while the logger was off, a machine may be carried away
    some = rows[:: max(1, len(rows) // _ENOUGH)]
    # Where either has gaps, the other has values.
    way = max(_way(time[some], speed[some]), _way(time[some], _mean(rims, some)))
    spread = _spread(recording, rows)
    if spread > max(_SPREAD, _OUTRUN * way):
        clock = _clock(spread / max(_OUTRUN * way, 1e-9), time)
        return [
            f"The positions lie {spread:.4g} m apart, where ground and wheels drove {way:.4g} m: {clock}."
        ]
    return []


def _clock(factor: float, time: Floats) -> str:
    """What to write where time runs too fast by ``factor`` at least: the shortest unit that explains it, of a date's number a day."""
    shortest = next((unit for unit in _LONGER if factor_to(unit, "s") >= factor), _LONGER[-1])
    unit = "d" if time[0] > SPREADSHEET_1970 and time[-1] < time[0] + 1 else shortest
    return f"time may not be in seconds: give its unit in a profile, 'time: {{from: ..., unit: {unit}}}'"


def drift_warnings(recording: Recording) -> list[str]:
    """A sentence where the ground speed falls ever further behind its wheels, or they behind it: two loggers' clocks in one file."""
    time, channels = recording.time, recording.channels
    if "ground_speed" not in channels or not np.all(np.diff(time) > 0):
        return []
    third = (time[-1] - time[0]) / 3

    def lag_of(part: int) -> Lag | None:
        edges = time[0] + part * third + np.array([0.0, min(third, _PART)])
        rows = slice(*np.searchsorted(time, edges))
        return lag_within(time[rows], {name: channels[name][rows] for name in speed_names(channels)})

    def is_grown(*lags: Lag) -> bool:
        return abs(grown) >= max(_DRIFT, _CERTAIN * error + max(lag.explained[1] for lag in lags))

    if (first := lag_of(0)) is None or (last := lag_of(2)) is None:
        return []
    grown, error = last.seconds - first.seconds, float(np.hypot(first.std, last.std))
    if not is_grown(first, last) or (middle := lag_of(1)) is None or not is_grown(first, middle, last):
        return []
    if abs(middle.seconds - (first.seconds + last.seconds) / 2) > _EVENLY * abs(grown):
        return []
    return [
        f"ground_speed is {first.seconds:.2f} s behind the wheel speeds in the first third of the log, {middle.seconds:.2f} s in the "
        f"second and {last.seconds:.2f} s in the last: its clock and theirs drift apart by {abs(grown) / (2 * third):.2%}. Stamp both by "
        f"one clock, or divide the time of the ground speed by {1 + grown / (2 * third):.5f} before joining them."
    ]


def odometry_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence where the ground speed is made of the driven wheels' speeds: slip is then 0 by construction."""
    ground = recording.channels.get("ground_speed")
    columns = [recording.channels.get(f"wheel_speed_{w}") for w in vehicle.driven_wheels]
    known = [c for c in columns if c is not None]
    if ground is None or not known or len(known) < len(columns):
        return []
    if not is_odometry(recording.time, ground, np.array(known)):
        return []
    return [
        "ground_speed is made of the wheels' speeds (odometry): slip from it is not a measurement. Give a speed over "
        "ground: from a receiver, a radar, or positions ('derivative_of')."
    ]


def is_odometry(time: Floats, ground: Floats, wheels: Floats) -> bool:
    """Whether a ground speed (n,) at ``time`` (n,) [s] is a sum of ``wheels`` (wheels, n), each times a number, its noise included."""
    rows = np.flatnonzero(np.isfinite(ground) & np.isfinite(wheels).all(axis=0))
    rows = rows[:: max(1, len(rows) // _ENOUGH)]
    speed, turning = ground[rows], wheels[:, rows].T
    moving = np.abs(speed) > _DRIVEN * float(np.max(np.abs(speed), initial=0.0))
    if moving.sum() < 20 * len(wheels) or not np.ptp(speed[moving]):
        return False
    speed, turning = speed[moving], turning[moving]
    size = float(np.sqrt(np.mean(speed**2)))
    rest = speed - turning @ np.linalg.lstsq(turning, speed, rcond=None)[0]
    if float(np.sqrt(np.mean(rest**2))) > _COPY * size:
        return False
    # last, since it needs a fifth of an estimate's time
    return (white_noise(*measured_part(time, ground)) or 0.0) >= _SHARED * size


def _rims(recording: Recording, vehicle: Vehicle) -> list[tuple[float, Floats]]:
    """Radius and speed (n,) [rad/s] of the wheels that have one."""
    named = [(radius, f"wheel_speed_{wheel}") for wheel, radius in vehicle.radii.items()]
    filled_up = [
        (radius, filled_channel(recording, name)) for radius, name in named if name in recording.channels
    ]
    return [(radius, values) for radius, values in filled_up if np.isfinite(values[:1]).all()]


def _mean(rims: list[tuple[float, Floats]], rows: Ints) -> Floats:
    """The rims' mean speed [m/s] in ``rows`` (m,)."""
    return np.asarray(np.mean([radius * values[rows] for radius, values in rims], axis=0))


def _changes(time: Floats, speed: Floats, rims: list[tuple[float, Floats]]) -> float:
    """How fast both speeds (n,) change at once [m/s²], beyond the scatter of the calmer one from row to row."""
    most = scatter = 0.0
    rows = np.arange(0, len(time) - _LAGS[-1], max(1, len(time) // _ENOUGH))
    before = _mean(rims, rows)
    for lag in (1, *_LAGS):
        a, b = speed[rows + lag] - speed[rows], _mean(rims, rows + lag) - before
        both = np.minimum(np.abs(a), np.abs(b))
        if lag == 1:
            scatter = 3 * median(both)
            continue
        elapsed = median(time[rows + lag] - time[rows])
        fast = quantile(np.where(a * b > 0, both, 0.0), _OFTEN)
        most = max(most, (fast - scatter) / elapsed)
    return most


def _longest_stretch(time: Floats) -> Ints:
    """The rows of the longest run of rows at ``time`` (n,) without a gap."""
    cuts = np.r_[0, np.flatnonzero(gaps(time)) + 1, len(time)]
    k = int(np.argmax(np.diff(cuts)))
    return np.arange(cuts[k], cuts[k + 1])


def _way(time: Floats, speed: Floats) -> float:
    return float(np.sum(np.abs(speed[1:] + speed[:-1]) * np.diff(time)) / 2)


def _spread(recording: Recording, rows: Ints) -> float:
    """Between how far north and south, or east and west, 90 % of the positions between the first and last of ``rows`` lie [m]; 0 without
    positions."""
    channels = recording.channels
    if "latitude" not in channels or "longitude" not in channels:
        return 0.0
    known = np.isfinite(channels["latitude"]) & np.isfinite(channels["longitude"])
    known = rows[0] + np.flatnonzero(known[rows[0] : rows[-1] + 1])
    if len(known) < 2:
        return 0.0
    some = known[:: max(1, len(known) // _ENOUGH)]
    places = metres_of(channels["latitude"][some], channels["longitude"][some])
    return max(float(np.subtract(*np.quantile(x, [0.95, 0.05]))) for x in places)
