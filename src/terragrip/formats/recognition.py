"""Propose which column of a foreign log is which channel: by name, unit and data, with the evidence and a confidence.

A proposal without a question mark can be defended: its unit is stated, or the data tell it, and nothing speaks against it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.formats.agreement import Agreement
from terragrip.formats.axle_torques import axle_torque_hints, is_of_an_axle, of_the_only_wheel
from terragrip.formats.candidates import Column, candidates_of, columns_of, kind_of
from terragrip.formats.evidence import Evidence
from terragrip.formats.judgement import E7, Guess, Judge
from terragrip.formats.profile_parts import MADE_OF
from terragrip.formats.rim_units import own_name, radius_of
from terragrip.formats.vocabulary import GENERAL, Vocabulary
from terragrip.recording.checks import PLACES
from terragrip.recording.schema import LABELS, split_channel, unit_of
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

Texts = Mapping[str, npt.NDArray[Any]]

SURE = 0.7
"""Confidence from which a proposal carries no question mark."""

_OF_WHEELS = ("wheel_speed", "drive_torque")
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


class Proposals(dict[str, Proposal]):
    """Proposals by channel; ``left_out``: sentences on speeds and places by name that the others contradict too clearly to be proposed,
    and on torques of axles."""

    left_out: tuple[str, ...] = ()


def propose(
    numbers: Mapping[str, Floats],
    texts: Texts | tuple[str, ...],
    units: Mapping[str, str],
    clocks: Mapping[str, Floats] | None = None,
    vocabulary: Vocabulary = GENERAL,
    vehicle: Vehicle | None = None,
) -> Proposals:
    """A `Proposal` for each channel that some column may be, by channel.

    ``numbers`` are the columns (n,), ``texts`` the text columns, ``units`` those that the log states, ``clocks`` the instants [s] of
    each column (n,), without which nothing is held against time. The radii of a ``vehicle`` tell the unit of wheel speeds.
    """
    constants = _constants(texts) if isinstance(texts, Mapping) else {}
    columns = {
        name: of_the_only_wheel(column, vehicle)
        for name, column in columns_of(tuple(numbers), constants, units, vocabulary).items()
    }
    evidence = Evidence(numbers, clocks or {})
    plane = _velocity_in_the_plane(columns, evidence)
    judge = Judge(columns, numbers, evidence)
    ranked: dict[str, list[Guess]] = {}
    for column in columns.values():
        for candidate in () if is_of_an_axle(column) else candidates_of(column):
            if column.column in plane and candidate.channel == "ground_speed":
                continue
            if (guess := judge.of(column, candidate)) is not None:
                ranked.setdefault(candidate.channel, []).append(guess)
    Agreement(columns, evidence, vehicle).refine(ranked)
    chosen = _assigned(ranked)
    proposals = {
        channel: _proposal(channel, guess, ranked[channel], vehicle) for channel, guess in chosen.items()
    }
    _add_derived(proposals, numbers, columns, plane)
    for name in texts:
        if name in LABELS or vocabulary.read(name).has("soil"):
            proposals.setdefault("soil", Proposal({"from": name}, confidence=0.8, evidence=("its name",)))
    named = {_in_the_vehicle(c, vehicle): proposal for c, proposal in proposals.items()}
    result = Proposals({channel: _held_against(vehicle, channel, p) for channel, p in named.items()})
    used = {column for proposal in result.values() for column in proposal.columns}
    unused = [column for name, column in columns.items() if name not in used]
    result.left_out = (*_left_out(ranked, chosen, vehicle), *axle_torque_hints(unused, vehicle))
    return result


def _left_out(
    ranked: Mapping[str, list[Guess]], chosen: Mapping[str, Guess], vehicle: Vehicle | None
) -> Iterator[str]:
    used = {guess.column.column for guess in chosen.values()}
    for channel, guesses in ranked.items():
        best = max(guesses, key=lambda guess: guess.confidence, default=None)
        if best is None or channel in chosen or best.column.column in used or not best.doubt:
            continue
        if channel in ("ground_speed", *PLACES) or channel.startswith("wheel_speed_"):
            unit = f" in {best.unit}" if best.unit else ""
            yield (
                f"{best.column.column}{unit} has the name of {_in_the_vehicle(channel, vehicle)}, but {best.doubt}: check its unit."
            )


def _in_the_vehicle(channel: str, vehicle: Vehicle | None) -> str:
    """A wheel's channel by the name that the vehicle has for the wheel."""
    quantity, wheel = split_channel(channel) or ("", "")
    return f"{quantity}_{own_name(vehicle, wheel)}" if wheel else channel


