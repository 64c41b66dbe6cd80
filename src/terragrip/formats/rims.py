"""Hold wheel speeds against the ground, the path and the turning of the vehicle: radius and track must be a vehicle's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from terragrip.formats.candidates import kind_of
from terragrip.formats.evidence import RADII, Evidence, Finding, Path, Series, nearest_unit, sizes, slope_of
from terragrip.formats.judgement import Guess
from terragrip.formats.rim_units import POSSIBLE, RimUnit, lightest_share, radius_of, rim_unit, speeds_of
from terragrip.formats.words import MEANINGS
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

Ranked = dict[str, list[Guess]]
Way = tuple[str, Path | float]
"""What was driven: by which columns, and the path, or metres for a count of distance."""
Ground = tuple[str, float]
"""A ground speed's column and its factor to m/s."""

_TRACKS = {"rotation": (1.1, 14.0), "speed": (0.15, 5.0)}
"""Track over radius, or track in m, that the difference of right and left over the rate of turn may make; skid steering counts double."""
_TURNING_WORDS = frozenset(MEANINGS["rotation"].split()) - {"w"}
_TURNING = 0.08  # rad/s: less turns too little to show a track
# m, rad/s: a wheel this small that turns this fast is rarer than turns a minute called rad/s.
_SMALL, _FAST = 0.1, 30.0


def surest(ranked: Mapping[str, list[Guess]], channel: str) -> Guess | None:
    """The guess of a channel with the highest confidence; None where there is none."""
    return max(ranked.get(channel, ()), key=lambda guess: guess.confidence, default=None)


def _turn(ranked: Mapping[str, list[Guess]], columns: Mapping[str, str]) -> bool:
    """Whether the names of all ``columns`` of wheels say that they turn; w or n alone does not, nor a speed."""
    guesses = [
        g for wheel, c in columns.items() for g in ranked[f"wheel_speed_{wheel}"] if g.column.column == c
    ]
    return all(_TURNING_WORDS & set(g.column.name.words) and not g.column.name.has("speed") for g in guesses)


