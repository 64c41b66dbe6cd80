"""What a data set holds of a log besides its estimates: the cells of its map, its sections of ground, and its events with their reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.errors import InputError, missing_package
from terragrip.estimation import Estimates

if TYPE_CHECKING:
    import pyarrow as pa

    from terragrip.ground.span import Span


def require_maps() -> None:
    """Raise InputError if the packages that maps need are not installed."""
    if find_spec("pyproj") is None:
        raise missing_package("pyproj", "geo", place="--map")


@dataclass(frozen=True)
class Extra:
    """``tables`` by folder, and the reasons for those that are missing."""

    tables: Mapping[str, pa.Table]
    no_map: str = ""
    no_ground: str = ""

    @classmethod
    def of(cls, estimates: Path, log: str, *, maps: bool, ground: bool) -> Extra:
        """The optional results of a file of estimates, those that are wanted; it is read once. Raises InputError as `Estimates.read`."""
        tables: dict[str, pa.Table] = {}
        no_map = no_ground = ""
        if not (maps or ground):
            return cls(tables)
        whole = Estimates.read(estimates)
        if maps:
            try:
                cells = cells_of_log(whole, log)
            except InputError as error:
                no_map = str(error)
            else:
                no_map = "" if cells is not None else "has no positions"
                tables |= {} if cells is None else {"cells": cells}
        if ground:
            try:
                tables |= ground_of_log(whole, log)
            except InputError as error:
                no_ground = str(error)
        return cls(tables, no_map, no_ground)


def cells_of_log(estimates: Estimates, log: str) -> pa.Table | None:
    """The map cells of a log's estimates (docs/maps.md); None if it has no positions.

    Columns: ``log``, ``epsg`` of the grid, ``cell`` [m], ``east`` and ``north`` of the cell's centre [m], and those of
    `terragrip.maps.layers.cell_table`. Raises InputError if the positions contradict the motion.
    """
    import pyarrow as pa

    from terragrip.maps.field_map import MapMaker
    from terragrip.maps.layers import cell_table
    from terragrip.maps.places import has_positions

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


def ground_of_log(estimates: Estimates, log: str) -> dict[str, pa.Table]:
    """The ``sections`` and ``events`` of a log's estimates, as `terragrip ground` finds them without a soil library.

    A row holds the ``log``, the fields of a `terragrip.ground.sections.Section` or `terragrip.ground.events.Event` except those by wheel
    or soil, and its duration ``seconds``. Without sections or events that table is missing. Raises InputError if the estimates do not
    suffice to find sections.
    """
    from terragrip.ground.analysis import analyse

    ground, _ = analyse(estimates, run=log)
    tables = {"sections": _table(ground.sections, log), "events": _table(ground.events, log)}
    return {name: table for name, table in tables.items() if table is not None}


def _table(spans: Sequence[Span], log: str) -> pa.Table | None:
    import pyarrow as pa

    if not spans:
        return None
    types = {"str": pa.string(), "int": pa.int64()}
    columns: dict[str, pa.Array] = {"log": pa.array([log] * len(spans))}
    for name, kind in type(spans[0]).__annotations__.items():
        if not kind.startswith("Mapping"):
            columns[name] = pa.array([getattr(span, name) for span in spans], types.get(kind, pa.float64()))
    return pa.table({**columns, "seconds": pa.array([span.seconds for span in spans])})
