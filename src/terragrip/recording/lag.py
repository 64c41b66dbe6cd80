"""The lag of one record of a machine's speed behind another: the clocks of two files, or two channels of one.

A vehicle follows its wheels with a lag of its own: it accelerates by pull, and pull needs slip. With the pull coefficient rising by K per
slip, a = g K s for small slip, hence v = w (1 - v'/(g K)): the ground speed lags by v / (g K). That part of a lag is not a clock's error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats, Ints
from terragrip.recording.held import fresh_samples, held_period, known_part, measurable
from terragrip.recording.ranks import median, quantile
from terragrip.recording.stretches import without_pauses
from terragrip.units import STANDARD_GRAVITY

_STEP = 0.05  # s between the points on which speeds are compared
_BRIDGED = 1.0  # s, or three samples, between two samples
_LEAST_OVERLAP = 20.0  # s
_LEAST_SHARE = 0.3  # of the shorter record
_LEAST_CORRELATION = 0.8
_LEAST_IN_PART = 0.6  # of gains or losses of speed alone
_APART = 2.0  # s from the best offset, where another one must be worse
_WORSE = 0.02  # in correlation, or twice as far from 1 as the best, a quarter of this at least: speeds on a road hardly change in seconds
_WIDTH = 20  # points over which rates are smoothed: a second
_ROUNDS = 5
_LEAST_STD = 0.005  # s
_LONGEST = 20_000_000  # points; a record over ten days
_FEW = 1000  # samples

_CERTAIN = 2.0  # standard deviations by which an offset must exceed the explained one
_SURE = 4.0  # the same, for an automatic correction: runs without a late sensor reach 3.4 (docs/formats.md)
_SHARP = 0.03  # s, a standard deviation up to which _CERTAIN is enough for it: on ground that gives way it is larger
# K on soft soil: the slope of ASABE D497's gross traction ratio at 15 % slip, Bn = 20, is 1.85.
STIFFNESS = 2.0
_OWN_SURE = 3.0  # standard errors of what the log shows of a vehicle's own lag
_WITHIN = 5.0  # s, the largest lag searched between channels of one file
_PAUSE = 60.0  # s, or ten samples: across more nothing is compared, and three days of points took a minute
_USUAL = 0.1  # s, prior SD of a receiver's delay, before a log shows it (ours): receivers filter
_FILTERED = 0.2  # of a lag that was corrected: a filter of first order errs by 1/e of its lag where a change begins, a mere delay does not


@dataclass(frozen=True)
class Speed:
    """A record of a speed (n,) of any scale; ``pace`` [m/s] is its usual size if it is a ground speed, else None."""

    time: Floats
    values: Floats
    pace: float | None


@dataclass(frozen=True)
class Lag:
    """``seconds`` by which the second record is behind, its standard deviation, the correlation there, and the ``explained`` part."""

    seconds: float
    std: float
    correlation: float
    explained: tuple[float, float]

    @property
    def is_of_the_clock(self) -> bool:
        """Whether it is certain, and larger than a vehicle's dynamics explain."""
        least, most = self.explained
        return max(least - self.seconds, self.seconds - most) > _CERTAIN * self.std

    @property
    def is_to_correct(self) -> bool:
        """Whether it is certain enough for an automatic correction: on yielding soil a ground speed is late, too, by more
        than firm ground explains, but not always by as much.
        """
        least, most = self.explained
        enough = _CERTAIN if self.std <= _SHARP else _SURE
        return max(least - self.seconds, self.seconds - most) > enough * self.std

    @property
    def of_the_clock(self) -> float:
        """The part [s] to correct: the vehicle's own lag is anywhere within the explained one, half of it on average."""
        return self.seconds - 0.5 * sum(self.explained)

    @property
    def delay(self) -> float:
        """SD [s] of the sensor's own delay: what was found, a vehicle's own lag being anywhere within the explained one, and
        what is usual.
        """
        weight, variance = self._beside_usual
        return float(np.hypot(weight * self.of_the_clock, np.sqrt(weight * variance)))

    @property
    def delay_left(self) -> float:
        """SD [s] of the sensor's delay once `of_the_clock` is corrected: what is not known of it, and that a filter is no mere delay."""
        weight, variance = self._beside_usual
        return float(np.hypot(_FILTERED * self.of_the_clock, np.sqrt(weight * variance)))

    @property
    def _beside_usual(self) -> tuple[float, float]:
        """Weight of what was found beside what is usual, and its variance [s²]."""
        least, most = self.explained
        variance = self.std**2 + (most - least) ** 2 / 12
        return _USUAL**2 / (_USUAL**2 + variance), variance

    @property
    def why_not(self) -> str:
        """The reason not to correct any clock."""
        if abs(self.seconds) <= _CERTAIN * self.std:
            return "that is no more than twice its standard deviation"
        return f"a vehicle follows its wheels by up to {max(map(abs, self.explained)):.2f} s"


