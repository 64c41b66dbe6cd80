"""What is in a log: columns, rates, gaps, ranges, held values, noise, and a profile to begin with."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.profile import Profile
from terragrip.formats.proposal import Fit, fit_of, is_ready, missing_channels, refusal
from terragrip.formats.reading import recording_of
from terragrip.formats.recognition import of_one_joint, silent
from terragrip.formats.seen import Seen, read_whole_or_thinned, size_of
from terragrip.formats.signals import SignalLog
from terragrip.formats.signs import add_signs
from terragrip.formats.spoilt import notes_on, of_a_long_table
from terragrip.formats.table import LogTable
from terragrip.formats.time_column import other_clocks
from terragrip.formats.vocabulary import GENERAL
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.checks import NOTHING_TOWED, refuse_estimates
from terragrip.recording.counted import refuse_counted
from terragrip.recording.cycles import in_cycles
from terragrip.recording.held import fresh_samples, held_period, measured_part
from terragrip.recording.noise import white_noise
from terragrip.recording.schema import TIME, has_torque, is_own, unit_of
from terragrip.vehicle import Vehicle

_SPARSE = (
    "The log is long ({:.1f} GB): one of every {} blocks of its records was read, spread over the log. Counts and "
    "shares refer to these; gaps are not searched for."
)


@dataclass(frozen=True)
class ColumnSummary:
    """One column: what it holds. Numbers are in the log's own unit; absent ones are None."""

    name: str
    kind: str  # "number", "text", "date" or "empty"
    unit: str | None
    count: int
    missing_share: float
    rate: float | None = None  # true updates a second
    held_period: float | None = None  # s, where values are repeated between updates
    noise: float | None = None  # standard deviation
    minimum: float | None = None
    quantile_05: float | None = None
    median: float | None = None
    quantile_95: float | None = None
    maximum: float | None = None
    examples: tuple[str, ...] = ()


@dataclass(frozen=True)
class TimeSummary:
    """The time base: ``spacing_*`` are quantiles between rows [s], ``gaps`` the longest as (start, length) [s]."""

    column: str
    unit: str
    start: float
    duration: float
    spacing_05: float
    spacing_50: float
    spacing_95: float
    gaps: tuple[tuple[float, float], ...]
    gap_count: int
    repeated: int
    backward: int
    missing: int


