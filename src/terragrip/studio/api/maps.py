"""The map page's grids: what a map's file holds, its cells as columns, the way that was driven."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from fastapi import APIRouter, Query, Response

from terragrip.errors import InputError
from terragrip.maps.reading import MapFile
from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here, Studio
from terragrip.studio.tables import packed

router = APIRouter(tags=["maps"])

TILE, WHOLE = 256, 1024
"""Cells along the side of a tile, over which the grid is a parallelogram on the page's map; and of a map that is one tile: at 3 m a cell
its middle is a twentieth of a cell off at most."""
WAY = 20_000
"""Points of the way that are sent."""
Quantity = Annotated[str, Query(max_length=40)]


def _map_of(studio: Studio, path: str, version: str = "") -> MapFile:
    """A map of the folder. Raises InputError where the file is none, or no longer the `version` that the page was given."""
    return studio.maps.get(studio.folder.file(path, version))


@router.get("/map")
def about(studio: Here, path: Named) -> dict[str, Any]:
    """What a map holds: cell size, grid, datum, runs, notes; by quantity its values in field and headland and how many cells changed
    between which runs; anomalies with their outlines in degrees; the corners of the grid's ``tiles`` in degrees."""
    version = studio.folder.version(path)
    made = _map_of(studio, path)
    to_degrees = _Degrees(made.about.epsg)
    known = made.about
    return finite(
        {
            "version": version,
            "cell": known.cell,
            "epsg": known.epsg,
            "datum": known.datum,
            "reference_slip": known.reference_slip,
            "runs": known.runs,
            "notes": known.notes,
            "cells": len(made.column),
            "soils": bool((made.cells["soil"] != "").any()),
            "points": made.points,
            "tiles": list(_tiles(made, to_degrees)),
            "quantities": [
                {"name": name, "areas": _areas(made, name), "changes": _changed(made, name)}
                for name in made.quantities
            ],
            "anomalies": [
                {
                    **{key: _plain(value) for key, value in one.row.items()},
                    "place": to_degrees(one.row["east"], one.row["north"]),
                    "rings": [to_degrees(ring[:, 0], ring[:, 1]) for ring in one.rings],
                }
                for one in made.anomalies
            ],
        }
    )


@router.get("/map/cells")
def cells(studio: Here, path: Named, quantity: Quantity, version: str = "") -> Response:
    """The cells of one quantity, each column 4 bytes a cell behind a JSON head (see `packed`), whose ``types`` says whether they are
    float32 or int32: place on the grid, value and SD, count, passes, headland, soil (its number in ``soils``) and its probability, and
    where the quantity has changes anywhere first, last, difference with its SD, whether it is significant (NaN, 0: driven once)."""
    made = _map_of(studio, path, version)
    if quantity not in made.quantities:
        raise InputError(
            "is not in the map", place=f"quantity {quantity}", hint=f"take {', '.join(made.quantities)}"
        )
    table = made.cells
    rows = np.flatnonzero(np.isfinite(table[quantity]))
    names, soil = np.unique([name or "" for name in table["soil"]], return_inverse=True)
    columns: dict[str, npt.NDArray[Any]] = {
        "column": made.column[rows],
        "row": made.row[rows],
        "value": table[quantity][rows],
        "std": table[f"{quantity}_std"][rows],
        "count": table["count"][rows],
        "passes": table["passes"][rows],
        "headland": table["headland"][rows],
        "soil": soil[rows],
        "soil_probability": table["soil_probability"][rows],
    }
    changes = made.changes(quantity)
    if changes:
        columns |= _beside(made, changes, rows)
    sent = [
        values.astype(np.int32 if values.dtype.kind in "iub" else np.float32) for values in columns.values()
    ]
    head = {
        "columns": list(columns),
        "types": [values.dtype.name for values in sent],
        "soils": names.tolist(),
    }
    return packed(head, sent)


