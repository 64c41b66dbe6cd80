"""Speeds of wheels, drive train and positions against the ground speed: sentences for the user, never errors.

They are compared where both are well above standstill, by the median of their ratio. Positions are in degrees and nothing else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import known_part
from terragrip.recording.ranks import median, quantile
from terragrip.recording.rolling import RATIOS
from terragrip.recording.track import Track
from terragrip.recording.turns import filled, filled_channel, straight_rows
from terragrip.recording.window_means import windows_of

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

# Ratio of wheel speed times radius to ground speed, and its cause; slip raises it by 1/(1 - slip).
_RATIOS = (
    (3.6, "wheel_speed may come from km/h, or ground_speed may be 3.6 times too small"),
    (9.5493, "wheel_speed may be in rpm: 1 rpm is 0.1047 rad/s"),
    (57.296, "wheel_speed may be in deg/s: 1 deg/s is 0.01745 rad/s"),
    (1 / 3.6, "ground_speed may be in km/h: 1 km/h is 0.2778 m/s"),
    (0.51444, "ground_speed may be in knots: 1 kn is 0.5144 m/s"),
    (0.44704, "ground_speed may be in miles an hour: 1 mph is 0.447 m/s"),
    (0.10472, "wheel_speed may have been converted from rpm twice, or ground_speed is 9.55 times too fast"),
    (0.15915, "wheel_speed may be in revolutions per second: 1 rev/s is 6.283 rad/s"),
    (0.017453, "wheel_speed may have been converted from degrees to radians twice"),
    (1e-2, "ground_speed may be in cm/s"),
    (1e-3, "ground_speed may be in mm/s"),
    (1e3, "wheel_speed or ground_speed may be off by a factor of 1000"),
)
_SLIP = 0.08  # of the rims: how far it may move a ratio from that of its reason
_ENOUGH = 4000  # rows: enough to distinguish medians that differ by a third
_APART = 1.2  # of the rims of driven wheels: front wheels lead by 5 % at most, radii are known to 10 %
_ONE = 1.15  # quartiles of one ratio
_GAP = 1.0  # s, or three samples: nothing was measured within it
_OUTRUN = 1.5  # straight line over distance driven: above, that distance is too short
_TOO_SLOW, _LONG_WAY = 1.03, 20.0  # the same, over windows of so many metres,
# of which at least so many go straight: else it is surely no more than this share less
_FEW, _VAGUE = 10, 1.117
_STRAIGHT = 1.01  # both halves of a window over all of it
_TOO_FAST = 1.3  # ground speed over the positions' speed, which noise can only increase
_WAY_WINDOW = 10.0  # s


def rim_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Wheel speeds that are likely not in rad/s, or radii that are wrong, by the ground speed."""
    if _stands(recording, max(vehicle.wheel_radius)):
        return []
    straight = straight_rows(recording, vehicle)
    ratios = {}
    for wheel, radius in vehicle.radii.items():
        turning = recording.channels.get(f"wheel_speed_{wheel}")
        ratio = None if turning is None else ratio_of(recording, radius * np.where(straight, turning, np.nan))
        if ratio is not None:
            ratios[wheel] = ratio
    return _units_off(vehicle, ratios) or _axles_off(recording, vehicle, ratios, straight)


def _units_off(vehicle: Vehicle, ratios: dict[str, float]) -> list[str]:
    """Sentences on the wheels whose ``ratios`` of rim to ground speed no slip explains, those of one cause together."""
    radii: dict[str, float | None] = dict(vehicle.radii)
    if len(ratios) > 1 and max(ratios.values()) < np.sqrt(_APART) * min(ratios.values()):
        # one factor is of one cause, and of wheels of unlike radii none of the radii
        unlike = max(vehicle.wheel_radius) > _APART * min(vehicle.wheel_radius)
        radii = dict.fromkeys(radii, None if unlike else float(np.mean(vehicle.wheel_radius)))
        ratios = dict.fromkeys(ratios, median(np.array(list(ratios.values()))))
    result: dict[str, list[tuple[str, float]]] = {}
    for wheel, ratio in ratios.items():
        if not RATIOS[0] <= ratio <= RATIOS[1]:
            result.setdefault(_cause(ratio, radii[wheel]), []).append((wheel, ratio))
    return [
        f"The wheel speed of {', '.join(wheel for wheel, _ in those)} times the radius is "
        f"{np.median([ratio for _, ratio in those]):.3g} times the ground speed: {why}."
        for why, those in result.items()
    ]


