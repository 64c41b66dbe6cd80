"""Apply a profile to a log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError
from terragrip.formats.binding import bound, efforts
from terragrip.formats.derivation import (
    beside_heading,
    derivative,
    fresh_positions,
    pitch_of,
    quotient,
    roll_of,
    unrolled,
    yaw_of,
)
from terragrip.formats.profile_parts import Rows, Source, matching, rate_unit
from terragrip.formats.signals import SAME, union
from terragrip.formats.stamps import Stamps
from terragrip.formats.table import LogTable
from terragrip.formats.time_base import time_base, with_nanoseconds
from terragrip.physics.geodesy import metres_of
from terragrip.recording import Recording
from terragrip.recording.checks import PLACES, refuse_place
from terragrip.recording.columns import numbers, texts
from terragrip.recording.frames import frame_of
from terragrip.recording.repeats import merged
from terragrip.recording.schema import LABELS, TIME, unit_of
from terragrip.units import UnitError, factor_to, quantity

if TYPE_CHECKING:
    from terragrip.formats.profile import Profile

Column = npt.NDArray[Any]
_CRAB = np.radians(10.0)  # beside a heading: the speed along it is 2 % less than that of the path
_TOGETHER = 0.8  # path and heading, which keep one angle
_CONVERTED = 0.01  # a scale so near the factor of the log's unit is that factor


@dataclass(frozen=True, eq=False)
class Part:
    """Channels of one log on its own time base; ``start``: when time 0 was [s since 1970], if that is known."""

    time: Floats
    columns: dict[str, Column]
    source: str | None
    sha256: str | None
    notes: tuple[str, ...]
    noise: dict[str, float]
    start: float | None


def convert(profile: Profile, log: Any, source: str | None = None) -> Recording:
    """The recording that ``profile`` makes of ``log`` (see `Profile.apply`)."""
    if not isinstance(log, LogTable):
        table = frame_of(log, source)
        log = LogTable(tuple(table.columns), table.columns, table.units, source, notes=table.notes)
    part = converted(profile, log)
    frame = {TIME: part.time, **part.columns}
    recording = Recording.from_frame(
        frame, part.source, sha256=part.sha256, notes=part.notes, noise=part.noise, start=part.start
    )
    return replace(recording, profiles=(profile.to_dict(),))


def converted(profile: Profile, log: LogTable, *, partial: bool = False) -> Part:
    """The channels that ``profile`` makes of a log; where it is ``partial``, those that it can make of this one."""
    profile, notes = bound(profile, log, partial=partial)
    log = with_nanoseconds(profile.time.column, profile.time.nanoseconds, log)
    log = Stamps(profile.time.column, profile.time.unit).corrected(log)
    wanted = asked(profile, log.columns)
    columns, repeats = merged({n: c for n, c in log.columns.items() if n in wanted}, profile.time.column)
    log = replace(log, columns=columns)
    notes += repeats.notes()
    time, start, remarks = time_base(profile.time, log)
    notes += remarks
    channels: dict[str, Column] = {}
    noise: dict[str, float] = {}
    for name, origin in profile.channels.items():
        channels[name], deviation = _channel(name, origin, log, time)
        if deviation is not None:
            noise[name] = deviation
            what = "derivative" if origin.derivative_of else "mean"
            notes.append(
                f"{name} is the {what} of {', '.join(origin.derivative_of or origin.candidates)} over "
                f"{origin.window:g} s, with a standard deviation of about {deviation:.2g} {unit_of(name)}."
            )
        if origin.forward is not None:
            notes += _heading_notes(name, origin, log, time)
    if profile.rows is not None:
        keep = _kept(profile.rows, log)
        time, channels = time[keep], {name: values[keep] for name, values in channels.items()}
    delays = {name: origin.delay for name, origin in profile.channels.items()}
    # A faulty time base is left as it is, for the recording's own checks to name.
    if len(time) and np.isfinite(time).all() and bool((np.diff(time) > 0).all()):
        time, channels = _shifted(time, channels, delays)
    return Part(time, channels, log.source, log.sha256, (*log.notes, *notes), noise, start)


def _shifted(
    time: Floats, channels: dict[str, Column], delays: dict[str, float]
) -> tuple[Floats, dict[str, Column]]:
    """Channels (n,) that were stamped ``delays`` [s] late, on the union of their instants: NaN where not measured; a text lasts until
    the next."""
    late = sorted(set(delays.values()))
    if late in ([], [0.0]):
        return time, channels
    # Closer stamps are one instant, so that rounding makes no rows of its own.
    tolerance = SAME * float(np.min(np.diff(time))) if len(time) > 1 else 0.0
    instants, rows = union([time - delay for delay in late], tolerance)
    place, result = dict(zip(late, rows, strict=True)), {}
    for name, values in channels.items():
        if values.dtype.kind == "O":
            since = np.zeros(len(instants), dtype=np.intp)
            since[place[delays[name]]] = np.arange(1, len(values) + 1)
            result[name] = np.r_[np.array([""], dtype=object), values][np.maximum.accumulate(since)]
        else:
            result[name] = np.full(len(instants), np.nan, values.dtype)
            result[name][place[delays[name]]] = values
    return instants, result


def asked(profile: Profile, names: Iterable[str]) -> set[str]:
    """Which columns ``names`` of a log the profile may read."""
    rows = () if profile.rows is None else (profile.rows.column,)
    every = {c for origin in profile.channels.values() for one in origin.chain for c in one.columns}
    stamps = (profile.time.column, profile.time.nanoseconds or profile.time.column)
    return {name for c in (*stamps, *rows, *every) for name in matching(c, names)}


def settled(profile: Profile, log: LogTable) -> tuple[Profile, list[str]] | None:
    """The profile bound to a log's columns, and notes, where every row of its recording follows from that row of the log alone.

    None where it does not: of several sources the values tell which counts, and of efforts whether they do, derivatives look at rows
    beside, delays shift them.
    Of the log only names are looked at. Raises InputError as `bound` does.
    """
    for origin in profile.channels.values():
        if any(one.has_window or one.over or one.delay for one in origin.chain):
            return None
        if sum(_ways(one, log.names) for one in origin.chain) > 1:
            return None
    if profile.rows is not None or profile.time.dates is not None or efforts(profile.channels):
        return None
    if profile.time.nanoseconds is not None:
        return None
    stub = np.zeros(1)
    return bound(profile, replace(log, columns=dict.fromkeys(log.names, stub)))


def _ways(origin: Source, names: tuple[str, ...]) -> int:
    """In how many ways a log's columns could give a source."""
    result = [len(matching(column, names)) for column in origin.columns]
    return sum(result) if origin.candidates else int(np.prod(result))  # a constant can be given in one


