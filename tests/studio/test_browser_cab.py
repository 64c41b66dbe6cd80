"""Live and the cab page in a real browser: look back, seek, alarms, three big numbers that fail visibly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from live_service import LiveService, listened_to
from served import NEEDS, Served

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = NEEDS

MARK = "() => getComputedStyle(document.querySelector('.cab-number')).textDecorationLine"


def assert_marked(page: Any, line: str) -> None:
    """The numbers come to have this line; on a busy machine a row may be late and strike them out for a moment."""
    page.wait_for_function(f"line => ({MARK})() === line", arg=line)


@pytest.fixture
def service(served: Served) -> Iterator[LiveService]:
    with listened_to(served) as service:
        yield service


def test_the_cab_shows_three_numbers_and_fails_visibly(
    page: Any, served: Served, service: LiveService
) -> None:
    page.set_viewport_size({"width": 1024, "height": 768})
    page.goto(f"{served.url}/#/cab")
    page.wait_for_selector("#cab-age:has-text('ago')")
    numbers = page.locator(".cab-number")
    assert numbers.all_inner_texts()[0] == "20"  # % of slip
    assert numbers.all_inner_texts()[2] == "1.50"  # m/s
    height = "document.querySelector('#cab-age').getBoundingClientRect().height"
    small = page.wait_for_function(f"() => ({MARK})() === 'none' && {height}").json_value()
    for mode in ("silent", "frozen"):
        service.mode = mode
        page.wait_for_selector("#cab-age:has-text('NO DATA for')")
        assert_marked(page, "line-through")
        page.wait_for_function(f"h => {height} > h", arg=1.5 * small)
        service.mode = "measured"
        page.wait_for_selector("#cab-age:has-text('ago')")
        assert_marked(page, "none")
    service.mode = "predicted"
    page.wait_for_selector("#cab-age:has-text('PREDICTED ONLY')")
    assert_marked(page, "underline")
    service.mode = "measured"
    page.wait_for_selector("#cab-age:has-text('ago')")
    service.stop()
    page.wait_for_selector("#cab-age:has-text('NO DATA for')")
    assert_marked(page, "line-through")


def test_the_cab_before_any_row_says_so(page: Any, served: Served, service: LiveService) -> None:
    service.mode = "silent"
    page.goto(f"{served.url}/#/cab")
    page.wait_for_selector("#cab-age:has-text('NO DATA YET')")
    assert_marked(page, "line-through")


def test_a_threshold_rings_and_is_kept(page: Any, served: Served, service: LiveService) -> None:
    page.goto(f"{served.url}/#/live")
    page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 10")
    assert page.is_hidden(".alarm")
    rings = "() => window.terragripLive.alarms.rings"
    quiet = page.evaluate(rings)  # a first row that is late rings as a dead source does
    page.click("summary:text-is('Alarms')")
    page.check("#alarm-sound")
    page.fill("#alarm-slip", "15")
    page.press("#alarm-slip", "Tab")
    page.wait_for_selector(".alarm:has-text('Slip 20 % is over 15 %')")
    page.wait_for_function(f"n => ({rings})() >= n + 2", arg=quiet)  # as long as it lasts
    for mode in ("silent", "predicted"):  # what was over its limit is not forgotten with the source
        service.mode = mode
        page.wait_for_selector(".alarm:has-text('Slip 20 % is over 15 % in the last measurement')")
    service.mode = "measured"
    page.wait_for_selector(".alarm:text-is('Slip 20 % is over 15 %')")
    service.mode = "slipless"  # a driven wheel's speed is lost: the alarm went without a word
    page.wait_for_selector(".alarm:text-is('Slip is not known: its alarm cannot sound')")
    service.mode = "measured"
    page.fill("#alarm-slip", "25")
    page.press("#alarm-slip", "Tab")
    page.wait_for_selector(".alarm", state="hidden")
    before = page.evaluate(rings)
    service.mode = "silent"
    page.wait_for_function(f"n => ({rings})() > n", arg=before)  # a dead source rings too
    service.mode = "measured"
    page.goto(f"{served.url}/#/cab")  # the same limits
    page.wait_for_function("() => window.terragripCab?.feed.ring.taken > 10")
    assert page.input_value("#alarm-slip") == "25"


def test_a_pause_holds_the_numbers_and_not_the_alarms(
    page: Any, served: Served, service: LiveService
) -> None:
    """Who paused to read a value was no longer warned: not of slip, nor that the source had gone."""
    page.goto(f"{served.url}/#/live")
    page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 10")
    page.click("button:text-is('Pause')")
    page.click("summary:text-is('Alarms')")
    page.fill("#alarm-slip", "15")
    page.press("#alarm-slip", "Tab")
    page.wait_for_selector(".alarm:text-is('Slip 20 % is over 15 %')")
    assert page.inner_text("#live-state") == "paused"
    service.mode = "silent"
    page.wait_for_selector(".alarm:has-text('in the last measurement')")
    rings = "() => window.terragripLive.alarms.rings"
    page.wait_for_function(f"n => ({rings})() > n", arg=page.evaluate(rings))


def test_looking_back_leaves_the_numbers_and_the_recording(
    page: Any, served: Served, service: LiveService
) -> None:
    service.step = 0.2
    page.goto(f"{served.url}/#/live")
    page.wait_for_function("() => window.terragripLive?.feed.ring.now > 12")
    page.select_option("#live-span", "10")
    assert page.evaluate("() => window.terragripLive.traces.span") == 10
    box = page.locator(".traces").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 60, steps=3)
    page.mouse.up()
    held = page.evaluate("() => window.terragripLive.traces.back")
    assert held is not None
    taken = page.evaluate("() => window.terragripLive.feed.ring.taken")
    page.wait_for_function("n => window.terragripLive.feed.ring.taken > n", arg=taken)
    assert (
        page.evaluate("() => window.terragripLive.traces.end") == held
    )  # it stands, while rows go on coming
    assert page.is_hidden("#live-age")
    page.click("#follow")
    assert page.evaluate("() => window.terragripLive.traces.back") is None


def test_a_replay_is_sought(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/live?replay=estimates.parquet&speed=1")
    page.wait_for_selector("#seek", state="visible")
    page.evaluate(
        "() => { const e = document.getElementById('seek'); e.value = '25'; e.dispatchEvent(new Event('change')); }"
    )
    page.wait_for_function("() => window.terragripLive.feed.ring.now > 25")
    assert page.evaluate("() => window.terragripLive.feed.ring.oldest") >= 25
    # As after a drag, or by Tab: it stood still, and an arrow key then went on from there.
    page.focus("#seek")
    page.wait_for_function("() => Number(document.getElementById('seek').value) > 26")
