"""A log's map as a table of cells, for a fleet's data set."""

from __future__ import annotations

import os
from importlib.util import find_spec
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.estimation import Estimates

if TYPE_CHECKING:
    import pyarrow as pa


def require_maps() -> None:
    """Raise InputError if the packages that maps need are not installed."""
    if find_spec("pyproj") is None:
        raise InputError(
            "the Python package 'pyproj' is needed", place="--map", hint="pip install 'terragrip[geo]'"
        )


def cells_of_log(path: str | os.PathLike[str], log: str) -> pa.Table | None:
    """The map cells of a file of estimates (docs/maps.md); None if it has no positions.

    Columns: ``log``, ``epsg`` of the grid, ``cell`` [m], ``east`` and ``north`` of the cell's centre [m], and those of
    `terragrip.maps.layers.cell_table`. Raises InputError if the positions contradict the motion.
    """
    import pyarrow as pa

    from terragrip.maps.field_map import MapMaker
    from terragrip.maps.layers import cell_table
    from terragrip.maps.places import has_positions

    estimates = Estimates.read(path)
    if not has_positions(estimates):
        return None
    maker = MapMaker()
    maker.add(estimates, log)
    made = maker.finish()
    table = cell_table(made)
    count = len(table["column"])
    where = {
        "log": [log] * count,
        "epsg": [made.epsg] * count,
        "cell": [made.cell] * count,
        "east": (table["column"] + 0.5) * made.cell,
        "north": (table["row"] + 0.5) * made.cell,
    }
    # null rather than NaN where a cell lacks a quantity: sums skip it
    return pa.table({name: pa.array(values, from_pandas=True) for name, values in {**where, **table}.items()})