def speed_of(time: Floats, columns: Mapping[str, npt.NDArray[Any]]) -> Speed | None:
    """The speed by some channels (n,) at ``time`` (n,): over ground, of the drive train, or of the wheels on average."""
    ground = measured(time, columns.get("ground_speed"))
    if ground is not None:
        speed = np.abs(ground[1])
        moving = speed[speed > 0.5 * quantile(speed, 0.9)]
        return Speed(ground[0], speed, median(moving) if len(moving) else 0.0)
    return wheels_of(time, columns)


def wheels_of(time: Floats, columns: Mapping[str, npt.NDArray[Any]]) -> Speed | None:
    """As `speed_of`, from the drive train or the wheels alone."""
    based = measured(time, columns.get("wheel_based_speed"))
    if based is not None:
        return Speed(based[0], np.abs(based[1]), None)
    wheels = [measured(time, v) for name, v in columns.items() if name.startswith("wheel_speed_")]
    known = [
        np.abs(values) if when is time else np.interp(time, when, np.abs(values))
        for when, values in filter(None, wheels)
    ]
    return Speed(time, sum(known[1:], known[0]) / len(known), None) if known else None


def measured(time: Floats, values: npt.NDArray[Any] | None) -> tuple[Floats, Floats] | None:
    """The true updates (m,) of a channel, since a held value is late by half its period; None if there are hardly any."""
    if values is None or values.dtype.kind not in "fiu":
        return None
    when, kept = known_part(time, np.asarray(values, np.float64))
    period = held_period(when, kept)
    if period is not None:
        fresh = fresh_samples(when, kept, period)
        when, kept = when[fresh], kept[fresh]
    return (when, kept) if len(kept) > 2 else None


def lag_between(first: Speed, second: Speed, *, reach: float | None = None) -> Lag | None:
    """The lag of ``second`` behind ``first``, with the part that a vehicle's dynamics explain; None as `offset_between`."""
    result = offset_between((first.time, first.values), (second.time, second.values), reach=reach)
    if result is None:
        return None
    low = high = 0.0
    if first.pace is None and second.pace is not None:
        high = _own(first, second, second.pace, result.seconds)
    elif second.pace is None and first.pace is not None:
        low = -_own(second, first, first.pace, -result.seconds)
    lag = replace(result, explained=(low, high))
    if not lag.is_of_the_clock:
        return lag
    return replace(lag, std=float(np.hypot(lag.std, _contradiction(first, second, lag.seconds))))


def _own(wheels: Speed, ground: Speed, pace: float, seconds: float) -> float:
    """The largest lag [s] of its own with which a vehicle follows its wheels at ``pace`` [m/s].

    It is v / (g K) and grows with the speed v, where a clock's error does not: on a road, where the softest ground explains half a second,
    stops show both. A tenth of a second remains possible, for tyres and filters lag at any speed. The rate of the ground speed is
    regressed as in `_refined`, with a part of the lag that goes with the speed.
    """
    softest = pace / (STANDARD_GRAVITY * STIFFNESS)
    if softest <= _USUAL:
        return softest
    mine, theirs = _regular(wheels.time, wheels.values), _regular(ground.time, ground.values)
    if mine is None or theirs is None:
        return softest
    time, rate, jerk = _rates(mine)
    speed = _at(time, theirs, seconds)
    fit = _robust(np.stack([rate, jerk, jerk * _smooth(speed)], axis=1), np.gradient(_smooth(speed), _STEP))
    if fit is None or fit[0][0] <= 0:
        return softest
    (scale, _, own), covariance = fit
    most = pace * (_OWN_SURE * np.sqrt(covariance[2, 2]) - own) / scale
    return float(np.clip(most, _USUAL, softest))


