"""From runs to a map: the quantities of the ground by cell, the points along the way, anomalies and changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from terragrip.errors import InputError
from terragrip.maps.anomalies import Anomaly, anomalies_of
from terragrip.maps.cells import CORRELATED, Cells, Pieces, cells_of, pieces_of
from terragrip.maps.changes import Changes, changes_of, moved_zeros
from terragrip.maps.filling import filled
from terragrip.maps.lanes import lane_spacing
from terragrip.maps.places import Places, has_positions, middle_of, places_of, zone_of
from terragrip.maps.points import Points, points_of
from terragrip.maps.repeats import WORTH_A_WORD, scaled, share_of_repeats
from terragrip.maps.soils import SoilWay, soil_of_cells, soil_way
from terragrip.maps.values import QUANTITIES, readings_of, usual_slip

if TYPE_CHECKING:
    from terragrip.arrays import Floats
    from terragrip.estimation import Estimates
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

GROUND = ("adhesion", "soil_resistance")
"""What is the ground's own, and searched for anomalies; slip and efficiency answer to the load too, and slip stands in where it is all."""
READ_BY_WHEELS = ("adhesion", "slip", "efficiency")
"""What repeated passes tell the errors of; the resistance's are mostly those of slope and drawbar, which stay the same in each pass."""
MOST_CELLS = 50_000_000
"""Cells of the box around all runs beyond which a raster of them would not fit a common machine's memory."""
METRE_MACHINE = 139.0
"""kg of a machine with cells of 1 m, the paper's robot; those of others are as their length, the cube root of their mass."""
NARROWEST = 0.6
"""Of that size, about the machine's own width: nearer passes are over the same ground."""
COARSE = 3.0
"""Times the scatter of the positions that a cell is at least: smaller ones show rounding and noise."""
FARTHEST = 100_000.0
"""Metres from the first run beyond which another is no part of its map: the grid would be another zone's."""


@dataclass(frozen=True)
class MapSettings:
    """Settings of a map: ``cell`` [m] (None: from the machine), ``reference_slip`` (None: near the first run's own), ``datum`` of the
    positions, ``fill``: number of cell sizes to krige beyond the driven cells (0: none)."""

    cell: float | None = None
    reference_slip: float | None = None
    datum: str = "EPSG:4326"
    fill: float = 0.0


@dataclass(frozen=True)
class FieldMap:
    """A map: ``epsg`` of its grid and the ``cell`` [m], the ``datum`` of the positions, ``middle`` (latitude, longitude [deg]);
    by quantity ``cells``, ``passes`` (a row per pass), ``anomalies``, ``changes``; the ``soil`` of cells; the ``points`` along the path;
    names of the ``runs``; ``notes``: sentences for the user."""

    epsg: int
    cell: float
    cells: Mapping[str, Cells]
    passes: Mapping[str, Cells]
    anomalies: Mapping[str, list[Anomaly]]
    changes: Mapping[str, Changes]
    soil: Mapping[tuple[int, int], tuple[str, float]]
    points: Points
    runs: tuple[str, ...]
    reference_slip: float
    datum: str
    middle: tuple[float, float]
    notes: tuple[str, ...] = field(default=())


