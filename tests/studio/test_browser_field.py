"""The cells of a map in a real browser: what is drawn is what the file holds; layers, areas, anomalies, the keyboard, empty states."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from served import DETAILS, Served, axe_violations

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
geopandas = pytest.importorskip("geopandas", reason="maps need terragrip[geo]")
pytestmark = DETAILS

PICKED = """() => {
  const { read, picked } = window.terragripField;
  const i = picked();
  return i === null ? null : [read().cells.column[i], read().cells.row[i]];
}"""
SHADE = """([column, row]) => {
  const { pixelOf, ink } = window.terragripField;
  const [x, y] = pixelOf(column, row).map((v) => Math.round(v * devicePixelRatio));
  return [...ink.getContext('2d').getImageData(x, y, 1, 1).data];
}"""
INKS = """() => {
  const { cells, painting } = window.terragripField.read();
  return Array.from({ length: cells.count }, (_, i) => painting.paint(i)[1]);
}"""


@pytest.fixture
def folder(folder: Path, field_maps: Path) -> Path:
    """The studio's folder with maps in it."""
    for file in field_maps.iterdir():
        shutil.copy(file, folder)
    return folder


def open_map(page: Any, served: Served, query: str = "map=field.gpkg") -> None:
    page.goto(f"{served.url}/#/map?{query}")
    page.wait_for_selector("#map[data-cells]")


def drawn(page: Any, count: int) -> None:
    page.wait_for_selector(f"#map[data-cells='{count}']")


def cells_of(folder: Path, name: str = "field.gpkg") -> Any:
    frame = geopandas.read_file(folder / name, layer="cells")
    frame["column"], frame["row"] = (np.rint(frame.geometry.bounds[k]).astype(int) for k in ("minx", "miny"))
    return frame


def test_a_cell_is_read_by_pointer_and_by_keyboard(page: Any, served: Served, folder: Path) -> None:
    open_map(page, served)
    frame = cells_of(folder)
    drawn(page, int(frame.adhesion.notna().sum()))
    seen = frame[frame.adhesion.notna()]
    wanted = seen[seen.row == frame.row.min() + 5].iloc[20]
    place = [int(wanted.column), int(wanted.row)]
    box = page.locator("#map").bounding_box()
    x, y = page.evaluate("p => window.terragripField.pixelOf(...p)", place)
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.wait_for_selector(f".line:has-text('{wanted['count']} rows')")
    said = page.inner_text(".line")
    value, std = re.search(r"slip ([-\d.]+) ± ([\d.]+) \(SD\)", said).groups()
    assert float(value) == pytest.approx(wanted.adhesion, abs=0.6 * 10.0 ** -len(value.split(".")[1]))
    assert float(std) == pytest.approx(wanted.adhesion_std, rel=0.06)
    assert f"{wanted.passes} passes" in said
    page.mouse.click(box["x"] + x, box["y"] + y)
    assert page.evaluate(PICKED) == place
    page.keyboard.press("ArrowRight")
    right = page.evaluate(PICKED)
    assert right == [place[0] + 1, place[1]]
    rows = int(frame["count"][(frame.column == right[0]) & (frame.row == right[1])].iloc[0])
    assert f"{rows} rows" in page.inner_text(".line")
    for _ in range(8):
        page.keyboard.press("ArrowDown")
    assert page.evaluate(PICKED)[1] == frame.row.min()  # to the edge and no further
    last = page.evaluate(PICKED)
    page.wait_for_function("cell => location.hash.includes(`cell=${cell}`)", arg=f"{last[0]},{last[1]}")
    page.reload()
    page.wait_for_selector(".line:has-text('(SD)')")
    assert page.evaluate(PICKED) == last


