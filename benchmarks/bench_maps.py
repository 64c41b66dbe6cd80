"""Whether a map's cells hold the truth, and whether its anomalies are some: simulated fields whose ground is known everywhere.

    python benchmarks/bench_maps.py [--seeds 7100 ...] [--write]

The robot of docs/physics.md 8 drives lanes 1 m apart over one soil, with patches of hard and of slippery ground (grass) of 2 to 5 m laid
in, and tows the cultipacker. Truth: the soil's curve at 10 % of slip, or its resistance at the drive's median slip, times the ground's own
variation, over 6 x 6 points of each cell. A patch is detected where an anomaly of the right sign, of adhesion or of resistance, overlaps a
third of it; an anomaly is right where it overlaps one. Coverage: share of cells whose 90 % interval holds the truth, borders of patches
included. Speed: recordings of half a million rows together. --write puts the table into docs/maps.md.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import Transformer

from marked import put
from terragrip.estimation import Estimates, estimate
from terragrip.maps import FieldMap, MapMaker, MapSettings, write_map
from terragrip.physics.adhesion import CURVES
from terragrip.simulation import Scenario, simulate
from terragrip.simulation.fields import Field, stream
from terragrip.simulation.route import EARTH_RADIUS, inside
from terragrip.simulation.scenario import Plot

SEEDS = tuple(range(7100, 7106))
REFERENCE = 0.1
"""Slip that adhesion is mapped at: next to that of these drives, as by default."""
LANES, LENGTH, SPACING = 18, 45.0, 1.0
PATCHES = 6
NORMAL = 1.6449
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/maps.md"
BEGIN = "<!-- made by benchmarks/bench_maps.py --write -->"


def field_scenario(seed: int) -> Scenario:
    """Lanes over `coarse` soil with patches of `hard` and `wet` ground; patches keep clear of each other."""
    rng = stream(seed, "patches")
    path: list[list[float]] = []
    for lane in range(LANES):
        ends = [[-4.0, lane * SPACING], [LENGTH + 4.0, lane * SPACING]]
        path += ends if lane % 2 == 0 else ends[::-1]
    plots: list[dict[str, Any]] = []
    centres: list[tuple[float, float]] = []
    while len(plots) < PATCHES:
        x, y = rng.uniform(4, LENGTH - 4), rng.uniform(2, LANES * SPACING - 2)
        wide, high = rng.uniform(2, 5, 2)
        if any(np.hypot(x - a, y - b) < 8 for a, b in centres):
            continue
        centres.append((x, y))
        soil = "hard" if len(plots) % 2 else "grass"
        plots.append({"soil": soil, "corners": [[x, y], [x + wide, y], [x + wide, y + high], [x, y + high]]})
    turns = 2 * len(path)
    duration = (LANES * (LENGTH + 10) + turns) / 0.75
    return Scenario.from_dict({
        "sensors": {"use": "robot"}, "vehicle": {"use": "innok-heros-444"}, "soils": {n: {"use": n} for n in ("coarse", "hard", "grass")},
        "robot": {"load_variation": 0.04},
        "route": {"around": "coarse", "plots": plots, "path": path, "turn_radius": 0.5, "border": 0.4},
        "tools": [{"use": "cultipacker"}], "speed": [[0, "off"], [3, 0], [8, 0.85]], "duration": min(duration, 3000.0),
    })  # fmt: skip


@dataclass
class Truth:
    """The ground of a scenario and seed at any place."""

    scenario: Scenario
    seed: int
    epsg: int

    def at(
        self, east: np.ndarray, north: np.ndarray, slip: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adhesion at the reference slip, resistance at `slip`, and the number of the patch (-1 outside), at grid metres (n,)."""
        route, soils = self.scenario.route, self.scenario.soils
        longitude, latitude = Transformer.from_crs(self.epsg, 4326, always_xy=True).transform(east, north)
        y = np.radians(latitude - route.latitude) * EARTH_RADIUS
        x = np.radians(longitude - route.longitude) * EARTH_RADIUS * np.cos(np.radians(route.latitude))
        patch = np.full(len(x), -1)
        name = np.full(len(x), route.around, dtype=object)
        for k, plot in enumerate(route.plots):
            patch[(within := inside(plot, x, y))] = k
            name[within] = plot.soil
        adhesion, resistance = np.zeros(len(x)), np.zeros(len(x))
        for soil in set(name):
            rows, ground = name == soil, soils[soil]
            curve = {k: v for k, v in ground.curve.items() if k != "name"}
            level = float(CURVES[ground.curve["name"]].value(REFERENCE, curve))
            for out, what, mean, spread in (
                (adhesion, "adhesion", level, ground.adhesion_variation),
                (
                    resistance,
                    "resistance",
                    ground.resistance + ground.resistance_slip * slip,
                    ground.resistance_variation,
                ),
            ):
                sigma = np.sqrt(np.log1p(spread**2))
                field = Field(stream(self.seed, f"{what} {soil}"), ground.correlation_length)
                out[rows] = mean * np.exp(sigma * field.at(x[rows], y[rows]) - 0.5 * sigma**2)
        return adhesion, resistance, patch


