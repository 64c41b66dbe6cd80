"""Whether the intervals have the coverage that they claim: coverage against the truth, and NIS against its chi-square law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Floats
from terragrip.estimation.consistency import coverage, nis_consistency
from terragrip.figures import BLUE, GREEN, INK, ORANGE, new_figure, styled
from terragrip.report.page import Table, number, percent
from terragrip.report.runs import Run
from terragrip.report.style import to_svg

LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)


QUANTITIES = {"adhesion µ": "adhesion_", "slip s": "slip_", "soil resistance ρs": "soil_resistance"}
"""What is judged, and how its columns begin; of the wheels' quantities every wheel counts."""


@dataclass(frozen=True)
class Coverage:
    """How often the intervals of one run hold the truth: rows judged, and rows held at each of LEVELS."""

    run: str
    quantity: str
    rows: int
    held: tuple[int, ...]

    def share(self, level: float = 0.95) -> float:
        """Share of rows held at `level`, one of LEVELS; NaN where no row was judged."""
        return self.held[LEVELS.index(level)] / self.rows if self.rows else float("nan")


def run_coverage(run: Run) -> list[Coverage]:
    """Coverage of mu and slip (every wheel) and rho_s of `run` against its truth, where :attr:`Run.judged`."""
    result = []
    for quantity, beginning in QUANTITIES.items():
        columns = [beginning] if beginning == "soil_resistance" else [beginning + w for w in run.wheels]
        truth, estimate, std = _triples(run, columns)
        rows = len(truth)
        held = (round(coverage(truth, estimate, std, level) * rows) if rows else 0 for level in LEVELS)
        result.append(Coverage(run.name, quantity, rows, tuple(held)))
    return result


def pooled(coverages: Sequence[Coverage]) -> list[Coverage]:
    """Coverage of each quantity over all runs together."""
    result = []
    for quantity in QUANTITIES:
        parts = [item for item in coverages if item.quantity == quantity and item.rows]
        if parts:
            held = tuple(sum(item.held[i] for item in parts) for i in range(len(LEVELS)))
            result.append(Coverage("all", quantity, sum(item.rows for item in parts), held))
    return result


def draw_coverage(coverages: Sequence[Coverage]) -> str:
    """An SVG: observed against nominal coverage. Above the diagonal intervals are conservative, below it overconfident."""
    figure = new_figure(width=5.6, height=4.4)
    with styled():
        plot = figure.subplots()
        plot.plot([0.45, 1], [0.45, 1], color=INK, linewidth=0.9, linestyle="--", label="ideal")
        for item, color, marker in zip(
            pooled(coverages), (BLUE, ORANGE, GREEN), ("o", "s", "^"), strict=False
        ):
            shares = [item.share(level) for level in LEVELS]
            plot.plot(LEVELS, shares, color=color, marker=marker, markersize=5, label=item.quantity)
        plot.set_xlabel("stated probability of the interval")
        plot.set_ylabel("share of rows in which it covers the truth")
        plot.set_xlim(0.45, 1.0)
        plot.legend(loc="lower right")
        return to_svg(figure)


def coverage_table(coverages: Sequence[Coverage]) -> Table:
    """Coverage at 95 %: pooled, and the spread over runs."""
    rows = []
    for item in pooled(coverages):
        shares = [part.share() for part in coverages if part.quantity == item.quantity and part.rows]
        low = f"{sum(share < 0.9 for share in shares)} of {len(shares)}"
        figures = (item.share(), float(np.median(shares)), min(shares))
        rows.append((item.quantity, *(percent(share) for share in figures), low))
    return Table(
        "Coverage of the 95 % intervals over all simulated runs while the vehicle moves by itself, neither stuck "
        "nor pushed by its operator (a force that no sensor measures).",
        ("quantity", "pooled", "median run", "worst run", "runs under 90 %"),
        tuple(rows),
    )


def nis_by_channels(run: Run) -> tuple[Floats, Floats]:
    """NIS and number of channels of the rows of `run` that took any."""
    nis, channels = run.estimated("nis"), run.estimated("channels")
    rows = np.isfinite(nis) & (channels > 0)
    return nis[rows], channels[rows]


def _chi_square_density(x: ArrayLike, degrees: int) -> Floats:
    """Of `x` (n,) above 0; scipy.stats, which has it, would take half a second to load."""
    from scipy.special import gammaln

    values, half = np.asarray(x, dtype=np.float64), degrees / 2
    density: Floats = np.exp((half - 1) * np.log(values) - values / 2 - gammaln(half) - half * np.log(2))
    return density


def draw_nis(run: Run) -> str:
    """An SVG: the histogram of NIS for each common number of channels, with the chi-square law."""
    from scipy.special import chdtri

    nis, channels = nis_by_channels(run)
    counts = {int(c): int((channels == c).sum()) for c in np.unique(channels)}
    common = sorted(sorted(counts, key=lambda c: -counts[c])[:3])
    figure = new_figure(width=8.4, height=3.2)
    with styled():
        plots = figure.subplots(1, len(common), squeeze=False)[0]
        for plot, degrees in zip(plots, common, strict=True):
            top = float(chdtri(degrees, 1e-4))
            values = nis[channels == degrees]
            heights, edges = np.histogram(np.minimum(values, top), bins=40, range=(0.0, top))
            width = edges[1] - edges[0]
            plot.bar(
                edges[:-1], heights / (len(values) * width), width=width, align="edge", color=BLUE, alpha=0.55
            )
            grid = np.linspace(width / 4, top, 200)
            plot.plot(grid, _chi_square_density(grid, degrees), color=INK, linewidth=1.2)
            # one degree of freedom has an infinite density at 0: keep the axis to what can be read
            highest = float((heights / (len(values) * width)).max())
            plot.set_ylim(0, 1.25 * max(highest, float(_chi_square_density(1.0, degrees))))
            plot.set_title(f"{degrees} channel{'s' if degrees > 1 else ''}, {len(values)} rows")
            plot.set_xlabel("NIS")
        plots[0].set_ylabel("density")
        return to_svg(figure)


def nis_table(runs: Sequence[Run]) -> Table:
    """NIS over its expectation, and the share inside its 95 % bounds, for each run."""
    rows = []
    for run in runs:
        coverages = nis_consistency(*nis_by_channels(run))
        rows.append(
            (
                f"{run.name}, {run.method}",
                number(coverages.ratio, 2),
                percent(coverages.within),
                str(coverages.count),
            )
        )
    return Table(
        "Normalised innovation squared over its expectation (1 for noise settings that are right) and the "
        "share of rows inside its two-sided 95 % bounds.",
        ("run, method", "NIS / channels", "within 95 %", "rows"),
        tuple(rows),
    )


def _triples(run: Run, columns: Sequence[str]) -> tuple[Floats, Floats, Floats]:
    """Truth, estimate and SD of `columns` of `run`, moving and finite rows, one after the other."""
    truth, estimate, std = [], [], []
    for name in columns:
        true = run.true(name)
        if true is None:
            continue
        estimated, sd = run.estimated(name), run.estimated(f"{name}_std")
        rows = run.judged & np.isfinite(true) & np.isfinite(estimated) & np.isfinite(sd)
        truth.append(true[rows])
        estimate.append(estimated[rows])
        std.append(sd[rows])
    if not truth:
        return np.empty(0), np.empty(0), np.empty(0)
    return np.concatenate(truth), np.concatenate(estimate), np.concatenate(std)
