"""A profile to begin with: written out as YAML with its doubts beside it, or one that comes with Terragrip; and what a log lacks."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import yaml

from terragrip.errors import InputError
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.machines import renamed
from terragrip.formats.profile import SHIPPED, Profile
from terragrip.formats.profile_parts import Source, matching
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import LogTable
from terragrip.formats.time_column import TimeColumn
from terragrip.formats.vocabulary import GENERAL
from terragrip.recording import Recording
from terragrip.recording.checks import NOTHING_TOWED
from terragrip.recording.schema import has_engine_torque, has_torque, wheel_names_in

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle


def missing_channels(
    proposals: Collection[str], has_time: bool, columns: Collection[str] = (), vehicle: Vehicle | None = None
) -> list[str]:
    """What is not among the channels that are recognised, and what follows, as sentences; ``columns`` are the log's."""
    notes = [] if has_time else ["No time column is recognised: it is needed, in increasing seconds."]
    wheels = [w for w in wheel_names_in(proposals) if f"wheel_speed_{w}" in proposals]
    turns = bool(wheels) or "wheel_based_speed" in proposals
    if not turns:
        notes.append(
            "No wheel speed is recognised, nor a drive train's (wheel_based_speed): it is needed. A motor's speed "
            "becomes one by 'scale' (1/gear ratio), an encoder's count by 'derivative_of' (docs: formats#in-a-profile)."
        )
        notes += _without_order(columns)
    if "ground_speed" not in proposals:
        notes.append("No ground speed is recognised: slip and resistance need it; positions will do.")
    strange = [] if vehicle is None else sorted(set(wheels) - set(vehicle.wheels))
    if strange and vehicle is not None:
        notes.append(
            f"The vehicle file has no wheel {', '.join(strange)}; its wheels are {', '.join(vehicle.wheels)}: name them alike in the "
            "vehicle file or in a profile."
        )
        return notes
    # By the engine's torque, or slip alone, `estimate` needs no speed of each wheel.
    if wheels and vehicle is not None and any(name.startswith("drive_torque_") for name in proposals):
        notes += [
            f"No wheel speed is recognised for wheel {wheel} of the vehicle file, which is driven: name its column in a profile."
            for wheel, driven in zip(vehicle.wheels, vehicle.driven, strict=True)
            if driven and wheel not in wheels
        ]
    return [*notes, *_missing_forces(proposals, wheels, vehicle)] if turns else notes


def _without_order(columns: Collection[str]) -> list[str]:
    """A sentence on columns numbered from 0 that may be the wheels' (``speed[0]``, ``motors[0].rpm``): which is which nobody knows."""
    turning = ("speed", "rotation", "torque", "current")
    several = [name for name in columns if name.endswith("[1]")]
    several += [name for name in columns if "[1]." in name and GENERAL.read(name).has(*turning)]
    if not several:
        return []
    named = ", ".join(name.removesuffix("[1]").replace("[1]", "[]") for name in several)
    first = several[0].replace("[1]", "[0]")
    return [
        f"The order in {named} is not known: if they are the wheels', say which is which in a "
        f"profile, 'wheel_speed_fl: {{from: \"{first}\"}}'."
    ]


