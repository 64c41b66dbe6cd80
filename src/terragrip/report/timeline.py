"""Quantities over time: estimate with interval, sensor and truth; soils as a strip, stuck spells shaded."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Bools, Floats
from terragrip.figures import INK, MUTED, new_figure, soil_color, styled
from terragrip.report.runs import Run, label_stretches, stretches
from terragrip.report.style import ESTIMATED, MEASURED, TRUE, name_axis, text_color, to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 900
"""Time slots a line is drawn with: about its pixels, so that a file stays small and spikes stay in."""


@dataclass(frozen=True)
class Lane:
    """One quantity of a run, ready to draw: (n,) each, None where there is none. `reference`: what `truth` is called."""

    label: str
    estimate: Floats
    std: Floats | None = None
    measured: Floats | None = None
    truth: Floats | None = None
    limits: tuple[float, float] | None = None
    reference: str = "truth"


def timeline(run: Run, lanes: list[Lane], window: tuple[float, float] | None = None) -> str:
    """An SVG with one plot for each lane over a common time axis.

    `window` zooms to (start, end) seconds. The interval drawn is ±1.96 SD, so about 95 %.
    """
    rows = np.ones(len(run.time), dtype=np.bool_)
    if window is not None:
        rows = (run.time >= window[0]) & (run.time <= window[1])
    figure = new_figure(height=0.75 + 2.65 * len(lanes))
    with styled():
        from matplotlib.patches import Patch

        plots = figure.subplots(len(lanes), 1, sharex=True, squeeze=False)[:, 0]
        for plot, lane in zip(plots, lanes, strict=True):
            _draw_lane(plot, run.time[rows], lane, rows)
            _shade(plot, run, rows)
        named = soil_strip(plots[0], run.time[rows], run.soil[rows], run.soils)
        handles, _ = plots[0].get_legend_handles_labels()
        if (run.stuck & rows).any():
            handles.append(Patch(color=INK, alpha=0.10, linewidth=0, label="stuck"))
        if not named:
            shown = [soil for soil in run.soils if (run.soil[rows] == soil).any()]
            handles += [Patch(color=soil_color(soil, run.soils), label=soil) for soil in shown]
        plots[0].legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.10),
            ncols=5,
            borderaxespad=0.0,
            handlelength=1.6,
        )
        plots[-1].set_xlim(float(run.time[rows][0]), float(run.time[rows][-1]))
        run.clock.mark(plots[-1])
        return to_svg(figure)


def soil_strip(plot: Axes, time: Floats, soil: NDArray[np.object_], soils: tuple[str, ...]) -> bool:
    """A strip of soils above `plot`, grey on a transition; whether every stretch had room for its name."""
    if not len(time) or not any(soil):
        return True
    across = plot.get_xaxis_transform()
    span = float(time[-1] - time[0]) or 1.0
    bar: dict[str, Any] = {"transform": across, "clip_on": False, "linewidth": 0}
    plot.broken_barh([(float(time[0]), span)], (1.015, 0.055), facecolor=MUTED, alpha=0.25, **bar)
    result = [(label, float(time[a]), float(time[b])) for label, a, b in label_stretches(soil)]
    roomy = all((end - start) / span > 0.011 * len(label) + 0.01 for label, start, end in result)
    for label, start, end in result:
        color = soil_color(label, soils)
        plot.broken_barh([(start, end - start)], (1.015, 0.055), facecolor=color, **bar)
        if roomy:
            plot.text(
                (start + end) / 2, 1.0405, label,
                transform=across, ha="center", va="center", fontsize=7.5, color=text_color(color),
            )  # fmt: skip
    return roomy


def slots(time: Floats, values: Floats, columns: int = COLUMNS) -> tuple[Floats, Floats]:
    """At most 2 x `columns` points that draw like all of them: each slot's extremes, in order of time.

    A slot without a finite value becomes one NaN, so that a gap stays a gap; a lone missing sample does not
    break a line of a slower channel.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) <= 2 * columns:
        return _with_gaps(time[finite], values[finite])
    edges = np.linspace(time[0], time[-1], columns + 1)
    bounds = np.searchsorted(time[finite], edges)
    bounds[-1] = len(finite)
    keep: list[int] = []
    for first, last in itertools.pairwise(bounds):
        if last > first:
            part = values[finite[first:last]]
            keep += sorted({int(finite[first + part.argmin()]), int(finite[first + part.argmax()])})
    return _with_gaps(time[keep], values[keep])


def _with_gaps(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Put a NaN where the step in time is far beyond the usual one (over 1 s and ten times the median)."""
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    breaks = np.flatnonzero(steps > max(1.0, 10.0 * float(np.median(steps)))) + 1
    middle = (time[breaks - 1] + time[breaks]) / 2.0
    return np.insert(time, breaks, middle), np.insert(values, breaks, np.nan)


def _draw_lane(plot: Axes, time: Floats, lane: Lane, rows: Bools) -> None:
    if lane.measured is not None:
        plot.plot(
            *slots(time, lane.measured[rows]),
            color=MEASURED,
            linewidth=0.7,
            alpha=0.75,
            label="force sensor" if lane.truth is None else "simulated force sensor",
        )
    if lane.std is not None:
        half = 1.96 * lane.std[rows]
        at, low = _with_gaps(*_thin(time, lane.estimate[rows] - half))
        _, high = _with_gaps(*_thin(time, lane.estimate[rows] + half))
        plot.fill_between(
            at, low, high, color=ESTIMATED, alpha=0.22, linewidth=0, label="95 % interval of the estimate"
        )
    plot.plot(*slots(time, lane.estimate[rows]), color=ESTIMATED, label="estimate")
    if lane.truth is not None:
        plot.plot(*slots(time, lane.truth[rows]), color=TRUE, linewidth=0.8, label=lane.reference)
    name_axis(plot.yaxis, lane.label)
    if lane.limits is not None:
        plot.set_ylim(*lane.limits)


def _thin(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Every k-th row, for bands that vary slowly."""
    step = max(1, len(time) // COLUMNS)
    return time[::step], values[::step]


def _shade(plot: Axes, run: Run, rows: Bools) -> None:
    for first, last in stretches(run.stuck & rows):
        plot.axvspan(float(run.time[first]), float(run.time[last]), color=INK, alpha=0.10, linewidth=0)
