"""Soils in a notebook: a table, and curves with their bins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.figures import LINES, notebook_figure, styled
from terragrip.html import figure_of, html_notes, html_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from terragrip.soil.library import Soil

_SLIPS = np.linspace(0.0, 0.65, 131)


def table_of(soils: Mapping[str, Soil]) -> pd.DataFrame:
    """A row per soil: model, parameters with 95 % intervals (``<name>_low``, ``<name>_high``), R2, NRMSE, the largest slip of the bins,
    mean rho_s and its SD."""
    import pandas as pd

    rows = {}
    for name, soil in soils.items():
        row: dict[str, Any] = {"model": soil.model, **soil.parameters}
        for parameter, (low, high) in soil.interval.items():
            row |= {f"{parameter}_low": low, f"{parameter}_high": high}
        resistance, std = soil.resistance or (None, None)
        rows[name] = row | {
            "r2": soil.r2, "nrmse": soil.nrmse, "reach": soil.reach if soil.bins else None,
            "resistance": resistance, "resistance_std": std, "source": soil.source,
        }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("soil")


def html_of(soils: Mapping[str, Soil], not_fitted: Mapping[str, str]) -> str:
    """Curves by soil with their intervals, and the soils without a fit."""
    rows = []
    for name, soil in soils.items():
        parameters = [
            f"{key} {value:.3g}"
            + (
                f" ({soil.interval[key][0]:.3g} to {soil.interval[key][1]:.3g})"
                if key in soil.interval
                else ""
            )
            for key, value in soil.parameters.items()
            if key in soil.interval or not soil.interval
        ]
        rows.append(
            (name, soil.model, ", ".join(parameters), figure_of(soil.r2), figure_of(soil.nrmse), figure_of(*(soil.resistance or (None,))))
        )  # fmt: skip
    head = ("soil", "model", "parameters (95 %)", "R²", "NRMSE", "resistance")
    return html_table(head, rows) + html_notes(f"{name}: {why}" for name, why in not_fitted.items())


def plot(soils: Mapping[str, Soil]) -> Figure:
    """Adhesion over slip: each soil's curve with its band, dotted beyond its data, and its bins with their standard deviations."""
    if not soils:
        raise InputError("there is no soil to draw", hint="learn one from labelled estimates")
    figure = notebook_figure(7.6, 4.6)
    with styled():
        axes = figure.subplots()
        for number, (name, soil) in enumerate(soils.items()):
            color = LINES[number % len(LINES)]
            within, beyond = soil.reach >= _SLIPS, min(soil.reach, _SLIPS[-1]) <= _SLIPS
            axes.plot(_SLIPS[within], soil.value(_SLIPS[within]), color=color, linewidth=1.8, label=name)
            axes.plot(_SLIPS[beyond], soil.value(_SLIPS[beyond]), ":", color=color, linewidth=1.8)
            if soil.has_band:
                axes.fill_between(_SLIPS, *soil.band(_SLIPS), color=color, alpha=0.12, linewidth=0)
            bins = [b for b in soil.bins if b.get("mean") is not None and b.get("slip") is not None]
            if bins:
                axes.errorbar(
                    [b["slip"] for b in bins], [b["mean"] for b in bins], yerr=[b.get("std") or 0.0 for b in bins],
                    fmt="o", color=color, markersize=3, elinewidth=0.7, alpha=0.8,
                )  # fmt: skip
        axes.set_xlabel("slip s [–]")
        axes.set_ylabel("adhesion µ [–]")
        axes.set_xlim(0, _SLIPS[-1])
        axes.legend()
    return figure
