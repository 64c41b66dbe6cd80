"""What a notebook shows of a calibration: its quantities as a table, and their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.figures import BLUE, MUTED, notebook_figure, styled
from terragrip.html import html_notes, html_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from terragrip.estimation.calibration.result import Calibration


def table_of(calibration: Calibration) -> pd.DataFrame:
    """A row a quantity: value, standard error, 95 % interval, unit, samples, sentence."""
    import pandas as pd

    rows = {
        one.name: {
            "value": one.value, "std": one.std, "low": one.interval[0], "high": one.interval[1], "unit": one.unit,
            "samples": one.samples, "sentence": one.sentence,
        }
        for one in calibration.quantities
    }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("quantity")


def html_of(calibration: Calibration) -> str:
    """Quantities with their intervals, what could not be determined and why, notes."""
    rows = [
        (one.name, f"{one.value:.4g}", f"{one.interval[0]:.4g} to {one.interval[1]:.4g}", "" if one.unit == "1" else one.unit, one.samples)
        for one in calibration.quantities
    ]  # fmt: skip
    missing = (f"{one.name}: {one.why}" for one in calibration.unknown)
    head = ("quantity", "value", "95 % interval", "unit", "samples")
    return html_table(head, rows) + html_notes([*missing, *calibration.notes])


def plot(calibration: Calibration) -> Figure:
    """Each quantity with its 95 % interval, a row of axes a unit."""
    if not calibration.quantities:
        raise InputError("no quantity was found to draw", hint="see .unknown for what the logs lack")
    keys = list(dict.fromkeys(one.key for one in calibration.quantities))
    by_key = [[one for one in calibration.quantities if one.key == key] for key in keys]
    figure = notebook_figure(7.6, 0.5 + sum(0.55 + 0.28 * len(ones) for ones in by_key))
    with styled():
        plots = figure.subplots(
            len(keys), 1, squeeze=False, height_ratios=[0.55 + 0.28 * len(o) for o in by_key]
        )
        for axes, key, ones in zip(plots[:, 0], keys, by_key, strict=True):
            for place, one in enumerate(ones):
                axes.plot(one.interval, [place, place], color=BLUE, linewidth=2)
                axes.plot([one.value], [place], "o", color=BLUE, markersize=5)
            if "gain" in key:
                axes.axvline(1.0, color=MUTED, linewidth=0.8)
            axes.set_yticks(range(len(ones)), [one.wheel or "vehicle" for one in ones])
            axes.set_ylim(len(ones) - 0.5, -0.5)
            axes.set_xlabel(f"{key} [{'–' if ones[0].unit == '1' else ones[0].unit}]")
    return figure
