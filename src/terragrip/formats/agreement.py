"""Hold the guesses of one log against each other: speeds against positions, rims against the ground, gyros against headings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from terragrip.formats.candidates import Column, candidates_of
from terragrip.formats.evidence import Evidence, Finding, Series, nearest_unit, sizes
from terragrip.formats.judgement import E7, Guess
from terragrip.formats.rim_units import own_name
from terragrip.formats.rims import Ranked, Rims, Way, surest
from terragrip.recording.checks import PLACES
from terragrip.recording.pace import is_odometry
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

_KNOWN = ("Terragrip", "a signal")
_E7 = re.compile(r"(?:^|[\W_\d]|lat|lon|lng|itude|deg)e-?7\W*$", re.IGNORECASE)
_NOT_OF_WHEELS = 0.03  # of the speed: more than stamps and rounding leave of wheel odometry
_TOGETHER = 0.9  # correlation of two speeds over ground; what they differ by then is no noise,
_OTHER_SCALE, _OTHER_UNIT = 0.03, 0.5  # and a unit is asked for elsewhere
_SIDEWAYS = 15.0  # m/s^2, the 90 % quantile


class Agreement:
    """The columns of one log, their evidence, and the guesses that these leave standing."""

    def __init__(
        self, columns: Mapping[str, Column], evidence: Evidence, vehicle: Vehicle | None = None
    ) -> None:
        self._columns, self._evidence, self._vehicle = columns, evidence, vehicle

    def refine(self, ranked: Ranked) -> None:
        """Hold the guesses against each other, in the order in which one helps the next."""
        self._positions(ranked)
        path = self._paths(ranked)
        for channel in ("ground_speed", "wheel_based_speed"):
            ranked[channel] = [self._speed(g, path) for g in ranked.get(channel, [])]
        self._prefer_ground(ranked)
        self._accelerations(ranked)
        self._turning(ranked)
        Rims(self._evidence, self._vehicle).judge(
            ranked,
            self._ground(ranked),
            path,
            self._turns_of_body(ranked),
            self._ground(ranked, assumed=True),
        )
        self._odometry(ranked)
        self._two_scales(ranked)
        for channel in [c for c, guesses in ranked.items() if not guesses]:
            del ranked[channel]

    def _odometry(self, ranked: Ranked) -> None:
        """Odometry's speed that does not follow from the wheel speeds may be smoothed, fused or a camera's, its rate of turn that does is
        no gyroscope's: a doubt."""
        rims = [g.column.column for c in ranked if c.startswith("wheel_speed_") and (g := surest(ranked, c))]
        self._ground_of_wheels(ranked)
        for k, guess in enumerate(ranked.get("wheel_based_speed", ())):
            if len(rims) < 2 or not guess.column.name.has("odometry") or guess.column.name.has("wheel"):
                continue
            rest = self._evidence.beyond(guess.column.column, rims)
            if rest is not None and rest > _NOT_OF_WHEELS:
                doubt = f"differs by {rest:.0%} from what the wheel speeds make of it: if a camera's or a lidar's, it is ground_speed?"
                ranked["wheel_based_speed"][k] = replace(guess, confidence=0.4, doubt=doubt)
        for k, guess in enumerate(ranked.get("angular_velocity_z", ())):
            name = guess.column.name
            # on firm ground a gyroscope's follows from them, too
            if len(rims) < 2 or not (name.has("odometry") or "twist" in name.words):
                continue
            rest = self._evidence.beyond(guess.column.column, rims)
            if rest is not None and rest < _NOT_OF_WHEELS:
                doubt = "follows from the wheel speeds: no gyroscope?"
                ranked["angular_velocity_z"][k] = replace(guess, confidence=0.4, doubt=doubt)

    def _ground_of_wheels(self, ranked: Ranked) -> None:
        """A ground speed that is made of the driven wheels' is left out for positions or another one, else in doubt: MoTeC's is."""
        driven = self._driven_rims(ranked)
        made = [g for g in ranked.get("ground_speed", ()) if self._is_odometry(g, driven)]
        if not made:
            return
        others = [g for g in ranked["ground_speed"] if g not in made]
        if self._vehicle is None or not (others or surest(ranked, "latitude")):  # those wheels may be free
            doubt = "is made of the wheels' speeds: odometry?"
            others += [replace(g, confidence=0.4, doubt=doubt) for g in made]
        ranked["ground_speed"] = others

    def _is_odometry(self, guess: Guess, driven: list[str]) -> bool:
        series = self._evidence.series(guess.column.column)
        if not driven or series is None:
            return False
        return is_odometry(*series, np.array([self._evidence.at(rim, series[0]) for rim in driven]))

    def _driven_rims(self, ranked: Ranked) -> list[str]:
        """The columns of the driven wheels' speeds; none where one of the vehicle's is not in the log."""
        best = {
            c.removeprefix("wheel_speed_"): surest(ranked, c) for c in ranked if c.startswith("wheel_speed_")
        }
        rims = {own_name(self._vehicle, w): g.column.column for w, g in best.items() if g is not None}
        driven = list(rims) if self._vehicle is None else self._vehicle.driven_wheels
        return [rims[wheel] for wheel in driven] if set(driven) <= rims.keys() else []

    def _two_scales(self, ranked: Ranked) -> None:
        """Of two speeds over ground that go together and are of other sizes one is of another scale; nothing shows which."""
        best = surest(ranked, "ground_speed")
        if (
            best is None
            or best.unit is None
            or best.doubt
            or best.unit_doubt
            or not best.column.name.has("ground")
        ):
            return
        for guess in ranked["ground_speed"]:
            other = guess.column
            if guess is best or guess.unit is None or not other.name.has("ground") or guess.doubt:
                continue
            if other.name.has("wheel") or best.column.name.has("wheel"):  # they differ by slip
                continue
            size, alike = self._evidence.ratio(best.column.column, other.column) or (1.0, 0.0)
            share = size * factor_to(best.unit, "m/s") / factor_to(guess.unit, "m/s")
            if alike > _TOGETHER and _OTHER_SCALE < abs(share - 1) < _OTHER_UNIT:
                doubt = f"is {share:.3g} times {other.column}: which of them has the right scale (a radar's angle), or is one the wheels'?"
                place = next(i for i, g in enumerate(ranked["ground_speed"]) if g is best)
                ranked["ground_speed"][place] = replace(best, doubt=doubt)
                return

    def _positions(self, ranked: Ranked) -> None:
        """Latitudes and longitudes in radians or degrees: both have one unit."""
        both = [g for c in ("latitude", "longitude") for g in ranked.get(c, ()) if g.column.unit is None]
        if both and all(self._evidence.size(g.column.column) < 3.2 for g in both):
            for channel in ("latitude", "longitude"):
                ranked[channel] = [
                    replace(g, unit="rad", unit_doubt="its magnitude suggests radians")
                    if g.column.unit is None
                    else g
                    for g in ranked.get(channel, [])
                ]
        for channel, limit in PLACES.items():
            ranked[channel] = [self._in_range(g, limit + 1e-3) for g in ranked.get(channel, [])]

    def _in_range(self, guess: Guess, limit: float) -> Guess:
        """A latitude or longitude in degrees, or in whole numbers of 1e-7 degrees; in doubt where it is neither."""
        size, name = self._evidence.size(guess.column.column), guess.column.column
        says_so = guess.column.unit is None and _E7.search(name) is not None
        if guess.unit not in ("deg", "°") or (size <= limit and not says_so):
            return guess
        if self._evidence.is_whole(name) and size * factor_to(E7, "deg") <= limit:
            doubt = "" if says_so else f"whole numbers up to {size:.0f}: 1e-7 degrees?"
            return replace(guess, unit=E7, unit_doubt=doubt)
        return replace(guess, confidence=0.2, doubt=f"reaches {size:.5g} (degrees and minutes, ddmm.mmmm?)")

    def _paths(self, ranked: Mapping[str, list[Guess]]) -> list[Way]:
        """What was driven, in metres: by latitude and longitude, by positions, by a distance."""
        result: list[Way] = []
        best = (surest(ranked, "latitude"), surest(ranked, "longitude"))
        known = [g for g in best if g is not None and g.unit in ("deg", "rad", E7) and not g.doubt]
        if len(known) == 2 and known[0].unit == known[1].unit:
            pair = (known[0].column.column, known[1].column.column)
            factor = factor_to(str(known[0].unit), "deg")
            if (path := self._evidence.displacements(pair, degrees=True, unit=factor)) is not None:
                result.append((f"{pair[0]}, {pair[1]}", path))
        places = {n: c for n, c in self._columns.items() if c.kind == "length" and c.unit is not None}
        for name, column in places.items():
            if column.name.axis != "x" or column.name.has("odometry", "statistic", "other"):
                continue
            alike = (n for n, c in places.items() if c.name.concepts == column.name.concepts)
            other = next((n for n in alike if places[n].name.axis == "y"), None)
            if other is not None:
                metres = factor_to(str(column.unit), "m")
                path = self._evidence.displacements((name, other), degrees=False, unit=metres)
                result += [] if path is None else [(f"{name}, {other}", path)]
        for name, column in self._columns.items():
            if (
                column.name.has("distance")
                and not column.name.has("statistic", "command")
                and column.kind in (None, "length")
            ):
                result.append((name, factor_to(column.unit or "m", "m")))
        return result

    def _speed(self, guess: Guess, paths: list[Way]) -> Guess:
        name = guess.column.column
        for source, path in paths:
            if isinstance(path, float):
                finding = self._evidence.against_distance(name, source, path)
            else:
                finding = self._evidence.against_path(name, path, source)
            if finding is None or (not finding.agrees and guess.channel == "wheel_based_speed"):
                continue
            judged, read = guess.with_finding(finding), guess.column.name
            of_the_body = read.has("body") and not read.has("ground")
            if guess.channel == "ground_speed" and of_the_body and not judged.doubt:
                judged = replace(judged, doubt="a vehicle's speed may be computed from its wheels")
            return judged if finding.agrees else replace(judged, confidence=0.3 * guess.confidence)
        return guess

    def _prefer_ground(self, ranked: Ranked) -> None:
        """Of two speeds of which one is named as over ground, the other is more likely the vehicle's own."""
        named = [g for g in ranked["ground_speed"] if g.column.name.has("ground") or g.why.startswith(_KNOWN)]
        if not named:
            beside = [g.column.name.words for g in ranked.get("latitude", ())]
            prefixes = {words[:1] for words in beside if len(words) > 1}
            ranked["ground_speed"] = [
                replace(
                    g, confidence=max(g.confidence, 0.75), evidence=(*g.evidence, "named like the latitude")
                )
                if g.column.name.words[:1] in prefixes and len(g.column.name.words) > 1
                else g
                for g in ranked["ground_speed"]
            ]
            ranked["wheel_based_speed"] = [
                g
                for g in ranked["wheel_based_speed"]
                if g.column.name.has("wheel", "odometry") or g.why.startswith(_KNOWN)
            ]
            return
        own = {g.column.column for g in named}
        ranked["ground_speed"] = [
            g if g.column.column in own else replace(g, confidence=0.4 * g.confidence)
            for g in ranked["ground_speed"]
        ]
        best = max(named, key=lambda g: g.confidence)
        others = [g for g in ranked["wheel_based_speed"] if g.column.column not in own]
        ranked["wheel_based_speed"] = [kept for g in others if (kept := self._own_speed(g, best)) is not None]

    def _own_speed(self, guess: Guess, ground: Guess) -> Guess | None:
        """A speed beside the one over ground as the vehicle's own; None where neither its name nor its ratio to that one says so."""
        if guess.column.name.has("wheel", "odometry") or guess.confidence >= 0.9:
            return guess
        result = self._evidence.ratio(ground.column.column, guess.column.column)
        if result is None:
            return None
        stated = guess.column.unit is not None and ground.column.unit is not None
        scale = (
            factor_to(ground.unit or "m/s", "m/s") / factor_to(guess.unit or "m/s", "m/s") if stated else 1.0
        )
        share = 1 / (result[0] * scale)
        if not (result[1] > 0.5 and 0.7 < share < 1.7):
            return None
        sentence = f"varies with {ground.column.column}, of which it is {share:.3g} times"
        doubt = "the wheels' own speed, beside one over ground?" if guess.column.name.strange else ""
        return replace(guess, confidence=0.6, evidence=(*guess.evidence, sentence), doubt=doubt)

    def _ground(
        self, ranked: Mapping[str, list[Guess]], *, assumed: bool = False
    ) -> tuple[str, float] | None:
        """The best ground speed and its factor to m/s, where its unit is beyond doubt, or ``assumed``: where it is the likely one."""
        best = surest(ranked, "ground_speed")
        if best is None or best.unit is None:
            return None
        if assumed:
            return None if best.doubt else (best.column.column, factor_to(best.unit, "m/s"))
        if best.contradicted or ((best.doubt or best.unit_doubt) and best.column.unit is None):
            return None
        return best.column.column, factor_to(best.unit, "m/s")

    def _accelerations(self, ranked: Ranked) -> None:
        """Accelerations by gravity in the sum of three, and along the vehicle by the derivative of its speed."""
        axes = ("acceleration_x", "acceleration_y", "acceleration_z")
        if all(ranked.get(a) for a in axes):
            best = [max(ranked[a], key=lambda g: g.confidence) for a in axes]
            unit = self._evidence.gravity(
                (best[0].column.column, best[1].column.column, best[2].column.column)
            )
            if unit is not None:
                finding = Finding(True, f"the three sum up to gravity, in {unit}", unit)
                for axis, guess in zip(axes, best, strict=True):
                    ranked[axis] = [g.with_finding(finding) if g is guess else g for g in ranked[axis]]
        ground = self._ground(ranked)
        if ground is None or not ranked.get("acceleration_x"):
            return
        rate = self._evidence.derivative(*ground)
        if rate is None:
            return
        judged = []
        for guess in ranked["acceleration_x"]:
            result = self._evidence.fit(guess.column.column, *rate)
            if result is not None and result[1] > 0.6:
                unit = nearest_unit(result[0], {"m/s^2": 1.0, "g": 1 / 9.80665}, 0.35)
                sentence = f"varies with the derivative of {ground[0]} (correlation {result[1]:.2f})"
                guess = guess.with_finding(Finding(True, sentence, None if guess.column.unit else unit))
            judged.append(guess)
        ranked["acceleration_x"] = judged

    def _turning(self, ranked: Ranked) -> None:
        """The rate of turn against headings, the path, and lateral acceleration over speed; its unit serves the other two gyros."""
        guesses = ranked.get("angular_velocity_z", [])
        if not guesses:
            return
        references = self._turns(ranked)
        judged = []
        for guess in guesses:
            for source, rate in references:
                result = self._evidence.fit(guess.column.column, *rate)
                if result is None or abs(result[1]) < 0.8:
                    continue
                unit = nearest_unit(abs(result[0]), sizes("rad/s", "rad/s", "deg/s"), 0.3)
                if unit is None:
                    continue
                sentence = f"varies with the rate of turn by {source} (correlation {result[1]:.2f})"
                least = 0.75 if guess.confidence < 0.5 else 0.0
                guess = guess.with_finding(Finding(True, sentence, unit))
                guess = replace(guess, confidence=max(guess.confidence, least))
                break
            else:
                guess = guess.with_finding(self._at_speed(guess, self._ground(ranked)))
            judged.append(guess)
        ranked["angular_velocity_z"] = [g for g in judged if g.confidence > 0.35]
        best = surest(ranked, "angular_velocity_z")
        if best is None:
            return
        own = {
            _sensor_of(g): g for g in judged
        }  # of one sensor: a yaw rate in deg/s may stand beside gyros in rad/s
        for channel in ("angular_velocity_x", "angular_velocity_y"):
            ranked[channel] = [
                self._in_unit_of(own.get(_sensor_of(g), best), g) for g in ranked.get(channel, [])
            ]

    def _in_unit_of(self, known: Guess, guess: Guess) -> Guess:
        """A rate that states no unit, in that of the rate of turn beside it, where there is no doubt about that."""
        if known.doubt or known.unit_doubt or known.unit is None:
            return guess
        if guess.column.unit is not None or not guess.unit_doubt.startswith("no unit"):
            return guess
        evidence = (*guess.evidence, f"in the unit of {known.column.column}")
        return replace(guess, unit=known.unit, unit_doubt="", evidence=evidence)

    def _at_speed(self, guess: Guess, ground: tuple[str, float] | None) -> Finding | None:
        """A rate of turn without a unit beside a speed: in rad/s it must not ask for more sideways than a vehicle can."""
        if (
            guess.column.unit is not None
            or ground is None
            or (series := self._evidence.series(guess.column.column)) is None
        ):
            return None
        speed = self._evidence.at(ground[0], series[0])
        if not np.isfinite(speed).any():
            return None
        sideways = float(np.nanquantile(np.abs(series[1] * speed * ground[1]), 0.9))
        if sideways < _SIDEWAYS:
            return None
        return Finding(True, f"in rad/s it would be {sideways:.0f} m/s^2 sideways at {ground[0]}", "deg/s")

    def _turns_of_body(self, ranked: Mapping[str, list[Guess]]) -> list[tuple[str, Series]]:
        """Rates of turn [rad/s] that no wheel made: a gyro's beyond doubt, and those of `_turns`."""
        best = surest(ranked, "angular_velocity_z")
        result = self._turns(ranked)
        if best is not None and best.unit is not None and not (best.doubt or best.unit_doubt):
            series = self._evidence.series(best.column.column)
            if series is not None and not best.column.name.has("odometry"):
                rate = series[1] * factor_to(best.unit, "rad/s")
                result.insert(0, (best.column.column, (series[0], rate)))
        return result

    def _turns(self, ranked: Mapping[str, list[Guess]]) -> list[tuple[str, Series]]:
        result: list[tuple[str, Series]] = []
        for name, column in self._columns.items():
            read = column.name
            if read.has(
                "rate", "gyro", "speed", "acceleration", "statistic", "command", "other"
            ) or column.kind not in (None, "angle"):
                continue
            if read.has("yaw", "heading") or (
                column.kind == "angle" and len(read.words) == 1 and not candidates_of(column)
            ):
                size = self._evidence.size(name)
                degrees = factor_to(column.unit, "rad") < 0.1 if column.unit else size > 7
                if (rate := self._evidence.rate_of_angle(name, degrees=degrees)) is not None:
                    result.append((name, rate))
        lateral = surest(ranked, "acceleration_y")
        ground = self._ground(ranked)
        if lateral is not None and lateral.unit is not None and ground is not None:
            series = self._evidence.series(lateral.column.column)
            if series is not None:
                speed = ground[1] * self._evidence.at(ground[0], series[0])
                with np.errstate(divide="ignore", invalid="ignore"):
                    sideways = np.where(
                        np.abs(speed) > 1.0, series[1] * factor_to(lateral.unit, "m/s^2") / speed, np.nan
                    )
                result.append((f"{lateral.column.column} over {ground[0]}", (series[0], sideways)))
        return result


def _sensor_of(guess: Guess) -> str:
    """A column's name without its axis: gyro_x and gyro_z are of one sensor."""
    return " ".join(word for word in guess.column.name.words if word != guess.column.name.axis)