def converted_block(profile: Profile, block: LogTable, first: Any) -> dict[str, Column]:
    """What a `settled` profile makes of consecutive rows of a log; ``first`` is the log's first stamp."""
    stamps = block.columns[profile.time.column]
    if profile.time.zero == "first" or stamps.dtype.kind == "M":
        shifted = (stamps.astype(np.int64) if stamps.dtype.kind in "iu" else stamps) - first
        block = replace(block, columns={**block.columns, profile.time.column: shifted})
    zero = profile.time.model_copy(update={"zero": None})
    time, _, _ = time_base(zero, block)
    return {
        TIME: time,
        **{name: _channel(name, origin, block, time)[0] for name, origin in profile.channels.items()},
    }


def _channel(name: str, origin: Source, log: LogTable, time: Floats) -> tuple[Column, float | None]:
    """One channel (n,) in the schema's unit, and its standard deviation where it is a derived one."""
    if name in LABELS:
        if origin.constant is not None:
            return np.full(len(time), str(origin.constant), dtype=object), None
        if origin.column is None:
            hint = "write 'from: <column>' or 'constant: <label>'"
            raise InputError("is a label", file=log.source, place=f"column {name}", hint=hint)
        return texts(name, log.columns[str(origin.column)], len(time), log.source), None
    deviation = None
    if origin.constant is not None:
        raw = np.full(len(time), quantity(origin.constant, unit_of(name) or "1"))
    elif origin.derivative_of is not None:
        turns = unit_of(name) == "rad/s" and origin.scale != 0
        turn = 2 * np.pi / abs(_factor(name, origin, log) * origin.scale) if turns else None
        raw, deviation = _rate(origin, log, time, turn)
    elif origin.norm_of is not None:
        raw = np.sqrt(sum(part**2 for part in _raw(origin.norm_of, log, time)))
    elif origin.sum_of is not None:
        raw = _sum(origin, log, time)
    elif origin.pitch_of is not None:
        raw = pitch_of(_raw(origin.pitch_of, log, time))
    elif origin.roll_of is not None:
        raw = roll_of(_raw(origin.roll_of, log, time))
    else:
        raw = _without_invalid(_raw((str(origin.column),), log, time)[0], origin)
        if origin.has_window:
            raw, deviation = _mean(time, raw, origin.window)
        if origin.over is not None:
            divisor = _raw((origin.over,), log, time)[0]
            if log.clocked:
                divisor = _between(time, divisor)
            elif len(origin.chain) == 1 and not origin.optional:
                _refuse_apart(name, origin, raw, divisor, log)
            raw = quotient(time, raw, divisor, origin.over_minimum)
    factor = _factor(name, origin, log)
    if deviation is not None:
        deviation *= abs(factor) if origin.is_geographic else abs(factor * origin.scale)
    gain, offset = origin.gain(factor)
    return (raw if (gain, offset) == (1.0, 0.0) else gain * raw + offset), deviation


