"""Figures of a page: SVG out, whose colours become CSS variables, so that a figure follows the reader's light or dark scheme; a figure on
disk keeps fixed colours on white."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

from terragrip.figures import (
    BLUE,
    GREEN,
    GRID,
    INK,
    MUTED,
    ORANGE,
    PAPER,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_DARK, _LIGHT = "#000000", "#fdfdfd"
"""Text on a patch whose colour is the same in either scheme."""

MEASURED, ESTIMATED, TRUE = VERMILLION, BLUE, INK
"""Colours of the three sources of a value in every figure: the reference sensor, the estimate, the truth."""

CSS_VARIABLES = {
    INK: "ink", MUTED: "muted", GRID: "grid", PAPER: "paper", ORANGE: "orange", SKY: "sky", GREEN: "green",
    YELLOW: "yellow", BLUE: "blue", VERMILLION: "vermillion", PURPLE: "purple",
}  # fmt: skip
"""Which CSS variable takes the place of which colour in a page."""

WIDEST = 750.0
"""Points of a figure that would fill a sheet's width: one of 9.6 inches leaves room for a second below it."""
PAGE_SCALE = 1.52
"""Pixels of a page that a point of a figure may grow to: 9.6 inches fill the text's width."""


def name_axis(axis: Axis, label: str) -> None:
    """Name an axis; of a share whose label ends in [%] the marks are per cents, the data stay shares."""
    axis.set_label_text(label)
    if label.endswith("[%]"):
        axis.set_major_formatter(lambda share, _: f"{round(100 * share, 6):g}".replace("-", "−"))


def to_svg(figure: Figure) -> str:
    """The figure as an SVG document, transparent, with the palette's literal colours."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    with styled():
        FigureCanvasSVG(figure)
        if (engine := figure.get_layout_engine()) is not None:
            # as savefig would do it, but without its first drawing, which only serves the layout: the same bytes in a fifth less time
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "terragrip"})
    return buffer.getvalue()


def on_paper(svg: str) -> str:
    """A stand-alone SVG file: `svg` with a white sheet under it, so that it reads on any background."""
    return re.sub(r"(<svg\b[^>]*>)", rf'\1\n <rect width="100%" height="100%" fill="{PAPER}"/>', svg, count=1)


def in_page(svg: str, label: str, prefix: str) -> str:
    """`svg` for inlining in HTML: no prologue, scales with the page, colours as CSS variables.

    `label` is what a screen reader says; `prefix` keeps ids apart between the figures of one page.
    """
    from html import escape

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, count=1, flags=re.DOTALL)
    width = re.search(r'\bwidth="([\d.]+)pt"', body)
    points = float(width[1]) if width else 0.0
    limit = (
        f' style="max-width: {points * PAGE_SCALE:.0f}px; --print: {points / WIDEST:.0%}"' if width else ""
    )
    body = re.sub(r'\b(width|height)="[\d.]+pt" ?', "", body, count=2)
    body = body.replace("<svg", f'<svg role="img" aria-label="{escape(label, quote=True)}"{limit}', 1)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = re.sub(r'(xlink:href|href)="#', rf'\1="#{prefix}-', body)
    body = body.replace("url(#", f"url(#{prefix}-")
    # Opacity of a group makes a printer paint it as a picture; of fill and stroke it stays drawing.
    body = re.sub(r"(?<![-\w])opacity: ([\d.]+)", r"fill-opacity: \1; stroke-opacity: \1", body)
    for color, name in CSS_VARIABLES.items():
        body = re.sub(color, f"var(--{name})", body, flags=re.IGNORECASE)
    return body


def text_color(patch: str) -> str:
    """The colour of a text on a patch of a `soil_color`: what stands off more. A colour that follows the page's scheme is light in the
    dark one, as paper is dark there."""
    on_dark, on_light = (_luminance(patch) + 0.05) / 0.05, 1.05 / (_luminance(patch) + 0.05)
    if on_dark >= on_light:
        return _DARK
    return PAPER if patch in CSS_VARIABLES else _LIGHT


def _luminance(color: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    coded = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in coded]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
