"""The one look of all figures: colours that colour-blind readers can tell apart, one font; and figures that a notebook shows.

The palette is Okabe and Ito's (jfly.uni-koeln.de/color).
"""

from __future__ import annotations

import io
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
