"""Maps of development machines drawn at random: do intervals hold the truth, are anomalies real, does the cell suit the machine?

    python benchmarks/map_families.py [--machines 24] [--seed 8230000] [--write]

Each machine drives twelve lanes, a working width apart, over soils whose truth is known at every place: one soil, a strip of another
along a side, and four patches of others. Every second tractor logs at 1 Hz, other machines at a drawn rate. Half of the machines
have RTK positions (2 cm), a quarter errors of .1 m with .3 m of drift, a quarter .3 m with 1.2 m. Every second vehicle file states
the working width, two in three the antenna. A map is made by default.

The truth of a cell is the mean over 6 x 6 points of it: of adhesion the soil's curve at the map's slip (wheels sunk in as that slip
makes them), of resistance that at the drive's median slip (of the way: a machine that got stuck spins), times the ground's own
variation. mapped: cells with an adhesion, of those with a resistance. held: cells whose 90 % interval holds the truth, mean of the
machines, and in brackets that of the worst. error: root mean square over the truth's mean, median of the machines. real: listed
anomalies whose cells are in truth beyond the medians of what is around on each side, in that direction and by half or more of the
difference listed.
found: patches so by 15 % or more of the mean that an anomaly of their sign overlaps. --write puts the table into docs/maps.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pyproj import Transformer

from marked import put
from terragrip.estimation import estimate
from terragrip.maps import FieldMap, map_of
from terragrip.maps.values import driven_slip
from terragrip.physics.adhesion import CURVES
from terragrip.simulation import Scenario, simulate
from terragrip.simulation.families import Kind, machines, scenario
from terragrip.simulation.fields import Field, stream
from terragrip.simulation.route import EARTH_RADIUS, inside

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/maps.md"
BEGIN = "<!-- made by benchmarks/map_families.py --write -->"
NORMAL = 1.6449
LANES, LONG = 12, 50
"""Lanes, and their length in working widths."""
QUANTITIES = ("adhesion", "soil_resistance")
CLEAR = 0.15
LEAST_CELLS, AROUND, ENOUGH = 4, 10.0, 50
FINE = 0.05
POSITIONS = ((0.02, 0.0), (0.1, 0.3), (0.02, 0.0), (0.3, 1.2))
"""Noise and drift [m] of the receivers in turn."""
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """A machine on its field: ``width`` [m] of its tool and lanes."""

    kind: Kind
    seed: int
    scenario: Scenario
    width: float
    noise: float


def drives(count: int, first_seed: int) -> Iterator[Drive]:
    """Development machines on fields."""
    for number, (kind, seed) in enumerate(machines("development", count, first_seed)):
        yield drive_of(kind, seed, number)


def drive_of(kind: Kind, seed: int, number: int) -> Drive:
    """The number-th machine on its field."""
    rng = stream(seed, f"map {kind}")
    rate = 1.0 if kind.mass == "tractor" and number % 2 else None
    first = scenario(kind, seed, rate=rate)
    vehicle = first.nominal_vehicle()
    width = (vehicle.track or 3.0 * float(vehicle.wheel_radius.mean())) * float(rng.uniform(1.3, 3.0))
    levels = [speed for _, speed in first.speed if speed not in ("off", 0.0)]
    length = LANES * (LONG + 4) * width
    duration = float(min(1.15 * length / np.mean(levels), 7000.0))
    made = scenario(kind, seed, rate=rate, duration=duration)
    noise, drift = POSITIONS[number % len(POSITIONS)]
    tree = made.model_dump(mode="json", exclude_none=True)
    fixes = min(10.0, made.sensors.wheel_speed.rate)
    tree["sensors"]["position"] = {"rate": fixes, "noise": noise, "drift": drift, "drift_time": 60.0}
    if number % 2:
        tree["vehicle"]["working_width"] = width
    if number % 3:  # the simulation's receiver is over the centre of gravity
        tree["vehicle"]["antenna"] = {"x": vehicle.center_of_gravity_to_rear, "y": 0.0}
    tree["route"] = {
        **field(rng, list(dict.fromkeys(made.route.soils())), width),
        "border": tree["route"]["border"],
        "turn_radius": 0.5 * width,
        "slope": tree["route"]["slope"],
    }
    return Drive(kind, seed, Scenario.from_dict(tree), width, float(np.hypot(noise, drift)))


def field(rng: np.random.Generator, soils: list[str], width: float) -> dict[str, Any]:
    """Lanes over the first soil, a strip of the second along them, four patches of others, two to five widths in size."""
    path: list[list[float]] = []
    long, across = LONG * width, LANES * width
    for lane in range(LANES):
        ends = [[-2 * width, (lane + 0.5) * width], [long + 2 * width, (lane + 0.5) * width]]
        path += ends if lane % 2 == 0 else ends[::-1]
    strip = 0.75 * across
    plots = [{"soil": soils[1], "corners": box(-9 * width, strip, long + 9 * width, across + 9 * width)}]
    centres: list[Floats] = []
    for _ in range(1000):
        size = rng.uniform(2, 5, 2) * width
        corner = rng.uniform([0.0, 0.0], [long - size[0], across - size[1]])
        centre = corner + 0.5 * size
        if len(centres) == 4 or any(np.hypot(*(centre - one)) < 9 * width for one in centres):
            continue
        centres.append(centre)
        here = soils[int(centre[1] > strip)]
        soil = str(rng.choice([name for name in soils if name != here]))
        plots.append({"soil": soil, "corners": box(*corner, *(corner + size))})
    return {"around": soils[0], "path": path, "plots": plots}


def box(west: float, south: float, east: float, north: float) -> list[list[float]]:
    """Corners of a rectangle."""
    return [[west, south], [east, south], [east, north], [west, north]]


@dataclass(frozen=True)
class Ground:
    """The ground of a drive at any place of a map's grid; ``slips``: that of adhesion, and that of resistance."""

    drive: Drive
    epsg: int
    slips: tuple[float, float]

    def at(self, east: Floats, north: Floats) -> tuple[dict[str, Floats], npt.NDArray[np.intp]]:
        """Truth by quantity, and the number of the plot (-1 outside), at grid metres (n,)."""
        route = self.drive.scenario.route
        longitude, latitude = Transformer.from_crs(self.epsg, 4326, always_xy=True).transform(east, north)
        y = np.radians(latitude - route.latitude) * EARTH_RADIUS
        x = np.radians(longitude - route.longitude) * EARTH_RADIUS * np.cos(np.radians(route.latitude))
        plot = np.full(len(x), -1)
        for k, one in enumerate(route.plots):
            plot[inside(one, x, y)] = k
        names = np.array([*(one.soil for one in route.plots), route.around], dtype=object)[plot]
        out = {quantity: np.zeros(len(x)) for quantity in ("adhesion", "soil_resistance")}
        for name in set(names):
            rows, soil = names == name, self.drive.scenario.soils[name]
            for (quantity, values), level in zip(out.items(), self.levels(name), strict=True):
                what = quantity.removeprefix("soil_")
                spread = getattr(soil, f"{what}_variation")
                sigma = np.sqrt(np.log1p(spread**2))
                own = Field(stream(self.drive.scenario.seed, f"{what} {name}"), soil.correlation_length)
                values[rows] = level * np.exp(sigma * own.at(x[rows], y[rows]) - 0.5 * sigma**2)
        return out, plot

    def levels(self, name: str) -> tuple[float, float]:
        """Adhesion and resistance of a soil without its own variation."""
        soil = self.drive.scenario.soils[name]
        spot = next(iter(self.drive.scenario.soft_spots), None)
        at, slip = self.slips
        parameters = {key: value for key, value in soil.curve.items() if key != "name"}
        curve = CURVES[soil.curve["name"]]
        loose = at / (1 + spot.loosening) if spot else at
        adhesion = float(curve.value(loose, parameters)) * (1 - (spot.adhesion_fall * at if spot else 0))
        sunk = 0.5 * (spot.front + spot.rear) * (1 + spot.sinkage * slip) if spot else 0.0
        return adhesion, soil.resistance + soil.resistance_slip * slip + sunk

    def over_cells(self, made: FieldMap, quantity: str) -> Floats:
        """The mean of a quantity's truth over each of its cells (k,)."""
        cells, grid = made.cells[quantity], (np.arange(6) + 0.5) / 6
        east = (cells.column[:, None, None] + grid[None, :, None] + 0 * grid) * made.cell
        north = (cells.row[:, None, None] + grid[None, None, :] + 0 * grid[:, None]) * made.cell
        return np.asarray(
            self.at(east.ravel(), north.ravel())[0][quantity].reshape(len(cells), -1).mean(axis=1)
        )


