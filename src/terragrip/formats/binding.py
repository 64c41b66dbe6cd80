"""Which columns of a log a profile's names stand for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.document import Part
from terragrip.errors import InputError, nearest
from terragrip.formats.machines import of_one_machine
from terragrip.formats.profile_parts import MADE_OF, Source, TimeSource, matching
from terragrip.formats.table import LogTable
from terragrip.formats.vocabulary import GENERAL
from terragrip.recording.checks import how_to_pivot
from terragrip.recording.frames import names_and_units
from terragrip.recording.schema import TIME, rim_names
from terragrip.units import UnitError, factor_to

if TYPE_CHECKING:
    from terragrip.formats.profile import Profile

_NO_TORQUE = {"%", "percent", "A", "mA"}
_SIDEWAYS = 0.3  # of the forward speed: more than wheels slip sideways


def bound(profile: Profile, log: LogTable, *, partial: bool = False) -> tuple[Profile, list[str]]:
    """The profile with one existing column for each name, and sentences on what was left out.

    Of several candidates the first with a value counts. Raises InputError at the first column that the log lacks,
    and names the nearest one; an optional channel is left out instead, and of a ``partial`` log any.
    """
    profile = _as_spelt(profile, log)
    log, notes = _of_one_machine(profile, log)
    channels: dict[str, Source] = {}
    for name, origin in profile.channels.items():
        source = _chosen(name, origin, log, may_lack=origin.optional or partial)
        if source is not None:
            channels[name] = source
    silent = efforts(channels) if _are_zero(efforts(channels).values(), log) else {}
    if silent:
        columns = ", ".join(source.columns[0] for source in silent.values())
        notes.append(
            f"{columns} hold nothing but 0, as drivers do that measure no torque: {', '.join(silent)} are left out."
        )
        channels = {name: source for name, source in channels.items() if name not in silent}
    plain = [
        name
        for name, one in efforts(channels).items()
        if one.unit is None and abs(one.scale) == 1.0 and not any(c in log.units for c in one.columns)
    ]
    if plain:
        notes.append(
            f"{', '.join(plain)} are efforts of joints as N m, as ROS defines them; many drivers give a motor's current: ask yours. If "
            "it is N m, 'unit: N m' in a profile says so; of a current write 'scale', the motor's constant times the gear ratio."
        )
    plain = [n for n, one in channels.items() if n.startswith("drive_torque_") and _is_unscaled(one, log)]
    if plain:
        notes.append(
            f"{', '.join(plain)} are from columns in per cent or of a current, and a scale of 1 makes 1 N m of each % or A: write in the "
            "profile as 'scale' how many N m at the wheel one is."
        )
    for name, source in channels.items():
        origin = profile.channels[name]
        if len(origin.chain) > 1 or len(origin.candidates) > 1 or any("*" in c for c in origin.columns):
            notes.append(f"{name} is from {', '.join(source.columns)}.")
    notes += _of_other_axes(channels.get("ground_speed"), log)
    absent = [name for name in profile.channels if name not in channels and name not in silent]
    if absent and not partial:
        notes.append(f"The log has no {', '.join(absent)}, optional in the profile.")
    time, remarks = _clock(profile.time, log)
    rows = profile.rows
    if rows is not None and rows.column not in log.columns:
        if not partial:
            raise _missing(rows.column, log)
        rows = None
    update = {"channels": channels, "time": time, "rows": rows}
    return profile.model_copy(update=update), notes + remarks


def _chosen(name: str, origin: Source, log: LogTable, *, may_lack: bool) -> Source | None:
    """The first source of a channel that the log has; None where there is none, or on a bus none with a value, if it may lack one."""
    result = next((own for source in origin.chain if (own := _bound(source, log)) is not None), None)
    if result is not None and (not log.clocked or all(_holds(log, column) for column in result.columns)):
        return result
    if may_lack:
        return None
    if result is not None:
        problem = 'has no value: it was sent as "not available" or "error" throughout'
        hint = "name another source in the profile, or join a log that has it (--with)"
        raise InputError(problem, file=log.source, place=f"signal {', '.join(result.columns)}", hint=hint)
    every = [column for source in origin.chain for column in source.columns]
    lacking = next((c for c in every if not matching(c, log.columns)), every[0])
    several = len(origin.chain) > 1 or len(origin.candidates) > 1
    raise _missing(lacking, log, several_for=name if several else None)


def efforts(channels: Mapping[str, Source]) -> dict[str, Source]:
    """The drive torques that are a joint's effort in ROS, which a driver gives as 0 where it measures none."""
    return {
        name: source
        for name, source in channels.items()
        if name.startswith("drive_torque_") and any(".effort" in column for column in source.columns)
    }


def _is_unscaled(source: Source, log: LogTable) -> bool:
    """Whether a torque is a share or a current as the log has it: a proposed profile, for one, whose scale was not filled in."""
    names = [GENERAL.read(column) for column in source.columns]
    units = {log.units.get(c) or name.unit for c, name in zip(source.columns, names, strict=True)}
    factors = (source.scale, *(source.sum_of or {}).values())
    return (
        source.over is None
        and all(abs(factor) == 1.0 for factor in factors)
        and (
            bool(units & _NO_TORQUE) or any(name.has("current") and not name.has("torque") for name in names)
        )
    )


def _are_zero(sources: Iterable[Source], log: LogTable) -> bool:
    """Whether no column of some sources has a number other than 0."""
    every = [log.columns[column] for source in sources for column in source.columns]
    return all(values.dtype.kind in "fiu" and not np.nan_to_num(values).any() for values in every)


