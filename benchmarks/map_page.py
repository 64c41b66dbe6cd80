"""The studio's map page with a large map: a hundred thousand cells, each driven twice, of four quantities."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from studio_session import studio

CELLS = 100_000
FRAMES = """async () => {
  const { map } = window.terragripField, times = [];
  await new Promise((done) => {
    let n = 0, last = performance.now();
    const step = (now) => {
      times.push(now - last);
      last = now;
      if (n++ === 120) return done();
      const { lng, lat } = map.getCenter();
      map.jumpTo({ center: [lng + (n % 2 ? 1e-5 : -1e-5), lat], zoom: map.getZoom() + 0.01 * Math.sin(n / 10) });
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  });
  return times.slice(1).sort((a, b) => a - b);
}"""

CHOSEN = "() => window.terragripField.read().mapped.name === document.getElementById('field-quantity').value"


def fill_map(folder: Path, cells: int = CELLS) -> None:
    """large.gpkg: a square of cells about one place, values by chance."""
    from terragrip.estimation import estimate
    from terragrip.maps import MapSettings, map_of, write_map
    from terragrip.maps.cells import Cells
    from terragrip.maps.changes import Changes
    from terragrip.simulation import Scenario, simulate

    result = simulate(Scenario.load("grass-05"), 1)
    made = map_of([("drive", estimate(result.recording, result.vehicle))], MapSettings(cell=1.0))
    side, rng = int(np.ceil(np.sqrt(cells))), np.random.default_rng(1)
    corner = made.cells["slip"].column.min(), made.cells["slip"].row.min()
    column, row = (x.ravel() for x in np.meshgrid(np.arange(side) + corner[0], np.arange(side) + corner[1]))
    many = len(column)

    def even(value: float | int) -> np.ndarray:
        return np.full(many, value)

    values = {
        name: Cells(
            column, row, rng.normal(0.4, 0.05, many), rng.uniform(0.01, 0.05, many), even(0.01)[:, None], even(20), even(2), even(0),
            even(0.0), even(0.0),
        )
        for name in made.cells
    }  # fmt: skip
    again = {
        name: Changes(
            column, row, even(0.4), even(0.4), rng.normal(0, 0.02, many), even(0.02), rng.uniform(size=many), rng.uniform(size=many) < 0.05,
            even(0), even(0), even(9.0),
        )
        for name in made.cells
    }  # fmt: skip
    write_map(dataclasses.replace(made, cells=values, changes=again), folder / "large.gpkg")


def large_map(chromium: Any) -> list[tuple[str, float, str, str]]:
    """Seconds from opening the map to its cells on the screen, the first time (the file is read) and after another quantity is chosen;
    milliseconds of a frame while it is moved and zoomed."""
    with tempfile.TemporaryDirectory() as folder:
        fill_map(Path(folder))
        with studio(Path(folder)) as (url, _):
            page: Any = chromium.new_page(viewport={"width": 1280, "height": 720})
            page.goto(f"{url}#/map?map=none.gpkg")
            page.wait_for_selector("#map-empty")
            begin = time.monotonic()
            page.select_option("#map-run", "large.gpkg")
            page.wait_for_selector("#map[data-cells]")
            opened = time.monotonic() - begin
            begin = time.monotonic()
            page.select_option("#field-quantity", index=1)
            page.wait_for_function(CHOSEN)
            chosen = time.monotonic() - begin
            frames = page.evaluate(FRAMES)
            page.close()
    name = f"a map of {CELLS} cells"
    return [
        (f"{name}: opened [s]", opened, "< 1", f"{chosen:.2f} for another quantity"),
        (f"{name}: 95 % of frames [ms]", frames[int(0.95 * len(frames))], "< 50", "moved and zoomed at once"),
    ]


if __name__ == "__main__":
    from priority import prefer
    from studio_session import browser

    prefer()
    with browser() as running:
        for figure, value, target, more in large_map(running):
            print(f"{figure:46s} {value:8.2f}  {target:7s} {more}")
