"""Propose which column of a foreign log is which channel: by name, unit and data, with the evidence and a confidence.

A proposal without a question mark can be defended: its unit is stated, or the data tell it, and nothing speaks against it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.formats.agreement import Agreement
from terragrip.formats.axle_torques import axle_torque_hints, is_of_an_axle, of_the_only_wheel
from terragrip.formats.candidates import Column, candidates_of, columns_of, joint_column
from terragrip.formats.channel_proposal import Proposal, proposal_of
from terragrip.formats.evidence import Evidence
from terragrip.formats.indirect import add_indirect, velocity_in_the_plane
from terragrip.formats.judgement import Guess, Judge, varies
from terragrip.formats.machines import machines_among, namespace_of, without
from terragrip.formats.rim_units import own_name, place_of
from terragrip.formats.vocabulary import GENERAL, Vocabulary
from terragrip.recording.checks import PLACES
from terragrip.recording.schema import LABELS, rim_names, split_channel
from terragrip.vehicle import Vehicle

Texts = Mapping[str, npt.NDArray[Any]]

_OF_WHEELS = ("wheel_speed", "drive_torque")
_GROUNDS = frozenset(["ground", "boden", "bodenart", "untergrund", "sol", "suelo", "terreno", "suolo"])


class Proposals(dict[str, Proposal]):
    """Proposals by channel; ``left_out``: sentences on speeds and places by name that the others contradict too clearly to be proposed,
    and on torques of axles. ``namespace``: of the machine that they are of, where the log has several."""

    left_out: tuple[str, ...] = ()
    namespace = ""


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
    each column (n,), without which nothing is held against time. The radii of a ``vehicle`` tell the unit of wheel speeds. Of several
    machines (`machines_among`) the first is proposed.
    """
    constants = _constants(texts) if isinstance(texts, Mapping) else {}
    numbers = of_one_joint(numbers, texts)
    spaces: dict[str, list[str]] = {}
    for name in numbers:
        spaces.setdefault(namespace_of(name), []).append(name)
    spaces.pop("", None)
    rims = {
        space: _rims(columns_of(own, constants, units, vocabulary, space), space)
        for space, own in spaces.items()
        if len(spaces) > 1
    }
    bare = {space: [name.removeprefix(space) for name in own] for space, own in spaces.items()}
    home, *others = machines_among(bare, rims) or [""]
    own, sentences = without(numbers, home, others)
    result = _proposed(home, {name: numbers[name] for name in own}, texts, units, clocks, vocabulary, vehicle)
    result.left_out += tuple(sentences)
    result.namespace = home
    return result


def of_one_joint(numbers: Mapping[str, Floats], texts: Texts | tuple[str, ...]) -> dict[str, Floats]:
    """The columns without those of joints that are named anew in each row."""
    constants = _constants(texts) if isinstance(texts, Mapping) else {}
    changing = [name for name in texts if name not in constants]
    return {name: values for name, values in numbers.items() if joint_column(name, changing) is None}


def _rims(columns: Mapping[str, Column], namespace: str) -> list[str]:
    """The names inside a namespace that are speeds of wheels on both sides, or of more than two, else those of a drive train."""
    speeds: dict[str, str] = {}
    for name, column in columns.items():
        guess = next(iter(candidates_of(column)), None)
        channel = "" if guess is None else guess.channel
        of_an_axle = channel == "wheel_based_speed" and column.name.has("front", "rear")
        if rim_names([channel]) and not of_an_axle:
            speeds[name.removeprefix(namespace)] = channel
    wheels = {name: channel for name, channel in speeds.items() if channel.startswith("wheel_speed_")}
    both = {"l", "r"} <= {channel[-1] for channel in wheels.values()} or len(set(wheels.values())) > 2
    return list(wheels) if both else [name for name in speeds if name not in wheels]


