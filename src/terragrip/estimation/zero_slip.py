"""The radius at which wheels would not slip, from speeds alone: ground speed over wheel speed where the load is least.

Speeds tell slip only against a condition that is called zero (ASABE S296: "zero condition"). A pass without load on firm
ground is one; in a log of work, the stretches where the wheels run least ahead of the ground come nearest. (R), our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.recording import Recording
from terragrip.recording.held import held_periods, without_held

Floats = npt.NDArray[np.float64]

WINDOW = 2.0
"""Length [s] of the windows that speeds are averaged over."""

_SLOWEST = 0.3  # m/s
_STEADY = 0.3  # m/s², of the change between the halves of a window
_TURNING = 0.05  # rad/s
_LIGHTEST = 0.9  # quantile of ground over wheel speed
_AT_QUANTILE = 1.2815515655446004  # of a standard normal distribution
_FEWEST = 15  # windows
_BLOCK = 5  # neighbouring windows that count as one
_DRAWS = 200


@dataclass(frozen=True)
class Ratio:
    """``value``: ground speed over supposed rim speed at zero slip; its SD; how many ``windows`` it rests on."""

    value: float
    std: float
    windows: int


def ratios(recording: Recording, channel: str, radius: float) -> tuple[Floats, float]:
    """Ground speed over rim speed in windows of steady straight motion (n,), and the SD that noise gives one of them.

    ``channel`` times ``radius`` is the rim speed. The windows' noise is told by the halves of each.
    """
    log = without_held(recording, held_periods(recording))
    time = log.time
    edges = np.arange(time[0], time[-1], WINDOW / 2)
    if len(edges) < 4:
        return np.empty(0), 0.0
    ground, rim = _halves(log, "ground_speed", edges), radius * _halves(log, channel, edges)
    turn = _halves(log, "angular_velocity_z", edges)
    with np.errstate(invalid="ignore", divide="ignore"):
        straight = ~(np.abs(turn) > _TURNING)
        moving = (np.abs(ground) > _SLOWEST) & (np.abs(rim) > _SLOWEST) & (ground * rim > 0) & straight
        ratio = ground / rim
    count = len(ratio) // 2
    first, second = slice(0, 2 * count, 2), slice(1, 2 * count, 2)
    used = moving[first] & moving[second]
    for speed in (ground, rim):
        used &= np.abs(speed[second] - speed[first]) < _STEADY * WINDOW / 2
    pairs = np.stack([ratio[first][used], ratio[second][used]])
    if not pairs.size:
        return np.empty(0), 0.0
    apart = 1.4826 * float(
        np.median(np.abs(pairs[1] - pairs[0]))
    )  # of two halves: √2 their own, twice the window's
    return pairs.mean(axis=0), apart / 2


def lightest(found: Floats, noise: float) -> Ratio | None:
    """The ratio of the tenth of windows (n,) where it is largest, without what noise adds there; None if there are few.

    The quantile of noisy ratios lies above that of true ones by up to noise times the normal quantile, which is taken
    off. The SD is that over draws of blocks of windows, with half of what was taken off.
    """
    if len(found) < _FEWEST:
        return None
    excess = noise * _AT_QUANTILE

    def value(ratios: Floats) -> float:
        spread = float(np.std(ratios))
        # Noise adds to the spread in squares, so to the quantile less than by itself.
        share = noise / spread if spread > noise else 1.0
        return float(np.quantile(ratios, _LIGHTEST)) - excess * share

    return Ratio(value(found), float(np.hypot(_over_blocks(found, value), 0.5 * excess)), len(found))


def average(found: Floats) -> Ratio | None:
    """The median ratio of windows (n,) of which none was under load; None if there are few."""
    if len(found) < _FEWEST:
        return None
    return Ratio(float(np.median(found)), _over_blocks(found, lambda x: float(np.median(x))), len(found))


def _over_blocks(found: Floats, value: object) -> float:
    """SD of a statistic over draws of blocks of neighbouring windows."""
    assert callable(value)
    draws = np.random.default_rng(0)
    starts = np.arange(0, len(found), _BLOCK)
    blocks = [found[s : s + _BLOCK] for s in starts]
    values = [
        value(np.concatenate([blocks[k] for k in draws.integers(0, len(blocks), len(blocks))]))
        for _ in range(_DRAWS)
    ]
    return float(np.std(values))


def _halves(log: Recording, name: str, edges: Floats) -> Floats:
    """Means of a channel between edges (n,); NaN where nothing was measured."""
    if name not in log.channels:
        return np.full(len(edges) - 1, np.nan)
    values = log.channels[name]
    known = np.isfinite(values)
    place = np.searchsorted(edges, log.time[known], side="right") - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    count = np.bincount(place[inside], minlength=len(edges) - 1)
    total = np.bincount(place[inside], values[known][inside], minlength=len(edges) - 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
