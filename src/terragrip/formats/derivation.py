"""Channels that a log holds only indirectly: a speed from positions, a torque from power, a pitch from a quaternion."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import fresh_samples, held_period, quantum
from terragrip.recording.noise import MAD_TO_SD

_FEWEST = 4  # points for a parabola with one to spare
_ROUNDS = 3  # of reweighting, after which outlying positions no longer move
_WIDEST = 100  # samples to either side of a window
_FAR = 0.3  # of the longest way in a window: shorter ones show no direction
_FILLED = 0.9  # of a counter's range: one that overflows has been near both of its ends
_LEAP = 0.75  # of it: shorter leaps are counts that went by in a gap
_BLOCK = 20_000  # instants at once, to bound memory


def fresh_positions(time: Floats, positions: list[Floats]) -> Bools:
    """Rows (n,) where a position was truly measured: all of them, unless the coordinates are held."""
    fresh = np.all([np.isfinite(p) for p in positions], axis=0)
    held = [(p, held_period(time, p)) for p in positions]
    if any(period is not None for _, period in held):
        # A pose is one measurement: whichever coordinate moved shows it.
        moved = [fresh_samples(time, p, period) for p, period in held if period is not None]
        fresh &= np.any(moved, axis=0)
    return fresh


def unrolled(angle: Floats, turn: float | None) -> Floats:
    """An angle (n,) that begins anew after each ``turn``, as a heading does, or a count that does so at a power of two, as a counter of so
    many bits does, without these steps; others as they are."""
    span = float(np.ptp(angle)) if len(angle) else 0.0
    if turn is not None and span <= 1.001 * turn:
        return np.unwrap(angle, period=turn)
    register = 2.0 ** np.ceil(np.log2(span + 1.0))
    steps = np.abs(np.diff(angle))
    if span < _FILLED * register or not np.any(steps > _LEAP * register) or np.any(angle != np.round(angle)):
        return angle
    return np.unwrap(angle, discont=_LEAP * register, period=register)


def quotient(time: Floats, dividend: Floats, divisor: Floats, least: float) -> Floats:
    """Dividend over divisor (n,), NaN where the divisor's size is under ``least``.

    A held dividend counts at its updates only: over a divisor that goes on changing it would look fresh.
    """
    period = held_period(time, dividend)
    known = np.abs(divisor) >= least
    if period is not None:
        known &= fresh_samples(time, dividend, period)
    return np.divide(dividend, divisor, out=np.full(len(time), np.nan), where=known)


def derivative(
    time: Floats, position: Floats, window: float, along: Floats | None = None
) -> tuple[Floats, float | None]:
    """Time derivative (n,) of a position (n,) at its own instants, or of positions (n, d) along a direction of each instant, unit
    vectors ``along`` (n, d); and its standard deviation.

    A parabola is fitted by least squares to the samples within ``window`` [s] around each instant, five or more
    (Savitzky and Golay 1964, on the actual instants); Tukey's biweight keeps jumps of the position out. NaN
    where fewer than four samples lie within the window, or nearly all to one side (at gaps and ends).

    The deviation is a root of mean squares over rows in motion, and has two parts: white noise, by the residuals or by the
    position's resolution where that is coarser, one square counting at most nine usual ones; and what the window flattens
    (`_flattened`). The noise of a position is largest along the path, since an uncertain stamp moves a sample along it: hence ``along``.
    None if it cannot be determined.
    """
    n = len(time)
    position = position.reshape(n, -1)
    along = np.ones((n, 1)) if along is None else along
    speed, deviation, bent = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    spacing = float(np.median(np.diff(time))) if n > 1 else 0.0
    if spacing <= 0.0:
        return speed, None
    half = int(np.clip(round(0.5 * window / spacing), 2, _WIDEST))
    floor = max(quantum(values) for values in position.T) / np.sqrt(12.0)
    for first in range(0, n, _BLOCK):
        low, high = max(first - half, 0), min(first + _BLOCK + half, n)
        near = slice(low, high)
        result = _parabolas(time[near], position[near], along[near], half, (half + 0.5) * spacing, floor)
        inner = slice(first - low, min(first + _BLOCK, n) - low)
        for whole, part in zip((speed, deviation, bent), result, strict=True):
            whole[first : first + _BLOCK] = part[inner]
    judged = _moving(speed, np.isfinite(speed)) & (deviation > 0)
    if not judged.any():
        return speed, None
    square, bent = deviation[judged] ** 2, bent[judged & np.isfinite(bent)]
    noise = float(np.mean(np.minimum(square, 9.0 * np.median(square))))
    return speed, float(np.sqrt(noise + (max(float(np.mean(bent)), 0.0) if len(bent) else 0.0)))


def _parabolas(
    time: Floats, position: Floats, along: Floats, half: int, reach: float, floor: float
) -> tuple[Floats, Floats, Floats]:
    """Slope (n,) of the parabola around each sample, its standard deviation (n,), and the square of what the window flattens (n,)
    in expectation; NaN where there is none."""
    n = len(time)
    index = np.arange(n)[:, None] + np.arange(-half, half + 1)
    inside = (index >= 0) & (index < n)
    index = np.clip(index, 0, n - 1)
    u = (time[index] - time[:, None]) / reach
    inside &= np.abs(u) <= 1.0
    y = sum((p[index] - p[:, None]) * a[:, None] for p, a in zip(position.T, along.T, strict=True))
    basis = np.stack([np.ones_like(u), u, u**2], axis=2)
    enough = inside.sum(axis=1) >= _FEWEST
    weight, fit, scale = inside.astype(np.float64), np.zeros((n, 3)), floor
    for _ in range(_ROUNDS):
        fit = np.linalg.solve(
            _normal(basis, weight), np.einsum("nk,nki,nk->ni", weight, basis, y)[:, :, None]
        )[..., 0]
        residual = y - np.einsum("nki,ni->nk", basis, fit)
        judged = enough & _moving(fit[:, 1], enough)
        kept = np.abs(residual[judged][inside[judged]])
        if not len(kept):
            break
        # Three parameters were fitted to each window, which shrinks its residuals.
        shrink = np.sqrt(max(1.0 - 3.0 / float(np.median(inside[enough].sum(axis=1))), 0.2))
        scale = max(MAD_TO_SD * float(np.median(kept)) / shrink, floor)
        if scale == 0.0:
            break
        weight = inside * np.clip(1.0 - (residual / (6.0 * scale)) ** 2, 0.0, None) ** 2
        enough &= (weight > 0.05).sum(axis=1) >= _FEWEST
    spread = np.sqrt(np.linalg.inv(_normal(basis, weight + 1e-9 * inside))[:, 1, 1])
    if enough.any():  # a slope at the end of a one-sided window is worth little
        enough &= spread <= 3.0 * np.median(spread[enough])
    squares = np.einsum("nk,nk->n", weight, (y - np.einsum("nki,ni->nk", basis, fit)) ** 2)
    own = np.sqrt(squares / np.maximum(weight.sum(axis=1) - 3.0, 0.5))
    deviation = np.maximum(own, floor) * spread / reach
    bent = _flattened(u, y, weight, fit[:, 1], scale**2 * spread**2) / reach**2
    return tuple(np.where(enough, values, np.nan) for values in (fit[:, 1] / reach, deviation, bent))  # type: ignore[return-value]


def _flattened(u: Floats, y: Floats, weight: Floats, slope: Floats, variance: Floats) -> Floats:
    """The square (n,) of the slope that a parabola loses where the acceleration changes within its window, NaN where a cubic cannot
    be fitted.

    That slope is the cubic's less the parabola's. Both are of the same samples, so that noise makes the difference's variance the
    difference of theirs (least squares over nested models), which is taken off: single values may be negative, their mean is meant.
    """
    enough = (weight > 0.05).sum(axis=1) >= _FEWEST + 2
    basis = np.stack([np.ones_like(u), u, u**2, u**3], axis=2)
    normal = np.einsum("nk,nki,nkj->nij", weight, basis, basis) + 1e-12 * np.eye(4)
    cubic = np.linalg.solve(normal, np.einsum("nk,nki,nk->ni", weight, basis, y)[:, :, None])[:, 1, 0]
    own = np.linalg.inv(_normal(basis[:, :, :3], weight + 1e-9))[:, 1, 1]
    noise = variance * (np.linalg.inv(normal)[:, 1, 1] / own - 1.0)
    return np.where(enough, (cubic - slope) ** 2 - noise, np.nan)


def _moving(speed: Floats, known: Bools) -> Bools:
    """Rows (n,) in motion: at rest a tracker is quieter, and a scale found there would reject motion itself."""
    pace = np.where(known, np.abs(speed), 0.0)
    return pace >= max(0.2 * float(np.quantile(pace[known], 0.95)), 1e-12) if known.any() else known


def _normal(basis: Floats, weight: Floats) -> Floats:
    """Normal matrices (n, 3, 3); the ridge only serves windows that are too empty to count."""
    return np.einsum("nk,nki,nkj->nij", weight, basis, basis) + 1e-12 * np.eye(3)


def beside_heading(time: Floats, position: Floats, heading: Floats, window: float) -> tuple[float, float]:
    """The angle [rad] by which positions (n, 2) go beside a heading (n,) [rad, from the first axis to the second], over ``window`` [s],
    forward and backward alike; and how much they keep to it, 0 to 1: 0 where nothing moves."""
    spacing = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    step = max(1, round(window / spacing)) if spacing > 0 else len(time)
    chord = (position[step:] - position[:-step]) @ np.array([1.0, 1.0j])
    middle, size = heading[step // 2 :][: len(chord)], np.abs(chord)
    known = np.isfinite(middle)
    known &= size > (_FAR * np.quantile(size[known], 0.95) if known.any() else 0.0)
    if not known.any():
        return 0.0, 0.0
    mean = np.mean((chord[known] / size[known]) ** 2 * np.exp(-2j * middle[known]))
    return float(np.angle(mean)) / 2, float(np.abs(mean))


def yaw_of(quaternion: list[Floats]) -> Floats:
    """Yaw [rad] (n,), left positive, of quaternions x, y, z, w (n,)."""
    x, y, z, w = quaternion
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def pitch_of(quaternion: list[Floats]) -> Floats:
    """Pitch [rad] (n,), nose up positive, of quaternions x, y, z, w (n,) in axes forward, left, up.

    A turn about the left axis lowers the nose, hence the sign.
    """
    x, y, z, w = quaternion
    return -np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))


def roll_of(quaternion: list[Floats]) -> Floats:
    """Roll [rad] (n,), right side down positive, of quaternions x, y, z, w (n,) in axes forward, left, up."""
    x, y, z, w = quaternion
    return np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
