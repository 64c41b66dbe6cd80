"""The channels of a recording that distinguish grounds, by sensor family, free of missing and held samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.recording import Recording, fresh_samples
from terragrip.recording.checks import check_time, place, refuse_infinite
from terragrip.recording.columns import numbers, seconds
from terragrip.recording.frames import frame_of, in_si
from terragrip.recording.held import held_period
from terragrip.recording.schema import TIME

# A motor current replaces the torque: what is learnt does not depend on the gain between them.
CURRENT = ("motor_current_",)
TORQUE = ("drive_torque_",)
PREFIXES = {
    "wheel speed": ("wheel_speed_",),
    "torque": (*TORQUE, *CURRENT),
    "ground speed": ("ground_speed",),
    "angular velocity": ("angular_velocity_x", "angular_velocity_y", "angular_velocity_z"),
    "acceleration": ("acceleration_x", "acceleration_y", "acceleration_z"),
}
FAMILIES = tuple(PREFIXES)
WHEELS = ("wheel speed", "torque")
BODY = ("angular velocity", "acceleration")

SAME_RATE = 1.2
"""Ratio of periods up to which two rates are one."""
_HELD = 1.5  # sample periods
_LARGEST = 1e30  # of a measured value, in any unit: loggers fill gaps with the largest number they have


class Columns(NamedTuple):
    """What is used of a recording: time (n,) [s], values (n,) by column, NaN = not measured, and the recording's name."""

    time: Floats
    values: dict[str, Floats]
    name: str


@dataclass(frozen=True)
class Channel:
    """One measured channel: its instants (n,) [s] and values (n,), all finite."""

    time: Floats
    values: Floats

    @cached_property
    def period(self) -> float:
        """Median time [s] between samples; NaN for fewer than two."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.nan


@dataclass(frozen=True)
class Signals:
    """The usable channels of one recording by family and name, and the span [s] of its rows."""

    start: float
    end: float
    families: dict[str, dict[str, Channel]]


def shortest_period(channels: Mapping[str, Channel]) -> float:
    """The period [s] of the fastest of some channels."""
    # One sensor's channels share their clock, whose period is computed once.
    clocks = {(len(c.time), c.time[0], c.time[-1]): c for c in channels.values()}
    return min(channel.period for channel in clocks.values())


def family_of(column: str) -> str | None:
    """The sensor family that a recording column belongs to, None for one that is not used."""
    for family, prefixes in PREFIXES.items():
        for prefix in prefixes:
            open_ended = prefix.endswith("_")
            if column == prefix or (open_ended and column.startswith(prefix) and len(column) > len(prefix)):
                return family
    return None


def wheel_of(column: str) -> str:
    """The wheel of a column such as ``drive_torque_<wheel>``."""
    return column.split("_", 2)[2]


def wheels_of(recorded: Sequence[Signals]) -> tuple[str, ...]:
    """The names of the wheels that any of some recordings has a speed, a torque or a current of, sorted."""
    named = (channels for one in recorded for family, channels in one.families.items() if family in WHEELS)
    return tuple(sorted({wheel_of(name) for channels in named for name in channels}))


def tables_of(recordings: Any) -> list[Columns]:
    """What is used of each recording (a Recording, a DataFrame or a mapping of columns).

    Ground speed and wheel speeds may be missing: what is there is used. Raises InputError naming the recording
    on anything that is no list of tables, and on time or values that are unusable.
    """
    if isinstance(recordings, Recording | Mapping | str) or hasattr(recordings, "columns"):
        raise InputError(
            "recordings is one table, not a list", place="recordings", hint="give a list: [recording]"
        )
    try:
        listed = list(recordings)
    except TypeError:
        problem = f"{type(recordings).__name__} is not a list of recordings"
        raise InputError(problem, place="recordings", hint="give a list of Recording or DataFrames") from None
    return [_table(recording, k) for k, recording in enumerate(listed)]


def held_channels(tables: Sequence[Columns]) -> dict[str, float]:
    """Update period [s] of each channel whose logger repeats values, judged on all recordings together."""
    result = {}
    for name in sorted({name for _, channels, _ in tables for name in channels}):
        times, values, offset = [], [], 0.0
        for time, channels, _ in tables:
            if name in channels and len(time):
                times.append(time - time[0] + offset)
                values.append(channels[name])
                offset = float(times[-1][-1]) + 1.0
        if not times:
            continue
        time, value = np.concatenate(times), np.concatenate(values)
        rows = float(np.median(np.diff(time[np.isfinite(value)]))) if np.isfinite(value).sum() > 1 else np.inf
        period = held_period(time, value)
        if (
            period is not None and period > _HELD * rows
        ):  # short of that it is a quantised signal at its own rate
            result[name] = period
    return result


def signals_of(table: Columns, held: Mapping[str, float]) -> Signals:
    """The usable channels of a table from `tables_of`; repeats of a held channel count as not measured."""
    time, channels, _ = table
    families: dict[str, dict[str, Channel]] = {}
    for name, values in channels.items():
        keep = fresh_samples(time, values, held[name]) if name in held else np.isfinite(values)
        if np.count_nonzero(keep) > 1:
            family = family_of(name) or ""
            families.setdefault(family, {})[name] = Channel(time[keep], values[keep])
    # Each row counts for one period, so a window's worth of rows fills a window. Every row counts, whatever was
    # measured in it: a recording has the same windows with and without a sensor.
    period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return Signals(float(time[0]), float(time[-1]) + period, families)


def _table(recording: Any, index: int) -> Columns:
    name = f"recordings[{index}]"
    if isinstance(recording, Recording):
        used = {n: v for n, v in recording.channels.items() if family_of(n)}
        for column, values in used.items():
            _refuse_absurd(column, values, recording.time, name)
        return Columns(recording.time, used, recording.source or name)
    frame = frame_of(recording, name)
    columns = in_si(frame.columns, frame.units, name)
    if TIME not in columns:
        raise InputError("is missing", file=name, place=f"column {TIME}", hint="add the instants in seconds")
    time, _ = seconds(columns[TIME], name)
    check_time(time, name)
    channels = {}
    for column, cells in columns.items():
        if family_of(column):
            values = numbers(column, cells, time, name)
            refuse_infinite(column, values, time, name)
            _refuse_absurd(column, values, time, name)
            channels[column] = values
    return Columns(time, channels, name)


def _refuse_absurd(column: str, values: Floats, time: Floats, name: str) -> None:
    """Raise InputError at the first value too large to be one."""
    rows = np.flatnonzero(np.abs(values) > _LARGEST)
    if len(rows):
        where = place(column, int(rows[0]), time)
        problem = f"{values[rows[0]]:.3g} is not a measurement"
        raise InputError(problem, file=name, place=where, hint="leave the cell empty instead")
