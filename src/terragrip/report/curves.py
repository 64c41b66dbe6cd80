"""Adhesion-slip curves drawn: bins with their fit, and mu(s) and eta(s) with both maxima (the paper's curve figures)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.figures import BLUE, GREEN, INK, MUTED, ORANGE, new_figure, soil_color, styled
from terragrip.physics.efficiency import tractive_efficiency
from terragrip.report.style import name_axis, to_svg
from terragrip.soil.bins import BY_PULL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from terragrip.soil.fit import AdhesionCurve
    from terragrip.soil.learn import LearnedSoil
    from terragrip.soil.library import Soil


SLIPS = np.linspace(0.0, 0.65, 131)
"""Slips that curves are drawn at: the bins' range and a little more."""


@dataclass(frozen=True)
class SoilCurves:
    """One soil's curve by each source.

    `learned`: from these estimates, or as the library holds it. `paper`: the paper's soil of that name. `truth`: what a
    simulation made the soil with; `true_pairs`: the fit of `learned` on the simulation's true slip and adhesion; `true_by_slip`: the
    paper's fit on them. None where there is none.
    """

    name: str
    learned: LearnedSoil
    paper: Soil | None = None
    truth: Soil | None = None
    true_pairs: AdhesionCurve | None = None
    true_by_slip: AdhesionCurve | None = None

    @property
    def sure(self) -> bool:
        """Whether the data fix the curve and give it an interval; else it is a hint only, drawn dotted."""
        return self.learned.curve.identifiability_.identifiable and self.learned.curve.has_band

    @property
    def reach(self) -> float:
        """The largest slip of the bins: beyond it a curve rests on its form alone. Infinite for a curve without bins."""
        return self.learned.soil.reach

    @property
    def by_slip(self) -> AdhesionCurve | None:
        """The paper's fit where it stands beside another; None where it is the one that counts."""
        return None if self.learned.by_slip is self.learned.curve else self.learned.by_slip


@dataclass(frozen=True)
class Maxima:
    """(slip, value) of the largest adhesion and of the largest tractive efficiency of one curve (paper eq. 7)."""

    adhesion: tuple[float, float]
    efficiency: tuple[float, float]


def maxima(soil: Soil, tire_resistance: float) -> Maxima:
    """Both maxima of `soil` on slips of 0 to 1, its mean resistance at every slip."""
    from terragrip.physics.adhesion import CURVES, efficiency_peak

    model = CURVES[soil.model]
    parameters = {k: v for k, v in soil.parameters.items() if k != "intercept"}
    return Maxima(
        model.peak(parameters), efficiency_peak(model, parameters, _resistance(soil), tire_resistance)
    )


def draw_fits(curves: Sequence[SoilCurves], columns: int = 2) -> str:
    """An SVG: a plot for each soil, bin means with SD bars, the fit and every other source of the curve."""
    columns = min(columns, len(curves))
    rows = -(-len(curves) // columns)
    wide = columns > 1
    figure = new_figure(9.6 if wide else 8.4, (3.0 if wide else 4.4) * rows + 0.5)
    with styled():
        plots = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=wide)
        named: dict[str, Any] = {}
        for plot, curve in zip(plots.flat, curves, strict=False):
            named |= _draw_fit(plot, curve)
            if wide:
                plot.set_title(curve.name)
        for plot in plots.flat[: len(curves)]:  # before all are drawn it would keep the height of the first
            plot.set_ylim(bottom=0)
        for plot in plots.flat[len(curves) :]:
            plot.remove()
        for plot in plots[:, 0]:
            plot.set_ylabel("adhesion µ [–]")
        for i, plot in enumerate(plots.flat[: len(curves)]):
            if i + columns >= len(curves):
                name_axis(plot.xaxis, "slip s [%]")
                plot.tick_params(labelbottom=True)
        figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=3 if wide else 4)
        return to_svg(figure)


def draw_both_maxima(curve: SoilCurves, tire_resistance: float) -> str:
    """An SVG of one soil: mu(s) and eta(s) over slip, their maxima marked, the truth's beside them."""
    figure = new_figure(8.4, 4.2)
    with styled():
        plot = figure.subplots()
        sources: list[tuple[str, Soil, dict[str, Any]]] = [("", curve.learned.soil, _line(curve))]
        if curve.truth is not None:
            sources.append((" of the truth", curve.truth, {"linewidth": 0.9, "linestyle": "--"}))
        slip = np.linspace(0.0, 1.0, 401)
        for ending, soil, style in sources:
            eta = _efficiency(soil, slip, tire_resistance)
            for label, values, color in (
                ("adhesion µ", soil.value(slip), BLUE),
                ("efficiency η", eta, GREEN),
            ):
                drawn = {"color": INK if ending else color, "label": f"{label}{ending}", **style}
                _draw_line(plot, slip, values, np.inf if ending else curve.reach, drawn)
        peaks = maxima(curve.learned.soil, tire_resistance)
        for (at, height), what, color, marker in (
            (peaks.adhesion, "µ", BLUE, "o"),
            (peaks.efficiency, "η", GREEN, "s"),
        ):
            if np.isfinite(at):
                _draw_maximum(plot, at, height, curve.reach, marker, color, 7)
                sentence = f"largest {what}: {height:.2f} at {100 * at:.0f} % slip"
                sentence += ", beyond the data" * (at > curve.reach)
                plot.annotate(
                    sentence, (at, height), (9, 9), textcoords="offset points", color=INK, fontsize=9
                )
        plot.set_xlim(0, 1)
        plot.set_ylim(0, 1.15 * max(peaks.adhesion[1], peaks.efficiency[1]))
        name_axis(plot.xaxis, "slip s [%]")
        plot.set_ylabel("adhesion µ, efficiency η [–]")
        figure.legend(loc="outside upper left", ncols=4)
        return to_svg(figure)


