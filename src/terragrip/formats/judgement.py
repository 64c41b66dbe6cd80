"""Judge a candidate by the data: its range, its unit, and what the other columns say of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.candidates import ON_THE_BUS, Candidate, Column, kind_of, unit_on_the_bus
from terragrip.formats.evidence import Evidence, Finding
from terragrip.recording.schema import unit_of
from terragrip.units import UnitError, factor_to

_LARGEST = {
    "m/s": 150.0,
    "rad/s": 2000.0,
    "m/s^2": 200.0,
    "N m": 1e6,
    "N": 1e6,
    "kg": 2e5,
    "m": 12_000.0,
    "deg": 180.001,
}
E7 = "deg*1e-7"
"""Receivers and flight controllers write degrees so, in whole numbers."""
_STEEP = 0.8  # rad: no vehicle leans or climbs so for long
_CONSTANTS = ("engine_friction_share", "engine_reference_torque")  # an engine's own, which hardly change
_STANDING = 0.5  # m/s, under which wheels may stand still throughout


@dataclass(frozen=True)
class Guess:
    """A candidate as judged: ``confidence`` (0 to 1), the column's ``unit`` (None: unknown), what speaks for it and against it.

    ``doubt`` stays; ``unit_doubt`` is of the unit alone and goes where a check tells the unit. ``contradicted``: the data tell another
    unit than the one stated.
    """

    column: Column
    channel: str
    confidence: float
    why: str
    unit: str | None = None
    evidence: tuple[str, ...] = ()
    doubt: str = ""
    unit_doubt: str = ""
    contradicted: bool = False

    def with_finding(self, finding: Finding | None) -> Guess:
        """The guess after a check: surer, or in doubt; the unit that the sizes tell counts where none is stated."""
        if finding is None:
            return self
        if not finding.agrees:
            return replace(self, confidence=0.5 * self.confidence, doubt=finding.sentence)
        stated = self.column.unit
        if stated is not None and finding.unit is not None and not _same(stated, finding.unit):
            sentence = f"stated in {stated}, but {finding.sentence}"
            return replace(self, confidence=0.6 * self.confidence, doubt=sentence, contradicted=True)
        surer = 1 - 0.45 * (1 - self.confidence)
        unit = stated or finding.unit or self.unit
        left = self.unit_doubt if finding.unit is None and stated is None else ""
        return replace(
            self, confidence=surer, unit=unit, evidence=(*self.evidence, finding.sentence), unit_doubt=left
        )


class Judge:
    """Judges candidates one by one, by the values of the columns of one log."""

    def __init__(
        self, columns: Mapping[str, Column], numbers: Mapping[str, Floats], evidence: Evidence
    ) -> None:
        self._columns, self._numbers, self._evidence = columns, numbers, evidence
        self._in_degrees = any(
            c.name.has("pitch", "roll", "yaw", "heading")
            and not c.name.has("rate", "gyro", "speed", "acceleration", "statistic")
            and 7 < evidence.size(n) <= 360
            for n, c in columns.items()
        )

    def of(self, column: Column, candidate: Candidate) -> Guess | None:
        """A column as a candidate says, with its unit, judged by its own values; None where they rule it out."""
        channel, target, own = candidate.channel, unit_of(candidate.channel), candidate.score == 1.0
        values = self._numbers[column.column]
        known, moves = values[np.isfinite(values)], own or channel in _CONSTANTS or varies(values)
        if not len(known) or not (moves or len(known) < 3 or self._may_stand(candidate, known)):
            return None
        guess = Guess(column, channel, candidate.score, candidate.why, column.unit, (candidate.why,))
        if column.unit is not None:
            if (
                target is not None
                and not own
                and _too_large(guess, self._evidence.size(column.column), target)
            ):
                return None
            surer = candidate.score if own else 1 - 0.7 * (1 - candidate.score)  # it measures the same
            guess = replace(guess, confidence=surer, evidence=(candidate.why, f"in {column.unit}"))
        elif target is not None and (
            not own or (target == "rad" and (self._in_degrees or self._evidence.size(column.column) > 1.6))
        ):
            guess = self._sized(guess, target)
        elif own:
            guess = replace(guess, unit=target)
        if channel.startswith("drive_torque_") and column.name.has("current"):
            guess = replace(guess, unit_doubt="", unit=column.unit)
        if channel in ("pitch", "roll") and guess.unit is not None:
            angle = self._evidence.size(column.column) * factor_to(guess.unit, "rad")
            if angle > _STEEP:
                doubt = f"reaches {np.degrees(angle):.0f} deg: a vehicle's?"
                guess = replace(guess, confidence=0.6 * guess.confidence, doubt=doubt)
        if len(known) < 3 and not own:
            return replace(guess, doubt=f"{len(known)} value{'s' * (len(known) > 1)} only")
        if not moves:
            doubt = f"is {known[0]:.4g} throughout"
            return replace(guess, confidence=0.6 * guess.confidence, doubt=doubt)
        return guess

    def _may_stand(self, candidate: Candidate, known: Floats) -> bool:
        """Whether a column of zeros may be a wheel's speed: the ground speed says that the vehicle stands."""
        if not candidate.channel.startswith(("wheel_speed_", "wheel_based_speed")) or known[0] != 0:
            return False
        for name, column in self._columns.items():
            over_ground = column.name.has("speed") and not column.name.has(
                "wheel", "vertical", "statistic", "command"
            )
            if over_ground and column.kind == "speed" and column.unit and varies(self._numbers[name]):
                return self._evidence.size(name) * factor_to(column.unit, "m/s") < _STANDING
        return False

    def _sized(self, guess: Guess, target: str) -> Guess:
        """The unit of a column that states none, by the size of its values: with a doubt, unless nothing else is likely."""
        size = self._evidence.size(guess.column.column)
        if guess.channel in ("latitude", "longitude"):
            return replace(guess, unit="deg")
        if guess.channel == "altitude":
            return replace(guess, unit="m")
        if guess.why == ON_THE_BUS and (usual := unit_on_the_bus(guess.channel)) is not None:
            return replace(guess, unit=usual, unit_doubt=f"no unit is stated: {usual}?")
        if target == "rad":
            if size > 1.6 or self._in_degrees:
                sure = size > 7 or self._in_degrees
                return replace(
                    guess,
                    unit="deg",
                    unit_doubt="" if sure else "the magnitudes suggest degrees",
                    evidence=(guess.why, "its magnitude suggests degrees"),
                )
            return replace(guess, unit="rad", unit_doubt="no unit is stated: rad?")
        if guess.channel.startswith("wheel_speed_") and size > 40:
            return replace(guess, unit="rad/s", unit_doubt=f"reaches {size:.3g}: rpm or deg/s?")
        if target == "rad/s" and guess.channel.startswith("angular") and size > 12:
            return replace(guess, unit="deg/s", evidence=(guess.why, "its magnitude suggests deg/s"))
        effort = ", or a current, as many drivers give it" if "effort" in guess.column.name.words else ""
        return replace(guess, unit=target, unit_doubt=f"no unit is stated: {target}{effort}?")


def varies(values: Floats) -> bool:
    """Whether two of the values (n,) are known and differ."""
    known = values[np.isfinite(values)]
    return len(known) > 0 and bool(known.max() > known.min())


def _same(unit: str, other: str) -> bool:
    """Whether two units are of one size (as far as sizes tell: within a tenth)."""
    try:
        return 0.88 < factor_to(unit, other) < 1.14
    except UnitError:
        if not kind_of(unit) == kind_of(other) == "acceleration":
            return False
        return 0.88 < factor_to(unit, "m/s^2") / factor_to(other, "m/s^2") < 1.14  # G is g


def _too_large(guess: Guess, size: float, target: str) -> bool:
    limit = _LARGEST.get(target)
    if limit is None or guess.unit is None:
        return False
    try:
        return size * factor_to(guess.unit, target) > limit
    except UnitError:
        return False  # a rim speed, a current
