"""The map in a real browser: uncertainty, the brushed stretch, unlabelled ground, outliers, the basemap that is remembered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from served import DETAILS, Served, leave
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

FEATURES = "id => window.terragripMap.map.getSource(id).serialize().data.features"


def open_map(page: Any, served: Served, query: str = "path=estimates.parquet") -> None:
    page.goto(f"{served.url}/#/map?{query}")
    page.wait_for_function("() => window.terragripMap?.map.getSource('track')")
    page.wait_for_selector(".charts[data-rows]")


def test_what_is_uncertain_is_paler(page: Any, served: Served, folder: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    std = np.full(len(table), 1e-4)
    std[table.time > 20] = 1.0  # nothing is known there
    table.columns["slip_rr_std"] = std
    table.write(folder / "doubt.parquet")
    open_map(page, served, "path=doubt.parquet")
    inks = f"() => [...new Set(({FEATURES})('track').map((f) => f.properties.ink))].sort()"
    assert page.evaluate(inks) == [1]
    page.check("#map-doubt")
    page.wait_for_function(f"() => ({inks})().length === 2")
    assert page.evaluate(inks) == pytest.approx([0.2, 1])
    paint = page.evaluate("() => window.terragripMap.map.getPaintProperty('track', 'line-opacity')")
    assert "ink" in str(paint)


def test_the_brushed_stretch_is_that_of_the_times_shown(page: Any, served: Served, folder: Path) -> None:
    open_map(page, served)
    page.wait_for_function("() => window.terragripMap.map.getSource('brushed')")
    assert page.evaluate(FEATURES, "brushed") == []
    page.evaluate("() => window.terragripMap.charts.zoom([10, 20])")
    page.wait_for_function(f"() => ({FEATURES})('brushed').length === 1")
    line = page.evaluate(FEATURES, "brushed")[0]["geometry"]["coordinates"]
    table = Estimates.read(folder / "estimates.parquet")
    for place, time in ((line[0], 10.0), (line[-1], 20.0)):
        row = int(np.searchsorted(table.time, time))
        assert place == pytest.approx([table["longitude"][row], table["latitude"][row]], abs=1e-7)
    page.evaluate("() => window.terragripMap.charts.zoom(window.terragripMap.charts.whole)")
    page.wait_for_function(f"() => ({FEATURES})('brushed').length === 0")


def test_unlabelled_ground_has_a_colour_of_its_own(page: Any, served: Served, folder: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    labels = table.labels["soil"].astype(object).copy()
    labels[table.time > 20] = ""
    table.labels["soil"] = labels.astype(str)
    table.write(folder / "part.parquet")
    open_map(page, served, "path=part.parquet&quantity=soil")
    shades = f"() => [...new Set(({FEATURES})('track').map((f) => f.properties.shade))]"
    page.wait_for_function(f"() => ({shades})().length === 2")
    neutral = page.evaluate(
        "() => getComputedStyle(document.documentElement).getPropertyValue('--line').trim()"
    )
    assert neutral in page.evaluate(shades)
    assert "unlabelled" in page.inner_text(".legend-row")


def test_outliers_are_named(page: Any, served: Served, folder: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    slip = table["slip_rr"].copy()
    slip[-5:] = 7.5
    table.columns["slip_rr"] = slip
    table.write(folder / "wild.parquet")
    open_map(page, served, "path=wild.parquet")
    page.wait_for_selector(".legend-row:has-text('above, to 750 %')")


def test_a_basemap_is_remembered_where_it_was_laid(page: Any, served: Served, folder: Path) -> None:
    from PIL import Image

    Image.new("RGB", (8, 8), (120, 160, 90)).save(folder / "field.png")
    open_map(page, served)
    page.wait_for_selector("option[value='field.png']", state="attached")
    page.select_option("select[aria-label='Basemap']", "field.png")
    page.fill("#edge-north", "50.5")
    page.click("text=Place it")
    page.wait_for_function("() => window.terragripMap.map.getSource('base')")
    leave(page)
    open_map(page, served)
    page.wait_for_function("() => window.terragripMap.map.getSource('base')")
    assert page.evaluate("() => window.terragripMap.map.getSource('base').coordinates[0][1]") == 50.5
    assert page.locator("dialog").count() == 0  # not asked again
    page.click("#map-edges")  # but it can be laid anew
    assert page.input_value("#edge-north") == "50.500000"