def _as_spelt(profile: Profile, log: LogTable) -> Profile:
    """The profile with the log's names, which are without units: ``Speed (km/h)`` is the column Speed of which the log states km/h."""
    names = {}
    for whole in profile.sources - log.columns.keys():
        (bare,), units = names_and_units([whole])
        if bare in log.columns and log.units.get(bare) == units.get(bare):
            names[whole] = bare

    def spelt(value: Any) -> Any:
        if isinstance(value, Part):
            return value.model_copy(update={k: spelt(getattr(value, k)) for k in value.model_fields_set})
        if isinstance(value, dict):
            return {spelt(key): spelt(own) for key, own in value.items()}
        return tuple(map(spelt, value)) if isinstance(value, tuple) else names.get(value, value)

    return spelt(profile) if names else profile


def _of_other_axes(speed: Source | None, log: LogTable) -> list[str]:
    """A sentence where the ground speed is one component of a velocity that has a large one beside it: then it is no forward speed."""
    forward = "" if speed is None or not isinstance(speed.column, str) else speed.column
    beside = re.sub(r"\.linear\.x$", ".linear.y", forward)
    held = [log.columns[c] for c in (forward, beside) if c in log.columns]
    if beside == forward or [values.dtype.kind in "fiu" for values in held] != [True, True]:
        return []
    along, across = (float(np.sqrt(np.nansum(np.square(values)))) for values in held)
    if across <= _SIDEWAYS * along:
        return []
    return [
        f"ground_speed may be one component of a velocity: {beside} is {across / max(along, 1e-9):.2g} times {forward}. Where they are "
        f"east and north, or of a map, write 'ground_speed: {{norm_of: [{forward}, {beside}]}}' in a profile."
    ]


def _of_one_machine(profile: Profile, log: LogTable) -> tuple[LogTable, list[str]]:
    """The log for patterns ``*...``, which may take nothing of a second machine, and a sentence on that (`of_one_machine`)."""
    names = {
        key: [n for one in source.chain for n in one.columns] for key, source in profile.channels.items()
    }
    found = {key: [c for n in own for c in matching(n, log.columns)] for key, own in names.items()}
    kept, notes = of_one_machine(log.columns, [found[key] for key in rim_names(found)])
    stated = [n for own in names.values() for n in own if not n.startswith("*")]
    kept += [c for n in stated for c in matching(n, log.columns) if c not in kept]
    return replace(log, columns={c: log.columns[c] for c in kept}), notes


def _clock(time: TimeSource, log: LogTable) -> tuple[TimeSource, list[str]]:
    """The time column with the unit that the log itself states, unless the profile gives another, which a note then says.

    Signals that have clocks of their own are in seconds under our name.
    """
    if time.column not in log.columns:
        if not log.clocked:
            raise _missing(time.column, log)
        if TIME not in log.columns:
            hint = "name some under 'channels:' ('terragrip inspect' shows them)"
            raise InputError("the profile reads none of its signals", file=log.source, hint=hint)
        return time.model_copy(update={"column": TIME, "unit": "s"}), []
    stated = log.units.get(time.column, time.unit)
    try:
        same = factor_to(stated, "s") == factor_to(time.unit, "s")
    except UnitError:  # no unit of time: a remark of the logger
        return time, []
    if "unit" not in time.model_fields_set:
        return time.model_copy(update={"unit": stated}), []
    sentence = f"The log states {stated} for {time.column}; the profile's {time.unit} is used."
    return time, [] if same else [sentence]


def _bound(origin: Source, log: LogTable) -> Source | None:
    """A source with existing columns for its names; None if the log lacks one, or has several alternatives without a value."""
    if origin.constant is not None:
        return origin
    key = next((key for key in MADE_OF if getattr(origin, key) is not None), "column")
    if key == "column":
        found = [column for name in origin.candidates for column in matching(name, log.columns)]
        columns = [next((column for column in found if _holds(log, column)), next(iter(found), ""))]
    else:
        columns = [next(iter(matching(name, log.columns)), "") for name in getattr(origin, key)]
    if "" in columns or (origin.otherwise is not None and not all(_holds(log, c) for c in columns)):
        return None
    made_of: object = columns[0] if key == "column" else tuple(columns)
    if origin.sum_of is not None:
        twice = next((c for c in columns if columns.count(c) > 1), None)
        if twice is not None:
            hint = "give each column a name of its own"
            raise InputError(f"names the column {twice} twice", place="sum_of", hint=hint)
        made_of = dict(zip(columns, origin.sum_of.values(), strict=True))
    result = origin.model_copy(update={key: made_of})
    return result if all(column in log.columns for column in result.columns) else None


def _holds(log: LogTable, column: str) -> bool:
    values = log.columns[column]
    return values.dtype.kind != "f" or bool(np.isfinite(values).any())


def _missing(column: str, log: LogTable, *, several_for: str | None = None) -> InputError:
    # A pattern is near to what it was made to leave out.
    close = nearest(column, log.names) if "*" not in column else None
    hint = f"the nearest column is {close!r}" if close else f"its columns are {', '.join(log.names[:12])}"
    # of several messages, or pages of one
    alike = [name for name in log.names if f".{column}." in f".{name}."]
    hint = how_to_pivot(log.names) or (f"the log has {', '.join(alike[:6])}" if len(alike) > 1 else hint)
    problem = "is missing, but the profile names it"
    if several_for is not None:
        problem += f" for {several_for}, and so are its alternatives"
        if "*" in column:
            hint = (
                f"name the log's own column for {several_for} in a profile ('terragrip inspect' proposes one)"
            )
    if column == TIME:
        problem, hint = "is missing", f"name it in the profile: 'time: {{from: ...}}'; {hint}"
    return InputError(problem, file=log.source, place=f"column {column}", hint=hint)