def _refuse_apart(name: str, origin: Source, dividend: Floats, divisor: Floats, log: LogTable) -> None:
    """Raise InputError where both columns (n,) of a quotient hold values, and no row holds both."""
    here, there = np.isfinite(dividend), np.isfinite(divisor)
    if here.any() and there.any() and not (here & there).any():
        raise InputError(
            f"{origin.column} and {origin.over} are never stamped together",
            file=log.source,
            place=f"channel {name}, over",
            hint="log both in one row, or fill the rows between",
        )


def _factor(name: str, origin: Source, log: LogTable) -> float:
    """Factor to the schema's unit: from the profile's unit, else from the one that the log itself states."""
    target = unit_of(name)
    if target is None or origin.is_geographic:
        return 1.0
    if origin.unit is not None:
        return factor_to(rate_unit(origin.unit) if origin.derivative_of else origin.unit, target)
    factors = {abs(origin.scale * factor) for factor in (origin.sum_of or {"": 1.0}).values()}
    plain = factors == {1.0} and origin.over is None
    every = {log.units.get(column) for column in origin.sum_of or (str(origin.column),)}
    if len(every) > 1 and plain:
        hint = "give each its factor, and the sum a unit: 'sum_of: {a: 1, b: 1000}, unit: N'"
        place = f"columns {', '.join(origin.columns)}"
        raise InputError("are of unlike units", file=log.source, place=place, hint=hint)
    stated = every.pop() if len(every) == 1 and origin.over is None else None
    if stated is None:
        return 1.0
    try:
        factor = factor_to(stated, target)
    except UnitError as error:
        if not plain:  # the scale is a torque constant, say: amperes to newton metres
            return 1.0
        hint = f"give {name} a unit or a scale in the profile"
        raise InputError(
            error.problem, file=log.source, place=f"column {', '.join(origin.columns)}", hint=hint
        ) from error
    if plain or abs(factor - 1.0) < _CONVERTED:
        return factor
    if all(abs(part / factor - 1.0) < _CONVERTED for part in factors):
        return 1.0
    raise InputError(
        f"is in {stated} by the log, and scaled besides: nothing shows whether that converts it to {target}",
        file=log.source,
        place=f"channel {name}",
        hint=f"write 'unit: {stated}' beside the scale if the log's unit still counts, 'unit: {target}' if the scale converts it",
    )


def _between(time: Floats, values: Floats) -> Floats:
    """Values (n,) of a signal of its own clock at the instants of others, on straight lines between its samples."""
    known = np.isfinite(values)
    if not known.any():
        return values
    return np.interp(time, time[known], values[known], left=np.nan, right=np.nan)


def _raw(columns: tuple[str, ...], log: LogTable, time: Floats) -> list[Floats]:
    return [numbers(column, log.columns[column], time, log.source) for column in columns]


def _sum(origin: Source, log: LogTable, time: Floats) -> Floats:
    """The sum (n,) of columns times their factors at the instants of the first; others of their own clock are taken between samples."""
    factors = origin.sum_of or {}
    parts = [_without_invalid(part, origin) for part in _raw(tuple(factors), log, time)]
    if log.clocked:
        parts[1:] = [_between(time, part) for part in parts[1:]]
    return np.asarray(sum(factor * part for factor, part in zip(factors.values(), parts, strict=True)))


def _without_invalid(values: Floats, origin: Source) -> Floats:
    """Values (n,) with the declared invalid ones and ranges missing."""
    if not origin.invalid:
        return values
    bad = np.zeros(len(values), dtype=bool)
    for item in origin.invalid:
        low, high = item if isinstance(item, tuple) else (item, item)
        bad |= (values >= low) & (values <= high)
    return np.where(bad, np.nan, values)


def _mean(time: Floats, values: Floats, window: float) -> tuple[Floats, float | None]:
    """The mean (n,) of a column around its own instants, each value that of the time since the one before, and its standard deviation."""
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    total = np.cumsum(values[known] * np.diff(time[known], prepend=time[known][:1]))
    result = np.full(len(time), np.nan)
    result[known], deviation = derivative(time[known], total, window)
    return result, deviation


