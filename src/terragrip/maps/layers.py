"""The layers of a map as tables with geometry (geopandas), in the grid's own coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.maps.field_map import FieldMap

if TYPE_CHECKING:
    import geopandas
    import numpy.typing as npt

    from terragrip.maps.cells import Cells

LAYERS = ("cells", "points", "anomalies", "changes")
"""Names of the layers."""


def layer(made: FieldMap, name: str) -> geopandas.GeoDataFrame:
    """One of `LAYERS`; without rows if there is nothing to show. Raises KeyError on another name."""
    return {"cells": _cells, "points": _points, "anomalies": _anomalies, "changes": _changes}[name](made)


def cell_table(made: FieldMap) -> dict[str, npt.NDArray[Any]]:
    """The cells of all quantities side by side (k,): ``column``, ``row``, ``<quantity>``, ``<quantity>_std`` (NaN where a cell has none),
    ``count`` of rows and ``passes`` (of the quantity with most), ``headland`` (share of the distance), ``soil``, ``soil_probability``."""
    width = 1 << 32
    keys = {name: cells.column * width + cells.row for name, cells in made.cells.items()}
    every = np.unique(np.concatenate(list(keys.values())))
    column = np.floor_divide(every + width // 2, width)
    table: dict[str, Any] = {"column": column, "row": every - column * width}
    count = np.zeros(len(every), dtype=np.int64)
    passes, headland = count.copy(), np.zeros(len(every))
    for name, cells in made.cells.items():
        at = np.searchsorted(every, keys[name])
        for label, values in ((name, cells.value), (f"{name}_std", cells.std)):
            table[label] = np.full(len(every), np.nan)
            table[label][at] = values
        count[at] = np.maximum(count[at], cells.count)
        passes[at] = np.maximum(passes[at], cells.passes)
        headland[at] = cells.headland
    table |= {"count": count, "passes": passes, "headland": headland}
    soils = [
        made.soil.get(place, ("", np.nan))
        for place in zip(column.tolist(), table["row"].tolist(), strict=True)
    ]
    table["soil"] = np.array([name for name, _ in soils], dtype=object)
    table["soil_probability"] = np.array([share for _, share in soils])
    return table


def _cells(made: FieldMap) -> geopandas.GeoDataFrame:
    table = cell_table(made)
    return _frame(table, _boxes(made, table["column"], table["row"]), made)


def _boxes(made: FieldMap, column: npt.NDArray[np.int64], row: npt.NDArray[np.int64]) -> Any:
    import shapely

    size = made.cell
    return shapely.box(column * size, row * size, (column + 1) * size, (row + 1) * size)


def _points(made: FieldMap) -> geopandas.GeoDataFrame:
    import shapely

    points = made.points
    runs = np.array(made.runs, dtype=object)
    table = {
        "run": runs[points.run], "time": points.time, "heading": np.degrees(np.pi / 2 - points.heading) % 360,
        "headland": points.headland, **points.values, "soil": points.soil, "event": points.event,
    }  # fmt: skip
    return _frame(table, shapely.points(points.east, points.north), made)


def _anomalies(made: FieldMap) -> geopandas.GeoDataFrame:
    import shapely

    names = (
        "quantity", "kind", "value", "around", "difference", "difference_std", "p", "area", "east", "north",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    shapes = []
    for quantity, found in made.anomalies.items():
        cells: Cells = made.cells[quantity]
        for one in found:
            rows.append((
                quantity, _kind(quantity, one.difference), one.value, one.around, one.difference, one.std, one.p,
                len(one.cells) * made.cell**2, one.column * made.cell, one.row * made.cell,
            ))  # fmt: skip
            shapes.append(shapely.union_all(_boxes(made, cells.column[one.cells], cells.row[one.cells])))
    return _frame({name: np.array([row[i] for row in rows]) for i, name in enumerate(names)}, shapes, made)


def _kind(quantity: str, difference: float) -> str:
    more = difference > 0
    words = {"adhesion": ("grips", "slips"), "soil_resistance": ("soft", "firm"), "slip": ("slips", "grips")}
    high, low = words.get(quantity, ("high", "low"))
    return high if more else low


def _changes(made: FieldMap) -> geopandas.GeoDataFrame:
    runs = np.array(made.runs, dtype=object)
    parts: dict[str, list[Any]] = {}
    shapes: list[Any] = []
    for quantity, one in made.changes.items():
        table = {
            "column": one.column, "row": one.row,
            "quantity": np.full(len(one), quantity, dtype=object), "first": one.first, "last": one.last, "difference": one.difference,
            "difference_std": one.std, "p": one.p, "significant": one.significant, "first_run": runs[one.first_run],
            "last_run": runs[one.last_run], "seconds": one.seconds,
        }  # fmt: skip
        for name, values in table.items():
            parts.setdefault(name, []).append(values)
        shapes.append(_boxes(made, one.column, one.row))
    table = {name: np.concatenate(values) for name, values in parts.items()}
    return _frame(table, np.concatenate(shapes) if shapes else [], made)


def changes_between(made: FieldMap) -> dict[str, list[tuple[str, str, int, int]]]:
    """For each quantity and pair of runs, the number of cells driven again and of cells that changed."""
    out: dict[str, list[tuple[str, str, int, int]]] = {}
    for quantity, one in made.changes.items():
        pairs, which = np.unique(np.column_stack([one.first_run, one.last_run]), axis=0, return_inverse=True)
        out[quantity] = [
            (
                made.runs[first],
                made.runs[last],
                int(np.sum(which.ravel() == k)),
                int(one.significant[which.ravel() == k].sum()),
            )
            for k, (first, last) in enumerate(pairs.tolist())
        ]
    return out


def _frame(table: dict[str, Any], geometry: Any, made: FieldMap) -> geopandas.GeoDataFrame:
    import geopandas

    return geopandas.GeoDataFrame(table, geometry=list(geometry), crs=made.epsg)
