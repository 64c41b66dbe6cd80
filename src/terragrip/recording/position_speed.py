"""The ground speed against the positions, which are in degrees and nothing else: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.ranks import median
from terragrip.recording.speed_ratios import ratio_of, top_speed
from terragrip.recording.track import Track
from terragrip.recording.turns import filled

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_OUTRUN = 1.5  # straight line over distance driven: above, that distance is too short
_TOO_SLOW, _LONG_WAY = 1.03, 20.0  # the same, over windows of so many metres,
_FEW, _VAGUE = (
    10,
    1.117,
)  # of which at least so many go straight: else it is surely no more than this share less
_STRAIGHT = 1.01  # both halves of a window over all of it
_TOO_FAST = 1.3  # ground speed over the positions' speed, which noise can only increase
_WAY_WINDOW = 10.0  # s


def position_warnings(recording: Recording, track: Track | None, *, wheels_agree: bool = False) -> list[str]:
    """A ground speed of another unit or scale than the positions'. ``wheels_agree``: the wheel speeds go with it.

    Noise of positions only adds to their speed, so a ground speed far above it is wrong whatever the noise. One far below is
    wrong only if the positions also move further in a straight line than it allows.
    """
    if track is None or "ground_speed" not in recording.channels:
        return []
    result = ratio_of(recording.time, recording.channels["ground_speed"], track.at("speed", recording.time))
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
    speed = np.abs(filled(recording.time, recording.channels["ground_speed"]))
    way = np.r_[0.0, np.cumsum(np.diff(recording.time) * (speed[1:] + speed[:-1]) / 2)]
    length = max(_WAY_WINDOW, least / max(top_speed(speed), 1e-9))
    edges = np.arange(track.time[0], track.time[-1], length / 2)
    edges = edges[: len(edges) - (len(edges) + 1) % 2]  # two halves to a window
    if len(edges) < 3:
        return 0.0, 0.0
    north, east = (np.interp(edges, track.time, x) for x in (track.north, track.east))
    chord = np.hypot(np.diff(north[::2]), np.diff(east[::2]))
    halves = np.hypot(np.diff(north), np.diff(east)).reshape(-1, 2).sum(axis=1)
    edges, made = edges[::2], np.diff(np.interp(edges[::2], recording.time, way))
    moving = made > 0.3 * top_speed(made)
    for when in (recording.time[np.isfinite(recording.channels["ground_speed"])], track.time):
        moving &= np.histogram(when, edges)[0] > 0.5 * length / median(np.diff(when))  # no gap
    straight = moving & (halves < _STRAIGHT * chord)
    if not moving.any():
        return 0.0, 0.0
    rows = straight if straight.sum() >= _FEW else moving
    ratio = chord[rows] / np.maximum(made[rows], 1e-9)
    middle = median(ratio)
    spread = median(
        np.abs(ratio - middle)
    )  # 1.4826 of it is the SD, and 1.2533/√n of that the median's error
    return middle, middle - 5.6 * spread / np.sqrt(len(ratio)) if rows is straight else middle / _VAGUE
