"""Make docs/images/studio-*.png: every page of the studio, light and dark, on a simulated run; given names, only those.

Needs chromium and the built pages.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import terragrip as tg
from studio_session import browser, fill, studio

IMAGES = Path(__file__).parent / "images"


def drive(page: Any) -> None:
    page.wait_for_selector(".charts[data-rows]")
    page.locator(".u-over").first.click(position={"x": 560, "y": 40})
    page.wait_for_selector(".why")


def honesty(page: Any) -> None:
    page.evaluate(
        '() => localStorage.setItem(\'terragrip-drive-panels\', \'["adhesion","nis","supervisor","adaptation"]\')'
    )
    page.reload()
    drive(page)
    page.evaluate("() => localStorage.removeItem('terragrip-drive-panels')")


def live(page: Any) -> None:
    page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 4500", timeout=60_000)


def fit(page: Any) -> None:
    page.wait_for_selector("#soil-list li")
    page.click("#fit-button")
    page.wait_for_selector(".badge")


def map_page(page: Any) -> None:
    page.wait_for_function("() => window.terragripMap?.map.getSource('track')")


def field(page: Any) -> None:
    page.wait_for_selector("#map[data-cells]")
    page.select_option("#field-quantity", "soil_resistance")  # whose patches are anomalies
    page.wait_for_selector(".anomalies li")
    page.focus(".maplibregl-canvas")
    page.keyboard.press("ArrowRight")


def start(page: Any) -> None:
    page.wait_for_selector("h1")


def machine(page: Any) -> None:
    page.set_viewport_size({"width": 1280, "height": 900})
    page.wait_for_selector("#machine-class option[value='tractor-4wd']", state="attached")
    page.select_option("#machine-class", "tractor-4wd")
    page.wait_for_selector("#machine-mass")
    page.fill("#machine-mass", "6.2 t")
    page.fill("#machine-wheel_radius", "0.83 m")
    page.wait_for_selector("text=by tape, not calibrated")


def shrink(picture: bytes, target: Path) -> None:
    """A palette of 256 colours is enough for a page, at a third of the size; chosen so that small patches and pale tints keep theirs."""
    whole = Image.open(io.BytesIO(picture)).convert("RGB")
    whole.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=0).save(target, optimize=True)


PAGES = {
    "start": ("", start),
    "machine": ("#/start?machine", machine),
    "drive": ("#/drive?path={run}", drive),
    "honesty": ("#/drive?path=multi2-aukf-fs.parquet", honesty),
    "live": ("#/live?replay={run}&speed=5", live),
    "map": ("#/map?path={run}", map_page),
    "field": ("#/map?map=field.gpkg", field),
    "fit": ("#/fit?path={run}", fit),
}


def field_of(folder: Path) -> None:
    """field.gpkg: a simulated field with patches of other soils, driven on two days."""
    from bench_maps import field_scenario
    from terragrip.maps import MapSettings, map_of, write_map

    scenario = field_scenario(7000)
    days = []
    for seed, day in ((7000, "monday"), (7001, "friday")):
        result = tg.simulate(scenario, seed)
        days.append((day, tg.estimate(result.recording, result.vehicle)))
    write_map(map_of(days, MapSettings(cell=1.0)), folder / "field.gpkg")


def main() -> None:
    with tempfile.TemporaryDirectory() as made, browser() as chromium:
        folder = Path(made) / "field-days"
        folder.mkdir()
        fill(folder)
        recording, vehicle = tg.read(folder / "multi2.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
        tg.estimate(recording, vehicle, "aukf-fs").write(folder / "multi2-aukf-fs.parquet")
        field_of(folder)
        run = next(folder.glob("*-estimates.parquet")).name
        with studio(folder) as (url, _):
            for theme in ("light", "dark"):
                for name in sys.argv[1:] or PAGES:
                    place, work = PAGES[name]
                    page = chromium.new_page(viewport={"width": 1280, "height": 720}, color_scheme=theme)
                    page.goto(url + place.format(run=run))
                    work(page)
                    page.wait_for_timeout(1500)
                    shrink(page.screenshot(), IMAGES / f"studio-{name}-{theme}.png")
                    page.close()


if __name__ == "__main__":
    main()
