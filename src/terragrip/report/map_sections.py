"""The map of the ground: cells of all runs with positions, and the patches unlike their surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.figures import styled
from terragrip.report.page import Picture, Section, Table, number
from terragrip.report.style import to_svg

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.maps import FieldMap, MapMaker

TITLE = "Map of the ground"
ROWS = 12
"""Anomalies that are listed; the rest are counted."""


@dataclass
class GatheredMap:
    """The runs of a report for its map: added one by one; and why the first one that could not be mapped was left out."""

    maker: MapMaker | None = None
    refused: str = ""
    runs: list[str] = field(default_factory=list)

    def add(self, estimates: Estimates, run: str) -> None:
        """Take a run with positions; one without, or with impossible ones, leaves the map without it."""
        if find_spec("pyproj") is None:
            self.refused = "the Python package 'pyproj' is missing: pip install 'terragrip[geo]'"
            return
        from terragrip.maps import MapMaker
        from terragrip.maps.places import has_positions

        if not has_positions(estimates):
            return
        self.maker = self.maker or MapMaker()
        try:
            self.maker.add(estimates, run)
        except InputError as error:
            self.refused = str(error)
        else:
            self.runs.append(run)

    def section(self) -> Section:
        """The map, or why there is none."""
        if self.maker is None or not self.runs:
            why = self.refused or "the logs have no position (latitude and longitude)"
            return Section("map", TITLE, omitted=f"Left out: {why}.")
        try:
            made = self.maker.finish()
        except InputError as error:
            return Section("map", TITLE, omitted=f"Left out: {error}.")
        return Section("map", TITLE, _prose(made, self.refused), (_drawn(made), *_anomalies(made)))


def _prose(made: FieldMap, refused: str) -> tuple[str, ...]:
    changed = [
        f"{int(one.significant.sum())} of {len(one)} cells driven more than once changed in {name.replace('_', ' ')}"
        for name, one in made.changes.items()
    ]
    said = [f"Between passes: {'; '.join(changed)}."] if changed else []
    return (*said, *made.notes[:6], *([f"Left out of the map: {refused}."] if refused else []))


def _drawn(made: FieldMap) -> Picture:
    from terragrip.maps.picture import picture

    with styled():
        figure = picture(made)
    return Picture(
        "map",
        to_svg(figure),
        f"Cells of {made.cell:g} m, {len(made.runs)} run{'s' * (len(made.runs) != 1)}: value on the left, standard deviation on the right. "
        "How a cell is made: docs/maps.md. As a file for a GIS: terragrip map.",
        "Map of the ground by cell",
    )


def _anomalies(made: FieldMap) -> Sequence[Table]:
    from pyproj import Transformer

    from terragrip.maps.values import SHARES

    back = Transformer.from_crs(made.epsg, 4326, always_xy=True)
    rows = []
    every = sorted(
        ((name, one) for name, found in made.anomalies.items() for one in found), key=lambda pair: pair[1].p
    )
    for name, one in every[:ROWS]:
        longitude, latitude = back.transform(one.column * made.cell, one.row * made.cell)
        scale, digits, unit = (100.0, 1, " %") if name in SHARES else (1.0, 3, "")
        value, around, apart = (number(scale * v, digits) for v in (one.value, one.around, one.difference))
        plus = "+" * (one.difference > 0)
        rows.append((
            name.replace("_", " "), f"{latitude:.6f}", f"{longitude:.6f}", number(len(one.cells) * made.cell**2, 0),
            f"{value}{unit}", f"{around}{unit}", f"{plus}{apart} ± {number(1.96 * scale * one.std, digits)}{unit}",
        ))  # fmt: skip
    if not rows:
        return ()
    more = f" {len(every) - ROWS} more are in the file of terragrip map." if len(every) > ROWS else ""
    head = ("quantity", "latitude [°]", "longitude [°]", "area [m²]", "value", "around", "difference ± 95 %")
    return (
        Table(
            f"Patches that differ from their surroundings; at most 5 % of them by chance.{more}",
            head,
            tuple(rows),
        ),
    )
