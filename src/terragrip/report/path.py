"""The path of runs that have positions, coloured by soil, by what the machine did, or by slip (the paper's figure of multi1 and multi2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.figures import INK, MUTED, new_figure, soil_color, styled
from terragrip.physics.geodesy import metres_of
from terragrip.report.field_work import PARTS
from terragrip.report.page import Picture, Section, names
from terragrip.report.runs import Run
from terragrip.report.style import to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 1500
"""Places of a run that are drawn."""
TITLE = "Where it was driven"


def section(runs: Sequence[Run], labels: Sequence[NDArray[np.object_] | None] | None = None) -> Section:
    """The paths side by side; `labels` of each run (n,), its soils unless they are given."""
    chosen = (
        [run.soil for run in runs]
        if labels is None
        else [own if own is not None else run.soil for run, own in zip(runs, labels, strict=True)]
    )
    placed = [
        (run, own, at) for run, own in zip(runs, chosen, strict=True) if (at := positions(run)) is not None
    ]
    if not placed:
        return Section("path", TITLE, omitted="Left out: the logs have no position (latitude and longitude).")
    said = names([run.name for run, _, _ in placed])
    simulated = any(run.truth is not None for run, _, _ in placed)
    picture = Picture(
        "path",
        draw(placed),
        f"{'Simulated path' if simulated else 'Path'}{'s' * (len(placed) > 1)} of {said}, in metres; the arrow marks the start and the "
        f"driving direction. {_colours(placed)}"
        + (
            " The paper shows the same of its own multi1 and multi2, which were driven elsewhere."
            if simulated
            else ""
        ),
        f"Map of the path of {said}",
    )
    return Section("path", TITLE, (), (picture,))


def _colours(placed: Sequence[tuple[Run, NDArray[np.object_], tuple[Floats, Floats]]]) -> str:
    """What the colours mean, in a sentence."""
    every = {str(name) for _, own, _ in placed for name in own if name}
    if every & set(PARTS):
        return "Colours: what the machine did, by the track itself: straight passes are work, turns between them headland."
    if len(every) < 2 and not any(run.soils for run, _, _ in placed):
        return "The ground is not labelled."
    return "Colours: the label under the vehicle, grey where there is none or a transition."


def positions(run: Run) -> tuple[Floats, Floats] | None:
    """East and north [m] of each row (n,), between fixes straight; None with fewer than two."""
    if not {"latitude", "longitude"} <= set(run.estimates.columns):
        return None
    north, east = metres_of(run.estimated("latitude"), run.estimated("longitude"))
    fixed = np.isfinite(north) & np.isfinite(east)
    if fixed.sum() < 2:
        return None
    return tuple(np.interp(run.time, run.time[fixed], values[fixed]) for values in (east, north))  # type: ignore[return-value]


def draw(placed: Sequence[tuple[Run, NDArray[np.object_], tuple[Floats, Floats]]]) -> str:
    """An SVG: a map for each run."""
    every = tuple(dict.fromkeys(str(name) for _, own, _ in placed for name in own if name))
    wide = 9.6 / len(placed)
    tall = max(float(np.ptp(north)) / max(float(np.ptp(east)), 1e-3) for _, _, (east, north) in placed)
    figure = new_figure(9.6, float(np.clip((wide - 0.8) * tall + 1.2, 2.4, 6.0)))
    with styled():
        from matplotlib.lines import Line2D

        plots = figure.subplots(1, len(placed), squeeze=False)[0]
        for plot, (run, own, (east, north)) in zip(plots, placed, strict=True):
            _draw_one(plot, own, east, north, every)
            plot.set_title(run.name)
            plot.set_xlabel("east [m]")
        plots[0].set_ylabel("north [m]")
        handles = [Line2D([], [], color=soil_color(name, every), linewidth=4, label=name) for name in every]
        if handles:
            figure.legend(handles=handles, loc="outside upper left", ncols=8, handlelength=1.4)
        return to_svg(figure)


def _draw_one(
    plot: Axes, own: NDArray[np.object_], east: Floats, north: Floats, every: tuple[str, ...]
) -> None:
    step = max(1, len(east) // POINTS)
    x, y, names_ = east[::step], north[::step], own[::step]
    plot.plot(x, y, color=MUTED, linewidth=0.8, alpha=0.7)
    for name in every:
        mine = names_ == name
        # a line that ends where the label does
        plot.plot(
            np.where(mine, x, np.nan),
            np.where(mine, y, np.nan),
            color=soil_color(name, every),
            linewidth=2.6,
            solid_capstyle="butt",
        )
    size = max(float(np.ptp(x)), float(np.ptp(y)), 1.0)
    away = np.flatnonzero(np.hypot(x - x[0], y - y[0]) > 0.06 * size)
    if len(away):
        to = int(away[0])
        plot.annotate(
            "",
            (x[to], y[to]),
            (x[0], y[0]),
            arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.6, "mutation_scale": 16},
        )
        plot.plot([x[0]], [y[0]], "o", color=INK, markersize=5)
    plot.margins(0.06)
    plot.set_aspect("equal", adjustable="box", anchor="NW")