def _contradiction(first: Speed, second: Speed, seconds: float) -> float:
    """How far [s] from an offset that by the gains of speed alone is, or that by its losses, the farther of those that show one.

    A clock is off by the same in both. A vehicle that digs itself in loses its speed before its driver stops the wheels, but does not
    gain it before them. What is within the smoothing is one offset.
    """
    mine, theirs = _regular(first.time, first.values), _regular(second.time - seconds, second.values)
    if mine is None or theirs is None:
        return 0.0
    rates = [np.gradient(_smooth(values), _STEP) for _, values in (mine, theirs)]
    apart = theirs[0] - mine[0]
    lags = np.arange(np.ceil((apart - _WITHIN) / _STEP), (apart + _WITHIN) / _STEP).astype(np.intp)
    farthest = 0.0
    for sign in (1.0, -1.0):
        ours, other = (np.maximum(sign * rate, 0.0) for rate in rates)
        correlation = _correlation(ours, other, lags)
        best = int(np.argmax(correlation))
        if correlation[best] >= _LEAST_IN_PART:
            farthest = max(farthest, abs(apart - _STEP * int(lags[best])))
    return farthest if farthest > 0.5 * _WIDTH * _STEP else 0.0


def lag_within(time: Floats, columns: Mapping[str, npt.NDArray[Any]]) -> Lag | None:
    """The lag of one file's ground speed behind its wheel speeds (n,), if they show one; it need not be certain.

    The file cannot show which of the two sensors is late; slip needs only that both are of one instant.
    """
    time = without_long_pauses(time)
    part = {name: measurable(values) for name, values in columns.items()}
    if "ground_speed" in part:
        part = {
            n: v
            for n, v in part.items()
            if not n.startswith("wheel_speed_") or not is_copy(v, part["ground_speed"])
        }
    wheels = wheels_of(time, part)
    ground = speed_of(time, {"ground_speed": part["ground_speed"]}) if "ground_speed" in part else None
    return None if wheels is None or ground is None else lag_between(wheels, ground, reach=_WITHIN)


def without_long_pauses(time: Floats) -> Floats:
    """Instants (n,) [s] whose pauses are short enough to compare speeds on points of all of the time."""
    return without_pauses(time, max(_PAUSE, 10 * median(np.diff(time)))) if len(time) > 1 else time


def delay_of(lag: Lag | None) -> float:
    """`Lag.delay` [s] of what `lag_within` found; 0 where that is nothing."""
    return 0.0 if lag is None else lag.delay


