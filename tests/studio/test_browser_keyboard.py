"""Focus and headings in a real browser: the keyboard's place is kept while controls are drawn anew."""

from __future__ import annotations

from typing import Any

import pytest

from served import DETAILS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

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


def test_a_link_to_another_page_leads_to_its_heading(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/start")
    page.focus("a >> text=estimates.parquet")
    page.keyboard.press("Enter")
    page.wait_for_selector(".charts[data-rows]")
    assert page.evaluate(FOCUSED) == "Drive"
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.id") == "run"


def test_a_menu_folds_in_when_the_focus_leaves_it(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.focus("summary >> text=Panels")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.locator("details.chooser[open]").count() == 1
    page.get_by_label("Soil resistance").first.focus()
    page.keyboard.press("Space")  # the boxes are drawn anew
    page.wait_for_selector(".charts h2:has-text('Soil resistance')", state="detached")
    assert page.evaluate("() => document.activeElement.labels[0].textContent").startswith("Soil resistance")
    assert page.locator("details.chooser[open]").count() == 1
    page.locator("details.chooser[open] .check").first.hover()
    page.mouse.down()  # on a label, as slowly as by hand
    assert page.locator("details.chooser[open]").count() == 1
    page.mouse.up()
    page.focus("#run")
    assert page.locator("details.chooser[open]").count() == 0


def test_the_dialog_of_a_command_and_its_fields_have_names(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/start")
    page.click("button >> text=Report")
    assert page.get_by_role("dialog", name="Write a report: estimates.parquet").is_visible()
    assert page.get_by_label("Title").input_value() == "Traction report"
