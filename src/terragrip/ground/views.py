"""What a notebook shows of the ground of a drive: sections and events as tables, the soils over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from terragrip.figures import INK, MUTED, ORANGE, notebook_figure, soil_color, styled
from terragrip.ground.causes import OR_TOOL
from terragrip.ground.span import Span
from terragrip.html import figure_of, html_notes, html_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from terragrip.ground.result import Ground


def table_of(spans: Sequence[Span]) -> pd.DataFrame:
    """A row a section or event, as ground.json holds it, and how long it lasts [s]."""
    import pandas as pd

    return pd.DataFrame([{**span.to_dict(), "seconds": span.seconds} for span in spans])


def html_of(ground: Ground) -> str:
    """Sections, events and notes of a drive."""
    changes = f"{len(ground.changes)} change{'s' * (len(ground.changes) != 1)} of the ground"
    sections = html_table(
        ("section", "until [s]", "soil", "slip", "adhesion", "resistance"),
        [
            (
                f"{one.start:.1f} s", f"{one.end:.1f}", one.soil, figure_of(one.slip_mean, one.slip_std),
                figure_of(one.adhesion_mean, one.adhesion_std), figure_of(one.resistance_mean, one.resistance_std),
            )
            for one in ground.sections
        ],
        f"{ground.run or 'drive'}: {ground.end - ground.start:.1f} s, {changes}; mean ± SD",
    )  # fmt: skip
    events = html_table(
        ("event", "lasts [s]", "what", "why"),
        [(f"{one.start:.1f} s", f"{one.seconds:.1f}", one.kind, one.why) for one in ground.events],
    )
    return sections + (events if ground.events else "") + html_notes(ground.notes)


def draw_soils(axes: Axes, ground: Ground) -> None:
    """The probabilities of the soils over time, stacked, "unknown" on top, each with its name for a legend; the changes as lines, as dark
    as they are probable, dotted where a tool may be the cause, with their standard deviations."""
    timeline = ground.timeline
    soils = sorted(timeline.names, key=lambda name: name == "unknown")
    if len(timeline.time):
        layers = timeline.probabilities[:, [timeline.names.index(name) for name in soils]].T
        colors = [INK if name == "unknown" else soil_color(name, soils) for name in soils]
        axes.stackplot(
            timeline.time, layers, labels=soils, colors=colors, alpha=0.9, linewidth=0, step="post"
        )
    for change in ground.changes:
        dark = max(min(change.probability, 1.0), 0.1)
        line = ":" if change.cause == OR_TOOL else "-"
        axes.axvline(change.time, color=INK, linewidth=1.0, linestyle=line, alpha=dark)
        axes.axvspan(
            change.time - change.std, change.time + change.std, color=INK, alpha=0.2 * dark, linewidth=0
        )
        axes.plot([change.time], [1.0], "v", color=MUTED, markersize=4, clip_on=False)
    axes.set_ylim(0, 1)
    axes.set_ylabel("probability")
    axes.grid(visible=False)


def plot(ground: Ground) -> Figure:
    """The soils over time with the changes (`draw_soils`), events below."""
    figure = notebook_figure(9.6, 3.8)
    with styled():
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        draw_soils(axes, ground)
        if len(ground.timeline.time):
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes.set_title("soil; lines: changes ± SD, dotted: or a tool")
        kinds = sorted({event.kind for event in ground.events})
        for event in ground.events:
            below.barh(
                kinds.index(event.kind), max(event.seconds, 0.002 * (ground.end - ground.start)), left=event.start,
                height=0.7, color=ORANGE,
            )  # fmt: skip
        below.set_yticks(np.arange(len(kinds)), kinds)
        below.set_ylabel("events" if kinds else "no event")
        below.set_xlabel("time [s]")
        below.set_xlim(ground.start, max(ground.end, ground.start + 1e-3))
    return figure