def _rate(origin: Source, log: LogTable, time: Floats, turn: float | None) -> tuple[Floats, float | None]:
    """Speed (n,) along the positions' path, at the instants of fresh positions, and its standard deviation; of angles, of which a whole
    turn is ``turn``, their rate."""
    fresh, where = _positions(origin, log, time)
    when, result = time[fresh], np.full(len(time), np.nan)
    if origin.forward is not None:
        heading = _heading(origin, log, time)[fresh]
        along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        result[fresh], deviation = derivative(when, where, origin.window, along)
    elif where.shape[1] == 1:
        result[fresh], deviation = derivative(when, unrolled(where[:, 0], turn), origin.window)
    else:
        rates = np.stack([derivative(when, p, origin.window)[0] for p in where.T], axis=1)
        result[fresh] = size = np.sqrt((rates**2).sum(axis=1))
        along = np.divide(rates, size[:, None], out=np.zeros_like(rates), where=size[:, None] > 0)
        deviation = derivative(when, where, origin.window, np.nan_to_num(along))[1]
    return result, deviation


def _positions(origin: Source, log: LogTable, time: Floats) -> tuple[Bools, Floats]:
    """Rows (n,) with a fresh position, and these (m, d), in metres where they are a latitude and a longitude."""
    positions = _raw(origin.derivative_of or (), log, time)
    if origin.is_geographic:
        positions = [origin.scale * part for part in positions]
        for channel, column, part in zip(PLACES, origin.derivative_of or (), positions, strict=True):
            refuse_place(column, part, log.source, channel)
        positions = list(metres_of(*positions))
    fresh = fresh_positions(time, positions) & np.isfinite(time)
    return fresh, np.stack([p[fresh] for p in positions], axis=1)


def _heading_notes(name: str, origin: Source, log: LogTable, time: Floats) -> list[str]:
    """A sentence where the path goes surely beside the heading along which a speed is taken."""
    fresh, where = _positions(origin, log, time)
    heading = _heading(origin, log, time)[fresh]
    angle, together = beside_heading(time[fresh], where, heading, origin.window)
    other, exchanged = beside_heading(time[fresh], where[:, ::-1], heading, origin.window)
    if together > _TOGETHER and abs(angle) < _CRAB:
        return []
    forward, axes = origin.forward, ", ".join(origin.derivative_of or ())
    yaw = (forward and forward.yaw) or "the quaternion"
    without = "or leave 'forward' out, and the sign is lost"
    if exchanged > _TOGETHER and abs(other) < _CRAB:
        if origin.is_geographic:
            return [f"{name} is wrong: check {yaw}, which does not count from north to the right, {without}."]
        turned = ", ".join((origin.derivative_of or ())[::-1])
        return [
            f"{name} is wrong: check {yaw}, which counts from the second axis of {axes} to the first, as a compass does from north "
            f"to east: write 'derivative_of: [{turned}]'."
        ]
    if together <= _TOGETHER:
        return []
    return [
        f"The path of {axes} goes {np.degrees(abs(angle)):.0f} deg beside {yaw}: if the vehicle does not drive in crab, {name}, which is "
        f"taken along it, is {1 - np.cos(angle):.0%} too small: check the zero of {yaw}, {without}."
    ]


def _heading(origin: Source, log: LogTable, time: Floats) -> Floats:
    forward = origin.forward
    assert forward is not None
    if forward.quaternion is not None:
        return yaw_of(_raw(forward.quaternion, log, time))
    return _raw((str(forward.yaw),), log, time)[0] * factor_to(forward.unit, "rad")


def _kept(rows: Rows, log: LogTable) -> Bools:
    """Which rows (n,) the profile keeps; raises InputError if none."""
    column = log.columns[rows.column]
    if log.clocked and column.dtype.kind == "f":  # a state lasts until the next is sent
        last = np.maximum.accumulate(np.where(np.isfinite(column), np.arange(len(column)), 0))
        column = column[last]
    hint = "correct 'rows:' in the profile"
    if column.dtype.kind in "fiub" and isinstance(rows.equals, int | float):
        keep = column == rows.equals
    else:
        labels = texts(rows.column, column, len(column), log.source)
        keep = np.array([label.strip() == str(rows.equals) for label in labels], dtype=bool)
        hint = f"the column holds {', '.join(sorted({str(label) for label in labels})[:8])}"
    if not keep.any():
        raise InputError(
            f"no row equals {rows.equals!r}", file=log.source, place=f"column {rows.column}", hint=hint
        )
    return np.asarray(keep)
