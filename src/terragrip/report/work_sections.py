"""Sections on how a machine worked: time by slip band for each label (or work, headland, road), and hour by hour."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta

import numpy as np

from terragrip.figures import GRID, INK, new_figure, styled
from terragrip.report.blocks import BAND_NAMES, Blocks, Share, share_of, shares
from terragrip.report.field_work import PARTS, STANDING
from terragrip.report.page import Picture, Section, Table, number, percent
from terragrip.report.style import text_color, to_svg

HOUR, QUARTER = 3600.0, 900.0
LONG = 2.5 * HOUR
"""Seconds of a run from which on it is split into whole hours, else by quarters of an hour."""


def bands(every: Sequence[Blocks]) -> Section:
    """Shares of the driven time by slip band, for each label."""
    title = "Time by slip"
    result = [one for one in _ordered(shares(every)) if one.bands.sum() > 0]
    if not result:
        return Section(
            "slip-bands",
            title,
            omitted="Left out: slip is not known on any labelled stretch of these drives.",
        )
    rows = tuple(
        (one.label, number(one.bands.sum() / 60, 1), *(percent(x, 0) for x in one.bands / one.bands.sum()))
        for one in result
    )
    picture = Picture(
        "slip-bands",
        draw_bands(result),
        "Share of the time at each slip, of the time in which slip is known. Darker is less slip.",
        "Shares of time by slip band",
    )
    table = Table(
        "The same in figures: share of the time at each slip.", ("", "time [min]", *BAND_NAMES), rows
    )
    return Section("slip-bands", title, (), (picture, table))


def by_hour(every: Sequence[Blocks]) -> Section:
    """What was done in each hour (of a short run each quarter of one), and the slip then."""
    title = "Hour by hour"
    rows = []
    labels = [one.label for one in _ordered(shares(every))]
    for one in every:
        if not len(one.start) or not labels:
            continue
        length = HOUR if one.start[-1] - one.start[0] > LONG else QUARTER
        shift = (one.began.minute * 60 + one.began.second if one.began is not None else 0) % length
        slot = np.floor((one.start + shift) / length)
        for number_ in np.unique(slot):
            mine = slot == number_
            row = [f"{one.run}, {_when(one, number_ * length - shift)}"]
            row += [number(one.seconds[mine & (one.label == label)].sum() / 60, 1) for label in labels]
            whole = share_of("", [(one, mine & (one.label != STANDING))])
            row += [number(whole.metres, 0), _slip(whole)]
            rows.append(tuple(row))
    if not rows:
        return Section(
            "by-hour",
            title,
            omitted="Left out: no drive is labelled or has positions that show what was done.",
        )
    table = Table(
        "Minutes of each hour (of a run shorter than two and a half hours: a quarter), the way, the mean slip with its 95 % interval.",
        ("run, from", *(f"{label} [min]" for label in labels), "way [m]", "slip"),
        tuple(rows),
    )
    return Section("by-hour", title, (), (table,))


def draw_bands(result: Sequence[Share]) -> str:
    """An SVG: a bar for each label, its slip bands one after the other."""
    figure = new_figure(9.6, 0.9 + 0.45 * len(result))
    with styled():
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        colors = [to_hex(c) for c in colormaps["cividis"](np.linspace(0.0, 1.0, len(BAND_NAMES)))]
        plot = figure.subplots()
        left = np.zeros(len(result))
        height = [one.label for one in result]
        for i, band in enumerate(BAND_NAMES):
            share = np.array([100 * one.bands[i] / one.bands.sum() for one in result])
            bars = plot.barh(
                height, share, left=left, color=colors[i], edgecolor=GRID, linewidth=0.6, label=band
            )
            for bar, value in zip(bars, share, strict=True):
                if value >= 6:
                    plot.text(
                        bar.get_x() + value / 2, bar.get_y() + bar.get_height() / 2, f"{value:.0f}",
                        ha="center", va="center", fontsize=8, color=text_color(colors[i]),
                    )  # fmt: skip
            left += share
        plot.invert_yaxis()
        plot.set_xlim(0, 100)
        plot.set_xlabel("share of the time [%]")
        plot.tick_params(axis="y", labelcolor=INK)
        plot.grid(visible=False)
        figure.legend(
            loc="outside upper left",
            ncols=len(BAND_NAMES),
            title="slip",
            alignment="left",
            columnspacing=1.2,
            handlelength=1.2,
        )
        return to_svg(figure)


def _ordered(result: list[Share]) -> list[Share]:
    """Work before headland, road and standing; labels by their time."""
    return sorted(result, key=lambda one: PARTS.index(one.label) if one.label in PARTS else -1)


def _when(one: Blocks, seconds: float) -> str:
    seconds = max(seconds, float(one.start[0]))
    if one.began is not None:
        return f"{one.began + timedelta(seconds=seconds):%H:%M}"
    return f"{number(seconds / 60, 0)} min"


def _slip(whole: Share) -> str:
    mean, half = whole.slip
    if not np.isfinite(mean):
        return "–"
    return percent(mean) if not np.isfinite(half) else f"{number(100 * mean, 1)} ± {number(100 * half, 1)} %"
