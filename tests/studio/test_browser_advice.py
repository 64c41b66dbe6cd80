"""The advice panel of Drive and the set-point on Live, in a real browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from live_service import listened_to
from served import DETAILS, Served
from terragrip.cli import main

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS


def test_the_panel_of_drive_shows_the_best_slip_and_what_to_do(
    page: Any, served: Served, folder: Path
) -> None:
    out = folder / "advice.json"
    files = [str(folder / "estimates.parquet"), "--vehicle", str(folder / "vehicle.yaml")]
    assert main(["advise", *files, "-o", str(out), "--quiet"]) == 0
    written = json.loads(out.read_text())
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    assert page.locator(".advice table").count() == 0  # not asked for until it is opened
    page.locator(".advice > summary").click()
    page.wait_for_selector(".advice table")
    text = page.locator(".advice").inner_text()
    assert f"{100 * written['best_efficiency']['slip']:.1f} %" in text
    assert written["actions"][0]["what"] in text
    page.click("#units > summary")
    page.select_option("#unit-share", "–")  # a ratio had the dash as its unit, as if it were a range
    page.wait_for_selector(f".advice td:has-text('{written['best_efficiency']['slip']:.3f} (')")


def test_live_shows_the_set_point_as_advice_and_none_once_nothing_comes(page: Any, served: Served) -> None:
    with listened_to(served) as service:
        page.goto(f"{served.url}/#/live")
        page.wait_for_selector("#live-state:text-is('connected')")
        page.wait_for_function("() => window.terragripLive.feed.ring.taken > 30")
        assert page.is_hidden("#setpoint")  # this service publishes none yet
        service.setpoint = {
            "state": "slow", "why": "immobilization", "slip": 0.11, "speed": 1.5, "wheel_speed": {"a": 2.5},
        }  # fmt: skip
        page.wait_for_selector("#setpoint:has-text('advice only')")
        text = page.inner_text("#setpoint")
        assert "slow (immobilization), slip up to 11 %" in text
        assert "a 2.50 rad/s" in text
        service.mode = "silent"
        page.wait_for_selector("#setpoint", state="hidden")