@dataclass(frozen=True)
class Inspection:
    """What a log holds (see `inspect`)."""

    file: str
    sha256: str
    rows: int
    time: TimeSummary | None
    columns: tuple[ColumnSummary, ...]
    recognised: dict[str, tuple[str, ...]]  # channel: the columns it may come from
    proposals: dict[str, Proposal]  # the same, each with its evidence, confidence, doubt and alternatives
    missing: tuple[str, ...]
    warnings: tuple[str, ...]
    ready: bool  # the log can be estimated as it is, or with the profile that was given
    fitting: tuple[str, ...]  # profiles that come with Terragrip and fit
    nearly: tuple[str, ...]  # sentences on those that nearly do, and by which names
    unfit: str  # why the log cannot be estimated with the vehicle that was given; empty if it can
    refused: str  # why nothing can be estimated from this log, whatever the profile; empty if something can
    profile: str  # a proposed profile, YAML

    def to_dict(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        return asdict(self)

    def to_text(self) -> str:
        """A report to read, lines of text without colour."""
        from terragrip.formats.inspection_text import text_of

        return text_of(self)


def inspect(
    path: str | os.PathLike[str],
    profile: Profile | str | os.PathLike[str] | None = None,
    vehicle: Vehicle | str | os.PathLike[str] | None = None,
    *,
    dbc: Sequence[str | os.PathLike[str]] = (),
) -> Inspection:
    """Tell what is in a log, which of our channels it holds or lacks, and propose a profile.

    With a profile, what the log becomes through it is reported. With a vehicle, wheels and units are held against
    it. Nothing is required of the log but that it is a table; raises InputError if it is none, or one of estimates.
    """
    machine = vehicle if isinstance(vehicle, Vehicle) or vehicle is None else Vehicle.load(vehicle)
    chosen = profile if isinstance(profile, Profile) or profile is None else Profile.load(profile)
    log, every = read_whole_or_thinned(path, (*dbc, *(chosen.dbc if chosen else ())))
    refuse_estimates(log.names, str(log.source))
    recording, fits, remarks = _recording_or_fit(log, chosen)
    warnings = [*log.notes, *remarks]
    if every > 1:
        warnings.insert(0, _SPARSE.format(size_of(path) / 1e9, every))
    unfit = ""
    if recording is not None:
        warnings += unit_warnings(in_cycles(recording), machine)
        unfit = _unfit(recording, machine)
        warnings += [unfit] * bool(unfit and f"{unfit}." not in warnings)
        log = log if chosen is None else _as_table(recording, log)
    seen = Seen.of(log, whole=every == 1)
    proposals = seen.proposals(GENERAL, machine)
    with suppress(InputError):  # a log that no profile of these proposals reads
        add_signs(proposals, _recording(log, seen.profile(proposals)), machine)
    fits = _of_all_wheels(fits, proposals)
    quiet = silent(seen.numbers(), proposals, seen.units)
    warnings += [*_notes_on(seen), *proposals.left_out, *quiet]
    if recording is None:
        warnings += seen.repeats.notes()
    present = proposals.keys() | fits.channels
    known = of_one_joint(seen.numbers(), seen.texts())
    ready = recording is not None and is_ready(recording)
    return Inspection(
        file=str(log.source),
        sha256=str(log.sha256),
        rows=seen.rows,
        time=_time_summary(seen),
        columns=tuple(_column_summary(name, seen) for name in seen.columns),
        recognised={channel: proposal.columns for channel, proposal in proposals.items()},
        proposals=proposals,
        missing=tuple(missing_channels(present, seen.stamp is not None, known, machine)),
        warnings=tuple(warnings),
        ready=ready,
        fitting=fits.names,
        nearly=fits.nearly,
        unfit=unfit,
        refused="" if ready or fits.names else refusal(seen.rows, present, quiet),
        profile=seen.profile_text(proposals, tuple(dbc), os.path.basename(str(log.source))),
    )


def _recording_or_fit(
    log: LogTable | SignalLog, profile: Profile | None
) -> tuple[Recording | None, Fit, list[str]]:
    """What a log becomes, or, without a profile, the shipped ones that fit it where it becomes nothing; and sentences on that."""
    try:
        recording = _recording(log, profile)
    except InputError as error:
        if profile is not None:
            raise
        fits = fit_of(log)
        return None, fits, [] if fits.names else [f"Without a profile: {_cause(error)}"]
    said = (*log.notes, NOTHING_TOWED)  # the latter among what is missing
    return recording, Fit(), [note for note in recording.notes if note not in said]


def _of_all_wheels(fits: Fit, channels: Iterable[str]) -> Fit:
    """The profiles that fit, unless they leave wheels of the log out, as a robot's profile of four wheels does with a log of six."""
    wheels = {channel for channel in channels if channel.startswith("wheel_speed_")}
    return Fit() if wheels - fits.channels and wheels & fits.channels else fits


def _notes_on(seen: Seen) -> list[str]:
    """Sentences on texts that should be numbers and on clocks."""
    notes = [*notes_on(seen.texts(), GENERAL, timed=seen.stamp is not None)]
    notes += of_a_long_table(seen.texts(), seen.numbers(), None if seen.stamp is None else seen.stamp.name)
    if seen.stamp is not None:
        notes += [f"{seen.stamp.name}: {seen.stamp.doubt}"] * bool(seen.stamp.doubt)
        notes += other_clocks(seen.numbers(), seen.stamp.name, seen.units)
    return notes


def _unfit(recording: Recording, vehicle: Vehicle | None) -> str:
    """Why a recording cannot be estimated, with a vehicle; empty if it can."""
    try:
        refuse_counted(recording)
        if vehicle is None:
            return ""
        if has_torque(recording.channels):
            recording.check_against(vehicle)
        for wheel in recording.wheels:
            if wheel not in vehicle.wheels:
                return f"column wheel_speed_{wheel}: the vehicle has no wheel {wheel}; its wheels are {', '.join(vehicle.wheels)}"
        if recording.wheels:
            _ = vehicle.wheel_data
    except InputError as error:
        return _cause(error)
    return ""


def _recording(log: LogTable | SignalLog, profile: Profile | None) -> Recording:
    """The recording of what was read of a log."""
    if isinstance(log, LogTable):
        return recording_of(log, profile)
    wants = is_own if profile is None else profile.wants
    return recording_of(
        replace(log, signals={n: s for n, s in log.signals.items() if wants(n)}).table(), profile
    )


def _cause(error: InputError) -> str:
    """An error as a sentence without the file, which the report names once."""
    place = f"{error.place}: " if error.place else ""
    return f"{place}{error.problem}" + (f"; {error.hint}" if error.hint else "")


def _as_table(recording: Recording, table: LogTable | SignalLog) -> LogTable:
    columns = {TIME: recording.time, **recording.channels, **recording.labels}
    units = {name: unit for name in columns if (unit := unit_of(name)) is not None}
    return LogTable(tuple(columns), columns, units, table.source, table.sha256)


def _time_summary(seen: Seen) -> TimeSummary | None:
    if seen.stamp is None or seen.base is None:
        return None
    known = seen.base[np.isfinite(seen.base)]
    if len(known) < 2:
        return None
    spacing = np.diff(known)
    low, middle, high = (float(q) for q in np.quantile(spacing, [0.05, 0.5, 0.95]))
    wide = np.flatnonzero(spacing > max(5 * middle, 0.5)) if seen.whole else np.empty(0, dtype=np.intp)
    longest = wide[np.argsort(spacing[wide])[::-1][:5]]
    return TimeSummary(
        column=seen.stamp.name,
        unit=seen.stamp.unit,
        start=float(known[0]),
        duration=float(known[-1] - known[0]),
        spacing_05=low,
        spacing_50=middle,
        spacing_95=high,
        gaps=tuple((float(known[k]), float(spacing[k])) for k in longest),
        gap_count=len(wide),
        repeated=seen.repeats.merged + seen.repeats.other,
        backward=int(np.sum(spacing < 0)),
        missing=len(seen.base) - len(known),
    )


def _spanned(time: Floats, whole: bool) -> float:
    """How long (n,) instants last [s], without the blocks that were left out."""
    if whole:
        return float(time[-1] - time[0])
    steps = np.diff(time)
    return float(steps[steps < 100 * np.median(steps)].sum()) or 1.0


def _column_summary(name: str, seen: Seen) -> ColumnSummary:
    column, unit, time = seen.columns[name], seen.units.get(name), seen.clock_of(name)
    rows = max(len(column), 1)
    if column.dtype.kind == "O":
        present = [str(cell) for cell in column if cell not in (None, "")]
        kind = "text" if present else "empty"
        examples = tuple(dict.fromkeys(present))[:5]
        return ColumnSummary(name, kind, unit, len(present), 1 - len(present) / rows, examples=examples)
    if column.dtype.kind not in "fiub":
        return ColumnSummary(name, "date", unit, len(column), 0.0)
    values = column.astype(np.float64)
    known = np.isfinite(values)
    count = int(known.sum())
    if not count:
        return ColumnSummary(name, "empty", unit, 0, 1.0)
    low, q05, middle, q95, high = (float(q) for q in np.quantile(values[known], [0, 0.05, 0.5, 0.95, 1]))
    rate = held = noise = None
    forward = time is not None and len(time) > 2 and bool((np.diff(time) > 0).all())
    if time is not None and forward and high > low and time is not values:
        held = held_period(time, values)
        when, sample = measured_part(time, values)
        if held is not None:
            fresh = fresh_samples(when, sample, held)
            when, sample = when[fresh], sample[fresh]
        noise = white_noise(when, sample - middle)  # a latitude's is no part of 51 degrees
        rate = 1 / held if held is not None else count / _spanned(time, seen.whole)
    return ColumnSummary(
        name, "number", unit, count, 1 - count / rows, rate, held, noise, low, q05, middle, q95, high
    )
