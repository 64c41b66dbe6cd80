"""A map read back from its GeoPackage."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError, missing_package
from terragrip.maps.about import ABOUT, About
from terragrip.maps.values import QUANTITIES

Ints = npt.NDArray[np.int64]

_REMAKE = "make it again: terragrip map ESTIMATES... -o map.gpkg"


@dataclass(frozen=True)
class Patch:
    """An anomaly of a map's file: columns of its row by name, and the ``rings`` of its outline, each east and north (n, 2) [m]."""

    row: Mapping[str, Any]
    rings: list[Floats]


@dataclass(frozen=True)
class MapFile:
    """A map's file.

    ``about``: how it was made; ``column``, ``row`` (k,) of its cells on the grid; ``cells``: their columns (k,) by name as
    :func:`terragrip.maps.layers.cell_table` has them; ``anomalies``; ``points``: their number along the path. Changes and the path
    are read on request.
    """

    path: Path
    about: About
    column: Ints
    row: Ints
    cells: Mapping[str, npt.NDArray[Any]]
    anomalies: list[Patch]
    points: int

    @property
    def quantities(self) -> list[str]:
        """The mapped quantities."""
        return [name for name in QUANTITIES if name in self.cells]

    def changes(self, quantity: str) -> dict[str, npt.NDArray[Any]]:
        """A quantity's rows of the layer ``changes`` by column, with ``column`` and ``row`` of the grid; empty if it has none."""
        if not self.about.changes.get(quantity):
            return {}
        return _columns(self.path, "changes", where=f"quantity = '{quantity}'")

    def way(self, most: int) -> tuple[npt.NDArray[np.object_], Floats, Floats, Floats]:
        """At most `most` points along the path, evenly drawn: run, time [s], east and north [m] (n,)."""
        if not self.points:
            return np.zeros(0, dtype=object), np.zeros(0), np.zeros(0), np.zeros(0)
        every = -(-self.points // most)
        import shapely

        table, shapes = _layer(self.path, "points", columns=["run", "time"], where=f"fid % {every} = 0")
        place = shapely.get_coordinates(shapes)
        return table["run"], table["time"], place[:, 0], place[:, 1]


def read_map(path: str | os.PathLike[str]) -> MapFile:
    """A map from its GeoPackage.

    Raises InputError if `terragrip map` did not write the file, or pyogrio is missing.
    """
    file = Path(path)
    about = _about(file)
    table = _columns(file, "cells")
    layers = _names(file)
    anomalies = _anomalies(file) if "anomalies" in layers else []
    return MapFile(file, about, table["column"], table["row"], table, anomalies, layers.get("points", 0))


def _pyogrio(file: Path) -> Any:
    try:
        import pyogrio
    except ModuleNotFoundError as error:
        raise missing_package("pyogrio", "geo", "read a map", file=file) from error
    pyogrio.set_gdal_config_options(
        {"GDAL_PAM_ENABLED": False}
    )  # else reading leaves a .aux.xml beside the map
    return pyogrio


def _about(file: Path) -> About:
    pyogrio = _pyogrio(file)
    try:
        info = pyogrio.read_info(file, layer="cells")
        return About.from_text((info["dataset_metadata"] or {})[ABOUT])
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise InputError("is not a GeoPackage with a layer of cells", file=file, hint=_REMAKE) from error
    except (KeyError, ValueError, TypeError) as error:
        raise InputError("is not a map of this version of Terragrip", file=file, hint=_REMAKE) from error


def _names(file: Path) -> dict[str, int]:
    """Rows by layer."""
    pyogrio = _pyogrio(file)
    return {
        str(name): int(pyogrio.read_info(file, layer=name)["features"])
        for name, _ in pyogrio.list_layers(file)
    }


def _layer(file: Path, layer: str, **which: Any) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[Any]]:
    """Columns by name and shapes (n,) of a layer. Raises InputError where the file is damaged."""
    import shapely

    pyogrio = _pyogrio(file)
    try:
        meta, _, shapes, columns = pyogrio.raw.read(file, layer=layer, **which)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise InputError(f"the layer {layer} cannot be read", file=file, hint=_REMAKE) from error
    return dict(zip(map(str, meta["fields"]), columns, strict=True)), shapely.from_wkb(shapes)


def _columns(file: Path, layer: str, **which: Any) -> dict[str, npt.NDArray[Any]]:
    """Columns of a layer by name (n,), without its shapes, which take most of the time. Raises InputError where the file is damaged."""
    pyogrio = _pyogrio(file)
    try:
        _, table = pyogrio.read_arrow(file, layer=layer, read_geometry=False, **which)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise InputError(f"the layer {layer} cannot be read", file=file, hint=_REMAKE) from error
    return {name: table[name].to_numpy() for name in table.column_names}


def _anomalies(file: Path) -> list[Patch]:
    import shapely

    table, shapes = _layer(file, "anomalies")
    names = list(table)
    rows = [dict(zip(names, one, strict=True)) for one in zip(*table.values(), strict=True)]
    return [
        Patch(
            row,
            [
                shapely.get_coordinates(ring)
                for part in shapely.get_parts(shape)
                for ring in shapely.get_rings(part)
            ],
        )
        for row, shape in zip(rows, shapes, strict=True)
    ]
