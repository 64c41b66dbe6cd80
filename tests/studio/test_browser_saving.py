"""What Drive and Map show, taken away as PNG, SVG and CSV, in a real browser."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from served import DETAILS, Served
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

SVG = "{http://www.w3.org/2000/svg}"


def saved(page: Any, kind: str, tmp_path: Path) -> Path:
    if not page.is_visible(f"#save-{kind}"):
        page.click("#saving summary")
    with page.expect_download() as waiting:
        page.click(f"#save-{kind}")
    target = tmp_path / waiting.value.suggested_filename
    waiting.value.save_as(target)
    assert target.suffix == f".{kind}"
    return target


def shade(page: Any, name: str) -> str:
    return page.evaluate(
        "n => getComputedStyle(document.documentElement).getPropertyValue(`--${n}`).trim()", name
    )


def count_of(picture: Path, colour: str) -> int:
    from PIL import Image

    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(pixels - wanted).max(axis=2) < 12).sum())


def words_of(drawing: Path) -> list[str]:
    root = ET.parse(drawing).getroot()
    text = drawing.read_text()
    assert "NaN" not in text
    assert "undefined" not in text
    return ["".join(one.itertext()) for one in root.iter(f"{SVG}text")]


def open_drive(page: Any, served: Served, query: str) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet&{query}")
    page.wait_for_selector(".charts[data-rows]")
    page.wait_for_selector("#across-caption:has-text('samples')")


def test_the_charts_are_saved_as_drawings(page: Any, served: Served, folder: Path, tmp_path: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    later = Estimates(table.time + 60, table.columns, table.event_codes, table.labels, table.about)
    later.write(folder / "late.parquet")
    open_drive(
        page,
        served,
        "panels=slip,speed,f.Sum&f.Sum [m]=slip_rl%2Bslip_rr&with=late.parquet&from=10&to=20&over=elapsed",
    )
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 2")
    page.wait_for_function(
        "() => new Set(window.terragripDrive.charts.shown[0].drawn.map(({ trace }) => trace.layer ?? 0)).size === 2"
    )
    words = words_of(saved(page, "svg", tmp_path))
    for wanted in (
        "estimates.parquet, late.parquet",
        "Slip s [%]",
        "Speeds [m/s]",
        "Sum [m]",
        "time since start [s]",
        "estimates rr",
        "late rr",
        "Adhesion µ rr [–]",
    ):
        assert wanted in words, wanted
    picture = saved(page, "png", tmp_path)
    assert count_of(picture, shade(page, "blue")) > 300
    assert count_of(picture, shade(page, "vermillion")) > 300


def test_the_charts_are_saved_as_a_table(page: Any, served: Served, folder: Path, tmp_path: Path) -> None:
    open_drive(page, served, "panels=slip,speed,f.Sum&f.Sum [m]=slip_rl%2Bslip_rr&from=10&to=20&wheels=rr")
    found = pl.read_csv(saved(page, "csv", tmp_path), infer_schema_length=None)
    table = Estimates.read(folder / "estimates.parquet")
    rows = (table.time >= 10) & (table.time <= 20)
    assert found.columns[:4] == ["time [s]", "slip_rr [%]", "slip_rr 95 % low [%]", "slip_rr 95 % high [%]"]
    assert {"ground_speed [m/s]", "measured ground_speed [m/s]", "rim_speed_rr [m/s]", "Sum [m]"} <= set(
        found.columns
    )
    np.testing.assert_array_equal(
        found["time [s]"], table.time[rows]
    )  # every row, thinned or not on the screen
    np.testing.assert_allclose(found["slip_rr [%]"], 100 * table["slip_rr"][rows], rtol=1e-10)
    np.testing.assert_allclose(found["Sum [m]"], (table["slip_rl"] + table["slip_rr"])[rows], rtol=1e-12)
    radius = page.evaluate(
        "async () => (await (await fetch('./api/drive?path=estimates.parquet')).json()).radius.rr"
    )
    np.testing.assert_allclose(
        found["rim_speed_rr [m/s]"], radius * table["wheel_speed_rr"][rows], rtol=1e-10
    )


def open_map(page: Any, served: Served, query: str = "") -> None:
    page.goto(f"{served.url}/#/map?path=estimates.parquet{query}")
    page.wait_for_function("() => window.terragripMap?.map.getSource('track')")
    page.wait_for_selector(".charts[data-rows]")


def test_the_map_is_saved_as_drawings(page: Any, served: Served, folder: Path, tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (8, 8), (120, 160, 90)).save(folder / "field.png")
    open_map(page, served)
    page.wait_for_selector("option[value='field.png']", state="attached")
    page.select_option("select[aria-label='Basemap']", "field.png")
    page.click("text=Place it")  # over all that is shown
    page.wait_for_function("() => window.terragripMap.map.getSource('base')")
    drawing = saved(page, "svg", tmp_path)
    words = words_of(drawing)
    for wanted in ("estimates.parquet", "Slip rr [%]", "longitude [°], WGS 84", "latitude [°]"):
        assert wanted in words, wanted
    assert any(word.endswith(" m") for word in words)  # the scale
    root = ET.parse(drawing).getroot()
    (image,) = root.iter(f"{SVG}image")
    assert image.get("href").startswith("data:image/png;base64,")  # the file stands alone
    lines = page.evaluate("() => window.terragripMap.map.getSource('track').serialize().data.features.length")
    drawn = [p for p in root.iter(f"{SVG}path") if p.get("stroke-width") == "5"]
    assert len(drawn) == lines
    picture = saved(page, "png", tmp_path)
    assert count_of(picture, "#78a05a") > 100_000  # the basemap
    page.select_option("#map-quantity", "soil")
    page.wait_for_selector(".legend-row:has-text('grass')")
    assert "grass" in words_of(saved(page, "svg", tmp_path))


def test_the_scale_of_a_saved_map_is_in_metres(
    page: Any, served: Served, folder: Path, tmp_path: Path
) -> None:
    """The bar against the track: a degree of latitude is 111.2 km on a sphere of the map's radius."""
    open_map(page, served)
    drawing = saved(page, "svg", tmp_path)
    root = ET.parse(drawing).getroot()
    texts = {"".join(t.itertext()): t for t in root.iter(f"{SVG}text")}
    (said,) = [word for word in texts if word.endswith(" m")]
    bar = next(p for p in root.iter(f"{SVG}path") if p.get("stroke-width") == "1.5")
    xs = [float(part.split()[0]) for part in bar.get("d")[1:].split("L")]
    metre = (max(xs) - min(xs)) / float(said.split()[0])
    pixels = page.evaluate(
        "() => { const { map } = window.terragripMap, c = map.getCenter();"
        "return map.project([c.lng, c.lat - 5e-6]).y - map.project([c.lng, c.lat + 5e-6]).y; }"
    )
    assert pixels / (1e-5 * 40_075_016.686 / 360) == pytest.approx(metre, rel=0.01)