def _held_against(vehicle: Vehicle | None, channel: str, proposal: Proposal) -> Proposal:
    """A proposal, in doubt where the vehicle has no such wheel."""
    quantity, wheel = split_channel(channel) or ("", "")
    if vehicle is None or proposal.doubt or quantity not in _OF_WHEELS or wheel in vehicle.wheels:
        return proposal
    return replace(proposal, doubt=f"the vehicle's wheels are {', '.join(vehicle.wheels)}")


def silent(
    numbers: Mapping[str, Floats], proposals: Mapping[str, Proposal], units: Mapping[str, str]
) -> list[str]:
    """Sentences on columns that go by the name of a speed or torque which was not found, but hold nothing or never change."""
    notes = []
    for name, column in columns_of(tuple(numbers), {}, units, GENERAL).items():
        values = numbers[name]
        guess = next(iter(candidates_of(column)), None)
        if guess is None or guess.channel in proposals or _varies(values):
            continue
        if guess.channel.startswith(("ground_speed", "wheel_based_speed", "wheel_speed_", "drive_torque_")):
            known = values[np.isfinite(values)]
            held = f"is {known[0]:.4g} throughout" if len(known) else "has no value"
            notes.append(f"{name} has the name of {guess.channel}, but {held}.")
    return notes[:6]


def _assigned(ranked: Mapping[str, list[Guess]]) -> dict[str, Guess]:
    """One column for each channel, the surest first; no column serves two."""
    chosen: dict[str, Guess] = {}
    taken: set[str] = set()
    pairs = [(guess, channel) for channel, guesses in ranked.items() for guess in guesses]
    for guess, channel in sorted(pairs, key=lambda pair: -pair[0].confidence):
        if channel not in chosen and guess.column.column not in taken and guess.confidence >= 0.25:
            chosen[channel] = guess
            taken.add(guess.column.column)
    wheels = [c for c in chosen if c.startswith("wheel_speed_")]
    if wheels and any(not chosen[w].column.name.has("motor") for w in wheels):
        for wheel in wheels:  # motors, though wheels are there
            if chosen[wheel].column.name.has("motor"):
                del chosen[wheel]
    return chosen


def _proposal(channel: str, guess: Guess, ranked: list[Guess], vehicle: Vehicle | None) -> Proposal:
    others = sorted((g for g in ranked if g is not guess), key=lambda g: -g.confidence)
    doubt = guess.doubt or guess.unit_doubt
    if not doubt and guess.confidence < SURE:
        doubt = guess.why
    rival = next((g for g in others if g.confidence > guess.confidence - 0.02 and g.unit == guess.unit), None)
    if not doubt and rival is not None and channel.startswith(("wheel_speed_", "drive_torque_")):
        doubt = f"or {rival.column.column}?"
    entry: dict[str, object] = {"from": guess.column.column}
    target = unit_of(channel)
    unit, give = guess.unit, ""
    shown: tuple[str, ...] = ()
    kind = kind_of(unit)
    torque = channel.startswith("drive_torque_")
    is_current = torque and kind in ("current", None) and guess.column.name.has("current")
    if is_current or (torque and kind == "share"):
        entry |= {"scale": 1.0, "unit": "N m"} if guess.column.unit else {"scale": 1.0}
        side = " times the gear ratio" if guess.column.name.has("motor") else ""
        what, of = ("a current", "A") if is_current else ("a torque in %", "%")
        give = f"{what}: the scale in N m per {of}{side} must be given by you"
    elif channel.startswith("wheel_speed_") and kind == "speed" and unit is not None:
        radius = radius_of(vehicle, channel.removeprefix("wheel_speed_"))
        entry |= {"scale": float(f"{factor_to(unit, 'm/s') / (radius or 1.0):.6g}"), "unit": "rad/s"}
        if radius is None:
            give = f"a rim speed in {unit}: divide the scale by the wheel's radius in m"
        else:
            shown = (f"a rim speed in {unit}, by the vehicle's radius of {radius:.4g} m",)
    elif unit == E7:
        entry["scale"] = factor_to(E7, "deg")
    elif unit and target and (unit != target or guess.column.stated not in (None, unit)):
        entry["unit"] = unit
    if (
        guess.column.name.has("motor")
        and not (give or shown)
        and channel.startswith(("wheel_speed_", "drive_torque_"))
    ):
        entry |= {"scale": 1.0} | ({"unit": unit} if unit and unit != target else {})
        turns = "wheel turns per motor turn" if channel.startswith("wheel") else "motor turns per wheel turn"
        give = f"motor side, needs the gear ratio: the scale is {turns}"
        if _EITHER_SIDE.match(guess.column.column):
            give = f"at the wheel (scale 1), or motor side, which needs the gear ratio: the scale is {turns}"
    twin = next((g for g in others if _is_of_the_other_side(guess.column, g.column)), None)
    if channel in ("drawbar_force", "hitch_load") and twin is not None and "scale" not in entry:
        entry = {"sum_of": [entry.pop("from"), twin.column.column]} | entry
        shown = (*shown, "the sum of both sides")
    return Proposal(
        entry,
        doubt,
        give,
        round(guess.confidence, 2),
        (*guess.evidence, *shown),
        tuple(_proposal(channel, g, [], vehicle) for g in others[:3]),
        unit or None,
    )


