"""Mean and SD of slip and traction by section and by soil: the crosses of the paper's last two figures.

Traction is adhesion (mu, as the paper has it) or the net traction ratio (kappa, what an axle sensor reads).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.figures import INK, new_figure, soil_color, styled
from terragrip.report.page import Table, number, percent
from terragrip.report.runs import Run, label_stretches
from terragrip.report.style import name_axis, to_svg
from terragrip.soil.literature import paper_soils

LEAST_ROWS = 100
"""A section or a soil with fewer rows has no mean worth a cross."""


@dataclass(frozen=True)
class Cross:
    """Mean and SD of slip and traction over the rows of one soil, by one source.

    `source` is ``measured``, ``estimated`` or ``true``.
    """

    soil: str
    source: str
    slip: float
    slip_std: float
    traction: float
    traction_std: float
    count: int


def section_crosses(run: Run, quantity: str) -> list[Cross]:
    """A cross per section of `run` on one soil, one for each source.

    `quantity` is ``adhesion`` or ``net_traction``, here and below.
    """
    crosses = []
    sources = _sources(run, quantity)
    for soil, first, last in label_stretches(run.soil):
        rows = np.zeros(len(run.time), dtype=np.bool_)
        rows[first : last + 1] = True
        rows &= run.moving & ~run.stuck
        crosses += [_cross(soil, source, slip[rows], mu[rows]) for source, slip, mu in sources]
    return [cross for cross in crosses if cross.count >= LEAST_ROWS]


def soil_crosses(runs: Sequence[Run], quantity: str) -> list[Cross]:
    """A cross per soil over all `runs` together, one for each source."""
    pool: dict[tuple[str, str], list[tuple[Floats, Floats]]] = {}
    for run in runs:
        counted = run.moving & ~run.stuck
        for source, slip, mu in _sources(run, quantity):
            for soil in run.soils:
                rows: Bools = counted & (run.soil == soil)
                pool.setdefault((soil, source), []).append((slip[rows], mu[rows]))
    crosses = [
        _cross(soil, source, np.concatenate([s for s, _ in parts]), np.concatenate([m for _, m in parts]))
        for (soil, source), parts in pool.items()
    ]
    return [cross for cross in crosses if cross.count >= LEAST_ROWS]


def draw_crosses(crosses: Iterable[Cross], sources: Sequence[str], what: str) -> str:
    """An SVG of `crosses`: the colour shows the soil, line and marker show the source."""
    shown = [cross for cross in crosses if cross.source in sources]
    soils = tuple(dict.fromkeys(cross.soil for cross in shown))
    looks: dict[str, Any] = {
        "measured": ("x", ":" if len(sources) > 1 else "-", 1.0),
        "estimated": ("o", "-", 1.7),
        "true": ("+", "-", 0.8),
    }
    figure = new_figure(width=7.4, height=4.6)
    with styled():
        from matplotlib.lines import Line2D

        plot = figure.subplots()
        for cross in shown:
            marker, line, width = looks[cross.source]
            color = INK if cross.source == "true" else soil_color(cross.soil, soils)
            bars = plot.errorbar(
                cross.slip, cross.traction, xerr=cross.slip_std, yerr=cross.traction_std, fmt=marker,
                color=color, linewidth=width, markersize=7 if marker != "o" else 5,
            )  # fmt: skip
            for bar in bars[2]:
                bar.set_linestyle(line)
        keys = [Line2D([], [], color=soil_color(s, soils), linewidth=3, label=s) for s in soils]
        keys += [
            Line2D(
                [], [], color=INK, marker=looks[v][0], linestyle=looks[v][1], linewidth=looks[v][2], label=v
            )
            for v in sources
            if any(cross.source == v for cross in shown)
        ]
        plot.legend(handles=keys, loc="upper left", bbox_to_anchor=(1.01, 1.0))
        name_axis(plot.xaxis, "slip s [%]")
        plot.set_ylabel(f"{what} [–]")
        return to_svg(figure)


def cross_table(crosses: Iterable[Cross], what: str) -> Table:
    """Means by soil, the sources side by side, and how far the estimate's mean lies from the other two."""
    by_soil: dict[str, dict[str, Cross]] = {}
    for cross in crosses:
        by_soil.setdefault(cross.soil, {})[cross.source] = cross
    sources = [v for v in ("measured", "estimated", "true") if any(v in kinds for kinds in by_soil.values())]
    others = [v for v in sources if v != "estimated"]
    named = {"measured": "sensor", "estimated": "estimated", "true": "true"}
    rows = []
    for soil, kinds in by_soil.items():
        row = [soil, *(_spread(kinds.get(v)) for v in sources)]
        row += [_apart(kinds.get("estimated"), kinds.get(v)) for v in others]
        row += [percent(kinds[v].slip) if v in kinds else "–" for v in sources]
        rows.append(tuple(row))
    return Table(
        f"Mean ± SD of {what} and mean slip by soil."
        + (" The sensor's column is its F_x/F_z, which follows κ." if "measured" in sources else "")
        + " The paper finds its estimate of µ within .015 of its sensor on grass, wet and fine, and within .03 on coarse."
        * bool({"measured"} & {*sources} and by_soil.keys() & paper_soils().keys()),
        (
            "soil",
            *(named[v] for v in sources),
            *(f"est. − {named[v]}" for v in others),
            *(f"slip {v}" for v in sources),
        ),
        tuple(rows),
    )


def _spread(cross: Cross | None) -> str:
    return f"{number(cross.traction)} ± {number(cross.traction_std)}" if cross else "–"


def _apart(estimated: Cross | None, other: Cross | None) -> str:
    return number(estimated.traction - other.traction) if estimated and other else "–"


def _sources(run: Run, quantity: str) -> list[tuple[str, Floats, Floats]]:
    """(source, slip, traction) one for each source. Estimates alone hold no measured slip: the sensor's traction then stands at the
    estimated one."""
    wheel = run.shown_wheel
    slip = run.estimated(f"slip_{wheel}")
    measured = run.measured_slip()
    result = [
        ("measured", slip if measured is None else measured, run.measured_ratio()),
        ("estimated", slip, run.estimated(f"{quantity}_{wheel}")),
        ("true", run.true(f"slip_{wheel}"), run.true(f"{quantity}_{wheel}")),
    ]
    return [(source, slip, mu) for source, slip, mu in result if slip is not None and mu is not None]


def _cross(soil: str, source: str, slip: Floats, mu: Floats) -> Cross:
    """Mean and SD, slip and adhesion each over its own finite rows: their sensors may run at other rates."""
    s, m = slip[np.isfinite(slip)], mu[np.isfinite(mu)]
    if min(len(s), len(m)) == 0:
        return Cross(soil, source, np.nan, np.nan, np.nan, np.nan, 0)
    return Cross(
        soil, source, float(s.mean()), float(s.std()), float(m.mean()), float(m.std()), min(len(s), len(m))
    )
