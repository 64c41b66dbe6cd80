"""Sections of the report on the ground: soils with probabilities over the drive, confusion, section crosses, events with reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from terragrip.figures import new_figure, styled
from terragrip.ground.views import draw_soils
from terragrip.report.clock import Clock
from terragrip.report.operating_points import Cross, draw_crosses
from terragrip.report.page import Picture, Section, Table, names, number, percent, stem
from terragrip.report.runs import label_stretches
from terragrip.report.style import to_svg
from terragrip.report.timeline import soil_strip

if TYPE_CHECKING:
    from terragrip.ground.events import Event
    from terragrip.ground.result import Ground, Timeline

NO_CLOCKS: Mapping[str, Clock] = MappingProxyType({})
"""Of runs that have none, times are seconds."""
ALIKE = ("fine", "wet")
"""Soils that the paper could not distinguish: their shares are also given as one."""
SHOWN = 2
"""Drives drawn over time: those with most changes."""
LEAST_EVENT = 0.5
"""Seconds under which an event is counted but not listed, unless it is one of `WARNINGS`."""
WARNINGS = ("immobilization", "stuck", "push")
"""Events that a driver acts on: each is listed, however short."""
LISTED = 40
ALIKE_LISTED = 3
"""Of a run's events of one kind for one reason so many are listed, the longest, and the rest in one row; warnings are all listed."""


def recognised(
    grounds: Sequence[Ground], clocks: Mapping[str, Clock] = NO_CLOCKS, simulated: bool = False
) -> Section:
    """Probabilities of the soils over the drives, changes, and the confusion matrix where the recording names its soils.

    `clocks`: of the runs, by name.
    """
    title = "The ground"
    with_time = [ground for ground in grounds if len(ground.timeline.time) > 1]
    if not with_time:
        return Section(
            "ground", title, omitted="Left out: no ground.json was given, or it contains no drive."
        )
    shown = sorted(with_time, key=lambda ground: -len(ground.changes))[:SHOWN]
    sim = "Simulated run" if simulated else "Run"
    content: list[Picture | Table] = []
    for ground in sorted(shown, key=lambda one: one.run):
        way = (
            "as it was reported while driving"
            if ground.about.get("online")
            else "reported afterwards, from the whole drive"
        )
        labelled = any(ground.timeline.label)
        strip = " The strip on top is the recording's own label, grey a transition." if labelled else ""
        picture = Picture(
            f"ground-{stem(ground.run)}",
            draw_probabilities(ground, clocks.get(ground.run, Clock())),
            f"{sim} {ground.run}: probability of each soil over time, {way}. Vertical lines: changes of the ground in the estimates, "
            f"as dark as they are probable, dotted where a tool may be the cause, with their standard deviations.{strip} Where two soils "
            "are alike, they share the probability.",
            f"Probabilities of soils over time in {ground.run}",
        )
        content.append(picture)
    named = [ground.timeline for ground in with_time if set(ground.timeline.names) - {"unknown"}]
    matrix = confusion(named)
    prose = [
        note if len(with_time) == 1 else f"{ground.run}: {note}" for ground in shown for note in ground.notes
    ]
    if matrix is not None:
        prose.insert(0, matrix[1])
        content.append(matrix[0])
    elif not named:
        prose.append(
            "No soil is named: the ground was searched without a library of soils, or with an empty one."
        )
    else:
        prose.append("There is no confusion matrix: the recordings do not name their soils.")
    return Section("ground", title, tuple(prose), tuple(content))


def section_points(
    grounds: Sequence[Ground], clocks: Mapping[str, Clock] = NO_CLOCKS, simulated: bool = False
) -> Section:
    """Mean and SD of slip and adhesion of each section found, coloured by the soil it was taken for (the paper's last two figures)."""
    title = "Operating points of the sections found"
    crosses = [
        Cross(
            one.soil,
            "estimated",
            one.slip_mean,
            one.slip_std or 0.0,
            one.adhesion_mean,
            one.adhesion_std or 0.0,
            one.samples,
        )
        for ground in grounds
        for one in ground.sections
        if one.slip_mean is not None and one.adhesion_mean is not None
    ]
    if not crosses:
        return Section(
            "sections",
            title,
            omitted="Left out: no ground.json was given, or none of its sections has a sample.",
        )
    picture = Picture(
        "ground-sections",
        draw_crosses(crosses, ("estimated",), "adhesion µ"),
        f"Mean ± SD of slip and adhesion (the driven wheels' mean by load) of each of the {len(crosses)} sections between changes"
        f"{' of the simulated runs' if simulated else ''}, in the colour of the recognised soil. Labels are not used here.",
        "Crosses of slip and adhesion of the sections that were found",
    )
    rows = tuple(
        (
            f"{ground.run}, {clocks.get(ground.run, Clock()).span(one.start, one.end)}",
            one.soil,
            percent(one.probabilities.get(one.soil), 0),
            one.label or "–",
            f"{number(100 * one.slip_mean, 1)} ± {percent(one.slip_std)}"
            if one.slip_mean is not None
            else "–",
            f"{number(one.adhesion_mean)} ± {number(one.adhesion_std)}",
            _sensor(one.measured),
        )
        for ground in grounds
        for one in ground.sections
    )[:LISTED]
    table = Table(
        "Sections: vehicle and tool between two changes. The sensor's column is its F_x/F_z, which follows κ."
        + (f" The first {LISTED}." if sum(len(ground.sections) for ground in grounds) > LISTED else ""),
        ("run, time", "recognised as", "probability", "label", "slip", "adhesion", "sensor"),
        rows,
    )
    return Section("sections", title, (), (picture, table))