def _is_of_the_other_side(column: Column, other: Column) -> bool:
    """Whether two columns differ by left and right alone, as the pins of a hitch do."""
    sides = {"left", "right"}
    here, there = column.name.concepts, other.name.concepts
    return here ^ there == sides and len(here & sides) == 1 and column.unit == other.unit


def _add_derived(
    proposals: dict[str, Proposal],
    numbers: Mapping[str, Floats],
    columns: Mapping[str, Column],
    plane: tuple[str, str] | tuple[()],
) -> None:
    """Ground speed from two velocities or positions, pitch from a quaternion, where no column is it."""
    pose = _quaternion(tuple(numbers))
    speed = _derived_speed(proposals, numbers, columns, plane, pose)
    if "ground_speed" not in proposals and speed is not None:
        proposals["ground_speed"] = speed
    made_of_wheels = any("odometry" in columns[c].name.concepts for c in pose)
    if (
        "pitch" not in proposals
        and pose
        and not made_of_wheels
        and all(_varies(numbers[c]) for c in pose[:2])
    ):
        proposals["pitch"] = Proposal(
            {"pitch_of": pose}, "axes forward, left, up?", "", 0.5, ("a quaternion",)
        )


def _derived_speed(
    proposals: Mapping[str, Proposal],
    numbers: Mapping[str, Floats],
    columns: Mapping[str, Column],
    plane: tuple[str, str] | tuple[()],
    pose: list[str],
) -> Proposal | None:
    if parts := _east_and_north(columns) or plane:
        unit = columns[parts[0]].unit
        entry: dict[str, object] = {"norm_of": list(parts)}
        entry |= {"unit": unit} if unit and unit != "m/s" else {}
        doubt = "" if unit else "no unit is stated: m/s?"
        return Proposal(entry, doubt, "", 0.8, ("two velocities in the plane",), (), unit)
    if pair := _position_pair(numbers, columns):
        forward = {"quaternion": pose} if pose else _yaw(numbers, columns)
        unit = columns[pair[0]].unit if columns[pair[0]].kind == "length" else None
        entry = {"derivative_of": list(pair), "unit": unit or "m", "window": "0.5 s"}
        entry |= {"forward": forward} if forward else {}
        sign = "x forward at yaw 0?" if forward else "a heading under 'forward:' would give its sign"
        doubt = ("" if unit else "positions in m? ") + sign
        return Proposal(entry, doubt, "", 0.5, ("two positions",), (), unit or "m")
    place = [proposals[c] for c in ("latitude", "longitude") if c in proposals]
    if len(place) < 2 or place[0].unit != place[1].unit:
        return None
    if any(one.doubt or one.entry.get("unit", "deg") != "deg" for one in place):
        return None
    entry = {"derivative_of": [one.columns[0] for one in place], "unit": "deg", "window": "2 s"}
    entry |= {key: value for key, value in place[0].entry.items() if key == "scale"}
    return Proposal(entry, "no speed: from positions?", "", 0.5, ("latitude and longitude",), (), "deg")