def score(drive: Drive) -> dict[str, Any]:
    """Figures of one drive."""
    result = simulate(drive.scenario, drive.seed)
    estimates = estimate(result.recording, result.vehicle)
    made = map_of([("drive", estimates)])
    ground = Ground(drive, made.epsg, (made.reference_slip, driven_slip(estimates)))
    row: dict[str, Any] = {"cell": made.cell, "width": drive.width, "counts": np.zeros(4, dtype=int)}
    for quantity in QUANTITIES:
        if quantity not in made.cells:
            continue
        cells, true = made.cells[quantity], ground.over_cells(made, quantity)
        row[quantity] = (np.abs(cells.value - true) < NORMAL * cells.std, cells.value - true, true)
        row["counts"] += anomalies(made, ground, quantity, true)
    return row


def anomalies(made: FieldMap, ground: Ground, quantity: str, true: Floats) -> npt.NDArray[np.int_]:
    """Anomalies listed, real ones, patches that are one, and those found."""
    cells, listed = made.cells[quantity], made.anomalies[quantity]
    place = np.column_stack([cells.column, cells.row]).astype(float)
    plot = ground.at(*((place + 0.5) * made.cell).T)[1]
    real = 0
    for one in listed:
        real += bool(np.sign(one.difference) * beyond(place, one.cells, true) >= 0.5 * abs(one.difference))
    patches, found = 0, 0
    for k in range(1, len(ground.drive.scenario.route.plots)):
        inside_ = np.flatnonzero(plot == k)
        difference = beyond(place, inside_, true) if len(inside_) >= LEAST_CELLS else 0.0
        if abs(difference) > CLEAR * true.mean():
            patches += 1
            found += any(one.difference * difference > 0 and np.any(plot[one.cells] == k) for one in listed)
    return np.array([len(listed), real, patches, found])