@dataclass
class MapMaker:
    """Adds runs one by one, so many fit the memory; `finish` makes the map."""

    settings: MapSettings = field(default_factory=MapSettings)
    library: SoilLibrary | None = None
    ground: Mapping[str, list[Mapping[str, object]]] = field(default_factory=dict)
    runs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    _epsg: int = 0
    _cell: float = 0.0
    _slip: float = 0.0
    _correlated: float = 0.0
    _middle: tuple[float, float] = (0.0, 0.0)
    _origin: tuple[float, float] = (0.0, 0.0)
    _parts: dict[str, list[Pieces]] = field(default_factory=dict)
    _soil: list[SoilWay] = field(default_factory=list)
    _points: list[Points] = field(default_factory=list)
    _machines: set[str] = field(default_factory=set)
    _bare: list[str] = field(default_factory=list)

    def add(self, estimates: Estimates, run: str, file: str | None = None) -> None:
        """Add one run. Raises InputError if it has no positions, or impossible ones; ``file`` is named there."""
        vehicle = estimates.vehicle
        if not has_positions(estimates):
            raise InputError(
                "has no positions", file=file or run, hint="estimate a log with latitude and longitude"
            )
        epsg = self._epsg or zone_of(estimates["latitude"], estimates["longitude"])
        places = places_of(estimates, epsg, self.settings.datum, file)
        way = np.maximum.accumulate(np.nan_to_num(estimates["distance"]))
        cell = self._cell or self.settings.cell or usual_cell(vehicle, places, way)
        self._check_extent(places, cell, file or run)
        if not self.runs:
            self._begin(estimates, places, epsg, cell)
        number = len(self.runs)
        self.runs.append(run)
        self._machines.add(str(estimates.about.get("vehicle")))
        self.notes += [f"{run}: {note}" for note in places.notes]
        if vehicle.antenna is None:
            self._bare.append(run)
        for reading in readings_of(estimates, places, self._slip, self.library):
            pieces = pieces_of(reading, estimates.time, way, self._cell, number, places.headland)
            self._parts.setdefault(reading.quantity, []).append(pieces)
            del reading  # before the next one is made
        self._soil.append(soil_way(estimates, places, way, self._cell, self.ground.get(run, [])))
        self._points.append(points_of(estimates, places, way, self._cell, number))

    def _begin(self, estimates: Estimates, places: Places, epsg: int, cell: float) -> None:
        """Settings that the first run determines for all."""
        vehicle = estimates.vehicle
        radius = float(vehicle.wheel_radius.mean()) if vehicle.knows_wheels else 0.5
        self._epsg, self._cell, self._correlated = epsg, cell, CORRELATED * radius
        self._slip = self.settings.reference_slip or usual_slip(estimates)
        self._origin = float(np.nanmedian(places.east)), float(np.nanmedian(places.north))
        self._middle = middle_of(estimates["latitude"], estimates["longitude"])

    def _check_extent(self, places: Places, cell: float, file: str) -> None:
        known = np.isfinite(places.east)
        if not known.any():
            raise InputError(
                "has no usable stretch of positions",
                file=file,
                hint="check the positions: there are too few, or all are jumps",
            )
        if self.runs:
            east, north = np.nanmedian(places.east), np.nanmedian(places.north)
            away = float(np.hypot(east - self._origin[0], north - self._origin[1]))
            if away > FARTHEST:
                raise InputError(
                    f"lies {away / 1000:.0f} km from the first run",
                    file=file,
                    hint="map it separately, or check its positions",
                )
        long, wide = np.ptp(places.east[known]), np.ptp(places.north[known])
        if (long / cell + 1) * (wide / cell + 1) > MOST_CELLS:
            raise InputError(
                f"cells of {cell:g} m over {long:.0f} m by {wide:.0f} m are more than {MOST_CELLS} cells",
                file=file, place="--cell", hint=f"take {_enough(float(long), float(wide)) * 1.1:.2g} m or more",
            )  # fmt: skip

    def finish(self) -> FieldMap:
        """The map of the added runs. Raises InputError if there are none, or no row counts."""
        if not self.runs:
            raise InputError("there is no run to map", hint="give files written by 'terragrip estimate'")
        if self._bare:
            which = ", ".join(self._bare) if len(self._bare) < 4 else f"{len(self._bare)} runs"
            self.notes.append(
                f"{which}: the vehicle file has no antenna; it is assumed to be over the rear axle."
            )
        cells: dict[str, Cells] = {}
        passes: dict[str, Cells] = {}
        for quantity in (name for name in QUANTITIES if name in self._parts):
            whole, each = cells_of(self._parts[quantity], self._correlated)
            if len(whole):
                share = share_of_repeats(each) if quantity in READ_BY_WHEELS else 1.0
                cells[quantity], passes[quantity] = scaled(whole, share), scaled(each, share)
                if share < WORTH_A_WORD:
                    self.notes.append(
                        f"{quantity}: passes over one cell agree better than the estimates' intervals say; standard deviations are "
                        f"{share:.2f} times those."
                    )
        if not cells:
            raise InputError(
                "no row with a position shows the ground",
                hint="drive, with positions",
            )
        if len(cells.get("adhesion", ())) < WORTH_A_WORD * len(cells.get("soil_resistance", ())):
            self.notes.append(
                f"adhesion: {len(cells.get('adhesion', ()))} of {len(cells['soil_resistance'])} cells; in the others slip was too low or "
                "too uncertain to show it. Take larger cells (--cell), or map the same ground with more pull."
            )
        judged = GROUND if any(name in cells for name in GROUND) else ("slip",)
        anomalies = {name: anomalies_of(cells[name]) for name in judged if name in cells}
        one = len(self._machines) == 1
        changes = {
            name: found for name, all_ in passes.items() if len(found := changes_of(all_, same_machine=one))
        }
        said = {name: moved_zeros(found, passes[name]) for name, found in changes.items() if one}
        self.notes += [f"{name}: {sentence}" for name, sentence in said.items() if sentence]
        if not changes:
            self.notes.append("Every cell was driven once: there is no map of changes.")
        if self.settings.fill:
            cells = {name: filled(one, self.settings.fill) for name, one in cells.items()}
        return FieldMap(
            self._epsg, self._cell, cells, passes, anomalies, changes, soil_of_cells(self._soil), Points.joined(self._points),
            tuple(self.runs), self._slip, self.settings.datum, self._middle, tuple(self.notes),
        )  # fmt: skip