def is_copy(turning: npt.NDArray[Any], ground: npt.NDArray[Any]) -> bool:
    """Whether a wheel's speed was computed from the ground speed, as for a free wheel without a sensor: it has the ground speed's lag."""
    for step in (len(turning) // _FEW + 1, 1):  # of most wheels a few samples show it already
        wheel, speed = turning[::step], ground[::step]
        known = np.isfinite(wheel)
        wheel, speed = wheel[known], speed[known]
        moves = bool(np.any(speed))
        own = speed * (np.sum(wheel * speed) / np.sum(speed**2) if moves else 0.0)
        if not (np.isfinite(speed).all() and (np.abs(wheel - own) <= 1e-9 + 1e-6 * np.abs(own)).all()):
            return False
    return moves


def offset_between(
    reference: tuple[Floats, Floats], other: tuple[Floats, Floats], *, reach: float | None = None
) -> Lag | None:
    """How far the clock of ``other`` is ahead of that of ``reference``; each is (time [s], speed), of any scale. No part is explained.

    The correlation of both speeds over their common part is largest at the true offset (Padfield 2012, for records
    that overlap in part). ``reach``: the largest offset searched [s]; None: any. The result is None if the common part
    is short, the speeds are unlike, or do not distinguish one offset from another.
    """
    first, second = _regular(*reference), _regular(*other)
    if first is None or second is None or len(first[1]) + len(second[1]) > _LONGEST:
        return None
    lags = np.arange(1 - len(second[1]), len(first[1]))
    shift = second[0] - first[0] - _STEP * lags  # to subtract from the second clock
    if reach is not None:
        lags, shift = lags[np.abs(shift) <= reach], shift[np.abs(shift) <= reach]
    if not len(lags):
        return None
    correlation = _correlation(first[1], second[1], lags)
    best = int(np.argmax(correlation))
    if not correlation[best] >= _LEAST_CORRELATION:
        return None
    elsewhere = np.abs(shift - shift[best]) > _APART
    worse = np.clip(1.0 - correlation[best], _WORSE / 4, _WORSE)
    if elsewhere.any() and correlation[elsewhere].max() > correlation[best] - worse:
        return None
    seconds, deviation = _refined(first, second, float(shift[best]))
    return Lag(seconds, deviation, float(min(correlation[best], 1.0)), (0.0, 0.0))


def _regular(time: Floats, speed: Floats) -> tuple[float, Floats] | None:
    """Start and speed on regular points, NaN in gaps over a second."""
    known = np.isfinite(time) & np.isfinite(speed)
    time, speed = time[known], speed[known]
    if len(time) < 3 or time[-1] - time[0] < _LEAST_OVERLAP or (time[-1] - time[0]) / _STEP > _LONGEST:
        return None
    # To the microsecond, so that where a stamp is a point no rounding of the clock decides.
    since = np.round(time - time[0], 6)
    points, steps = np.round(_STEP * np.arange(np.ceil(round(since[-1] / _STEP, 6))), 6), np.diff(since)
    values = np.interp(points, since, speed)
    if steps.max() > _BRIDGED:
        after = np.clip(np.searchsorted(since, points), 1, len(since) - 1)
        values[steps[after - 1] > max(_BRIDGED, 3.0 * median(steps))] = np.nan
    return float(time[0]), values


def _correlation(a: Floats, b: Floats, lags: Ints) -> Floats:
    """Correlation of a (n,) with b (m,) over their common part, at lags of b by whole points (k,), increasing."""
    from numpy.fft import irfft, rfft

    # room for both, and so much more that no overlap from the other end reaches a lag that is wanted
    size = 1 << (max(len(a), len(b), len(a) - int(lags[0]), len(b) + int(lags[-1])) - 1).bit_length()
    masks = [np.isfinite(x).astype(np.float64) for x in (a, b)]
    values = [
        np.where(m > 0, x - np.nansum(x) / max(m.sum(), 1.0), 0.0) for x, m in zip((a, b), masks, strict=True)
    ]
    fa, fb = rfft(values[0], size), np.conj(rfft(values[1], size))
    ma, mb = rfft(masks[0], size), np.conj(rfft(masks[1], size))
    sa, sb = rfft(values[0] ** 2, size), np.conj(rfft(values[1] ** 2, size))

    def at_lags(product: npt.NDArray[np.complex128]) -> Floats:
        return np.asarray(irfft(product, size)[lags])

    count = np.maximum(np.round(at_lags(ma * mb)), 0.0)
    common = np.maximum(count, 1.0)
    sum_a, sum_b = at_lags(fa * mb), at_lags(ma * fb)
    cross = at_lags(fa * fb) - sum_a * sum_b / common
    spread_a = at_lags(sa * mb) - sum_a**2 / common
    spread_b = at_lags(ma * sb) - sum_b**2 / common
    floor = 1e-9 * common * max(float(values[0].var()), float(values[1].var()), 1e-12)
    enough = count >= max(_LEAST_OVERLAP / _STEP, _LEAST_SHARE * min(masks[0].sum(), masks[1].sum()))
    with np.errstate(invalid="ignore", divide="ignore"):
        result = cross / np.sqrt(np.maximum(spread_a, floor) * np.maximum(spread_b, floor))
    return np.where(enough, result, -np.inf)


def _refined(
    first: tuple[float, Floats], second: tuple[float, Floats], seconds: float
) -> tuple[float, float]:
    """A better offset, from the changes of the speeds, and its standard deviation.

    The rate of the second speed is regressed on rate and jerk of the first, whose coefficients are k and -k times the
    missing part of the offset. Rates are used because a change of slip shifts a speed for long but a rate for a moment, and
    biweights exclude those moments.
    """
    time, rate, jerk = _rates(first)
    design = np.stack([rate, jerk], axis=1)
    deviation = 0.5 * _APART  # without refinement only the correlation at _APART is known to be worse
    for _ in range(_ROUNDS):
        fit = _robust(design, np.gradient(_smooth(_at(time, second, seconds)), _STEP))
        if fit is None or fit[0][0] <= 0:
            break
        result, covariance = fit
        step = float(np.clip(-result[1] / result[0], -_APART, _APART))
        seconds += step
        deviation = max(float(np.sqrt(covariance[1, 1]) / result[0]), _LEAST_STD)
        if abs(step) < 0.1 * deviation:
            break
    return seconds, deviation


def _rates(speed: tuple[float, Floats]) -> tuple[Floats, Floats, Floats]:
    """The points (n,) of a regular speed, its rate and its jerk there."""
    rate: Floats = np.gradient(_smooth(speed[1]), _STEP)
    jerk: Floats = np.gradient(_smooth(rate), _STEP)
    return np.asarray(speed[0] + _STEP * np.arange(len(rate)), np.float64), rate, jerk


def _at(time: Floats, speed: tuple[float, Floats], seconds: float) -> Floats:
    """A regular speed whose clock is ``seconds`` ahead, at ``time`` (n,), NaN outside and in its gaps."""
    place = np.round((time - (speed[0] - seconds)) / _STEP, 6)
    points, known = np.arange(len(speed[1])), np.isfinite(speed[1])
    values = np.interp(place, points[known], speed[1][known], left=np.nan, right=np.nan)
    away = np.isnan(np.interp(place, points, speed[1], left=np.nan, right=np.nan))
    return np.where(away, np.nan, values)


def _robust(design: Floats, target: Floats) -> tuple[Floats, Floats] | None:
    """Coefficients (k,) of a regression on ``design`` (n, k) by biweights, and their covariance (k, k); None of too few rows."""
    rows = np.isfinite(design).all(axis=1) & np.isfinite(target)
    if rows.sum() < 2 * _WIDTH:
        return None
    design, target = design[rows], target[rows]
    columns = np.ascontiguousarray(design.T)  # weighted three times as fast
    weight = np.ones(len(target))
    for _ in range(_ROUNDS):
        normal = columns @ (weight * columns).T + 1e-12 * np.eye(len(columns))
        result = np.linalg.solve(normal, design.T @ (weight * target))
        rest = target - design @ result
        scale = max(1.4826 * median(np.abs(rest)), 1e-9)
        weight = np.clip(1.0 - (rest / (4.7 * scale)) ** 2, 0.0, None) ** 2
    # Points within the smoothing are alike: so many count as one.
    return np.asarray(result, np.float64), np.asarray(
        scale**2 * 2 * _WIDTH * np.linalg.inv(normal), np.float64
    )


def _smooth(values: Floats) -> Floats:
    """Means over a second around each point (n,); NaN where one of them is."""
    half = _WIDTH // 2
    sums = np.r_[0.0, np.cumsum(np.nan_to_num(values))]
    missing = np.r_[0, np.cumsum(np.isnan(values))]
    inner = max(len(values) - 2 * half, 0)
    whole = missing[len(sums) - inner :] == missing[:inner]
    result = np.full(len(values), np.nan)
    result[half : half + inner] = np.where(
        whole, (sums[len(sums) - inner :] - sums[:inner]) / (2 * half + 1), np.nan
    )
    return result
