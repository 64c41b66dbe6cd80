"""The soil of each cell with its probability: by the recording's labels, or by the recognised ground."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.document import read_json
from terragrip.maps.columns import Columns
from terragrip.maps.places import Places

if TYPE_CHECKING:
    from terragrip.estimation import Estimates

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SoilWay(Columns):
    """Metres driven by cell and soil (m,): ``column``, ``row``, ``soil``, ``metres``; a section's soils share its metres."""

    column: Ints
    row: Ints
    soil: npt.NDArray[np.object_]
    metres: Floats


def sections_by_run(
    ground: str | os.PathLike[str], runs: Sequence[str]
) -> dict[str, list[Mapping[str, Any]]]:
    """Sections of a ground.json by run; those of one drive alone are the first run's. Raises InputError if it is not one."""
    result: dict[str, list[Mapping[str, Any]]] = {}
    for one in read_json(os.fspath(ground), "sections", 1, "'terragrip ground'")["sections"]:
        result.setdefault(str(one.get("run", runs[0])), []).append(one)
    return result


def soil_way(
    estimates: Estimates, places: Places, way: Floats, size: float, sections: Sequence[Mapping[str, Any]]
) -> SoilWay:
    """A run's metres by cell and soil: of ``sections`` (of ground.json) if there are any, else of the labels."""
    import pandas as pd

    known = np.isfinite(places.east)
    column = np.floor(np.where(known, places.east, 0) / size).astype(np.int64)
    row = np.floor(np.where(known, places.north, 0) / size).astype(np.int64)
    step = np.diff(way, prepend=way[:1])
    parts = []
    if sections:
        for one in sections:
            inside = known & (estimates.time >= float(one["start"])) & (estimates.time < float(one["end"]))
            for soil, probability in dict(one["probabilities"]).items():
                parts.append(
                    (
                        column[inside],
                        row[inside],
                        np.full(inside.sum(), soil, dtype=object),
                        step[inside] * float(probability),
                    )
                )
    elif "soil" in estimates.labels:
        labels = estimates.labels["soil"]
        good = known & (labels != "")
        parts.append((column[good], row[good], labels[good], step[good]))
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return SoilWay(none, none, np.zeros(0, dtype=object), np.zeros(0))
    table = pd.DataFrame(
        {
            name: np.concatenate([p[k] for p in parts])
            for k, name in enumerate(("column", "row", "soil", "metres"))
        }
    )
    total = table.groupby(["column", "row", "soil"], sort=False)["metres"].sum().reset_index()
    return SoilWay(*(total[name].to_numpy() for name in ("column", "row", "soil", "metres")))


def soil_of_cells(ways: Sequence[SoilWay]) -> dict[tuple[int, int], tuple[str, float]]:
    """The soil with most metres in each cell, and its share of them."""
    metres: dict[tuple[int, int], dict[str, float]] = {}
    for one in ways:
        for column, row, soil, way in zip(
            one.column.tolist(), one.row.tolist(), one.soil, one.metres.tolist(), strict=True
        ):
            cell = metres.setdefault((column, row), {})
            cell[soil] = cell.get(soil, 0.0) + way
    out = {}
    for place, cell in metres.items():
        soil = max(cell, key=lambda name: cell[name])
        total = sum(cell.values())
        if total > 0:
            out[place] = (soil, cell[soil] / total)
    return out