def _missing_forces(proposals: Collection[str], wheels: Sequence[str], vehicle: Vehicle | None) -> list[str]:
    """Sentences on torques, forces and slopes that were not found beside the speeds of ``wheels``, or of the drive train."""
    without = [wheel for wheel in wheels if f"drive_torque_{wheel}" not in proposals]
    if len(without) == len(wheels) and has_engine_torque(proposals):
        if vehicle is not None and vehicle.driveline is not None:
            return []
        return [
            "No wheel's drive torque is recognised, but the engine's: with a 'driveline' in the vehicle file the adhesion of all driven "
            "wheels together can be estimated, without it slip alone."
        ]
    if len(without) == len(wheels):
        return [
            "No drive torque is recognised (a motor's current, or the pressures on both sides of a hydraulic one, give it in a profile): "
            "slip, its zero-slip radius, distance and maps of slip can be estimated; adhesion, soil resistance, net traction, "
            "efficiency and soil curves cannot."
        ]
    driven = {} if vehicle is None else dict(zip(vehicle.wheels, vehicle.driven, strict=True))
    notes = [
        f"No drive torque is recognised for wheel {wheel}, which the vehicle file says is driven: name its column in a profile."
        if wheel in driven
        else f"No drive torque is recognised for wheel {wheel}: estimates need it, or 'driven: false' for its axle in the vehicle file."
        for wheel in without
        if driven.get(wheel, True)
    ]
    if "drawbar_force" not in proposals and (vehicle is None or vehicle.uncertainty.drawbar_force is None):
        notes.append(NOTHING_TOWED)
    if "acceleration_x" not in proposals:
        notes.append(
            "No acceleration_x is recognised: soil resistance is estimated from speed alone, more slowly."
        )
    if "pitch" not in proposals:
        notes.append(
            "No pitch is recognised: the ground is assumed level, and a slope appears as soil resistance."
        )
    return notes


def refusal(rows: int, channels: Collection[str], silent: Sequence[str]) -> str:
    """Why nothing can be estimated from a log of ``rows`` with these channels, whatever the profile; empty if something can.

    ``silent``: sentences on columns that have the name of a speed, but say nothing.
    """
    if "wheel_based_speed" in channels or any(c.startswith("wheel_speed_") for c in channels):
        return ""
    if not rows:
        return "has no rows: only the names of its columns were logged"
    result = (
        ", ".join(sorted(c for c in channels if not c.startswith("true_"))) or "nothing that Terragrip knows"
    )
    wheels = next((s for s in silent if "wheel_speed_" in s or "wheel_based_speed" in s), "").rstrip(".")
    if wheels:
        return f"has no wheel speed that ever changes: {wheels}"
    return f"has no wheel speed, nor one of the drive train: nothing can be estimated from it alone (found: {result})"


def is_ready(recording: Recording) -> bool:
    """Whether the recording has what estimates need of it: with speeds alone there is slip."""
    return "ground_speed" in recording and (bool(recording.wheels) or "wheel_based_speed" in recording)


def profile_text(
    file: str,
    stamp: TimeColumn | None,
    proposals: Mapping[str, Proposal],
    *,
    since_1970: bool,
    dbc: Sequence[str | os.PathLike[str]] = (),
    namespace: str = "",
    head: str = "Proposed by 'terragrip inspect' for {}. Check every line; '?' marks a doubt.",
) -> str:
    """A profile as YAML: loads as it stands, with a question mark where a line was guessed or lacks a number; ``head``: its first line.

    ``namespace``: of the machine that is proposed, of several.
    """
    lines = [f"# {head.format(file)}"]
    columns = [column for proposal in proposals.values() for column in proposal.columns]
    if not namespace or not all(column.startswith(f"{namespace}/") for column in columns):
        namespace = ""  # what is beside the machines has no name inside one
    else:
        lines.append(f"namespace: {namespace}   # of one of several machines; names are inside it")
    if stamp is None:
        lines.append("# time: {from: ???, unit: s}   # needed: no column looked like time")
    else:
        entry = {"from": stamp.name} | ({} if stamp.unit == "s" else {"unit": stamp.unit})
        entry |= {"dates": stamp.dates} if stamp.dates else {}
        entry |= {"nanoseconds": stamp.nanoseconds} if stamp.nanoseconds else {}
        doubt = f"   # ? {stamp.doubt}" if stamp.doubt else ""
        lines.append(f"time: {_flow(entry | ({'zero': 'first'} if since_1970 else {}))}{doubt}")
    if dbc:
        lines.append(f"dbc: {json.dumps([os.path.abspath(file) for file in dbc], ensure_ascii=False)}")
    lines.append("channels:" if proposals else "channels: {}")
    for channel in sorted(proposals, key=_order):
        proposal = proposals[channel]
        remarks = "; ".join(filter(None, (proposal.doubt, proposal.give)))
        entry = renamed(proposal.entry, lambda name: name.removeprefix(namespace))
        lines.append(f"  {channel}: {_flow(entry)}" + f"   # ? {remarks}" * proposal.is_doubtful)
    if not wheel_names_in(proposals) and "wheel_based_speed" not in proposals:
        lines.append("  # wheel_speed_fl: {from: ???, unit: rad/s}   # needed: one for each wheel")
    if "ground_speed" not in proposals:
        lines.append("  # ground_speed: {from: ???, unit: m/s}   # needed: or derivative_of two positions")
    if not has_torque(proposals) and not has_engine_torque(proposals):
        lines.append(
            "  # drive_torque_fl: {from: ???, unit: N m}   # of each driven wheel; without, slip alone"
        )
    return "\n".join(lines) + "\n"


