"""The live page in a real browser: a dead source must show."""

from __future__ import annotations

from typing import Any

import pytest

from live_service import LiveService
from served import NEEDS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = NEEDS


def test_a_dead_source_shows_on_the_live_page(page: Any, served: Served) -> None:
    service = LiveService()
    served.stop()
    served.live = service.address
    served.start()
    try:
        page.goto(f"{served.url}/#/live")
        page.wait_for_selector("#live-state:text-is('connected')")
        page.wait_for_function("() => window.terragripLive.feed.ring.taken > 30")
        mark = "() => getComputedStyle(document.querySelector('.tile .big')).textDecorationLine"
        assert page.is_hidden("#live-age")
        assert page.evaluate(mark) == "none"
        page.wait_for_selector("#health:has-text('ms behind')")
        for mode in ("silent", "frozen"):
            service.mode = mode
            page.wait_for_selector("#live-age:has-text('s old: no rows come')")
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
        page.wait_for_selector("#live-age:has-text('Predicted: nothing was measured for')")
        assert page.evaluate(mark) == "underline"
        assert (
            page.evaluate("() => getComputedStyle(document.querySelector('.tile .big')).fontStyle")
            == "italic"
        )
        service.mode = "silent"
        page.wait_for_selector("#live-age:has-text('s old: no rows come')")
        service.stop()
        page.wait_for_selector("#live-state:has-text('connection lost')")
        page.wait_for_selector("#live-age:has-text('s old')")
        assert page.evaluate(mark) == "line-through"
    finally:
        service.stop()


def test_the_numbers_are_whole_on_a_telephone(page: Any, served: Served) -> None:
    page.set_viewport_size({"width": 390, "height": 800})
    page.goto(f"{served.url}/#/live?replay=estimates.parquet&speed=10")
    page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 500")
    cut = "() => [...document.querySelectorAll('.tile > div')].some((e) => e.scrollWidth > e.clientWidth)"
    assert not page.evaluate(cut)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
