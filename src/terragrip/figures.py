"""The one look of all figures: colours that colour-blind readers can tell apart, one font; and figures that a notebook shows.

The palette is Okabe and Ito's (jfly.uni-koeln.de/color).
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from terragrip.errors import missing_package

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, MUTED, GRID, PAPER = "#1b1f24", "#68707a", "#dfe3e8", "#ffffff"
ORANGE, SKY, GREEN, YELLOW = "#e69f00", "#56b4e9", "#009e73", "#f0e442"
BLUE, VERMILLION, PURPLE = "#0072b2", "#d55e00", "#cc79a7"
LINES = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION, MUTED, YELLOW)
"""Colours of lines beside each other, in this order."""

SOIL_COLORS = {"hard": MUTED, "fine": ORANGE, "wet": SKY, "coarse": PURPLE, "grass": GREEN}
"""None of them is the colour of a source."""
PART_COLORS = {"work": GREEN, "headland": ORANGE, "road": SKY, "standing": PURPLE, "the drive": BLUE}
"""Of what a machine did (field_work.py)."""
_SPARE_COLORS = (BLUE, VERMILLION, "#8d4b35", "#7f20df", "#cab472", "#a3bfdc", "#234e5c", "#72ca9e")
"""Each as far as can be from those before and from the soils', to eyes of all kinds (a test sees with them). Beyond them hues are made,
a golden angle apart."""
_GOLDEN = 0.618034

_RC: Any = {
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.facecolor": "none",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 10.5,
    "axes.labelsize": 9.5,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.3,
    "lines.solid_joinstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "font.size": 9.5,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Segoe UI", "Helvetica", "Arial", "sans-serif"],
    "svg.fonttype": "none",  # text stays text: small files, searchable, readable by a screen reader
    "svg.hashsalt": "terragrip",  # the same figure gives the same bytes
}


def new_figure(width: float = 9.6, height: float = 3.4) -> Figure:
    """An empty figure in this style, size in inches. Raises InputError without matplotlib."""
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError:
        raise missing_package("matplotlib", "report") from None
    with rc_context(_RC):
        return Figure(figsize=(width, height), layout="constrained")


def styled() -> Any:
    """A context in which axes and artists take this style; draw and save inside it."""
    from matplotlib import rc_context

    return rc_context(_RC)


def notebook_figure(width: float = 9.6, height: float = 3.4) -> Figure:
    """As `new_figure`, on white, and shown by a notebook that never imported pyplot. Raises InputError without matplotlib."""
    new_figure()  # refuses in one line where matplotlib is missing
    with styled():
        made: Figure = _shown()(figsize=(width, height), layout="constrained")
    made.set_facecolor(PAPER)
    return made


@cache
def _shown() -> type[Figure]:
    """The class of figures that show themselves."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure that a notebook draws as its cell's value."""

        def _repr_png_(self) -> bytes:
            buffer = io.BytesIO()
            self.savefig(buffer, format="png", dpi=110, facecolor=PAPER)
            return buffer.getvalue()

    return Shown


def soil_color(soil: str, soils: Sequence[str] = ()) -> str:
    """The colour of a soil: fixed for the paper's five, for others one of its own by its place among `soils` in order of names: each
    figure has an order of its own."""
    known = SOIL_COLORS | PART_COLORS
    if soil in known:
        return known[soil]
    others = sorted({name for name in soils if name not in known})
    if soil not in others:
        return MUTED
    place = others.index(soil)
    if place < len(_SPARE_COLORS):
        return _SPARE_COLORS[place]
    return _made(place - len(_SPARE_COLORS))


def _made(number: int) -> str:
    """One of any number of colours, as #rrggbb: hues a golden angle apart, by turns dark and light."""
    import colorsys

    red, green, blue = colorsys.hls_to_rgb((0.07 + _GOLDEN * number) % 1.0, 0.62 if number % 2 else 0.38, 0.6)
    return f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"
