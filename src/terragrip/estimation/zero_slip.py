"""The zero of slip: the ratio of ground speed to wheel speed in light work, determined from a log in one way for all callers.

Speeds give slip only relative to a condition that is called zero (ASABE S296: "zero condition"): driving without load on firm ground.
A log of work holds such stretches too, on the headland and on the road. Over windows of some seconds the ratio then has more than
one mode; the mode of the highest ratio is light work. Where there is one mode only, or the highest runs far behind the supposed radius,
field work cannot be distinguished from light work, which is reported. Wheels slip there, too, to move the vehicle alone, on soft ground
by a per cent or two: that is in the interval, and a road, where it is least, counts before light work in the field. The modes are
Gaussians beside a uniform floor, fitted by expectation and maximisation, their number by the Bayesian information criterion (Schwarz
1978). (R), our own construction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.recording import Recording
from terragrip.recording.held import held_periods, without_held
from terragrip.recording.window_means import window_means, windows_of

Span = tuple[float, float]

WINDOW = 5.0
"""Length [s] of the windows that speeds are averaged over: a lag of .2 s between the two speeds then hardly counts."""
FEWEST = 8
"""Windows that are needed: 40 s."""
UNDETERMINED = 0.03
"""Relative SD of a radius that no log shows, only the machine: worn or other tires, other pressure."""

_ALIKE: Mapping[str, float] = MappingProxyType({})  # wheels of one radius
REMEDY = "also record 40 s without load (headland, road), or state which rows are without load (terragrip calibrate --light FROM:TO)"
_SLOWEST = 0.3  # m/s
_GOING = 0.5  # of the window's mean speed: slower samples are stops
_TURNING = 0.05  # rad/s
_HUB = 0.02  # of the ground speed: what a turn adds to the outermost hub
_STRAIGHT = 0.05  # relative difference of the wheels' speeds
_ROAD = 5.0  # m/s: faster than any work in the soil
_PLAUSIBLE = 0.15  # a radius is not further off than this; units are
_NEAR = 0.05  # a radius is seldom further off than this
_BEHIND = (
    1.5 * UNDETERMINED
)  # from here on a log of two loads without light work is as likely as light work by such a radius (R)
_LIGHT = 0.002  # SD of the slip in light work from place to place
# Slip of wheels that carry their vehicle alone, by ASABE D497 at zero net traction: .2 to .3 % on firm ground (mobility number 80 to 55),
# .6 to 1.8 % on tilled to very soft fields (30 to 13). Root mean squares of what may be, from 0 to .5 and to 2 %:
_SELF_ROAD = 0.003
_SELF_FIELD = 0.012
_FLOOR = 0.003  # least SD of a mode
_ROUNDS = 200
_SETTLED = 1e-4  # of the log likelihood, from round to round
_ENOUGH = 1500  # windows: two hours, or every so many of a longer log
_NUMBERS = (1, 2, 3, 4)
_STRAY = 0.1  # share of windows that are of no mode, at most


@dataclass(frozen=True)
class Zero:
    """``ratio``: ground speed over supposed rim speed at zero slip, with its SD; ``windows`` it rests on (0: none); ``doubt``: why light
    work cannot be distinguished from field work, empty where it can."""

    ratio: float
    std: float
    windows: int
    doubt: str = ""


def zero_of(
    logs: Sequence[Recording],
    channel: str,
    radius: float,
    light: Sequence[Span | None] | None = None,
    radii: Mapping[str, float] = _ALIKE,
    half_track: float = 0.0,
) -> Zero | None:
    """The zero of a channel over logs of one machine; None where there are too few windows of driving.

    ``channel`` times ``radius`` is the rim speed [m/s]. ``light``: of each log the span [s] that was driven without load, if the
    user knows one; then only that counts. ``radii`` [m]: of all wheels, where they are not alike, to see by their rims' speeds what is
    straight. ``half_track`` [m]: of the outermost hub, which a turn moves beside the middle.
    """
    spans = [None] * len(logs) if light is None else list(light)
    declared = any(span is not None for span in spans)
    parts = [
        _windows(log, channel, radius, span, radii, half_track)
        for log, span in zip(logs, spans, strict=True)
        if channel in log.channels and (span is not None or not declared)
    ]
    ratio = np.concatenate([np.empty(0), *(result for result, _ in parts)])
    if len(ratio) < FEWEST:
        return None
    if declared:
        return Zero(float(np.median(ratio)), _error(ratio), len(ratio))
    return _judged(ratio, np.concatenate([fast for _, fast in parts]))


def _judged(ratio: Floats, fast: Bools) -> Zero:
    modes = _modes(ratio)
    value, spread, share = modes[-1]
    count = round(share * len(ratio))  # four or more
    road = ratio[fast]
    of_road = len(road) >= FEWEST and (len(road) > 0.8 * len(ratio) or float(np.median(road)) > value)
    if (
        of_road
    ):  # firm ground, and no pull: nearer to no slip than the lightest work in the field, however short
        value, spread, count = float(np.median(road)), _spread(road), len(road)
    std = float(np.sqrt(spread**2 / (count / 2) + _LIGHT**2 + (_SELF_ROAD if of_road else _SELF_FIELD) ** 2))
    if abs(value - 1) > _PLAUSIBLE:
        why = f"ground speed is {value:.3g} times wheel speed even in the lightest work: check the units and the radius"
        return Zero(1.0, UNDETERMINED, count, why)
    if of_road or (len(modes) > 1 and 1 - value <= _BEHIND):
        return Zero(value, std, count)
    if len(modes) > 1:
        why = f"it is {1 - value:.0%} below the supposed radius: another radius or, as likely, lighter field work: {REMEDY}"
        return Zero(value, float(np.hypot(std, max(UNDETERMINED, (1 - value) / 2))), count, why)
    if abs(value - 1) <= _NEAR:
        why = f"all windows slip alike, so light work cannot be distinguished from field work: {REMEDY}"
        return Zero(value, float(np.hypot(std, UNDETERMINED)), count, why)
    why = (
        f"all windows slip alike and are {abs(1 - value):.0%} {'below' if value < 1 else 'above'} the supposed radius: another "
        f"radius or, as likely, field work: {REMEDY}"
    )
    return Zero(1.0, UNDETERMINED, count, why)


def _error(ratio: Floats) -> float:
    """SD of a median of windows (n,) of which neighbours are correlated."""
    return float(np.hypot(1.2533 * _spread(ratio) / np.sqrt(len(ratio) / 2), _LIGHT))


def _spread(ratio: Floats) -> float:
    """SD of windows (n,) by their median deviation."""
    return max(1.4826 * float(np.median(np.abs(ratio - np.median(ratio)))), _FLOOR)


def _modes(ratio: Floats) -> list[tuple[float, float, float]]:
    """Mean, SD and share of each mode, from the lowest to the highest; modes that run into each other are one."""
    ratio = ratio[:: 1 + len(ratio) // _ENOUGH]
    best: tuple[float, list[tuple[float, float, float]]] | None = None
    for number, first in ((n, first) for n in _NUMBERS for first in _starts(ratio, n)):
        score, modes = _fit(ratio, number, first)
        kept = [mode for mode in modes if mode[2] * len(ratio) >= FEWEST / 2]
        apart = all(b[0] - a[0] > a[1] + b[1] for a, b in pairwise(kept))
        if kept and apart and (best is None or score < best[0]):
            best = score, kept
    if best is None:
        return [(float(np.median(ratio)), float(np.std(ratio)), 1.0)]
    return best[1]


def _starts(ratio: Floats, number: int) -> list[Floats]:
    """Means (number,) to begin with: spread over the windows, and with one of them at the few that slip least."""
    even = (np.arange(number) + 0.5) / number
    light = np.r_[(np.arange(number - 1) + 0.5) / max(1, number - 1) * 0.9, 0.97]
    return [np.quantile(ratio, places) for places in ((even,) if number == 1 else (even, light))]


def _fit(ratio: Floats, number: int, mean: Floats) -> tuple[float, list[tuple[float, float, float]]]:
    """Bayesian information criterion and modes of a mixture, by expectation and maximisation (Dempster, Laird, Rubin 1977)."""
    n = len(ratio)
    floor = 1 / max(float(np.ptp(ratio)), 0.2)
    spread = np.full(number, max(float(np.std(ratio)) / number, _FLOOR))
    share = np.r_[np.full(number, 0.95 / number), 0.05]
    likelihood = -np.inf
    for _ in range(_ROUNDS):
        before = likelihood
        scaled = (ratio[:, None] - mean) / spread
        density = np.column_stack(
            [np.exp(-0.5 * scaled**2) / (spread * np.sqrt(2 * np.pi)), np.full(n, floor)]
        )
        density *= share
        total = density.sum(axis=1)
        likelihood = float(np.sum(np.log(total)))
        if abs(likelihood - before) < _SETTLED:
            break
        weight = density / total[:, None]
        held = np.maximum(weight.sum(axis=0), 1e-9)
        share = held / held.sum()
        share[-1] = min(share[-1], _STRAY)  # a floor that removes whole modes would be none
        share /= share.sum()
        mean = (weight[:, :-1] * ratio[:, None]).sum(axis=0) / held[:-1]
        square = (weight[:, :-1] * (ratio[:, None] - mean) ** 2).sum(axis=0) / held[:-1]
        spread = np.maximum(np.sqrt(square), _FLOOR)
    result = sorted(zip(mean.tolist(), spread.tolist(), share.tolist(), strict=False))
    return 3 * number * float(np.log(n)) - 2 * likelihood, result


def _windows(
    recording: Recording,
    channel: str,
    radius: float,
    span: Span | None,
    radii: Mapping[str, float] = _ALIKE,
    half_track: float = 0.0,
) -> tuple[Floats, Bools]:
    """Ground speed over rim speed in windows without a stop (n,), of one wheel in straight ones; and whether each is of a road."""
    log = without_held(recording, held_periods(recording))
    if span is not None:
        log = log.select((log.time >= span[0]) & (log.time <= span[1]))
        if len(log) == 0:
            return np.empty(0), np.zeros(0, dtype=bool)
    place, starts = windows_of(log.time, WINDOW)
    count = len(starts)
    ground, slowest = _means(log.channels["ground_speed"], place, count)
    rim, least = _means(radius * log.channels[channel], place, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        used = (np.abs(ground) > _SLOWEST) & (np.abs(rim) > _SLOWEST) & (ground * rim > 0)
        used &= (slowest > _GOING * np.abs(ground)) & (least > _GOING * np.abs(rim))
        if channel != "wheel_based_speed":
            used &= _straight(log, place, count, radii, half_track, ground)
        return (ground / rim)[used], (np.abs(ground) > _ROAD)[used]


def _straight(
    log: Recording, place: Ints, count: int, radii: Mapping[str, float], half_track: float, ground: Floats
) -> Bools:
    """Windows (count,) in which no turn shows: in the yaw rate, else in the rims' speeds."""
    if "angular_velocity_z" in log.channels:
        turn = np.abs(window_means(log.channels["angular_velocity_z"], place, count))
        return ~(turn > _TURNING) & ~(turn * half_track > _HUB * np.abs(ground))
    rims = np.stack(
        [radii.get(w, 1.0) * window_means(log.channels[f"wheel_speed_{w}"], place, count) for w in log.wheels]
    )
    return np.asarray(np.ptp(rims, axis=0) <= _STRAIGHT * np.abs(rims.mean(axis=0)))


def _means(values: Floats, place: Ints, count: int) -> tuple[Floats, Floats]:
    """Mean of a channel in windows (count,), NaN where nothing was measured, and its least magnitude there."""
    known = np.isfinite(values)
    least = np.full(count, np.inf)
    np.minimum.at(least, place[known], np.abs(values[known]))
    return window_means(values, place, count), least