def _proposed(
    namespace: str,
    numbers: Mapping[str, Floats],
    texts: Texts | tuple[str, ...],
    units: Mapping[str, str],
    clocks: Mapping[str, Floats] | None,
    vocabulary: Vocabulary,
    vehicle: Vehicle | None,
) -> Proposals:
    """The proposals of all columns, their names read inside a ``namespace``."""
    constants = _constants(texts) if isinstance(texts, Mapping) else {}
    columns = {
        name: of_the_only_wheel(column, vehicle)
        for name, column in columns_of(tuple(numbers), constants, units, vocabulary, namespace).items()
    }
    evidence = Evidence(numbers, clocks or {})
    plane = velocity_in_the_plane(columns, evidence)
    judge = Judge(columns, numbers, evidence)
    ranked: dict[str, list[Guess]] = {}
    for column in columns.values():
        for candidate in () if is_of_an_axle(column) else candidates_of(column):
            if column.column in plane and candidate.channel == "ground_speed":
                continue
            if (guess := judge.of(column, candidate)) is not None:
                ranked.setdefault(candidate.channel, []).append(guess)
    Agreement(columns, evidence, vehicle).refine(ranked)
    chosen = _beside_motors(_assigned(ranked))
    proposals = {
        channel: proposal_of(channel, guess, ranked[channel], vehicle) for channel, guess in chosen.items()
    }
    add_indirect(proposals, numbers, columns, plane, evidence, vehicle)
    for name in texts:
        read = vocabulary.read(name)  # of texts the ground is a label: a speed over it is none
        if name in LABELS or read.has("soil") or not _GROUNDS.isdisjoint(read.words):
            proposals.setdefault("soil", Proposal({"from": name}, confidence=0.8, evidence=("its name",)))
    named: dict[str, Proposal] = {}
    for channel, proposal in proposals.items():
        own = _in_the_log(channel, proposals) if vehicle is None else _in_the_vehicle(channel, vehicle)
        named[channel if own in proposals else own] = proposal  # left, where rear left is in the log, too
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


def _in_the_log(channel: str, channels: Iterable[str]) -> str:
    """A wheel's channel by the name that the log's own columns have for the wheel: left, beside a column wheel_speed_left."""
    quantity, wheel = split_channel(channel) or ("", "")
    wheels = {parts[1] for one in channels if (parts := split_channel(one)) and parts[0] in _OF_WHEELS}
    others = [one for one in wheels - {wheel} if quantity in _OF_WHEELS and place_of(one) == wheel]
    return f"{quantity}_{others[0]}" if len(others) == 1 else channel


def _held_against(vehicle: Vehicle | None, channel: str, proposal: Proposal) -> Proposal:
    """A proposal, in doubt where the vehicle has no such wheel."""
    quantity, wheel = split_channel(channel) or ("", "")
    if vehicle is None or proposal.doubt or quantity not in _OF_WHEELS or wheel in vehicle.wheels:
        return proposal
    return replace(proposal, doubt=f"the vehicle's wheels are {', '.join(vehicle.wheels)}")


def silent(
    numbers: Mapping[str, Floats], proposals: Mapping[str, Proposal], units: Mapping[str, str]
) -> list[str]:
    """Sentences on columns that go by the name of a speed, torque or pull that no other is, but hold nothing or never change."""
    notes = []
    named = ("ground_speed", "wheel_based_speed", "wheel_speed_", "drive_torque_", "drawbar_force")
    for name, column in columns_of(tuple(numbers), {}, units, GENERAL).items():
        values = numbers[name]
        guess = next(iter(candidates_of(column)), None)
        if guess is None or guess.channel in proposals or varies(values):
            continue
        if guess.channel.startswith(named):
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


def _beside_motors(chosen: Mapping[str, Guess]) -> dict[str, Guess]:
    """The guesses; torques that are said to be no wheel's are in doubt where the speeds are the motors': they may be, too."""
    speeds = [guess for channel, guess in chosen.items() if channel.startswith("wheel_speed_")]
    if not speeds or not all(guess.column.name.has("motor") for guess in speeds):
        return dict(chosen)
    doubt = "at the wheel, or the motor's, as the speeds are?"
    return {
        channel: replace(guess, doubt=doubt)
        if channel.startswith("drive_torque_")
        and not (guess.doubt or guess.column.name.has("wheel", "motor", "current"))
        else guess
        for channel, guess in chosen.items()
    }


def _constants(texts: Texts) -> dict[str, str]:
    """The text columns that hold one text throughout, with it."""
    result = {}
    for name, cells in texts.items():
        present = {str(cell) for cell in cells if cell not in (None, "")}
        if len(present) == 1:
            result[name] = present.pop()
    return result
