"""Focus and headings in a real browser: the keyboard's place is kept while controls are drawn anew."""

from __future__ import annotations

from typing import Any

import pytest

from served import NEEDS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = NEEDS

FOCUSED = "() => document.activeElement === document.body ? 'body' : document.activeElement.textContent"


def test_each_page_has_one_heading(page: Any, served: Served) -> None:
    for where in ("start", "drive", "live", "cab", "map", "fit"):
        page.goto(f"{served.url}/#/{where}")
        page.wait_for_function("where => document.querySelector(`main.page-${where} h1`)", arg=where)
        assert page.locator("h1").count() == 1, where
        assert page.inner_text("h1").strip(), where


def test_focus_stays_on_what_is_drawn_anew(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.focus(".chip:text-is('rl')")
    page.keyboard.press("Enter")  # the wheels are drawn anew
    page.wait_for_selector(".chip:text-is('rl')[aria-pressed='false']")
    page.wait_for_function(f"() => ({FOCUSED})() === 'rl'")


def test_focus_leaves_a_button_that_has_nothing_more_to_do(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 20])")
    page.wait_for_selector("#back:not([disabled])")
    page.focus("#back")
    page.keyboard.press("Enter")
    page.wait_for_selector("#back[disabled]")
    page.wait_for_function(f"() => ({FOCUSED})() !== 'body'")


def test_focus_stays_in_the_bar_from_page_to_page(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.focus("nav >> text=Fit")
    page.keyboard.press("Enter")
    page.wait_for_selector("#fit-button")
    assert page.evaluate(FOCUSED) == "Fit"


def test_the_skip_link_goes_into_the_page_and_stays_on_it(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.focus(".skip")
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.activeElement.id === 'main'")
    assert page.title().startswith("Drive")
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.id") == "run"


def test_no_control_hides_below_the_cab_page(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/cab")
    page.wait_for_selector("#cab-age")
    inside = "() => document.activeElement.closest('#main') !== null || document.activeElement.matches('.skip, body')"
    for _ in range(12):
        page.keyboard.press("Tab")
        assert page.evaluate(inside)
