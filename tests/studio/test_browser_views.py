"""Values at the cursor, the picked sample, events, views to go back to, links and layouts, in a real browser."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from served import DETAILS, Served, leave
from terragrip.estimation import Estimates
from terragrip.ground.events import events

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

PLACE = """() => {
  const { map } = window.terragripMap;
  const p = map.project(map.getSource('track').serialize().data.features[40].geometry.coordinates[0]);
  const b = map.getContainer().getBoundingClientRect();
  return [b.x + p.x, b.y + p.y];
}"""
"""Where a part of the track lies on the screen."""
CUT = """() => {
  const e = document.querySelector('.line');
  return e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1;
}"""
RANGE = "() => window.terragripDrive.charts.range"


def open_drive(page: Any, served: Served, query: str = "path=estimates.parquet") -> None:
    page.goto(f"{served.url}/#/drive?{query}")
    page.wait_for_selector(".charts[data-rows]")


def cursor_time(page: Any) -> float:
    page.wait_for_selector(".line:has-text('t ')")
    return float(re.search(r"t ([0-9.]+) s", page.inner_text(".line")).group(1))


def test_values_under_the_cursor_are_those_of_the_file(page: Any, served: Served, folder: Path) -> None:
    open_drive(page, served, "path=estimates.parquet&from=10&to=12&panels=slip,speed&wheels=rl,rr")
    page.wait_for_function("() => Number(document.querySelector('.charts').dataset.rows) < 1000")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 40)
    page.wait_for_function("() => document.querySelector('.value').textContent !== ''")
    table = Estimates.read(folder / "estimates.parquet")
    time = table.time
    at = page.evaluate(
        "() => { const r = window.terragripDrive.charts.range; return r[0] + 0.4 * (r[1] - r[0]); }"
    )
    row = int(np.argmin(np.abs(time - at)))
    value, spread = (float(text) for text in page.inner_text(".value >> nth=1").split(" ± "))
    nearby = 100 * table["slip_rr"][row - 1 : row + 2]
    assert nearby.min() * (1 - 0.006) <= value <= nearby.max() * (1 + 0.006)
    assert spread == pytest.approx(196 * table["slip_rr_std"][row], rel=0.1)
    # every chart has its own, in its own unit
    speeds = page.locator(".chart >> nth=1").locator(".value").all_inner_texts()
    assert float(speeds[0].split(" ± ")[0]) == pytest.approx(table["ground_speed"][row], rel=0.02)
    page.mouse.move(5, 5)
    page.wait_for_function("() => document.querySelector('.value').textContent === ''")


def test_the_cursor_is_one_on_drive_and_map_both_ways(page: Any, served: Served) -> None:
    open_drive(page, served)
    other = page.context.new_page()
    other.goto(f"{served.url}/#/map?path=estimates.parquet")
    other.wait_for_function("() => window.terragripMap?.map.getSource('track')")
    other.wait_for_selector(".charts[data-rows]")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 40)
    wanted = cursor_time(page)
    near = """t => Math.abs(parseFloat(document.querySelector('.line').textContent.slice(2)) - t) < 0.15"""
    other.wait_for_function(near, arg=wanted)
    assert "%" in other.inner_text(".line")  # and the value there
    place = other.evaluate(PLACE)
    other.mouse.move(*place)
    other.wait_for_function(f"t => !({near})(t)", arg=wanted)
    moved = cursor_time(other)
    page.wait_for_function(near, arg=moved)
    assert other.inner_text(".value >> nth=0") != ""  # the chart below the map follows the map
    other.close()


def test_the_picked_sample_is_marked_and_is_in_the_link(page: Any, served: Served) -> None:
    open_drive(page, served)
    count = """() => { const canvas = document.querySelector(".chart canvas");
      const ink = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
      const rgb = [1, 3, 5].map((k) => parseInt(ink.slice(k, k + 2), 16));
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let n = 0; for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && rgb.every((c, k) => Math.abs(data[i + k] - c) < 12)) n++;
      return n; }"""
    before = page.evaluate(count)
    page.locator(".u-over").first.click(position={"x": 200, "y": 30})
    page.wait_for_selector(".why")
    page.wait_for_function(f"n => ({count})() > n", arg=before + 60)  # an upright line through the chart
    picked = page.inner_text(".sample strong")
    page.wait_for_function("() => location.hash.includes('at=')")
    link = page.url
    leave(page)
    page.goto(link)
    page.wait_for_selector(".why")
    assert page.inner_text(".sample strong") == picked


def test_a_link_opens_the_same_view(page: Any, served: Served) -> None:
    open_drive(page, served)
    page.click(".chip:text-is('rl')")
    page.click("summary:text-is('Panels')")
    page.uncheck("label:has-text('Adhesion')")
    page.evaluate(
        "() => { const { charts } = window.terragripDrive; charts.zoom([10, 20]); charts.setUpright('slip', [-0.05, 0.4]); }"
    )
    page.wait_for_function(
        "() => location.hash.includes('y.slip=-0.05,0.4') && location.hash.includes('from=10')"
    )
    link = page.url
    page.evaluate("() => localStorage.clear()")
    leave(page)
    page.goto(link)
    page.wait_for_function(f"() => ({RANGE})().join() === '10,20'")
    assert page.locator(".chip[aria-pressed='true']").all_inner_texts() == ["rr"]
    assert "Adhesion" not in " ".join(page.locator(".chart h2").all_inner_texts())
    assert page.evaluate("() => window.terragripDrive.charts.scale(0)") == [-5, 40]


def test_views_are_gone_back_to(page: Any, served: Served) -> None:
    open_drive(page, served)
    whole = page.evaluate(RANGE)
    assert page.is_disabled("#back")
    for view in ([10, 30], [15, 20]):
        page.evaluate("v => window.terragripDrive.charts.zoom(v)", view)
        page.wait_for_selector("#back:not([disabled])")  # the view has stood for long enough to count
    page.click("#back")
    assert page.evaluate(RANGE) == [10, 30]
    page.focus(".charts")
    page.keyboard.press("Backspace")
    assert page.evaluate(RANGE) == whole
    page.click("#forward")
    assert page.evaluate(RANGE) == [10, 30]


def test_an_upright_axis_is_zoomed_and_follows_again(page: Any, served: Served) -> None:
    open_drive(page, served, "path=estimates.parquet&panels=slip,speed")
    scale = "i => window.terragripDrive.charts.scale(i)"
    page.wait_for_function(f"() => ({scale})(0)[1] > 10")
    first, second = page.evaluate(scale, 0), page.evaluate(scale, 1)
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] - 20, box["y"] + box["height"] / 2)
    page.mouse.wheel(0, -400)
    page.wait_for_function(
        f"w => {{ const s = ({scale})(0); return s[1] - s[0] < 0.8 * w; }}", arg=first[1] - first[0]
    )
    assert page.evaluate(scale, 1) == second  # the others stay
    page.hover(".chart >> nth=0")
    page.click("button[aria-label='auto: Fit the vertical axis of Slip s']")
    page.wait_for_function(f"s => ({scale})(0).join() === s.join()", arg=first)


def test_events_are_gone_through(page: Any, served: Served, folder: Path) -> None:
    known = events(Estimates.read(folder / "estimates.parquet"))
    open_drive(page, served)
    assert page.locator(".events li").count() == len(known)
    page.click("button[aria-label='Next event']")
    page.wait_for_selector(".sample strong")
    first = min(event.start for event in known)
    assert float(re.search(r"[0-9.]+", page.inner_text(".sample strong")).group()) == pytest.approx(
        first, abs=0.02
    )
    low, high = page.evaluate(RANGE)
    assert low <= first <= high
    if len(known) > 1:
        page.click("button[aria-label='Next event']")
        assert (
            page.locator(".events li.chosen").evaluate("e => [...e.parentElement.children].indexOf(e)") == 1
        )


def test_a_press_is_not_lost_where_a_caption_arrives(page: Any, served: Served) -> None:
    """The plane's caption takes lines above the list of events: not while something below is pressed."""
    held: list[Any] = []
    page.route(lambda url: "/drive/pairs" in url, lambda route: held.append(route))
    with page.expect_request(lambda request: "/drive/pairs" in request.url):
        open_drive(page, served)
    box = page.locator("button[aria-label='Next event']").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    for route in held:
        route.continue_()
    page.wait_for_selector("[data-pairs]:not([data-pairs='0'])")
    page.mouse.up()
    page.wait_for_selector(".sample strong")
    page.wait_for_selector("#across-caption:has-text('samples')")


def test_the_reason_of_an_event_is_read_whole(page: Any, served: Served, folder: Path) -> None:
    page.set_viewport_size({"width": 768, "height": 720})
    open_drive(page, served)
    page.evaluate("() => { document.querySelector('.line').value = 'word '.repeat(80) + 'end'; }")
    assert not page.evaluate(CUT)


def test_a_layout_is_kept_by_name(page: Any, served: Served) -> None:
    open_drive(page, served, "path=estimates.parquet&panels=nis&wheels=rl")
    page.click("summary:text-is('Layouts')")
    page.fill("#layout-name", "honesty")
    page.keyboard.press("Enter")
    page.wait_for_selector("#layouts button:text-is('honesty')")
    leave(page)
    open_drive(page, served, "path=estimates.parquet&panels=slip,speed&wheels=rr")
    assert page.locator(".chart").count() == 2
    page.click("summary:text-is('Layouts')")
    page.click("#layouts button:text-is('honesty')")
    page.wait_for_function("() => document.querySelectorAll('.chart').length === 1")
    assert "NIS" in page.inner_text(".chart h2")
    assert page.locator(".chip[aria-pressed='true']").all_inner_texts() == ["rl"]
