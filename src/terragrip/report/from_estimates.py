"""The report of any set of estimates: it shows what they contain, and says what they lack."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terragrip import __version__
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.ground.events import Event, events
from terragrip.recording.plain_units import leapt
from terragrip.report import (
    advice_sections,
    ground_sections,
    map_sections,
    path,
    residuals,
    sections,
    slip_sections,
    soil_sections,
    summary,
    trust_sections,
    wheels,
    work_sections,
)
from terragrip.report.blocks import Blocks, blocks_of
from terragrip.report.clock import Clock
from terragrip.report.field_work import parts_of
from terragrip.report.ground_sections import WARNINGS
from terragrip.report.page import Page, Section, Table, names, number
from terragrip.report.runs import Run, label_stretches
from terragrip.report.scores import Comparison, compare
from terragrip.soil.estimates import GatheredRuns, distinct, repeated
from terragrip.soil.known import known_soils
from terragrip.soil.learn import Campaign
from terragrip.soil.library import SoilLibrary

if TYPE_CHECKING:
    from terragrip.ground.result import Ground

SHOWN = 2
"""Runs drawn over time; the paper draws one and compares two."""
HOURLY = 1800.0
"""Seconds of a run from which on it is also given by the hour."""
ALL = "the drive"
"""The label of a run that has neither labels nor positions."""


@dataclass(frozen=True)
class _Summary:
    """A line of the table of runs."""

    driven: summary.Driven
    soils: tuple[str, ...]
    method: str
    events: str
    clock: Clock


_UNLABELLED = "no soil label, so no curve can be learned (a column soil)"


@dataclass
class _Gathered:
    """The content of all runs, gathered file by file."""

    summaries: list[_Summary] = field(default_factory=list)
    shown: list[Run] = field(default_factory=list)
    gathered: GatheredRuns = field(default_factory=GatheredRuns)
    events: dict[str, tuple[Event, ...]] = field(default_factory=dict)
    blocks: list[Blocks] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    advice: advice_sections.GatheredAdvice = field(default_factory=advice_sections.GatheredAdvice)
    map: map_sections.GatheredMap = field(default_factory=map_sections.GatheredMap)


def report_of(
    files: Sequence[str | os.PathLike[str]],
    library: SoilLibrary | None = None,
    grounds: Sequence[Ground] = (),
    title: str = "Traction report",
    progress: Callable[[int, int], None] | None = None,
) -> Page:
    """The report of estimates files (Parquet, written by `terragrip estimate`).

    library: soils as `terragrip soils` learned them, of which those are shown that the runs are labelled with or the grounds name,
    all where neither does; without it they are learned here, by the same settings. grounds: of ground.json (`terragrip ground`).
    progress: called with steps done and steps in all.
    Raises InputError on a file that is no table of estimates or is given twice; whatever else is absent leaves its section out.
    """
    paths = distinct(files)
    total = len(paths) + 2

    def step(done: int) -> None:
        if progress is not None:
            progress(done, total)

    read = _read(paths, grounds, step)
    summaries, shown, gathered, happened = read.summaries, read.shown, read.gathered, read.events
    campaign = Campaign({}, {}, ())
    if library is not None:
        named = {part.soil for part in gathered.pairs}
        named |= {
            section.soil for ground in grounds for section in ground.sections if section.soil in library
        }
        campaign = known_soils(library, named or library)
        if campaign.soils and _UNLABELLED in read.missing:
            read.missing.remove(_UNLABELLED)
    elif gathered.pairs:
        campaign = gathered.learn()
    step(total - 1)
    if not shown:
        raise InputError(
            "no row of these estimates moves",
            file=paths[0],
            hint="give estimates of a drive, not of a standstill",
        )
    main, together = shown[0], sorted(shown, key=lambda run: run.name)
    clocks = {one.driven.name: one.clock for one in summaries}
    comparisons: list[Comparison] = [c for run in together for c in compare(run)]
    page = Page(
        title,
        f"{summary.extent([one.driven for one in summaries])}, estimated by {names(sorted({one.method for one in summaries}))}. "
        f"Drawn over time: {names([run.name for run in together])}.",
        (
            _summarised(read, main, grounds, campaign, repeated(paths)),
            path.section(together, [_labels(run) for run in together]),
            *(_sections(main, together, campaign) if main.has_adhesion else _of_slip(together)),
            read.advice.section(),
            read.map.section(),
            *_worked(read.blocks),
            ground_sections.recognised(grounds, clocks),
            ground_sections.section_points(grounds, clocks),
            ground_sections.events(grounds, happened, clocks),
            *(
                [residuals.section(main), sections.methods(comparisons, [], main.method)]
                if main.has_adhesion
                else []
            ),
            sections.honesty(main, []),
            _runs(summaries),
        ),
        facts=(
            ("Made by", f"Terragrip {__version__}, terragrip report"),
            ("Vehicle", main.vehicle.name if main.vehicle is not None else "–"),
            (
                "Estimates",
                names([path.name for path in paths[:3]])
                + (f" and {len(paths) - 3} more" if len(paths) > 3 else ""),
            ),
        ),
    )
    step(total)
    return page


def _read(paths: Sequence[Path], grounds: Sequence[Ground], step: Callable[[int], None]) -> _Gathered:
    """What each run says, and the SHOWN most telling ones whole (most stretches of soil, then a sensor, then the longest)."""
    read = _Gathered()
    kept: list[tuple[tuple[int, bool, float], Run]] = []
    for number_, file in enumerate(paths, 1):
        estimates = Estimates.read(file)
        if len(estimates) < 2:
            raise InputError("has fewer than two rows", file=file, hint="leave it out")
        if estimates.has_adhesion:
            read.gathered.add(estimates, file.stem, file=str(file))
        read.map.add(estimates, file.stem)
        read.advice.add(estimates, file.stem)
        read.events[file.stem] = events(estimates)
        run = _run(estimates, file.stem, grounds, read.events[file.stem])
        read.summaries.append(_summary(run))
        if run.wheels and run.moving.any():
            read.blocks.append(blocks_of(run, _labels(run)))
            soils = len(label_stretches(run.soil)) if run.has_adhesion else -1
            worth = (soils, run.sensor_wheel is not None, read.summaries[-1].driven.duration)
            kept = sorted([*kept, (worth, run)], key=lambda one: one[0], reverse=True)[:SHOWN]
        read.missing += [one for one in _lacks(run) if one not in read.missing]
        step(number_)
    if len(kept) == SHOWN and kept[1][0][0] < 2 and set(kept[1][1].soils) < set(kept[0][1].soils):
        kept = kept[:1]  # a run on one soil says nothing beside one over that and others
    read.shown = [run for _, run in kept]
    return read


def _run(estimates: Estimates, name: str, grounds: Sequence[Ground], own: Sequence[Event]) -> Run:
    """A run with its events: those of its ground, without one those of the estimates themselves."""
    mine = [ground for ground in grounds if ground.run == name]
    happened = tuple(event for ground in mine for event in ground.events) if mine else tuple(own)
    return Run(name, estimates.to_pandas(), estimates.method, vehicle=estimates.vehicle, events=happened)


def _labels(run: Run) -> NDArray[np.object_]:
    """What each row is named by (n,): its soil label; of an unlabelled run what the machine did, where positions say it."""
    if run.soils:
        return run.soil
    parts = parts_of(run) if not run.has_adhesion else None
    return parts if parts is not None else np.where(run.moving, ALL, "").astype(object)


def _lacks(run: Run) -> list[str]:
    """What a log does not hold, and what would come with it, in clauses."""
    columns, found = set(run.estimates.columns), []
    if not run.has_adhesion:
        found.append("no drive torque was logged, so there is no adhesion, curve or efficiency")
    if not run.soils and run.has_adhesion:
        found.append(_UNLABELLED)
    if not {"latitude", "longitude"} <= columns:
        found.append("no position, so there is no map")
    if run.began is None:
        found.append("no clock time: times count from the start of each log")
    return found


def _summarised(
    read: _Gathered, main: Run, grounds: Sequence[Ground], campaign: Campaign, doubts: Sequence[str]
) -> Section:
    """The summary on top, which ends with the ``doubts``."""
    known = {ground.run for ground in grounds}
    every = [event.kind for ground in grounds for event in ground.events]
    every += [event.kind for run, mine in read.events.items() if run not in known for event in mine]
    missing = [*read.missing, *(f"{name} could not be fitted" for name in campaign.not_fitted)]
    section = summary.section(
        [one.driven for one in read.summaries],
        read.blocks,
        soil_sections.curves_of_all(campaign),
        main.vehicle.tire_rolling_resistance if main.vehicle is not None else 0.0,
        {kind: every.count(kind) for kind in WARNINGS if kind in every},
        missing,
    )
    return replace(section, prose=(*section.prose, *doubts))


def _worked(blocks: Sequence[Blocks]) -> Iterator[Section]:
    """Time by slip, and of long drives by the hour."""
    yield work_sections.bands(blocks)
    if any(len(one.start) and one.start[-1] - one.start[0] > HOURLY for one in blocks):
        yield work_sections.by_hour(blocks)


def _sections(main: Run, together: Sequence[Run], campaign: Campaign) -> Iterator[Section]:
    """Traction over time, slip and resistance, curves and operating points; of drawn runs without torques slip alone."""
    curves = soil_sections.curves_of_all(campaign)
    tire = main.vehicle.tire_rolling_resistance if main.vehicle is not None else 0.0
    yield from (sections.tracking(run) for run in together if run.has_adhesion)
    yield sections.slip_and_resistance(main)
    yield from (one for run in together if (one := wheels.section(run)) is not None)
    yield from (one for run in together if not run.has_adhesion for one in slip_sections.of(run))
    yield sections.online_curve(
        main, {one.name: one.learned.soil.parameters.get("a", np.nan) for one in curves}
    )
    yield soil_sections.both_maxima(curves, tire, campaign.not_fitted)
    yield soil_sections.fits(curves, campaign.not_fitted)
    yield trust_sections.trust(curves, campaign.not_fitted)
    yield trust_sections.what_is_missing(curves, campaign.not_fitted)
    yield sections.soils(main, [run for run in together if run.has_adhesion])


def _of_slip(together: Sequence[Run]) -> Iterator[Section]:
    """What can be determined where no run has a torque, and what cannot."""
    for run in together:
        yield from slip_sections.of(run)
        if (every := wheels.section(run)) is not None:
            yield every
    yield Section(
        "without-torque",
        "Adhesion and traction",
        omitted="Left out: the logs have no drive torque. With it come adhesion and traction over time, adhesion curves of the soils "
        "with fits and what to trust, operating points, what to drive next, and residuals.",
    )


def _summary(run: Run) -> _Summary:
    distance = run.estimated("distance")[-1] if "distance" in run.estimates else np.nan
    events = run.estimates["event"].value_counts() if "event" in run.estimates else {}
    shares = ", ".join(f"{kind} {count / len(run.time):.0%}" for kind, count in events.items() if kind)
    began = run.began + timedelta(seconds=float(run.time[0])) if run.began is not None else None
    seconds, metres = float(run.time[-1] - run.time[0]) - leapt(run.time), float(np.nan_to_num(distance))
    driven = summary.Driven(run.name, seconds, metres, began)
    return _Summary(driven, run.soils, run.method, shares or "–", run.clock)


def _runs(summaries: Sequence[_Summary]) -> Section:
    clocked = any(one.driven.began is not None for one in summaries)
    table = Table(
        "The runs of this report. Events: the share of rows with each.",
        ("run", *(["began"] * clocked), "duration [s]", "distance [m]", "soils", "method", "events"),
        tuple(
            (
                one.driven.name,
                *(
                    [f"{one.driven.began:%Y-%m-%d %H:%M:%S}" if one.driven.began is not None else "–"]
                    * clocked
                ),
                number(one.driven.duration, 0),
                number(one.driven.distance, 0),
                names(one.soils) or "unlabelled",
                one.method,
                one.events,
            )
            for one in summaries
        ),
    )
    return Section("runs", "Runs", (), (table,))