def draw_all_maxima(curves: Sequence[SoilCurves], tire_resistance: float) -> str:
    """An SVG of all soils: mu(s) left, eta(s) right, the maxima marked."""
    names = tuple(curve.name for curve in curves)
    figure = new_figure(9.6, 3.7)
    with styled():
        left, right = figure.subplots(1, 2)
        slip = np.linspace(0.0, 1.0, 401)
        for curve in curves:
            soil, color = curve.learned.soil, soil_color(curve.name, names)
            peaks = maxima(soil, tire_resistance)
            style = {"color": color, "label": curve.name, **_line(curve)}
            _draw_line(left, slip, soil.value(slip), curve.reach, style)
            eta = _efficiency(soil, slip, tire_resistance)
            _draw_line(right, slip, eta, curve.reach, {**style, "label": None})
            for plot, (at, height), marker in ((left, peaks.adhesion, "o"), (right, peaks.efficiency, "s")):
                _draw_maximum(plot, at, height, curve.reach, marker, color, 5)
        for plot, label in ((left, "adhesion µ [–]"), (right, "tractive efficiency η [–]")):
            name_axis(plot.xaxis, "slip s [%]")
            plot.set_ylabel(label)
            plot.set_xlim(0, 1)
            plot.set_ylim(bottom=0)
        figure.legend(loc="outside upper left", ncols=max(len(curves), 1))
        return to_svg(figure)


def _draw_fit(plot: Axes, shown: SoilCurves) -> dict[str, Any]:
    """Draw one soil; the legend's entries by label."""
    named: dict[str, Any] = {}
    paper, counts = shown.by_slip, shown.learned.curve
    by_pull = counts.bins_.settings.by == BY_PULL
    sorted_by_slip = paper if by_pull else counts
    if sorted_by_slip is not None:
        named["bins by slip, mean ± SD"] = _draw_bins(plot, sorted_by_slip, "x", MUTED, 4)
    if by_pull:
        named["bins by pull, mean ± SD"] = _draw_bins(plot, counts, "o", BLUE, 3.5)
    if shown.learned.curve.has_band:
        low, high = shown.learned.curve.band(SLIPS)
        within = shown.reach >= SLIPS
        for where, alpha in ((~within, 0.08), (within, 0.22)):
            named["95 % of the fit"] = plot.fill_between(
                SLIPS, low, high, where=where, color=BLUE, alpha=alpha, linewidth=0
            )
    lines: list[tuple[str, Floats | None, dict[str, Any]]] = [
        (
            "fit to the bins" + (" by pull" if by_pull else "") + ("" if shown.sure else ", a hint only"),
            counts.predict(SLIPS),
            {"color": BLUE, **_line(shown)},
        ),
        (
            "fit by slip, the paper's way",
            None if paper is None else paper.predict(SLIPS),
            {"color": MUTED, "linewidth": 1.4, "linestyle": "--"},
        ),
        ("paper", _value(shown.paper), {"color": ORANGE, "linewidth": 1.4, "linestyle": "-."}),
        ("simulated truth", _value(shown.truth), {"color": INK, "linewidth": 0.9}),
    ]
    for label, values, style in lines:
        if values is not None:
            named[label] = _draw_line(
                plot, SLIPS, values, shown.reach if style["color"] == BLUE else np.inf, style
            )
    plot.set_xlim(0, SLIPS[-1])
    return named


def _draw_line(plot: Axes, slip: Floats, values: Floats, reach: float, style: dict[str, Any]) -> Any:
    """A curve, pale and dotted beyond the data; what stands in the legend."""
    within = slip <= reach
    beyond = slip >= slip[within].max(initial=0.0)
    (line,) = plot.plot(slip[within], values[within], **style)
    if not within.all():
        plot.plot(slip[beyond], values[beyond], **{**style, "linestyle": ":", "alpha": 0.6, "label": None})
    return line


def _draw_maximum(
    plot: Axes, at: float, height: float, reach: float, marker: str, color: str, size: int
) -> None:
    """A maximum of a curve, hollow beyond the data."""
    fill = "none" if at > reach else "full"
    plot.plot([at], [height], marker, color=color, markersize=size, fillstyle=fill)


def _line(curve: SoilCurves) -> dict[str, Any]:
    """How a fit is drawn: one that is a hint only must not look the surest, for want of a band."""
    return {"linewidth": 1.8, "linestyle": "-" if curve.sure else ":"}


def _draw_bins(plot: Axes, curve: AdhesionCurve, marker: str, color: str, size: float) -> Any:
    """Means of the used bins with SD bars."""
    bins = curve.bins_
    used = bins.used
    return plot.errorbar(
        bins.slip[used],
        bins.mean[used],
        yerr=bins.std[used],
        fmt=marker,
        color=color,
        ecolor=color,
        elinewidth=0.7,
        markersize=size,
    )


def _value(soil: Soil | None) -> Floats | None:
    return None if soil is None else soil.value(SLIPS)


def _efficiency(soil: Soil, slip: Floats, tire_resistance: float) -> Floats:
    eta = tractive_efficiency(soil.value(slip), _resistance(soil), tire_resistance, slip)
    return np.asarray(eta, dtype=float)


def _resistance(soil: Soil) -> float:
    return soil.resistance[0] if soil.resistance else 0.0