def events(
    grounds: Sequence[Ground],
    result: Mapping[str, Sequence[Event]] | None = None,
    clocks: Mapping[str, Clock] = NO_CLOCKS,
) -> Section:
    """What happened, with start, end and the reason in the user's words.

    result: events of the estimates themselves by run (kind, start, end, why), for the runs that no `grounds` tells of.
    """
    title = "Events"
    with_time = {ground.run for ground in grounds}
    every = [(ground.run, one) for ground in grounds for one in ground.events]
    every += [(run, one) for run, mine in (result or {}).items() if run not in with_time for one in mine]
    if not grounds and not result:
        return Section(
            "events",
            title,
            omitted="Left out: no ground.json was given, and no estimates whose events could be determined.",
        )
    if not every:
        return Section("events", title, ("No event.",))
    listed = [(run, one) for run, one in every if one.seconds >= LEAST_EVENT or one.kind in WARNINGS]
    kinds = {
        kind: sum(one.kind == kind for _, one in every) for kind in sorted({one.kind for _, one in every})
    }
    counted = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    if not listed:
        return Section("events", title, (f"{counted}; none of half a second or more.",))
    prose = f"{counted}; listed are warnings, and the longest of what lasts half a second or more:"
    warned = [pair for pair in listed if pair[1].kind in WARNINGS]
    others = _longest([pair for pair in listed if pair[1].kind not in WARNINGS], clocks)
    # Warnings are never crowded out by a row of outliers.
    shown = [_event(run, one, clocks) for run, one in warned[:LISTED]] + others[
        : max(LISTED - len(warned), 0)
    ]
    whole = len(warned) + len(others)
    caption = (
        "Events, with the reason for each."
        if whole <= LISTED
        else f"Events; {LISTED} of {whole}, warnings first."
    )
    return Section(
        "events",
        title,
        (prose,),
        (Table(caption, ("run, start", "event", "lasts [s]", "why"), tuple(shown)),),
    )


def _event(run: str, one: Event, clocks: Mapping[str, Clock]) -> tuple[str, ...]:
    """A row of the table of events."""
    lasts = number(one.seconds, 1)
    return f"{run}, {clocks.get(run, Clock()).text(one.start, 1)}", one.kind, lasts, one.why or "–"


def _longest(listed: Sequence[tuple[str, Event]], clocks: Mapping[str, Clock]) -> list[tuple[str, ...]]:
    """Rows of the ALIKE_LISTED longest events of each run, kind and reason, in order of time, and one row for the others."""
    groups: dict[tuple[str, str, str], list[Event]] = {}
    for run, one in listed:
        groups.setdefault((run, one.kind, one.why), []).append(one)
    rows = []
    for (run, kind, _), mine in groups.items():
        longest = sorted(mine, key=lambda one: (-round(one.seconds, 3), one.start))
        kept = longest if len(mine) <= ALIKE_LISTED + 1 else longest[:ALIKE_LISTED]
        rows += [_event(run, one, clocks) for one in sorted(kept, key=lambda one: one.start)]
        if rest := longest[len(kept) :]:
            seconds = sum(one.seconds for one in rest)
            rows.append(
                (f"{run}, {len(rest)} more", kind, number(seconds, 1), "for the same reason; seconds of all")
            )
    return rows


def confusion(timelines: Iterable[Timeline]) -> tuple[Table, str] | None:
    """Shares of the labelled, telling time of each soil (rows) that was taken for each soil (columns), and how much is right in words.

    None without labels.
    """
    truth, taken = [], []
    for timeline in timelines:
        rows = timeline.known & (timeline.label != "")
        truth.append(timeline.label[rows])
        taken.append(timeline.soil[rows])
    true, estimated = (
        np.concatenate([np.zeros(0, dtype=object), *truth]),
        np.concatenate([np.zeros(0, dtype=object), *taken]),
    )
    if not len(true):
        return None
    columns = sorted(set(estimated), key=lambda name: (name == "unknown", name))
    rows_ = []
    for name in sorted(set(true)):
        mine = estimated[true == name]
        rows_.append(
            (name, *(percent(float(np.mean(mine == other)), 0) for other in columns), str(len(mine)))
        )
    sentence = f"By the recordings' own labels the soil is right in {percent(float(np.mean(true == estimated)))} of the time"
    if set(ALIKE) <= set(true):
        alike = np.isin(true, ALIKE) & np.isin(estimated, ALIKE)
        joined = percent(float(np.mean((true == estimated) | alike)))
        sentence += f", in {joined} with {names(ALIKE)} taken as one, which the paper could not distinguish"
    table = Table(
        "The soil by its label (rows) and the recognised soil (columns), in shares of the row.",
        ("label", *columns, "blocks of 0.5 s"),
        tuple(rows_),
    )
    return table, f"{sentence}."


def draw_probabilities(ground: Ground, clock: Clock = Clock()) -> str:  # noqa: B008
    """An SVG: the soils over time as `ground.views` draws them, the label's strip above."""
    timeline = ground.timeline
    figure = new_figure(9.6, 3.1)
    with styled():
        plot = figure.subplots()
        draw_soils(plot, ground)
        soil_strip(
            plot, timeline.time, timeline.label, tuple(s for s, _, _ in label_stretches(timeline.label))
        )
        plot.set_xlim(float(timeline.time[0]), float(timeline.time[-1]))
        clock.mark(plot)
        plot.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.10), ncols=8, borderaxespad=0.0, handlelength=1.6
        )
        return to_svg(figure)


def _sensor(measured: object) -> str:
    """The force sensor's mean and SD of a section, "–" without one."""
    for result in measured.values() if isinstance(measured, dict) else ():
        mean, std = result.get("force_ratio_mean"), result.get("force_ratio_std")
        if mean is not None:
            return f"{number(mean)} ± {number(std)}"
    return "–"