def _order(channel: str) -> tuple[int, str]:
    first = ("wheel_speed_", "drive_torque_", "ground_speed", "drawbar_force")
    return next((k for k, prefix in enumerate(first) if channel.startswith(prefix)), len(first)), channel


def _flow(entry: Mapping[str, object]) -> str:
    """An entry on one line of YAML."""
    return yaml.safe_dump(
        dict(entry), default_flow_style=True, sort_keys=False, allow_unicode=True, width=1 << 16
    ).rstrip("\n")


@dataclass(frozen=True)
class Fit:
    """The shipped profiles that fit, the channels that they find, and sentences on those that nearly fit."""

    names: tuple[str, ...] = ()
    channels: frozenset[str] = frozenset()
    nearly: tuple[str, ...] = ()


def fit_of(log: LogTable | SignalLog) -> Fit:
    """Try the profiles that come with Terragrip on a log."""
    names: list[str] = []
    channels: set[str] = set()
    nearly: list[str] = []
    for name in SHIPPED:
        profile = Profile.load(name)
        if isinstance(log, SignalLog):
            own = {n: s for n, s in log.signals.items() if profile.wants(n)}
            table = replace(log, signals=own).table() if own else None
        else:
            table = log
        try:
            recording = None if table is None else profile.apply(table)
        except InputError:
            recording = None
        if recording is not None and is_ready(recording):
            names.append(name)
            channels |= recording.channels.keys()
        elif text := _nearly(name, profile, log.names):
            nearly.append(text)
    return Fit(tuple(names), frozenset(channels), () if names else tuple(nearly))


def _nearly(name: str, profile: Profile, columns: tuple[str, ...]) -> str:
    """A sentence on a profile of which some of the speeds are there; empty if none is, or all are."""
    needed = {c: s for c, s in profile.channels.items() if not s.optional}
    result = {c: near for c, source in needed.items() if (near := _present(source, columns))}
    lacking = [c for c in needed if c not in result]
    if not result or not lacking:
        return ""
    there = ", ".join(f"{channel} <- {column}" for channel, column in result.items())
    wanted = {c: [column for one in needed[c].chain for column in one.columns] for c in lacking[:4]}
    away = "; ".join(f"{channel} (by the names {', '.join(names[:3])})" for channel, names in wanted.items())
    return f"The profile {name} nearly fits: {there}; but no {away}."


def _present(source: Source, columns: tuple[str, ...]) -> str:
    """The columns that a source or one in its place would read, all of which are there; empty if none is."""
    for one in source.chain:
        if one.candidates:
            hit = next((near for name in one.candidates for near in matching(name, columns)), "")
        else:
            parts = [next(iter(matching(name, columns)), "") for name in one.columns]
            hit = ", ".join(parts) if parts and all(parts) else ""
        if hit:
            return hit
    return ""
