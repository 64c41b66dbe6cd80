"""The report of any set of estimates: what they hold is shown, what they lack is said."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip import __version__
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.ground.events import events
from terragrip.report import ground_sections, residuals, sections, slip_sections, soil_sections
from terragrip.report.page import Page, Section, Table, names, number
from terragrip.report.runs import Run, label_stretches
from terragrip.report.scores import Comparison, compare
from terragrip.soil.estimates import GatheredRuns, distinct
from terragrip.soil.known import known_soils
from terragrip.soil.learn import Campaign
from terragrip.soil.library import SoilLibrary

if TYPE_CHECKING:
    from terragrip.ground.result import Ground

SHOWN = 2
"""Runs drawn over time; the paper draws one and compares two."""


@dataclass(frozen=True)
class _Summary:
    """A line of the table of runs."""

    name: str
    duration: float
    distance: float
    soils: tuple[str, ...]
    method: str
    events: str


def report_of(
    files: Sequence[str | os.PathLike[str]],
    library: SoilLibrary | None = None,
    grounds: Sequence[Ground] = (),
    title: str = "Traction report",
    progress: Callable[[int, int], None] | None = None,
) -> Page:
    """The report of estimates files (Parquet, written by `terragrip estimate`).

    library: soils as `terragrip soils` learned them, which are shown; without it they are learned here, by the same
    settings. grounds: of ground.json (`terragrip ground`).
    progress: called with steps done and steps in all.
    Raises InputError on a file that is no table of estimates or is given twice; whatever else is absent leaves its section out.
    """
    paths = distinct(files)
    total = len(paths) + 2

    def step(done: int) -> None:
        if progress is not None:
            progress(done, total)

    summaries, shown, gathered, happened = _read(paths, grounds, step)
    campaign = Campaign({}, {}, ())
    if library is not None:
        campaign = known_soils(library, (part.soil for part in gathered.pairs))
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
    comparisons: list[Comparison] = [c for run in together for c in compare(run)]
    page = Page(
        title,
        f"{len(paths)} run{'s' * (len(paths) != 1)}, {sum(one.duration for one in summaries) / 60:.0f} minutes, "
        f"{sum(one.distance for one in summaries):.0f} m, estimated by {names(sorted({one.method for one in summaries}))}. "
        f"Drawn over time: {names([run.name for run in together])}.",
        (
            *(_sections(main, together, campaign) if main.has_adhesion else _of_slip(together)),
            ground_sections.recognised(grounds),
            ground_sections.section_points(grounds),
            ground_sections.events(grounds, happened),
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


def _read(
    paths: Sequence[Path], grounds: Sequence[Ground], step: Callable[[int], None]
) -> tuple[list[_Summary], list[Run], GatheredRuns, dict[str, list[dict[str, Any]]]]:
    """A summary of each run, the SHOWN most telling runs (most stretches of soil, then a sensor, then the longest), all pairs, and
    the events of each run by its own estimates."""
    own: dict[str, list[dict[str, Any]]] = {}
    summaries: list[_Summary] = []
    kept: list[tuple[tuple[int, bool, float], Run]] = []
    gathered = GatheredRuns()
    for number_, path in enumerate(paths, 1):
        estimates = Estimates.read(path)
        if len(estimates) < 2:
            raise InputError("holds fewer than two rows", file=path, hint="leave it out")
        if estimates.has_adhesion:
            gathered.add(estimates, path.stem, file=str(path))
        own[path.stem] = [event.to_dict() for event in events(estimates)]
        has_ground = any(ground.run == path.stem for ground in grounds)
        happened = tuple(event for ground in grounds if ground.run == path.stem for event in ground.events)
        if not has_ground:
            happened = tuple(own[path.stem])
        table = estimates.to_pandas()
        table.attrs["zero_slip"] = estimates.about.get("zero_slip")
        run = Run(path.stem, table, estimates.method, vehicle=estimates.vehicle, events=happened)
        summaries.append(_summary(run))
        if run.wheels and run.moving.any():
            soils = len(label_stretches(run.soil)) if run.has_adhesion else -1
            worth = (soils, run.sensor_wheel is not None, summaries[-1].duration)
            kept = sorted([*kept, (worth, run)], key=lambda one: one[0], reverse=True)[:SHOWN]
        step(number_)
    if kept and len(kept) == SHOWN and kept[1][0][0] < 2 <= kept[0][0][0]:
        kept = kept[:1]  # a run on one soil says nothing beside one over several
    return summaries, [run for _, run in kept], gathered, own


def _sections(main: Run, together: Sequence[Run], campaign: Campaign) -> Iterator[Section]:
    """Traction over time, slip and resistance, curves and operating points; of drawn runs without torques slip alone."""
    curves = soil_sections.curves_of_all(campaign)
    tire = main.vehicle.tire_rolling_resistance if main.vehicle is not None else 0.0
    yield from (sections.tracking(run) for run in together if run.has_adhesion)
    yield sections.slip_and_resistance(main)
    yield from (one for run in together if not run.has_adhesion for one in slip_sections.of(run))
    yield sections.online_curve(
        main, {one.name: one.learned.soil.parameters.get("a", np.nan) for one in curves}
    )
    yield soil_sections.both_maxima(curves, tire, campaign.not_fitted)
    yield soil_sections.fits(curves, campaign.not_fitted)
    yield soil_sections.trust(curves, campaign.not_fitted)
    yield soil_sections.what_is_missing(curves, campaign.not_fitted)
    yield sections.soils(main, [run for run in together if run.has_adhesion])


def _of_slip(together: Sequence[Run]) -> Iterator[Section]:
    """What can be determined where no run has a torque, and what cannot."""
    for run in together:
        yield from slip_sections.of(run)
    yield Section(
        "without-torque",
        "Adhesion and traction",
        omitted="Left out: the logs have no drive torque. With it come adhesion and traction over time, adhesion curves of the soils "
        "with fits and what to trust, operating points, what to drive next, and residuals.",
    )


def _summary(run: Run) -> _Summary:
    distance = run.estimated("distance")[-1] if "distance" in run.estimates else np.nan
    events = run.estimates["event"].value_counts() if "event" in run.estimates else {}
    has_ground = ", ".join(f"{kind} {count / len(run.time):.0%}" for kind, count in events.items() if kind)
    return _Summary(
        run.name,
        float(run.time[-1] - run.time[0]),
        float(np.nan_to_num(distance)),
        run.soils,
        run.method,
        has_ground or "–",
    )


def _runs(summaries: Sequence[_Summary]) -> Section:
    table = Table(
        "The runs of this report. Events: the share of rows that carry each.",
        ("run", "duration [s]", "distance [m]", "soils", "method", "events"),
        tuple(
            (
                one.name,
                number(one.duration, 0),
                number(one.distance, 0),
                names(one.soils) or "unlabelled",
                one.method,
                one.events,
            )
            for one in summaries
        ),
    )
    return Section("runs", "Runs", (), (table,))
