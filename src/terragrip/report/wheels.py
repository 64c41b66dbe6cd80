"""Every wheel of a run beside the others: slip and adhesion over time, and their means."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, new_figure, styled
from terragrip.recording.window_means import window_means
from terragrip.report.page import Picture, Section, Table, number
from terragrip.report.runs import Run
from terragrip.report.style import name_axis, to_svg

_COLORS = (BLUE, ORANGE, GREEN, PURPLE, VERMILLION, SKY)
_DASHES = ("-", "--", "-.", ":")

SLOTS = 240
"""Means over time that a line is drawn with."""
_UNSURE = 0.15
QUANTITIES = (("slip", "slip s [%]"), ("adhesion", "adhesion µ [–]"))


def look(k: int) -> tuple[str, str]:
    """Colour and dash of wheel ``k``: of twelve wheels no two have both in common."""
    return _COLORS[k % len(_COLORS)], _DASHES[k % len(_DASHES)]


def section(run: Run) -> Section | None:
    """All wheels of a run; None where it has only one."""
    if len(run.wheels) < 2:
        return None
    shown = [(name, label) for name, label in QUANTITIES if f"{name}_{run.wheels[0]}" in run.estimates]
    picture = Picture(
        f"wheels-{run.name}",
        draw(run, shown),
        f"{'Simulated run' if run.truth is not None else 'Run'} {run.name}: {' and '.join(label.split(' [')[0] for _, label in shown)} "
        "of every wheel, means over stretches of the run; stuck spells and what is hardly known left out.",
        f"Every wheel of {run.name} over time",
    )
    return Section(f"wheels-{run.name}", f"Every wheel in {run.name}", (), (picture, _table(run)))


def draw(run: Run, shown: list[tuple[str, str]]) -> str:
    """An SVG: a plot for each quantity, a line for each wheel."""
    figure = new_figure(9.6, 0.7 + 2.2 * len(shown))
    with styled():
        plots = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for plot, (name, label) in zip(plots, shown, strict=True):
            for i, wheel in enumerate(run.wheels):
                color, dash = look(i)
                plot.plot(
                    *_means(run.time, _known(run, name, wheel)),
                    color=color,
                    linestyle=dash,
                    label=wheel,
                    linewidth=1.4,
                )
            name_axis(plot.yaxis, label)
        run.clock.mark(plots[-1])
        plots[0].legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.02), ncols=8, borderaxespad=0.0, handlelength=2.6
        )
        return to_svg(figure)


def _table(run: Run) -> Table:
    rows = []
    for wheel in run.wheels:
        slip = _known(run, "slip", wheel)
        row = [wheel, f"{number(100 * _mean(slip), 1)} ± {number(100 * _std(slip), 1)} %"]
        for name in ("adhesion", "net_traction"):
            if f"{name}_{wheel}" in run.estimates:
                values = _known(run, name, wheel)
                row.append(f"{number(_mean(values))} ± {number(_std(values))}")
        rows.append(tuple(row))
    head = ("wheel", "slip", *(["µ", "κ"] if len(rows[0]) == 4 else ["µ"] if len(rows[0]) == 3 else []))
    return Table(f"Mean ± SD over time of each wheel of {run.name}.", head, tuple(rows))


def _known(run: Run, quantity: str, wheel: str) -> Floats:
    rows = ~run.stuck & (run.estimated(f"slip_{wheel}_std") < _UNSURE)
    return np.where(rows, run.estimated(f"{quantity}_{wheel}"), np.nan)


def _means(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Means of equal slots of time, NaN where a slot knows nothing."""
    slots = min(SLOTS, max(len(time) // 4, 1))
    edges = np.linspace(time[0], time[-1], slots + 1)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, slots - 1)
    return (edges[:-1] + edges[1:]) / 2, window_means(values, place, slots)


def _mean(values: Floats) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def _std(values: Floats) -> float:
    return float(np.nanstd(values)) if np.isfinite(values).any() else float("nan")
