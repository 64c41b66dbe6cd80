"""A map as a picture: each quantity with its SD beside it, anomalies outlined."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.maps.field_map import FieldMap
from terragrip.maps.values import QUANTITIES, SHARES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 9.0
"""Inches."""
DRAWN = 4000
"""Cells up to which each is drawn; more are one image."""
QUANTILES = (0.02, 0.98)
"""What the colours span; beyond, the colour bar's ends are pointed."""


def picture(made: FieldMap) -> Figure:
    """A row for each quantity: value with its anomalies on the left, SD on the right; metres from the south-west corner."""
    from matplotlib.figure import Figure

    corner, extent = _corner(made), _extent(made)
    shape = extent[1] / max(extent[0], 1e-9)
    tall = WIDTH / 2.6 * min(max(shape, 0.25), 2.0) + 0.9
    wide = WIDTH * min(max(2.0 / shape, 0.55), 1.0)  # a narrow field needs no white beside it
    figure = Figure(figsize=(wide, tall * len(made.cells)), layout="constrained")
    axes = figure.subplots(len(made.cells), 2, squeeze=False, sharex=True, sharey=True)
    for line, quantity in zip(axes, made.cells, strict=True):
        cells = made.cells[quantity]
        title = QUANTITIES[quantity]
        if quantity == "adhesion":
            title = title.replace("the reference slip", f"{100 * made.reference_slip:g} % slip")
        title = fill(
            title, int((wide / 2 - 1.1) / 0.07)
        )  # above its own panel: a colour bar's end hid the rest
        scale, deviation = 1.0, "its standard deviation [-]"
        if quantity in SHARES:
            scale, title, deviation = 100.0, title.replace("[-]", "[%]"), deviation.replace("[-]", "[%]")
        _panel(line[0], made, cells.column, cells.row, scale * cells.value, corner, "viridis", title)
        _panel(line[1], made, cells.column, cells.row, scale * cells.std, corner, "cividis", deviation)
        for one in made.anomalies.get(quantity, []):
            x, y = one.column * made.cell - corner[0], one.row * made.cell - corner[1]
            size = np.sqrt(len(one.cells) / np.pi) * made.cell + made.cell
            line[0].add_patch(_ring(x, y, size))
        line[0].set_ylabel("north [m]")
    for ax in axes[-1]:
        ax.set_xlabel("east [m]")
    west, south = corner
    ringed = "anomalies ringed" if any(made.anomalies.values()) else "no anomalies"
    figure.suptitle(
        f"EPSG:{made.epsg}, from east {west:.0f} m, north {south:.0f} m\ncells of {made.cell:g} m; {ringed}",
        fontsize=9,
    )
    return figure


def _corner(made: FieldMap) -> tuple[float, float]:
    columns = [cells.column.min() for cells in made.cells.values()]
    rows = [cells.row.min() for cells in made.cells.values()]
    return float(min(columns) * made.cell), float(min(rows) * made.cell)


def _extent(made: FieldMap) -> tuple[float, float]:
    return tuple(
        made.cell
        * (
            max(getattr(c, n).max() for c in made.cells.values())
            - min(getattr(c, n).min() for c in made.cells.values())
            + 1
        )
        for n in ("column", "row")
    )


def _panel(
    ax: Axes,
    made: FieldMap,
    column: np.ndarray,
    row: np.ndarray,
    values: np.ndarray,
    corner: tuple[float, float],
    colours: str,
    title: str,
) -> None:
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    low, high = np.quantile(values, QUANTILES)
    scale = Normalize(low, max(high, low + 1e-9))
    if len(values) <= DRAWN:
        x, y = column * made.cell - corner[0], row * made.cell - corner[1]
        sides = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * made.cell
        shown: Any = PolyCollection(
            list(np.column_stack([x, y])[:, None, :] + sides), array=values, cmap=colours, norm=scale, linewidths=0.1, edgecolors="face"
        )  # fmt: skip
        ax.add_collection(shown)
        ax.autoscale_view()
        ax.set_aspect("equal")
    else:
        west, south = int(column.min()), int(row.min())
        image = np.full((int(row.max()) - south + 1, int(column.max()) - west + 1), np.nan)
        image[row - south, column - west] = values
        left, bottom = west * made.cell - corner[0], south * made.cell - corner[1]
        box = (left, left + image.shape[1] * made.cell, bottom, bottom + image.shape[0] * made.cell)
        shown = ax.imshow(
            image, origin="lower", cmap=colours, norm=scale, interpolation="nearest", extent=box
        )
    bar = ax.figure.colorbar(shown, ax=ax, extend="both", shrink=0.85, format="%.3g")
    if bar.solids is not None:
        bar.solids.set(rasterized=False, edgecolor="face")  # drawn, not painted, and without seams
    bar.locator = MaxNLocator(4)
    bar.update_ticks()
    ax.grid(False)  # lines would cut the cells
    ax.set_title(title, fontsize=9)


def _ring(x: float, y: float, radius: float):  # type: ignore[no-untyped-def]
    from matplotlib.patches import Circle

    return Circle((x, y), radius, fill=False, edgecolor="#d55e00", linewidth=1.5)