def _cause(ratio: float, radius: float | None) -> str:
    """The cause nearest to a ratio, and with it those that the slip, which is unknown, leaves as likely."""
    reasons = list(_RATIOS)
    if radius is not None:
        reasons.append((radius, "wheel_speed may be the rim's speed in m/s: divide it by the radius"))
        reasons.append((3.6 * radius, "wheel_speed may be the rim's speed in km/h"))
    near = sorted((abs(np.log(ratio / (1.08 * r))), text) for r, text in reasons)
    nearest = near[0][0]
    if nearest > np.log(1.35):
        return "check units, gear ratio and radius"
    return ", or ".join(text for distance, text in near if distance < nearest + _SLIP)


def _axles_off(
    recording: Recording, vehicle: Vehicle, ratios: dict[str, float], straight: Bools
) -> list[str]:
    """A sentence on the two driven axles whose rims go at speeds furthest apart, where their ratio stays one."""
    mean = {
        name: float(np.exp(np.mean([np.log(ratios[w]) for w in axle.wheels])))  # of both sides: turns cancel
        for name, axle in vehicle.axles.items()
        if axle.driven and all(w in ratios for w in axle.wheels)
    }
    if not mean or max(mean.values()) <= _APART * min(mean.values()):
        return []
    fast, slow = (pick(mean, key=lambda name: mean[name]) for pick in (max, min))
    if not _is_one_ratio(recording, vehicle, fast, slow, straight):
        return []
    return [
        f"The rims of the axle {fast} go {mean[fast] / mean[slow]:.2f} times as fast as those of {slow}, both driven: check their "
        "radii, and the wheel of each column."
    ]


def _is_one_ratio(recording: Recording, vehicle: Vehicle, fast: str, slow: str, rows: Bools) -> bool:
    """Whether the rims of two axles keep one ratio in ``rows`` (n,), as exchanged radii make: where one spins they do not."""
    rims = []
    for name in (fast, slow):
        own = [recording.channels[f"wheel_speed_{w}"] for w in vehicle.axles[name].wheels]
        rims.append(np.mean([filled(recording.time, np.abs(values)) for values in own], axis=0))
    moving = rows & (rims[0] > 0.3 * quantile(rims[0], 0.95)) & (rims[1] > 0)
    if not moving.any():
        return False
    low, high = (quantile(rims[0][moving] / rims[1][moving], share) for share in (0.25, 0.75))
    return high < _ONE * low


def _stands(recording: Recording, radius: float) -> bool:
    """Whether the ground speed brings the vehicle nowhere, by a turn of a wheel: dug in, its ratio to the rims is that of noise."""
    when, what = known_part(recording.time, recording.channels.get("ground_speed", np.empty(0)))
    return len(what) > 1 and float(np.ptp(np.cumsum(what[1:] * np.diff(when)))) < 2 * np.pi * radius


def drive_train_warnings(recording: Recording) -> list[str]:
    """The drive train's speed against the ground speed: both are in m/s, so a radius cannot cause a factor of 3.6."""
    turning = recording.channels.get("wheel_based_speed")
    ratio = None if turning is None else ratio_of(recording, turning)
    if ratio is None or RATIOS[0] <= ratio <= RATIOS[1]:
        return []
    high, low = "wheel_based_speed", "ground_speed"
    if ratio < 1:
        high, low = low, high
    apart = max(ratio, 1 / ratio)
    why = (
        f"{high} may be in km/h, or {low} was converted from km/h and is in m/s"
        if 2.5 < apart < 5.5
        else "check units"
    )
    return [f"wheel_based_speed is {ratio:.3g} times the ground speed: {why}."]


def ratio_of(recording: Recording, other: Floats) -> float | None:
    """Median of |other| / |ground speed| (n,) while both move; None without enough motion, or a ground speed.

    Beyond what slips reach rows count by the square of their speed: a vehicle that digs in for most of a log drove before.
    """
    speed = recording.channels.get("ground_speed")
    pairs = None if speed is None else _pairs(recording.time, speed, other)
    if pairs is None:
        return None
    ground, rim = np.abs(pairs[0]), np.abs(pairs[1])
    moving = (
        (ground > 0.3 * quantile(ground, 0.95)) & (rim > 0.3 * quantile(rim, 0.95)) & (ground > 0) & (rim > 0)
    )
    if moving.sum() < 10:
        return None
    ratio = median(rim[moving] / ground[moving])
    if ratio <= RATIOS[1]:
        return ratio
    turning = ground > 0
    ratios = rim[turning] / ground[turning]
    order = np.argsort(ratios)
    counted = np.cumsum(ground[turning][order] ** 2)
    return float(ratios[order][np.searchsorted(counted, counted[-1] / 2)])