def usual_cell(vehicle: Vehicle, places: Places, way: Floats) -> float:
    """Size of a cell [m] if the user gives none: the working width; where it is not stated, from lane to lane, and without
    lanes by the machine's size. Not less than `COARSE` times the scatter of the positions. ``way`` [m] (n,) not decreasing."""
    by_mass = _upward(float(np.cbrt(vehicle.mass / METRE_MACHINE)), 1)
    spacing = lane_spacing(places, way, NARROWEST * by_mass)
    size = vehicle.working_width or (_upward(spacing, 2) if spacing else by_mass)
    return max(size, _upward(COARSE * places.scatter, 1))


def _upward(size: float, digits: int) -> float:
    """The next number up of so many digits: cells narrower than lanes leave stripes between them."""
    if size <= 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(size)) + 1 - digits)
    return round(math.ceil(size / unit - 0.05) * unit, 9)


def _enough(long: float, wide: float) -> float:
    """The smallest size [m] at which `MOST_CELLS` cells cover a box: (long/size + 1)(wide/size + 1) = MOST_CELLS."""
    both, rest = long * wide, MOST_CELLS - 1
    half = 0.5 * (long + wide)
    return (half + math.sqrt(half**2 + rest * both)) / rest


def map_of(
    runs: Iterable[tuple[str, Estimates] | tuple[str, Estimates, str]],
    settings: MapSettings | None = None,
    library: SoilLibrary | None = None,
    progress: Callable[[int], None] | None = None,
    ground: Mapping[str, list[Mapping[str, object]]] | None = None,
) -> FieldMap:
    """The map of runs (name, estimates, and the file that errors name); one run at a time is in memory.

    ``ground``: sections of ground.json by run; ``progress`` is called with the runs done. Raises as `MapMaker`.
    """
    maker = MapMaker(settings or MapSettings(), library, ground or {})
    for number, (run, estimates, *file) in enumerate(runs, 1):
        maker.add(estimates, run, *file)
        if progress:
            progress(number)
    return maker.finish()
