"""Residuals of traction against a sensor and a truth: their histogram, and how fast their autocorrelation decays (whiteness)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.consistency import Whiteness, whiteness
from terragrip.figures import INK, new_figure, styled
from terragrip.report.page import Picture, Section, Table, number
from terragrip.report.runs import Run
from terragrip.report.style import MEASURED, TRUE, to_svg

STEP = 0.1
"""Seconds between the rows that whiteness is judged on: the estimates of neighbouring rows share their samples."""
LAGS = 50


@dataclass(frozen=True)
class Residual:
    """Estimate minus reference, of one source: every judged row (n,) and every `STEP` seconds; None where it is not enough to be judged."""

    source: str
    what: str
    values: Floats
    white: Whiteness | None


def residuals(run: Run) -> list[Residual]:
    """kappa against the sensor and mu against the truth of the shown wheel, while it moves and is neither stuck nor pushed."""
    wheel, shown = run.shown_wheel, []
    for source, what, column, reference in (
        ("sensor", "κ − sensor", f"net_traction_{wheel}", run.measured_ratio()),
        ("truth", "µ − truth", f"adhesion_{wheel}", run.true(f"adhesion_{wheel}")),
    ):
        if reference is None:
            continue
        off = np.where(run.judged, run.estimated(column) - reference, np.nan)
        known = np.isfinite(off)
        if known.sum() > 2:
            shown.append(Residual(source, what, off[known], _white(run.time[known], off[known])))
    return shown


def section(run: Run) -> Section:
    """The report's section: histogram and autocorrelation, and their figures as a table."""
    title = "Residuals"
    shown = residuals(run)
    if not shown:
        return Section(
            "residuals", title, omitted="Left out: there is neither a reference force sensor nor a truth."
        )
    picture = Picture(
        f"residuals-{run.name}",
        draw_residuals(shown),
        f"{'Simulated run' if run.truth is not None else 'Run'} {run.name}: residuals of wheel {run.shown_wheel} while the vehicle moves "
        "by itself. Left: their histogram and the normal law of the same mean and SD. Right: their autocorrelation; within the dashed "
        "lines it is that of white noise. A tail to the right says that the estimate lags or that ground is rougher than the model.",
        f"Histogram and autocorrelation of the residuals of {run.name}",
    )
    rows = tuple(
        (
            one.what,
            number(float(one.values.mean()), 4),
            number(float(one.values.std()), 4),
            number(float(np.mean(np.abs(one.values - one.values.mean()) > 3 * one.values.std())) * 100, 2)
            + " %",
            number(_memory(one.white), 1) if one.white else "–",
            ("yes" if one.white.p_value > 0.05 else "no") if one.white else "–",
        )
        for one in shown
    )
    table = Table(
        f"Residuals of {run.name}. White: the Ljung-Box test over {LAGS * STEP:g} s does not refuse it at 5 %. A normal law has 0.27 % "
        "beyond 3 SD.",
        ("residual", "mean", "SD", "beyond 3 SD", "forgotten after [s]", "white"),
        rows,
    )
    return Section("residuals", title, (), (picture, table))


def draw_residuals(shown: list[Residual]) -> str:
    """An SVG: a row for each source would repeat the axes, so both sources share two plots."""
    figure = new_figure(9.6, 3.5)
    colors = {"sensor": MEASURED, "truth": TRUE}
    with styled():
        left, right = figure.subplots(1, 2)
        for one in shown:
            color = colors[one.source]
            low, high = np.percentile(one.values, [0.2, 99.8])
            heights, edges = np.histogram(one.values, bins=60, range=(low, high))
            density = heights / (len(one.values) * (edges[1] - edges[0]))
            left.stairs(density, edges, color=color, linewidth=1.3, label=one.what)
            grid = np.linspace(low, high, 160)
            mean, std = one.values.mean(), max(float(one.values.std()), 1e-12)
            normal = np.exp(-(((grid - mean) / std) ** 2) / 2) / (std * np.sqrt(2 * np.pi))
            left.plot(grid, normal, color=color, linewidth=0.8, linestyle="--")
            if one.white is not None:
                lag = STEP * np.arange(1, len(one.white.autocorrelation) + 1)
                right.plot(lag, one.white.autocorrelation, color=color, label=one.what)
                for sign in (-1, 1):
                    right.axhline(sign * one.white.bound, color=color, linewidth=0.7, linestyle="--")
        right.axhline(0.0, color=INK, linewidth=0.6)
        left.set_xlabel("residual [–]")
        left.set_ylabel("density")
        left.legend(loc="upper right")
        right.set_xlabel("lag [s]")
        right.set_ylabel("autocorrelation")
        return to_svg(figure)


def _white(time: Floats, values: Floats) -> Whiteness | None:
    """Whiteness of the residual every STEP seconds; stretches are joined, so a few lags cross a gap."""
    _, first = np.unique(np.floor(time / STEP + 1e-9), return_index=True)
    try:
        return whiteness(values[first], LAGS)
    except InputError:
        return None


def _memory(white: Whiteness) -> float:
    """The first lag [s] at which the autocorrelation is under 1/e; the longest lag where it never is."""
    under = np.flatnonzero(white.autocorrelation < np.exp(-1))
    return STEP * float(under[0] + 1 if len(under) else len(white.autocorrelation))
