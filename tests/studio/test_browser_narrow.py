"""Pages on telephones and tablets, in a real browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from served import DETAILS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS


def test_the_hint_covers_no_axis(page: Any, served: Served) -> None:
    for width in (390, 768, 1280):
        page.set_viewport_size({"width": width, "height": 844})
        if width == 390:
            page.goto(f"{served.url}/#/drive?path=estimates.parquet")
            page.wait_for_selector(".charts[data-rows]")
            page.wait_for_function("() => document.querySelector('.line').textContent !== ''")
        line, foot = page.locator(".line").bounding_box(), page.locator(".foot").bounding_box()
        assert line["height"] <= foot["height"] + 1, width


def test_drive_scrolls_as_one_on_a_telephone(page: Any, served: Served) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{served.url}/#/drive?path=estimates.parquet&at=20")
    page.wait_for_selector(".why")
    inner = "() => { const e = document.querySelector('.charts'); return e.scrollHeight - e.clientHeight; }"
    assert page.evaluate(inner) <= 1
    page.locator(".sample").scroll_into_view_if_needed()
    assert page.locator(".sample strong").is_visible()
    heights = page.locator(".chart canvas").evaluate_all("all => all.map((e) => e.clientHeight)")
    assert min(heights) > 120


def test_the_cabs_numbers_use_the_screen(page: Any, served: Served) -> None:
    for width, height in ((390, 844), (768, 1024), (1280, 800)):
        page.set_viewport_size({"width": width, "height": height})
        if width == 390:
            page.goto(f"{served.url}/#/cab?replay=estimates.parquet")
            page.wait_for_selector("#cab-age:has-text('ago')")
        size = page.locator(".cab-number").first.evaluate("e => parseFloat(getComputedStyle(e).fontSize)")
        assert size > 0.08 * max(width, height), width
        beyond = "() => { const e = document.querySelector('main'); return e.scrollHeight - e.clientHeight; }"
        assert page.evaluate(beyond) <= 1, width


def test_of_many_logs_the_other_kinds_stay_in_reach(page: Any, served: Served, folder: Path) -> None:
    for i in range(60):
        (folder / f"log-{i:02}.csv").write_text("time,wheel_speed_l\n0,1\n")
    for width, height in ((360, 740), (1280, 720)):
        page.set_viewport_size({"width": width, "height": height})
        page.goto(f"{served.url}/#/start")
        page.wait_for_selector("text=log-59.csv")
        top = page.evaluate("() => document.querySelector('[aria-label=Vehicles]').offsetTop")
        assert top < 3 * height, width
        assert page.locator("#bar").bounding_box()["height"] < 60, width  # one line


def test_a_log_that_takes_long_to_read_shows_that_it_is_read(page: Any, served: Served) -> None:
    held: list[Any] = []
    page.route("**/api/columns?*", lambda route: held.append(route))
    page.goto(f"{served.url}/#/start?log=recording.parquet")
    page.get_by_role("progressbar", name="Reading the log …").wait_for()
    held[0].continue_()
    page.wait_for_selector("#wizard-profile")
    assert page.get_by_role("progressbar", name="Reading the log …").count() == 0