def _pairs(time: Floats, speed: Floats, turning: Floats) -> tuple[Floats, Floats] | None:
    """About `_ENOUGH` pairs of ground speed and wheel speed at one time; None where either has fewer than two values."""
    few = slice(None, None, max(1, len(time) // _ENOUGH))
    if np.isfinite(speed[few]).all() and np.isfinite(turning[few]).all() and len(time) > 1:
        return speed[few], turning[few]
    known, rows = np.flatnonzero(np.isfinite(speed)), np.flatnonzero(np.isfinite(turning))
    if len(known) < 2 or len(rows) < 2:
        return None
    after = np.clip(np.searchsorted(known, rows), 1, len(known) - 1)
    rows = rows[time[known[after]] - time[known[after - 1]] < max(_GAP, 3 * median(np.diff(time[known])))]
    if not len(rows):
        return None
    rows = rows[:: max(1, len(rows) // _ENOUGH)]
    return np.interp(time[rows], time[known], speed[known]), turning[rows]


def position_warnings(recording: Recording, track: Track | None, *, wheels_agree: bool = False) -> list[str]:
    """A ground speed of another unit or scale than the positions'. ``wheels_agree``: the wheel speeds go with it.

    Noise of positions only adds to their speed, so a ground speed far above it is wrong whatever the noise. One far below is
    wrong only if the positions also move further in a straight line than it allows.
    """
    if track is None:
        return []
    result = ratio_of(recording, track.at("speed", recording.time))
    if result is None:
        return []
    sentence = f"ground_speed is {1 / result:.3g} times the speed of the positions"
    if 2.9 < 1 / result < 4.4:
        return [f"{sentence}: it may be in km/h: 1 km/h is 0.2778 m/s."]
    if result < 1 / _TOO_FAST:
        clock = (
            " The wheel speeds agree with it: time may not be in seconds."
            if wheels_agree and result < 1 / 3
            else ""
        )
        return [f"{sentence}: check its unit and scale.{clock}"]
    if 2.9 < result < 4.4 and _straight_ahead(recording, track)[0] > _OUTRUN:
        return [f"{sentence}: it was converted from km/h, but may be in m/s."]
    ahead, surely = _straight_ahead(recording, track, _LONG_WAY)
    if surely > _TOO_SLOW:
        return [
            f"In a straight line the positions move {ahead:.3g} times as far as ground_speed does: check its unit and scale "
            "(a knot is 1.852 km/h, a mile per hour 1.609; a radar's angle), and that latitude and longitude are not exchanged."
        ]
    return []


def _straight_ahead(recording: Recording, track: Track, least: float = 0.0) -> tuple[float, float]:
    """Distance of the positions over the distance by ground speed in the same time: median over windows in motion, of those that go
    straight where these are many; and that less three standard errors, the scatter's.

    A turn only shortens a straight line between positions. ``least`` [m]: the shortest distance of a window by ground speed, larger than
    the positions' noise.
    """
    speed = np.abs(filled_channel(recording, "ground_speed"))
    way = np.r_[0.0, np.cumsum(np.diff(recording.time) * (speed[1:] + speed[:-1]) / 2)]
    length = max(_WAY_WINDOW, least / max(quantile(speed, 0.95), 1e-9))
    edges = windows_of(track.time, length / 2)[1]
    edges = edges[: len(edges) - (len(edges) + 1) % 2]  # two halves to a window
    if len(edges) < 3:
        return 0.0, 0.0
    north, east = (np.interp(edges, track.time, x) for x in (track.north, track.east))
    chord = np.hypot(np.diff(north[::2]), np.diff(east[::2]))
    halves = np.hypot(np.diff(north), np.diff(east)).reshape(-1, 2).sum(axis=1)
    edges, made = edges[::2], np.diff(np.interp(edges[::2], recording.time, way))
    whole = np.diff(edges) < 1.1 * length  # no pause between its edges
    if not whole.any():
        return 0.0, 0.0
    moving = whole & (made > 0.3 * quantile(made[whole], 0.95))
    for when in (recording.time[np.isfinite(recording.channels["ground_speed"])], track.time):
        moving &= np.histogram(when, edges)[0] > 0.5 * length / median(np.diff(when))  # no gap
    straight = moving & (halves < _STRAIGHT * chord)
    if not moving.any():
        return 0.0, 0.0
    rows = straight if straight.sum() >= _FEW else moving
    ratio = chord[rows] / np.maximum(made[rows], 1e-9)
    middle = median(ratio)
    # 1.4826 of it is the SD, and 1.2533/√n of that the median's error.
    spread = median(np.abs(ratio - middle))
    return middle, middle - 5.6 * spread / np.sqrt(len(ratio)) if rows is straight else middle / _VAGUE