class Rims:
    """Judges the guesses of wheel speeds of one log."""

    def __init__(self, evidence: Evidence, vehicle: Vehicle | None = None) -> None:
        self._evidence = evidence
        self._vehicle = vehicle

    def judge(
        self,
        ranked: Ranked,
        ground: Ground | None,
        paths: list[Way],
        turns: list[tuple[str, Series]],
        assumed: Ground | None = None,
    ) -> None:
        """Judge by the vehicle's radius or the one that follows from the ground speed or the path, by the others, and by the track.

        ``assumed``: a ground speed of a likely unit, by which wheels of our own names may but get a doubt.
        """
        channels = [c for c in ranked if c.startswith("wheel_speed_")]
        alike = self._without_unit(ranked, channels)
        by_radius = (
            rim_unit(self._evidence, self._vehicle, alike, ground, paths, turning=_turn(ranked, alike))
            if self._vehicle is not None and alike
            else None
        )
        for channel in channels:
            wheel = channel.removeprefix("wheel_speed_")
            radius = radius_of(self._vehicle, wheel)
            ranked[channel] = [
                by_radius.judge(g, radius)
                if by_radius is not None and radius is not None and g.column.column == alike.get(wheel)
                else self._against_way(g, ground, paths)
                for g in ranked[channel]
            ]
        if ground is None and assumed is not None and self._vehicle is not None and alike:
            self._against_assumed(ranked, rim_unit(self._evidence, self._vehicle, alike, assumed, []))
        self._as_the_others(ranked, channels)
        for left, right in (("l", "r"), ("fl", "fr"), ("rl", "rr")):
            self._track(ranked, f"wheel_speed_{left}", f"wheel_speed_{right}", turns)
        if ground is not None:
            ranked["wheel_based_speed"] = [
                g.with_finding(self._as_fast(g, *ground)) if g.column.column != ground[0] else g
                for g in ranked.get("wheel_based_speed", [])
            ]

    def _against_assumed(self, ranked: Ranked, by_assumed: RimUnit | None) -> None:
        """A doubt on wheels of our own names that are in another unit than rad/s if the ground speed is in its likely one."""
        if by_assumed is None or not by_assumed.contradicts_own:
            return
        for channel, guesses in ranked.items():
            radius = radius_of(self._vehicle, channel.removeprefix("wheel_speed_"))
            if channel.startswith("wheel_speed_") and radius is not None:
                doubt = f"{by_assumed.sentence(radius)}, if that is in m/s"
                ranked[channel] = [
                    replace(g, unit_doubt=doubt) if g.column.column == channel and not g.column.unit else g
                    for g in guesses
                ]

    def _without_unit(self, ranked: Ranked, channels: list[str]) -> dict[str, str]:
        """Of wheels whose radius is known, the columns that give no unit of their own."""
        best = {c.removeprefix("wheel_speed_"): surest(ranked, c) for c in channels}
        return {
            wheel: guess.column.column
            for wheel, guess in best.items()
            if guess is not None
            and guess.column.unit is None
            and radius_of(self._vehicle, wheel) is not None
            and not guess.column.name.has("motor")
        }

    def _against_way(self, guess: Guess, ground: Ground | None, paths: list[Way]) -> Guess:
        """The guess by the metres of ground for one count of wheel speed over a second; as it is where the two do not go together."""
        pair = speeds_of(self._evidence, [guess.column.column], ground, paths)
        metres = None if pair is None else lightest_share(pair[1], pair[2][0])
        return (
            guess if pair is None or metres is None else guess.with_finding(self._rim(guess, metres, pair[0]))
        )

    def _rim(self, guess: Guess, metres: float, ground: str) -> Finding | None:
        """``metres``: of ground speed for one count of wheel speed, by what is called ``ground``."""
        if guess.column.name.has("motor"):
            if guess.column.kind != "rotation" or guess.column.unit is None:
                return None
            rolled = metres / factor_to(guess.column.unit, "rad/s")
            if RADII[0] <= rolled <= RADII[1]:
                return None
            return Finding(
                True,
                f"{ground} moves {rolled:.3g} m per radian: the gear ratio is the wheel's radius over that",
            )
        if guess.column.unit is not None:
            if guess.column.kind == "speed":
                share = metres / factor_to(guess.column.unit, "m/s")
                return Finding(0.5 < share < 1.6, f"{ground} is {share:.3g} times the rim speed")
            factor = factor_to(guess.column.unit, "rad/s")
            radius = metres / factor
            known = radius_of(self._vehicle, guess.channel.removeprefix("wheel_speed_"))
            if known is not None:
                share = radius / known
                return Finding(
                    0.5 < share < POSSIBLE[1],
                    f"by a radius of {known:.3g} m {ground} is {share:.3g} of the rim speed",
                )
            sentence = f"a radius of {radius:.3g} m follows from {ground}"
            if radius < _SMALL and factor == 1.0 and self._evidence.size(guess.column.column) > _FAST:
                return Finding(False, f"{sentence}: rpm?")
            return Finding(RADII[0] <= radius <= RADII[1], sentence)
        likely = {}
        for unit in ("rad/s", "rpm", "deg/s"):
            radius = metres / factor_to(unit, "rad/s")
            if RADII[0] <= radius <= RADII[1]:
                likely[unit] = f"a radius of {radius:.3g} m follows from {ground}"
        if near := nearest_unit(1 / metres, sizes("m/s", "m/s", "km/h"), 0.12):
            likely[near] = f"as {ground} in {near}"
        if len(likely) == 1:
            unit, notes = next(iter(likely.items()))
            return Finding(True, notes, unit)
        if not likely:
            return Finding(False, f"with {ground} no radius of a wheel fits")
        return Finding(False, f"with {ground} {' or '.join(likely)}?")

    def _as_the_others(self, ranked: Ranked, channels: list[str]) -> None:
        """Wheels of one unit stand or fall together: where one of them contradicts its unit, the others are in doubt too."""
        bad = {
            g.column.unit: g
            for c in channels
            for g in ranked[c][:1]
            if g.doubt and g.column.unit and not g.column.name.has("motor")
        }
        for channel in channels:
            ranked[channel] = [
                replace(g, confidence=0.6 * g.confidence, doubt=f"{other.column.column}: {other.doubt}")
                if (other := bad.get(g.column.unit or "")) is not None and not g.doubt
                else g
                for g in ranked[channel]
            ]

    def _track(
        self, ranked: Mapping[str, list[Guess]], left: str, right: str, turns: list[tuple[str, Series]]
    ) -> None:
        """Right less left over the rate of turn: the track over the wheel's radius, in any log with turns."""
        first, second = surest(ranked, left), surest(ranked, right)
        if first is None or second is None or first.unit is None or first.unit != second.unit:
            return
        kind = kind_of(first.unit) or ""
        series = self._evidence.series(second.column.column)
        if series is None or kind not in _TRACKS or first.column.name.has("motor"):
            return
        factor = factor_to(first.unit, "rad/s" if kind == "rotation" else "m/s")
        difference = factor * (series[1] - self._evidence.at(first.column.column, series[0]))
        for source, (time, rate) in turns:
            known = np.isfinite(rate)
            if not known.any() or float(np.quantile(np.abs(rate[known]), 0.95)) < _TURNING:
                continue
            result = slope_of(np.interp(series[0], time, rate, left=np.nan, right=np.nan), difference)
            if result is None or abs(result[1]) < 0.7:
                continue
            low, high = _TRACKS[kind]
            if low <= abs(result[0]) <= high:
                return
            size = f"{abs(result[0]):.2g} " + ("wheel radii" if kind == "rotation" else "m")
            finding = Finding(False, f"in turns by {source} they give a track of {size}")
            for channel, guess in ((left, first), (right, second)):
                ranked[channel][ranked[channel].index(guess)] = guess.with_finding(finding)
            return

    def _as_fast(self, guess: Guess, ground: str, factor: float) -> Finding | None:
        result = self._evidence.ratio(ground, guess.column.column)
        if result is None:
            return None
        if guess.unit is not None and guess.column.unit is not None:
            share = result[0] * factor / factor_to(guess.unit, "m/s")
            return Finding(0.5 < share < 1.6, f"{ground} is {share:.3g} times as fast")
        unit = nearest_unit(1 / (result[0] * factor), sizes("m/s", "m/s", "km/h", "mm/s"), 0.4)
        return Finding(
            unit is not None,
            f"as fast as {ground}" if unit else f"is not as fast as {ground} in any unit",
            unit,
        )