def test_colours_are_lighter_where_there_is_more_and_fainter_where_less_is_known(
    page: Any, served: Served, folder: Path
) -> None:
    open_map(page, served, "map=field.gpkg&fade=0")
    frame = cells_of(folder).dropna(subset="adhesion")
    order = frame.sort_values("adhesion")
    lightness = []
    for at in (5, len(order) // 2, -5):
        one = order.iloc[at]
        red, green, blue, ink = page.evaluate(SHADE, [int(one.column), int(one.row)])
        assert ink == 255
        lightness.append(0.2126 * red + 0.7152 * green + 0.0722 * blue)
    assert lightness == sorted(lightness)
    assert lightness[-1] > lightness[0] + 50
    page.check("#field-fade")
    page.wait_for_function("() => !location.hash.includes('fade=0')")
    ink = np.array(page.evaluate(INKS))
    assert ink.min() >= 0.2
    assert np.all(np.diff(ink[np.argsort(frame.adhesion_std.to_numpy())]) <= 1e-9)
    assert "95 % interval" in page.inner_text(".legend-row")


def test_the_change_layer_shows_significance(page: Any, served: Served, folder: Path) -> None:
    open_map(page, served, "map=field.gpkg&layer=change")
    changes = geopandas.read_file(folder / "field.gpkg", layer="changes")
    changes = changes[changes.quantity == "adhesion"]
    drawn(page, len(changes))
    inks = page.evaluate(INKS)
    assert sum(ink == 1 for ink in inks) == int(changes.significant.sum())
    assert sum(ink == pytest.approx(0.3) for ink in inks) == int((~changes.significant).sum())
    legend = page.inner_text(".legend-row")
    assert f"{int(changes.significant.sum())} of {len(changes)} cells driven again changed" in legend
    assert "monday → friday" in page.inner_text("#field-panel")


def test_every_layer_draws_every_cell(page: Any, served: Served, folder: Path) -> None:
    frame = cells_of(folder)
    layers = ("std", "passes", "count", "headland", "soil")
    open_map(page, served, "map=field.gpkg&quantity=soil_resistance&layer=std")
    legends = set()
    for layer in layers:
        page.select_option("#field-layer", layer)
        page.wait_for_function("name => location.hash.includes(`layer=${name}`)", arg=layer)
        drawn(page, int(frame.soil_resistance.notna().sum()))
        legends.add(page.inner_text(".legend-row").strip())
    assert len(legends - {""}) == len(layers)


def test_the_headland_is_shown_apart(page: Any, served: Served, folder: Path) -> None:
    frame = cells_of(folder).dropna(subset="adhesion")
    inside = frame.headland > 0.5
    open_map(page, served)
    page.select_option("#field-area", "headland")
    drawn(page, int(inside.sum()))
    page.select_option("#field-area", "field")
    drawn(page, int((~inside).sum()))
    said = page.inner_text(".areas")
    for where in (inside, ~inside):
        assert f"{np.median(frame.adhesion[where]):.3g}" in said


def test_anomalies_are_listed_and_shown(page: Any, served: Served, folder: Path) -> None:
    frame = geopandas.read_file(folder / "field.gpkg", layer="anomalies")
    frame = frame[frame.quantity == "adhesion"]
    open_map(page, served)
    lines = page.locator("#anomalies li")
    assert lines.count() == len(frame) >= 2
    first, degrees = frame.iloc[0], frame.to_crs(4326).iloc[0].geometry
    said = lines.first.inner_text()
    assert f"{first.area:g} m²" in said
    assert f"{first.difference:.2f}"[:4] in said
    assert f"± {1.96 * first.difference_std:.1g}"[:5] in said
    page.click("#anomalies button")
    centre = page.evaluate("() => window.terragripField.map.getCenter().toArray()")
    assert np.hypot(*(np.subtract(centre, [degrees.centroid.x, degrees.centroid.y]))) < 3e-5
    column, row = page.evaluate(PICKED)
    assert first.geometry.buffer(1.0).contains(geopandas.points_from_xy([column + 0.5], [row + 0.5])[0])


def test_a_single_pass_says_that_there_is_no_change(page: Any, served: Served) -> None:
    open_map(page, served, "map=once.gpkg&layer=change")
    assert page.input_value("#field-layer") == "value"
    assert page.locator("#field-layer option[value='change']").is_disabled()
    assert "driven once" in page.inner_text("#field-panel")


def test_a_run_without_positions_says_what_to_do(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/map?path=nowhere.parquet")
    page.wait_for_selector("#map-empty")
    assert "choose its columns for latitude and longitude" in page.inner_text("#map-empty")
    assert page.is_disabled("#map-make")
    page.select_option("#map-run", "monday.parquet")
    page.wait_for_selector("#map-empty", state="detached")
    page.wait_for_selector("#map-make:enabled")


def test_a_map_that_is_gone_opens_no_other(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/map?map=none.gpkg")
    page.wait_for_selector("#map-empty:has-text('none.gpkg')")
    page.select_option("#map-run", "once.gpkg")
    page.wait_for_selector("#map[data-cells]")
    assert page.locator("#map-empty").count() == 0


def test_what_is_shown_is_saved(page: Any, served: Served, folder: Path, tmp_path: Path) -> None:
    frame = cells_of(folder).dropna(subset="slip")
    open_map(page, served, "map=field.gpkg&quantity=slip")
    page.click("#saving summary")
    for kind in ("csv", "svg"):
        with page.expect_download() as saved:
            page.click(f"#save-{kind}")
        saved.value.save_as(tmp_path / f"map.{kind}")
    rows = list(csv.DictReader((tmp_path / "map.csv").open()))
    assert len(rows) == len(frame)
    np.testing.assert_allclose([float(row["slip [%]"]) for row in rows], 100 * frame.slip, rtol=1e-5)
    np.testing.assert_allclose([float(row["east [m] EPSG:32633"]) for row in rows], frame.column + 0.5)
    drawing = (tmp_path / "map.svg").read_text(encoding="utf-8")
    assert "Slip [%]" in drawing
    assert "data:image/png" in drawing


def test_the_way_is_drawn_when_it_is_asked_for(page: Any, served: Served) -> None:
    open_map(page, served, "map=once.gpkg&fade=0")
    before = page.evaluate("() => window.terragripField.ink.toDataURL()")
    with page.expect_response(lambda answer: "/api/map/way" in answer.url):
        page.check("#field-way")
    page.wait_for_function("before => window.terragripField.ink.toDataURL() !== before", arg=before)


def test_axe_finds_nothing(page: Any, served: Served) -> None:
    """No violation of any weight, and nothing wider than the screen."""
    faults = []
    for where, ready, themes, width in (
        ("path=nowhere.parquet", "#map-empty", ("light",), 390),
        ("map=field.gpkg&layer=soil", "#map[data-cells]", ("light",), 390),
        ("map=none.gpkg", "#map-empty:has-text('none.gpkg')", ("light", "dark"), 1280),
        ("map=field.gpkg&layer=change", "#map[data-cells]", ("light", "dark"), 1280),
    ):
        page.set_viewport_size({"width": width, "height": 720})
        page.goto(f"{served.url}/#/map?{where}")
        page.wait_for_selector(ready, state="attached")
        faults += [(where, width, theme, fault) for theme in themes for fault in axe_violations(page, theme)]
        wide = page.evaluate("() => document.documentElement.scrollWidth")
        faults += [(where, width, "wide", wide)] if wide > width else []
    assert faults == []