@router.get("/map/way")
def way(studio: Here, path: Named, version: str = "") -> Response:
    """Longitude and latitude along the way as float64, thinned evenly; NaN parts runs and gaps."""
    made = _map_of(studio, path, version)
    run, time, east, north = made.way(WAY)
    longitude, latitude = _Degrees(made.about.epsg).columns(east, north)
    step = np.hypot(np.diff(east), np.diff(north))
    usual = float(np.median(step)) if len(step) else 0.0
    apart = np.flatnonzero((run[1:] != run[:-1]) | (np.diff(time) < 0) | (step > 10 * usual)) + 1
    head = {"columns": ["longitude", "latitude"], "of": made.points, "cut": len(run) < made.points}
    columns = [np.insert(values, apart, np.nan) for values in (longitude, latitude)]
    return packed(head, columns)


class _Degrees:
    """Longitude and latitude (WGS 84) of metres on a grid."""

    def __init__(self, epsg: int) -> None:
        from pyproj import Transformer

        self._transformer = Transformer.from_crs(epsg, 4326, always_xy=True)

    def columns(self, east: Any, north: Any) -> tuple[Any, Any]:
        longitude, latitude = self._transformer.transform(east, north)
        return longitude, latitude

    def __call__(self, east: Any, north: Any) -> Any:
        """A pair, or one after another (n, 2), as a list."""
        return np.column_stack(self.columns(np.atleast_1d(east), np.atleast_1d(north))).squeeze().tolist()


def _tiles(made: MapFile, to_degrees: _Degrees) -> Iterator[dict[str, Any]]:
    """Of each tile that holds cells its first ``column`` and ``row``, how many are ``wide`` and ``high``, and the ``corners`` in degrees:
    north-west, north-east, south-east, south-west."""
    west, south = int(made.column.min()), int(made.row.min())
    east, north = int(made.column.max()) + 1, int(made.row.max()) + 1
    side = WHOLE if max(east - west, north - south) <= WHOLE else TILE
    number = np.unique(np.column_stack([(made.column - west) // side, (made.row - south) // side]), axis=0)
    for column, row in (np.array([west, south]) + side * number).tolist():
        wide, high = min(side, east - column), min(side, north - row)
        x = np.array([column, column + wide, column + wide, column]) * made.about.cell
        y = np.array([row + high, row + high, row, row]) * made.about.cell
        yield {"column": column, "row": row, "wide": wide, "high": high, "corners": to_degrees(x, y)}


def _areas(made: MapFile, quantity: str) -> dict[str, dict[str, float] | None]:
    """10 %, 50 % and 90 % of a quantity's driven cells in the field and on the headland."""
    value, driven = made.cells[quantity], made.cells["count"] > 0
    inside = made.cells["headland"] > 0.5
    areas: dict[str, dict[str, float] | None] = {}
    for area, where in (("field", ~inside), ("headland", inside)):
        held = value[where & driven & np.isfinite(value)]
        low, middle, high = np.quantile(held, [0.1, 0.5, 0.9]).tolist() if len(held) else (0.0, 0.0, 0.0)
        areas[area] = {"cells": len(held), "low": low, "middle": middle, "high": high} if len(held) else None
    return areas


def _changed(made: MapFile, quantity: str) -> list[dict[str, Any]]:
    """From which run to which how many cells were driven again, and how many of them changed."""
    names = ("first", "last", "cells", "significant")
    return [dict(zip(names, one, strict=True)) for one in made.about.changes.get(quantity, [])]


def _beside(
    made: MapFile, table: Mapping[str, npt.NDArray[Any]], rows: npt.NDArray[np.intp]
) -> Mapping[str, npt.NDArray[Any]]:
    """The changes of a quantity laid beside its cells `rows` (k,)."""
    high = int(max(made.row.max(), table["row"].max())) + 1
    low = int(min(made.row.min(), table["row"].min()))

    def key(column: npt.NDArray[np.int64], row: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return column * (high - low) + (row - low)

    theirs = key(table["column"], table["row"])
    order = np.argsort(theirs)
    mine = key(made.column[rows], made.row[rows])
    at = order[np.minimum(np.searchsorted(theirs, mine, sorter=order), len(order) - 1)]
    same = theirs[at] == mine
    out: dict[str, npt.NDArray[Any]] = {
        name: np.where(same, table[name][at], np.nan)
        for name in ("first", "last", "difference", "difference_std")
    }
    return {**out, "significant": same & table["significant"][at].astype(bool)}


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
