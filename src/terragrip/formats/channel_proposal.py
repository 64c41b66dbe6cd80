"""The proposal for one channel: its entry in a profile, what speaks for it, its doubts, and what only the user can give."""

from __future__ import annotations

import re
from dataclasses import dataclass

from terragrip.formats.candidates import Column, kind_of
from terragrip.formats.judgement import E7, Guess
from terragrip.formats.profile_parts import MADE_OF
from terragrip.formats.rim_units import radius_of
from terragrip.recording.schema import unit_of
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

SURE = 0.7
"""Confidence from which a proposal carries no question mark."""

# The drive: before the gear or behind it.
_EITHER_SIDE = re.compile(r"^(?!.*mot).*(antrieb|drive)", re.IGNORECASE)


@dataclass(frozen=True)
class Proposal:
    """What a channel may be made of: the keys of its entry in a profile, and what to look at.

    ``doubt`` is what was guessed (empty: nothing), ``give`` what only the user can add (a gear ratio, a torque constant),
    ``confidence`` (0 to 1) how well name and data agree, ``evidence`` what speaks for it, ``others`` proposals of other columns, best
    first, ``unit`` the column's own unit, as far as it is known.
    """

    entry: dict[str, object]
    doubt: str = ""
    give: str = ""
    confidence: float = 0.0
    evidence: tuple[str, ...] = ()
    others: tuple[Proposal, ...] = ()
    unit: str | None = None

    @property
    def is_doubtful(self) -> bool:
        """Whether its line carries a question mark: it is guessed, or holds a number that only the user can know."""
        return bool(self.doubt or self.give)

    @property
    def alternatives(self) -> tuple[str, ...]:
        """The columns of the other proposals."""
        return tuple(column for other in self.others for column in other.columns)

    @property
    def columns(self) -> tuple[str, ...]:
        """The log's columns that it would read."""
        result = next((self.entry[key] for key in ("from", *MADE_OF) if key in self.entry), None)
        return (result,) if isinstance(result, str) else tuple(result) if isinstance(result, list) else ()


def proposal_of(channel: str, guess: Guess, ranked: list[Guess], vehicle: Vehicle | None) -> Proposal:
    """The proposal of a ``guess``, and of its nearest rivals among all that were ``ranked`` for the channel."""
    others = sorted((g for g in ranked if g is not guess), key=lambda g: -g.confidence)
    entry, give, shown = _entry(channel, guess, vehicle)
    twin = next((g for g in others if _is_of_the_other_side(guess.column, g.column)), None)
    if channel in ("drawbar_force", "hitch_load") and twin is not None and "scale" not in entry:
        entry = {"sum_of": [entry.pop("from"), twin.column.column]} | entry
        shown = (*shown, "the sum of both sides")
    return Proposal(
        entry,
        _doubt(channel, guess, others),
        give,
        round(guess.confidence, 2),
        (*guess.evidence, *shown),
        tuple(proposal_of(channel, g, [], vehicle) for g in others[:3]),
        guess.unit or None,
    )


def _doubt(channel: str, guess: Guess, others: list[Guess]) -> str:
    if doubt := guess.doubt or guess.unit_doubt:
        return doubt
    if guess.confidence < SURE:
        return guess.why
    rival = next((g for g in others if g.confidence > guess.confidence - 0.02 and g.unit == guess.unit), None)
    of_a_wheel = channel.startswith(("wheel_speed_", "drive_torque_"))
    return f"or {rival.column.column}?" if of_a_wheel and rival is not None else ""


def _entry(
    channel: str, guess: Guess, vehicle: Vehicle | None
) -> tuple[dict[str, object], str, tuple[str, ...]]:
    """The keys of a channel's entry, the number in them that only the user can give, and what the vehicle's radius showed."""
    column, unit, target = guess.column, guess.unit, unit_of(channel)
    entry: dict[str, object] = {"from": column.column}
    torque, wheel_speed = (channel.startswith(name) for name in ("drive_torque_", "wheel_speed_"))
    kind = kind_of(unit)
    is_current = torque and kind in ("current", None) and column.name.has("current")
    if is_current or (torque and kind == "share"):
        side = " times the gear ratio" if column.name.has("motor") else ""
        what, of = ("a current", column.unit or "A") if is_current else ("a torque in %", "%")
        entry |= {"scale": 1.0, "unit": "N m"} if column.unit else {"scale": 1.0}
        return entry, f"{what}: the scale in N m per {of}{side} must be given by you", ()
    if wheel_speed and kind == "speed" and unit is not None:
        radius = radius_of(vehicle, channel.removeprefix("wheel_speed_"))
        entry |= {"scale": float(f"{factor_to(unit, 'm/s') / (radius or 1.0):.6g}"), "unit": "rad/s"}
        if radius is None:
            return entry, f"a rim speed in {unit}: divide the scale by the wheel's radius in m", ()
        return entry, "", (f"a rim speed in {unit}, by the vehicle's radius of {radius:.4g} m",)
    if unit == E7:
        entry["scale"] = factor_to(E7, "deg")
    elif unit and target and (unit != target or column.stated not in (None, unit)):
        entry["unit"] = unit
    if not (column.name.has("motor") and (torque or wheel_speed)):
        return entry, "", ()
    entry |= {"scale": 1.0} | ({"unit": unit} if unit and unit != target else {})
    turns = "wheel turns per motor turn" if wheel_speed else "motor turns per wheel turn"
    if _EITHER_SIDE.match(column.column):
        return (
            entry,
            f"at the wheel (scale 1), or motor side, which needs the gear ratio: the scale is {turns}",
            (),
        )
    return entry, f"motor side, needs the gear ratio: the scale is {turns}", ()


def _is_of_the_other_side(column: Column, other: Column) -> bool:
    """Whether two columns differ by left and right alone, as the pins of a hitch do."""
    sides = {"left", "right"}
    here, there = column.name.concepts, other.name.concepts
    return here ^ there == sides and len(here & sides) == 1 and column.unit == other.unit