def one(seed: int) -> dict[str, Any]:
    """Coverage and anomalies of one field."""
    scenario = field_scenario(seed)
    result = simulate(scenario, seed)
    estimates = estimate(result.recording, result.vehicle)
    maker = MapMaker(MapSettings(cell=1.0, reference_slip=REFERENCE))
    maker.add(estimates, "drive")
    made = maker.finish()
    slip = float(np.nanmedian(estimates["slip_rr"]))
    truth = Truth(scenario, seed, made.epsg)
    row: dict[str, Any] = {"seed": seed, "rows": len(estimates)}
    for quantity, which in (("adhesion", 0), ("soil_resistance", 1)):
        cells = made.cells[quantity]
        true = _over_cells(truth, made, quantity, slip)[which]
        error = cells.value - true
        row[quantity] = {"error": error, "std": cells.std}
    row |= _anomalies(made, truth, scenario, slip)
    return row


def _over_cells(truth: Truth, made: FieldMap, quantity: str, slip: float) -> tuple[np.ndarray, ...]:
    cells, grid = made.cells[quantity], (np.arange(6) + 0.5) / 6
    east = (cells.column[:, None, None] + grid[None, :, None] + 0 * grid) * made.cell
    north = (cells.row[:, None, None] + grid[None, None, :] + 0 * grid[:, None]) * made.cell
    found = truth.at(east.ravel(), north.ravel(), slip)
    return tuple(x.reshape(len(cells), -1).mean(axis=1) for x in found[:2])


def _anomalies(made: FieldMap, truth: Truth, scenario: Scenario, slip: float) -> dict[str, int]:
    """By adhesion and resistance: anomalies in all, those on a patch and of its sign, patches driven over, patches detected by either."""
    plots: tuple[Plot, ...] = scenario.route.plots
    around = str(scenario.route.around)
    listed, right, detected, driven = 0, 0, set(), set()
    for quantity in ("adhesion", "soil_resistance"):
        cells = made.cells[quantity]
        patch = truth.at((cells.column + 0.5) * made.cell, (cells.row + 0.5) * made.cell, slip)[2]
        driven |= {k for k in range(len(plots)) if np.sum(patch == k) >= 2}
        for anomaly in made.anomalies[quantity]:
            over = patch[anomaly.cells]
            hits = [
                k
                for k in set(over.tolist())
                if k >= 0 and _more(scenario, quantity, plots[k].soil, around) == (anomaly.difference > 0)
            ]
            listed += 1
            right += bool(hits)
            detected |= {k for k in hits if np.sum(over == k) >= np.sum(patch == k) / 3}
    return {"listed": listed, "right": right, "patches": len(driven), "detected": len(detected & driven)}


def _more(scenario: Scenario, quantity: str, soil: str, around: str) -> bool:
    """Whether a soil has more of a quantity than the soil around."""
    one, other = scenario.soils[soil], scenario.soils[around]
    if quantity == "adhesion":
        return bool(one.curve["a"] > other.curve["a"])
    return one.resistance > other.resistance


def speed() -> tuple[int, float, float]:
    """Rows, seconds and peak memory [MB] from a file of estimates to a GeoPackage."""
    scenario = field_scenario(SEEDS[0])
    result = simulate(scenario, SEEDS[0])
    estimates = estimate(result.recording, result.vehicle)
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for k in range(max(1, int(np.ceil(500_000 / len(estimates))))):
            files.append(Path(folder) / f"drive{k}.parquet")
            estimates.write(files[-1])
        begin = time.perf_counter()
        maker = MapMaker()
        for file in files:
            maker.add(Estimates.read(file), file.stem)
        write_map(maker.finish(), Path(folder) / "map.gpkg")
        taken = time.perf_counter() - begin
    return len(estimates) * len(files), taken, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def table(rows: list[dict[str, Any]], fast: tuple[int, float, float]) -> str:
    """Markdown."""
    lines = [
        "| seed | quantity | 90 % interval holds | mean error | RMS error | median SD |",
        "|---|---|---|---|---|---|",
    ]
    quantities = ("adhesion", "soil_resistance")
    every = {
        "seed": "all cells",
        **{
            name: {key: np.concatenate([row[name][key] for row in rows]) for key in ("error", "std")}
            for name in quantities
        },
    }
    for row in (*rows, every):
        for name in quantities:
            error, std = row[name]["error"], row[name]["std"]
            lines.append(
                f"| {row['seed']} | {name} | {100 * np.mean(np.abs(error) < NORMAL * std):.0f} % | {np.mean(error):+.4f} | "
                f"{np.sqrt(np.mean(error**2)):.4f} | {np.median(std):.4f} |"
            )
    listed, right, patches, detected = (
        sum(row[k] for row in rows) for k in ("listed", "right", "patches", "detected")
    )
    lines += ["", f"Anomalies: {listed} listed, {right} of them on a patch (precision {right / max(listed, 1):.2f}); "
              f"{detected} of {patches} patches "
              f"detected (recall {detected / max(patches, 1):.2f}).",
              f"{fast[0]} rows to a GeoPackage: {fast[1]:.1f} s, {fast[2]:.0f} MB at the peak."]  # fmt: skip
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    text = table([one(seed) for seed in options.seeds], speed())
    print(text)
    if options.write:
        put(DOCUMENT, BEGIN, text)


if __name__ == "__main__":
    main()
