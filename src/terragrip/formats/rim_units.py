"""The unit of wheel speeds that state none, by the vehicle's radii: in which of them the rims go about as fast as the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.evidence import Evidence, Finding, Path
from terragrip.formats.judgement import Guess
from terragrip.formats.vocabulary import GENERAL
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

ROTATION = ("rad/s", "rpm", "deg/s", "rev/s")
SPEED = ("m/s", "km/h", "mph", "cm/s", "mm/s")
"""Units that wheel speeds are logged in: of the wheel's turning, and of its rim."""
USUAL = ("rad/s", "rpm", "m/s", "km/h")
"""Those that may be proposed without a question mark. The others are rarer than a gear ratio left in the column that looks like them."""

LIKELY = (0.85, 1.12)
"""Ground speed over the rims' in the lightest quarter of the work, by a unit that may be taken without a question mark: light work slips
some per cent, and a vehicle file's radius may be a tenth off."""
POSSIBLE = (0.62, 1.35)
"""The same, outside of which a unit is ruled out: then even the lightest quarter would slip by 38 %, or the wheels be dragged."""
_LIGHTEST = 0.75
_BLOCK = 1.0
"""Seconds over which both speeds are averaged: noise of slow rows would widen the quantile."""
_FEWEST = 8
_SPREAD = 0.25
"""Interquartile range of the logarithm of ground over rim speed above which neither tells the other's unit: turns on the spot, a poor
receiver, digging in."""
_UNEQUAL, _APART = 0.14, 0.07
"""Logarithms: radii of two driven axles that tell turning from rim speed, and how well their speeds must then agree."""


@dataclass(frozen=True)
class RimUnit:
    """What radii and ground speed say of the wheels' unit: each ``possible`` one with ground over rim speed in it, the likeliest first.

    ``ground``: the columns of ground speed. ``shown_by_axles``: axles of unequal wheels ruled other units out.
    """

    ground: str
    possible: Mapping[str, float]
    shown_by_axles: bool = False

    @property
    def unit(self) -> str | None:
        """The likeliest unit; None where none is possible."""
        return next(iter(self.possible), None)

    @property
    def is_sure(self) -> bool:
        """Whether it is a usual unit, and no other is possible."""
        return (
            len(self.possible) == 1
            and self.unit is not None
            and _is_usual(self.unit, self.possible[self.unit])
        )

    @property
    def contradicts_own(self) -> bool:
        """Whether rad/s, the unit of Terragrip's own names, is unlikely, and another usual unit is likely."""
        usual = [unit for unit, share in self.possible.items() if _is_usual(unit, share)]
        return bool(usual) and "rad/s" not in usual

    def sentence(self, radius: float) -> str:
        """What was found, by the ``radius`` [m] of a wheel."""
        if not self.possible:
            return f"with a radius of {radius:.3g} m the rims are not as fast as {self.ground} in any unit"
        parts = [f"{1 / share:.2f} times (in {unit})" for unit, share in self.possible.items()]
        axles = ", as the unequal wheels of two axles also show" if self.shown_by_axles else ""
        only = ", in no other unit near it" if self.is_sure and not self.shown_by_axles else ""
        return f"with a radius of {radius:.3g} m the rims go {' or '.join(parts)} as fast as {self.ground}{only}{axles}"

    def judge(self, guess: Guess, radius: float) -> Guess:
        """The guess with this unit: surer where no other is possible, with a question mark where one is."""
        is_own = guess.column.column == guess.channel
        sentence = self.sentence(radius)
        if is_own and "rad/s" in self.possible and not self.contradicts_own:  # by our own name it is rad/s
            if self.unit == "rad/s":
                return guess.with_finding(Finding(True, sentence, "rad/s"))
            return replace(guess, confidence=0.7 * guess.confidence, unit="rad/s", unit_doubt=f"{sentence}?")
        if self.possible and not self.is_sure:
            return replace(
                guess, confidence=0.7 * guess.confidence, unit=self.unit, unit_doubt=f"{sentence}?"
            )
        return guess.with_finding(Finding(self.unit is not None, sentence, self.unit))


def own_name(vehicle: Vehicle | None, wheel: str) -> str:
    """The name that a vehicle has for a wheel of a corner or side in a log (vl for fl, 1l for l); the log's where it has none such.

    A side alone is the driven wheel there, where one axle is driven: left of a tractor with free front wheels is its rear left one.
    """
    if vehicle is None or wheel in vehicle.wheels:
        return wheel
    place = place_of(wheel) or wheel
    read = {one: place_of(one) for one in vehicle.wheels}
    meant = [one for one, own in read.items() if place in (own, own.lstrip("0123456789"))]
    if place in ("l", "r") and not meant:
        driven = dict(zip(vehicle.wheels, vehicle.driven, strict=True))
        meant = [one for one, own in read.items() if driven[one] and own.endswith(place)]
    return meant[0] if len(meant) == 1 else wheel


def place_of(wheel: str) -> str:
    """The corner or side that a wheel's name says: l of left, fl of vl."""
    return GENERAL.read(f"wheel_speed_{wheel}").wheel


def radius_of(vehicle: Vehicle | None, wheel: str) -> float | None:
    """The radius [m] of a wheel that a log names: the vehicle's by that name, else the one that all its wheels have. None without."""
    if vehicle is None or not vehicle.knows_wheels:
        return None
    radii = dict(zip(vehicle.wheels, map(float, vehicle.wheel_radius), strict=True))
    wheel = own_name(vehicle, wheel)
    if wheel in radii:
        return radii[wheel]
    return max(radii.values()) if max(radii.values()) < 1.03 * min(radii.values()) else None