def test_the_map_is_saved_as_a_table(page: Any, served: Served, folder: Path, tmp_path: Path) -> None:
    open_map(page, served, "&from=10&to=20")
    page.wait_for_function("() => window.terragripMap.charts.range[0] === 10")
    found = pl.read_csv(saved(page, "csv", tmp_path), infer_schema_length=None)
    table = Estimates.read(folder / "estimates.parquet")
    rows = (table.time >= 10) & (table.time <= 20) & np.isfinite(table["latitude"])
    assert found.columns == ["time [s]", "longitude [deg]", "latitude [deg]", "slip_rr [%]", "soil", "event"]
    np.testing.assert_array_equal(found["time [s]"], table.time[rows])
    np.testing.assert_array_equal(found["latitude [deg]"], table["latitude"][rows])
    np.testing.assert_allclose(found["slip_rr [%]"], 100 * table["slip_rr"][rows], rtol=1e-10)
    assert set(found["soil"]) == {"grass"}


def test_a_curve_does_not_leave_the_axes_of_a_saved_fit(page: Any, served: Served, tmp_path: Path) -> None:
    page.goto(f"{served.url}/#/fit?path=estimates.parquet")
    page.wait_for_selector("#soil-list li")
    with page.expect_download() as waiting:
        page.click("button:text-is('SVG')")
    waiting.value.save_as(tmp_path / "fit.svg")
    root = ET.parse(tmp_path / "fit.svg").getroot()
    clipped = [g for g in root.iter(f"{SVG}g") if g.get("clip-path")]
    assert sum(len(list(g.iter(f"{SVG}circle"))) for g in clipped) > 100
    assert sum(len(list(g.iter(f"{SVG}text"))) for g in clipped) == 0  # labels stand outside


def test_the_whole_run_as_the_file_of_another_program(
    page: Any, served: Served, folder: Path, tmp_path: Path
) -> None:
    """Who wanted a .mat had to leave the studio for a command line; what the page gives is what that command writes."""
    from scipy.io import loadmat

    open_drive(page, served, "panels=slip")
    page.click("#saving summary")
    with page.expect_download() as waiting:
        page.click("#whole-mat")
    assert waiting.value.suggested_filename == "estimates.mat"
    waiting.value.save_as(tmp_path / "estimates.mat")
    slip = loadmat(tmp_path / "estimates.mat")["estimates"]["slip_rr"][0, 0].ravel()
    np.testing.assert_array_equal(slip, Estimates.read(folder / "estimates.parquet")["slip_rr"])
