"""A log whose wheels have other names than the vehicle's, in a real browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from served import DETAILS, Served
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

GERMAN = {"fl": "vl", "fr": "vr", "rl": "hl", "rr": "hr"}


@pytest.fixture
def folder(folder: Path) -> Path:
    table = pd.read_parquet(folder / "recording.parquet")
    names = {
        name: f"{name[:-2]}{GERMAN[name[-2:]]}"
        for name in table
        if name[-3:-2] == "_" and name[-2:] in GERMAN
    }
    table.rename(columns=names).to_parquet(folder / "german.parquet")
    return folder


def test_wheels_are_named_as_the_vehicle_has_them(page: Any, served: Served, folder: Path) -> None:
    page.goto(f"{served.url}/#/start?log=german.parquet")
    page.wait_for_selector("#wizard-found:has-text('the vehicle has no wheel vl')")
    assert page.is_disabled("#wizard-go")
    page.click("#name-wheels")
    assert page.evaluate("() => document.activeElement.id") == "wheel-vl"
    for mine, theirs in {**GERMAN, "fr": "vl"}.items():
        page.select_option(f"#wheel-{theirs}", mine)
    page.click("#use-columns")  # vr is not named yet
    page.wait_for_function("() => document.querySelector('#wizard-profile')?.value === 'german-profile.yaml'")
    page.wait_for_selector("#wizard-found:has-text('no wheel vr')")
    page.click("#name-wheels")
    assert page.evaluate("() => document.activeElement.id") == "wheel-vr"
    page.select_option("#wheel-vl", "fl")
    page.select_option("#wheel-vr", "fl")
    page.click("#use-columns")
    page.wait_for_selector(".note.error:has-text('vl and vr have the same name')")
    page.select_option("#wheel-vr", "fr")
    assert page.inner_text("label[for='column-wheel_speed_hr']").startswith("rr:")
    page.click("#use-columns")
    page.wait_for_selector("text=ready to estimate")
    page.click("#wizard-go")
    page.wait_for_selector(".state.done")
    mine, theirs = (
        Estimates.read(folder / "german-estimates.parquet"),
        Estimates.read(folder / "estimates.parquet"),
    )
    for wheel in GERMAN:
        np.testing.assert_allclose(mine[f"slip_{wheel}"], theirs[f"slip_{wheel}"], rtol=1e-9, equal_nan=True)


def test_a_log_with_the_vehicles_names_asks_for_none(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/start?log=recording.parquet")
    page.wait_for_selector("text=ready to estimate")
    assert page.locator("#name-wheels").count() == 0