def beyond(place: Floats, cells: npt.NDArray[np.intp], true: Floats) -> float:
    """How far the mean of the truth over cells is beyond the range of its medians on the four sides of them."""
    offset = place - place[cells].mean(axis=0)
    near = np.hypot(*offset.T) < np.sqrt(len(cells) / np.pi) + AROUND
    near[cells] = False
    sides = [near & (sign * offset[:, axis] > 0) for axis in (0, 1) for sign in (-1, 1)]
    medians = [np.median(true[side]) for side in sides if side.sum() >= LEAST_CELLS]
    mean = float(true[cells].mean())
    return mean - float(np.clip(mean, min(medians), max(medians))) if medians else 0.0


def line(name: str, rows: list[dict[str, Any]]) -> str:
    """A row of the table."""
    cell, width = (np.median([row[key] for row in rows]) for key in ("cell", "width"))
    words = [name, str(len(rows)), f"{width:.2f}", f"{cell:.2f}"]
    known = {q: [row[q] for row in rows if q in row and len(row[q][0])] for q in QUANTITIES}
    sizes = [sum(len(one[0]) for one in known[q]) for q in QUANTITIES]
    words.append(f"{100 * sizes[0] / max(sizes[1], 1):.0f} %")
    for some in known.values():
        shares = [float(held.mean()) for held, _, _ in some if len(held) >= ENOUGH] or [np.nan]
        errors = [float(np.sqrt(np.mean(error**2)) / true.mean()) for _, error, true in some] or [np.nan]
        words.append(f"{100 * np.mean(shares):.0f} ({100 * min(shares):.0f}) %")
        words.append(f"{np.median(errors):.2f}")
    listed, real, patches, found = sum(row["counts"] for row in rows)
    return "| " + " | ".join([*words, f"{real} of {listed}", f"{found} of {patches}"]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=8230000)
    parser.add_argument("--write", action="store_true", help="put the table into docs/maps.md")
    arguments = parser.parse_args()
    groups: dict[str, list[dict[str, Any]]] = {}
    for drive in drives(arguments.machines, arguments.seed):
        row = score(drive)
        slow = drive.scenario.sensors.wheel_speed.rate == 1.0
        receiver = "RTK positions" if drive.noise < FINE else "coarser positions"
        for group in (f"{drive.kind.mass}{', 1 Hz' * slow}", receiver, "all"):
            groups.setdefault(group, []).append(row)
    order = sorted(groups, key=lambda name: ("lrtRca".index(name[0]), name))
    lines = [
        f"{arguments.machines} machines from seed {arguments.seed}.",
        "",
        "| machines | number | width (m) | cell (m) | mapped | µ held | µ error | ρs held | ρs error | real | found |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
        *(line(name, groups[name]) for name in order),
    ]
    print("\n".join(lines))
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))


if __name__ == "__main__":
    main()
