"""The live page in a real browser: a dead source must show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from live_service import listened_to
from served import NEEDS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = NEEDS


def test_a_dead_source_shows_on_the_live_page(page: Any, served: Served) -> None:
    with listened_to(served) as service:
        page.goto(f"{served.url}/#/live")
        page.wait_for_selector("#live-state:text-is('connected')")
        page.wait_for_function("() => window.terragripLive.feed.ring.taken > 30")
        mark = "() => getComputedStyle(document.querySelector('.tile .big')).textDecorationLine"
        assert page.is_hidden("#live-age")
        assert page.evaluate(mark) == "none"
        page.wait_for_selector("#health:has-text('ms behind')")
        for mode in ("silent", "frozen"):
            service.mode = mode
            page.wait_for_selector("#live-age:has-text('s old: no new rows')")
            assert page.evaluate(mark) == "line-through"
            assert page.inner_text("#live-state") == "no measurements"
            page.wait_for_function("() => !document.getElementById('health').textContent.includes('behind')")
            # the age is the page's own: it grows while nothing comes
            old = page.evaluate("() => window.terragripLive.feed.age('measured')")
            page.wait_for_function(
                f"() => parseFloat(document.getElementById('live-age').textContent.match(/[0-9.]+/)[0]) > {old + 0.3}"
            )
            service.mode = "measured"
            page.wait_for_selector("#live-age", state="hidden")
            assert page.evaluate(mark) == "none"
        service.mode = "predicted"
        page.wait_for_selector("#live-age:has-text('Predicted: no measurement for')")
        assert page.evaluate(mark) == "underline"
        assert (
            page.evaluate("() => getComputedStyle(document.querySelector('.tile .big')).fontStyle")
            == "italic"
        )
        service.mode = "silent"
        page.wait_for_selector("#live-age:has-text('s old: no new rows')")
        service.stop()
        page.wait_for_selector("#live-state:has-text('connection lost')")
        page.wait_for_selector("#live-age:has-text('s old')")
        assert page.evaluate(mark) == "line-through"


def test_a_silent_source_is_named_while_others_go_on(page: Any, served: Served) -> None:
    with listened_to(served) as service:
        page.goto(f"{served.url}/#/live")
        page.wait_for_function("() => window.terragripLive?.feed.age('status') < 1")
        assert page.is_hidden("#live-silent")
        assert page.get_by_label("Look back").count() == 1
        service.quiet = ("nothing came from serial:/dev/ttyUSB0 for 3.2 s",)
        page.wait_for_selector("#live-silent:has-text('Nothing came from serial:/dev/ttyUSB0 for 3.2 s')")
        assert page.inner_text("#live-state") == "connected"
        page.click("a:text-is('Cab')")
        page.wait_for_selector("#cab-age:has-text('Nothing came from serial:/dev/ttyUSB0 for 3.2 s')")
        service.quiet = ()
        page.wait_for_selector("#cab-age:not(:has-text('Nothing'))")


def test_without_a_service_nothing_is_called_lost(page: Any, served: Served, folder: Path) -> None:
    (folder / "estimates.parquet").unlink()
    page.goto(f"{served.url}/#/live")
    page.wait_for_selector("#live-state:has-text('no live service was named')")
    assert "lost" not in page.inner_text("#live-state")


def test_the_numbers_are_whole_on_a_telephone(page: Any, served: Served) -> None:
    page.set_viewport_size({"width": 390, "height": 800})
    page.goto(f"{served.url}/#/live?replay=estimates.parquet&speed=10")
    page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 500")
    cut = "() => [...document.querySelectorAll('.tile > div')].some((e) => e.scrollWidth > e.clientWidth)"
    assert not page.evaluate(cut)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390


def test_of_many_vehicles_one_is_chosen(page: Any, served: Served) -> None:
    """The first at first; then the chosen one, in the cab too and after the service was away; one that does not send is said."""
    with listened_to(served) as service:
        service.vehicles = ("t7", "t8 grün", "t9")
        page.goto(f"{served.url}/#/live")
        page.wait_for_selector("#live-vehicle:visible")
        assert page.locator("#live-vehicle option").all_inner_texts() == ["t7", "t8 grün", "t9"]
        page.wait_for_selector(".tile:has-text('1.50')")
        page.select_option("#live-vehicle", "t8 grün")
        page.wait_for_selector(".tile:has-text('3.00')")
        assert page.input_value("#live-vehicle") == "t8 grün"
        page.click("a:text-is('Cab')")
        page.wait_for_selector(".cab-numbers:has-text('3.00')")
        page.click("a:text-is('Leave')")
        page.wait_for_selector(".tile:has-text('3.00')")
        service.vehicles = ("t7", "t6", "t9")
        page.evaluate("() => window.terragripLive.feed.again()")
        page.wait_for_selector("#live-state:has-text(\"no vehicle 't8 grün' sends\")")
        page.select_option("#live-vehicle", "t9")
        page.wait_for_selector(".tile:has-text('4.50')")