def rim_unit(
    evidence: Evidence,
    vehicle: Vehicle,
    columns: Mapping[str, str],
    ground: tuple[str, float] | None,
    paths: list[tuple[str, Path | float]],
    *,
    turning: bool = False,
) -> RimUnit | None:
    """The unit of wheel speeds, None where nothing tells it. ``turning``: their names say that they turn (omega, rpm, Drehzahl).

    ``columns``: the column of each wheel that `radius_of` knows. ``ground``: the ground speed's column and its factor to m/s; without it
    the ``paths`` that were driven tell the mean.
    """
    found = speeds_of(evidence, list(columns.values()), ground, paths)
    if found is None:
        return None
    source, speed, rims = found
    radii = np.array([radius_of(vehicle, wheel) for wheel in columns], dtype=np.float64)
    shares = lightest_share(speed, radii @ rims / len(rims)), lightest_share(speed, rims.mean(axis=0))
    if shares[0] is None or shares[1] is None:
        return None
    result = {u: shares[0] / factor_to(u, "rad/s") for u in ROTATION}
    result |= {u: shares[1] / factor_to(u, "m/s") for u in SPEED}
    possible = {u: s for u, s in result.items() if POSSIBLE[0] <= s <= POSSIBLE[1]}
    kind = _kind_by_axles(evidence, vehicle, columns)
    kept = {
        u: s for u, s in possible.items() if (kind is None or u in kind) and (not turning or u in ROTATION)
    }
    # The usual ones first, then by how near the rims are to the ground's speed.
    ranked = sorted(kept.items(), key=lambda item: (not _is_usual(*item), abs(np.log(item[1]))))
    return RimUnit(source, dict(ranked), shown_by_axles=kind is not None and len(kept) < len(possible))


def _is_usual(unit: str, share: float) -> bool:
    return unit in USUAL and LIKELY[0] <= share <= LIKELY[1]


def speeds_of(
    evidence: Evidence,
    columns: list[str],
    ground: tuple[str, float] | None,
    paths: list[tuple[str, Path | float]],
) -> tuple[str, Floats, Floats] | None:
    """What tells the ground's speed, that speed (n,) [m/s] over short times, and the means (columns, n) of wheels' columns over them.

    ``ground`` and ``paths`` as for `rim_unit`. None where there is neither.
    """
    if ground is not None:
        rows = _together(evidence, [*columns, ground[0]])
        return None if rows is None else (ground[0], rows[-1] * ground[1], rows[:-1])
    for source, path in paths:
        if isinstance(path, float):
            continue
        pieces = [evidence.pieces_over(column, path) for column in columns]
        known = [one for one in pieces if one is not None]
        if len(known) == len(columns) and len({len(one[0]) for one in known}) == 1 and len(known[0][0]):
            lasts = known[0][2]
            return source, known[0][1] / lasts, np.array([run for run, _, _ in known]) / lasts
    return None


def lightest_share(speed: Floats, rim: Floats) -> float | None:
    """Ground ``speed`` over ``rim`` speed, both (n,), in the lightest quarter of the work; None where they do not go together."""
    turns = rim > 0.3 * np.quantile(rim, 0.95)
    moving = turns & (speed > 0.2 * np.quantile(speed, 0.95))
    if moving.sum() < max(_FEWEST, turns.sum() / 3):
        return None
    low, high = np.quantile(np.log(speed[moving] / rim[moving]), [1 - _LIGHTEST, _LIGHTEST])
    return float(np.exp(high)) if high - low < _SPREAD else None


def _kind_by_axles(
    evidence: Evidence, vehicle: Vehicle, columns: Mapping[str, str]
) -> tuple[str, ...] | None:
    """The kind of unit that two driven axles of unequal wheels tell: equal rims, or turning by the radii; None where they do not."""
    axles = [
        [wheel for wheel in axle.wheels if wheel in columns]
        for axle in vehicle.axles.values()
        if axle.driven and set(axle.wheels) & columns.keys()
    ]
    found: set[tuple[str, ...] | None] = set()
    for first, second in combinations(axles, 2):
        by_radii = float(np.log(vehicle.radii[second[0]] / vehicle.radii[first[0]]))
        rows = _together(evidence, [columns[wheel] for wheel in (*first, *second)])
        if abs(by_radii) < _UNEQUAL or rows is None or len(first) != len(second):
            continue
        front, rear = rows[: len(first)].mean(axis=0), rows[len(first) :].mean(axis=0)
        moving = (front > 0.3 * np.quantile(front, 0.95)) & (rear > 0.3 * np.quantile(rear, 0.95))
        if moving.sum() < _FEWEST:
            continue
        seen = float(np.median(np.log(front[moving] / rear[moving])))
        turning, running = abs(seen - by_radii) < _APART, abs(seen) < _APART
        found.add(ROTATION if turning and not running else SPEED if running and not turning else None)
    return found.pop() if len(found) == 1 else None


def _together(evidence: Evidence, columns: list[str]) -> Floats | None:
    """Absolute values (columns, blocks) of columns, averaged over blocks of `_BLOCK`; None where they share fewer than `_FEWEST`."""
    series = evidence.series(columns[0])
    if series is None:
        return None
    time = series[0]
    rows = np.array([evidence.at(column, time) for column in columns])
    known = np.isfinite(rows).all(axis=0)
    if known.sum() < _FEWEST:
        return None
    _, place = np.unique(np.floor(time[known] / _BLOCK), return_inverse=True)
    count = np.bincount(place)
    if len(count) < _FEWEST:
        return None
    return np.array([np.bincount(place, np.abs(row[known])) / count for row in rows])
