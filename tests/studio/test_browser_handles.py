"""The fit page in a real browser: the curve is dragged by its handles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from served import DETAILS, Served, until
from terragrip.physics.adhesion import CURVES

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

PARAMETERS = "() => window.terragripFit.state.active.parameters"
TRUE = {"c1": 0.6, "c2": 12.0, "c3": 0.3}


@pytest.fixture
def fitted(page: Any, served: Served, folder: Path) -> Any:
    """The page with points on a known curve, fitted."""
    slip = np.linspace(0.02, 0.6, 30)
    mu = CURVES["burckhardt"].value(slip, TRUE)
    lines = [f"{100 * s:.4f},{m:.6f}" for s, m in zip(slip, mu, strict=True)]
    (folder / "points.csv").write_text("\n".join(["slip,mu", *lines]))
    page.goto(f"{served.url}/#/fit?path=points.csv")
    page.wait_for_selector("#soil-list li")
    page.select_option("#curve-model", "burckhardt")
    page.click("#fit-button")
    page.wait_for_selector(".badge")
    page.wait_for_function("() => document.getElementById('quality').textContent.includes('R² 1,')")
    return page


def test_a_peak_is_dragged_and_the_drag_undone(fitted: Any) -> None:
    before = fitted.evaluate(PARAMETERS)
    box = fitted.locator("#handle-peak").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    fitted.mouse.move(x, y)
    fitted.mouse.down()
    fitted.mouse.move(x + 20, y + 30)
    fitted.mouse.move(x + 40, y + 60)
    goal = fitted.evaluate(
        "([x, y]) => { const { view, element } = window.terragripFit.plot, b = element.getBoundingClientRect();"
        "return [view.x_of(x - b.x), view.y_of(y - b.y)]; }",
        [x + 40, y + 60],
    )
    fitted.mouse.up()
    fitted.wait_for_selector("#back-to-fit")  # the drag is over, and told apart from the fit
    dragged = fitted.evaluate(PARAMETERS)
    np.testing.assert_allclose(CURVES["burckhardt"].peak(dragged), goal, atol=0.005)
    assert float(fitted.input_value("#field-c1")) == pytest.approx(dragged["c1"], rel=1e-3)
    assert "(fit 1)" in fitted.inner_text("#quality")
    fitted.keyboard.press("Control+z")
    assert fitted.evaluate(PARAMETERS) == before
    fitted.keyboard.press("Control+Shift+z")
    assert fitted.evaluate(PARAMETERS) == dragged
    fitted.click("#fit-here")  # the points lie on a curve: from here to it again
    fitted.wait_for_selector("text=the automatic fit had R² 1")
    found = fitted.evaluate(PARAMETERS)
    assert found == pytest.approx(TRUE, rel=1e-3)


def test_a_handle_is_moved_by_keys_and_a_held_parameter_stays(fitted: Any) -> None:
    before = fitted.evaluate(PARAMETERS)
    fitted.check("#hold-c2")
    fitted.focus("#handle-level")
    fitted.keyboard.press("Shift+ArrowUp")
    fitted.wait_for_selector("#back-to-fit")
    after = fitted.evaluate(PARAMETERS)
    assert after["c2"] == before["c2"]
    value = [float(CURVES["burckhardt"].value(0.6, q)) for q in (before, after)]
    shown = fitted.evaluate("() => window.terragripFit.plot.view.y")
    assert value[1] - value[0] == pytest.approx(0.05 * (shown["high"] - shown["low"]), abs=0.003)
    assert fitted.evaluate("() => document.activeElement.id") == "handle-level"
    for name in before:
        fitted.check(f"#hold-{name}")
    fitted.wait_for_function("() => !document.querySelector('.handle')")


def test_a_drag_past_the_axes_stops_there_and_outlasts_a_handle_that_comes_back(fitted: Any) -> None:
    box = fitted.locator("#handle-peak").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    end = fitted.evaluate("() => window.terragripFit.plot.view.x.high")
    level = fitted.locator("#handle-level").bounding_box()["x"]

    def peak() -> float:
        return float(CURVES["burckhardt"].peak(fitted.evaluate(PARAMETERS))[0])

    before = peak()
    fitted.mouse.move(x, y)
    fitted.mouse.down()
    fitted.mouse.move(x + 3000, y)
    until(lambda: abs(peak() - end) < 0.01)
    fitted.mouse.move(level, y)
    fitted.wait_for_selector("#handle-level", state="detached")  # the peak lies beside it
    fitted.mouse.move(x + 20, y)
    fitted.wait_for_selector("#handle-level")
    fitted.mouse.move(x, y)
    until(lambda: abs(peak() - before) < 0.01)
    fitted.mouse.up()


def test_two_fingers_zoom_the_plot(fitted: Any) -> None:
    before = fitted.evaluate("() => window.terragripFit.plot.view.x")
    plot = fitted.locator(".plot").bounding_box()
    touch = fitted.context.new_cdp_session(fitted)
    middle, y = plot["x"] + 300, plot["y"] + 300

    def fingers(kind: str, *places: float) -> None:
        points = [{"x": x, "y": y, "id": i} for i, x in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    fingers("touchStart", middle - 50)
    fingers("touchStart", middle - 50, middle + 50)
    fingers("touchMove", middle - 100, middle + 50)
    fingers("touchMove", middle - 100, middle + 100)
    fingers("touchEnd")
    after = fitted.evaluate("() => window.terragripFit.plot.view.x")
    assert after["high"] - after["low"] == pytest.approx((before["high"] - before["low"]) / 2, rel=0.02)