def _east_and_north(columns: Mapping[str, Column]) -> tuple[str, str] | None:
    """Two velocity columns, east and north, of one unit."""
    parts: dict[str, str] = {}
    for name, column in columns.items():
        read = column.name
        beside = read.has("statistic", "command", "vertical", "other")
        if read.has("speed") and not beside and column.kind in (None, "speed"):
            for side in ("east", "north"):
                if read.has(side):
                    parts.setdefault(side, name)
    if len(parts) == 2 and columns[parts["east"]].unit == columns[parts["north"]].unit:
        return parts["east"], parts["north"]
    return None


def _velocity_in_the_plane(columns: Mapping[str, Column], evidence: Evidence) -> tuple[str, str] | tuple[()]:
    """A receiver's velocities x and y, of which neither is along the vehicle: both are great."""
    for name, column in columns.items():
        read = column.name
        if read.axis != "x" or not (read.has("ground") and read.has("speed")):
            continue
        if read.has("statistic", "command", "position", "rate", "gyro"):
            continue
        for other, beside in columns.items():
            if beside.name.axis == "y" and beside.name.words == (*read.words[:-1], "y"):
                small, great = sorted((evidence.size(name), evidence.size(other)))
                if small > 0.3 * great and column.kind in (None, "speed") and column.unit == beside.unit:
                    return name, other
    return ()


def _constants(texts: Texts) -> dict[str, str]:
    """The text columns that hold one text throughout, with it."""
    result = {}
    for name, cells in texts.items():
        present = {str(cell) for cell in cells if cell not in (None, "")}
        if len(present) == 1:
            result[name] = present.pop()
    return result


def _varies(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 0 and bool(known.max() > known.min())


def _quaternion(names: tuple[str, ...]) -> list[str]:
    """Four columns that look like a quaternion x, y, z, w; empty if there are none."""
    for name in names:
        match = re.fullmatch(r"(.*(?:quat|orientation|quaternion)[_.]?|(?:.*_)?q)x", name, re.IGNORECASE)
        if match and all(f"{match[1]}{axis}" in names for axis in "yzw"):
            return [f"{match[1]}{axis}" for axis in "xyzw"]
    return []


def _yaw(numbers: Mapping[str, Floats], columns: Mapping[str, Column]) -> dict[str, str]:
    """A yaw column and its unit, as a profile's ``forward:``; empty if there is none."""
    for name, values in numbers.items():
        read = columns[name].name
        if read.has("yaw") and not read.has("rate", "speed", "gyro", "acceleration") and _varies(values):
            unit = columns[name].unit or ("deg" if np.nanmax(np.abs(values)) > 7 else "rad")
            if unit in ("deg", "rad"):
                return {"yaw": name, "unit": unit}
    return {}


def _position_pair(numbers: Mapping[str, Floats], columns: Mapping[str, Column]) -> tuple[str, str] | None:
    """Two columns that look like a position in a plane: bare x, y, or names of positions that differ by x, y.

    Odometry is no such position: it is made of the wheel speeds, so that slip would be hidden.
    """
    names = [n for n, values in numbers.items() if _varies(values) and not columns[n].name.has("odometry")]
    for first, second in (("x", "y"), ("e", "n"), ("easting", "northing")):
        for name in names:
            match = re.fullmatch(rf"(.*?)({first})", name, re.IGNORECASE)
            if not match or (match[1] and not match[1].endswith(("_", "."))):
                continue
            other = match[1] + (second.upper() if match[2].isupper() else second)
            read = columns[name]
            about = first != "x" or not match[1] or read.name.has("position")
            if read.kind not in (None, "length") or read.name.has(
                "acceleration", "gyro", "speed", "force", "rate"
            ):
                continue
            if other in names and about:
                return name, other
    return None
