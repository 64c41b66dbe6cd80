"""The choice of units in a real browser: one choice for all pages, and nothing but what is shown depends on it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from live_service import listened_to
from served import DETAILS, Served
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS


def choose(page: Any, **units: str) -> None:
    if not page.locator("#units").evaluate("e => e.open"):
        page.click("summary:text-is('Units')")
    for kind, name in units.items():
        page.select_option(f"#unit-{kind}", name)


def test_drive_shows_the_chosen_units_and_keeps_them(page: Any, served: Served, folder: Path) -> None:
    query = "path=estimates.parquet&from=10&to=12&panels=slip,speed,load&wheels=rl,rr"
    page.goto(f"{served.url}/#/drive?{query}")
    page.wait_for_function("() => Number(document.querySelector('.charts')?.dataset.rows) < 1000")
    choose(page, share="–", speed="km/h", force="kN")
    page.keyboard.press("Escape")
    assert not page.locator("#units").evaluate("e => e.open")
    heads = " ".join(page.locator(".chart-head h2").all_inner_texts())
    assert all(f"[{unit}]" in heads for unit in ("–", "km/h", "kN"))
    table = Estimates.read(folder / "estimates.parquet")
    for _ in range(2):  # and again after a reload
        page.wait_for_function("() => document.querySelector('.chart-head')?.textContent.includes('[–]')")
        page.wait_for_function("() => Number(document.querySelector('.charts')?.dataset.rows) < 1000")
        box = page.locator(".u-over").first.bounding_box()
        page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 40)
        page.wait_for_function("() => document.querySelector('.value').textContent !== ''")
        at = page.evaluate(
            "() => { const r = window.terragripDrive.charts.range; return r[0] + 0.4 * (r[1] - r[0]); }"
        )
        row = int(np.argmin(np.abs(table.time - at)))
        first = [
            float(page.inner_text(f".chart >> nth={i} >> .value >> nth=0").split(" ± ")[0]) for i in range(3)
        ]
        load = next(name for name in table.columns if name.startswith("vertical_load_"))
        wanted = [table["slip_rl"][row], 3.6 * table["ground_speed"][row], table[load][row] / 1000]
        np.testing.assert_allclose(first, wanted, rtol=0.03)
        page.reload()


def test_a_sample_says_its_units(page: Any, served: Served, folder: Path) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet&at=20")
    page.wait_for_selector(".why")
    table = Estimates.read(folder / "estimates.parquet")
    row = int(np.argmin(np.abs(table.time - 20)))
    cells = ".sample tr:has(th:text-is('ground_speed')) >> nth=0 >> td"
    assert page.inner_text(f"{cells} >> nth=2") == "m/s"
    choose(page, speed="km/h")
    assert page.inner_text(f"{cells} >> nth=2") == "km/h"
    assert float(page.inner_text(f"{cells} >> nth=0")) == pytest.approx(
        3.6 * table["ground_speed"][row], rel=1e-3
    )


def test_a_link_shows_the_same_axis_in_other_units(page: Any, served: Served) -> None:
    link = f"{served.url}/#/drive?path=estimates.parquet&panels=speed&y.speed=0,2"
    page.goto(link)
    page.wait_for_selector(".charts[data-rows]")
    scale = "() => window.terragripDrive.charts.scale(0)"
    assert page.evaluate(scale) == [0, 2]
    choose(page, speed="km/h")
    page.wait_for_function(f"() => ({scale})()[1] > 2")
    assert page.evaluate(scale) == pytest.approx([0, 7.2])
    page.wait_for_function("() => location.hash.includes('y.speed=0,2')")


def test_map_fit_and_another_tab_follow(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/map?path=estimates.parquet&quantity=ground_speed")
    page.wait_for_selector(".legend-row:has-text('m/s')")
    other = page.context.new_page()
    other.goto(f"{served.url}/#/fit?path=estimates.parquet")
    other.wait_for_selector("#soil-list li")
    svg = "() => window.terragripFit.plot.svg()"
    assert "slip s [%]" in other.evaluate(svg)

    def ends() -> list[float]:
        return [float(x) for x in re.findall(r"-?[0-9.]+", page.inner_text(".legend-row span >> nth=1"))]

    before = ends()
    choose(other, share="–", speed="km/h")
    page.wait_for_selector(".legend-row:has-text('km/h')")
    assert ends() == pytest.approx([3.6 * v for v in before], rel=0.01)
    assert "slip s [–]" in other.evaluate(svg)
    other.close()


def test_live_and_cab_follow_and_an_alarm_stays_where_it_was_set(page: Any, served: Served) -> None:
    with listened_to(served):  # 20 % of slip at 1.5 m/s
        page.goto(f"{served.url}/#/live")
        page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 10")
        page.click("summary:text-is('Alarms')")
        page.fill("#alarm-slip", "30")
        page.press("#alarm-slip", "Tab")
        choose(page, share="–", speed="km/h")
        page.wait_for_selector(".tile:has-text('Speed') .big:text-is('5.4')")
        assert page.inner_text(".tile:has-text('Speed') .unit") == "km/h"
        assert page.inner_text(".tile:has-text('Slip') .big") == "0.20"
        assert page.input_value("#alarm-slip") == "0.3"
        assert page.is_hidden(".alarm")
        page.goto(f"{served.url}/#/cab")
        page.wait_for_selector("#cab-age:has-text('ago')")
        assert page.locator(".cab-number").all_inner_texts()[::2] == ["0.20", "5.4"]
        assert page.locator(".cab-tile h2").all_inner_texts()[2] == "Speed [km/h]"
        page.click("summary:text-is('Alarms')")
        page.fill("#alarm-slip", "0.15")
        page.press("#alarm-slip", "Tab")
        page.wait_for_selector(".alarm:has-text('Slip 0.20 is over 0.15')")
        choose(page, share="%")
        page.wait_for_selector(".alarm:has-text('Slip 20 % is over 15 %')")
