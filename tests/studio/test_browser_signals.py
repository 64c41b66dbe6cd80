"""Several runs over each other, one quantity over another, and signals by a formula, in a real browser."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from served import DETAILS, Served, axe_violations, leave
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

RANGE = "() => window.terragripDrive.charts.range"
WHOLE = "() => window.terragripDrive.charts.whole"
INK = """shade => {
  const canvas = document.querySelector(".chart canvas");
  const ink = getComputedStyle(document.documentElement).getPropertyValue(`--${shade}`).trim();
  const rgb = [1, 3, 5].map((k) => parseInt(ink.slice(k, k + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && rgb.every((c, k) => Math.abs(data[i + k] - c) < 30)) count++;
  return count;
}"""
"""Pixels of a colour in the first chart."""


@pytest.fixture
def three(folder: Path) -> Path:
    """The folder with two more runs: one a minute later on its clock, its slip 10 points higher and half as long; one at half speed."""
    table = Estimates.read(folder / "estimates.parquet")
    half = table.select(slice(0, len(table) // 2))
    columns = {**half.columns, "slip_rr": half["slip_rr"] + 0.1}
    Estimates(half.time + 60.0, columns, half.event_codes, half.labels, half.about).write(
        folder / "late.parquet"
    )
    columns = {**table.columns, "ground_speed": table["ground_speed"] / 2}
    Estimates(table.time, columns, table.event_codes, table.labels, table.about).write(
        folder / "slow.parquet"
    )
    return folder


def open_drive(page: Any, served: Served, query: str = "path=estimates.parquet") -> None:
    page.goto(f"{served.url}/#/drive?{query}")
    page.wait_for_selector(".charts[data-rows]")


def lay(page: Any, *paths: str) -> None:
    page.click("#overlay summary")
    for path in paths:
        page.check(f"#overlay label:has-text('{path}')")
    page.click("#overlay summary")
    page.wait_for_function(f"() => document.querySelectorAll('.legend-row .run').length === {1 + len(paths)}")


def test_runs_lie_over_each_other_by_time_since_their_start(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served, "path=estimates.parquet&panels=slip&wheels=rr")
    lay(page, "late.parquet")
    assert page.input_value("#over") == "elapsed"
    assert page.is_disabled("#over option[value='time']")
    page.wait_for_function(f"() => ({INK})('blue') > 100 && ({INK})('vermillion') > 100")
    assert page.locator(".legend-row .run").all_inner_texts() == ["estimates", "late"]
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 12])")
    page.wait_for_function("() => Number(document.querySelector('.charts').dataset.rows) < 2000")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40)
    page.wait_for_function("() => [...document.querySelectorAll('.value')].every((o) => o.textContent)")
    here, there = (float(text.split(" ± ")[0]) for text in page.locator(".value").all_inner_texts())
    assert there - here == pytest.approx(
        10, abs=0.2
    )  # the same instant of both: the same but for the 10 points
    table = Estimates.read(three / "estimates.parquet")
    row = int(np.argmin(np.abs(table.time - table.time[0] - 11)))
    assert here == pytest.approx(100 * table["slip_rr"][row], abs=0.6)
    # Past the shorter one's end it has no value.
    high = page.evaluate(WHOLE)[1]
    page.evaluate("r => window.terragripDrive.charts.zoom(r)", [high - 4, high])
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 41)
    page.wait_for_function("() => document.querySelectorAll('.value')[1].textContent === '–'")


def test_runs_lie_over_each_other_by_distance(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served, "path=estimates.parquet&panels=speed&wheels=rr&over=distance&with=slow.parquet")
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 2")
    table = Estimates.read(three / "estimates.parquet")
    speed = np.abs(table["ground_speed"])
    way = np.concatenate(([0.0], np.cumsum(np.diff(table.time) * (speed[1:] + speed[:-1]) / 2)))
    assert page.evaluate(WHOLE)[1] == pytest.approx(way[-1], rel=1e-3)
    middle = way[-1] / 4  # the slow one is half as far in all
    page.evaluate("r => window.terragripDrive.charts.zoom(r)", [middle - 0.5, middle + 0.5])
    page.wait_for_function("() => Number(document.querySelector('.charts').dataset.rows) < 2000")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40)
    page.wait_for_selector(".line:has-text('distance')")
    line = page.inner_text(".line")
    assert float(re.search(r"distance ([0-9.]+) m", line).group(1)) == pytest.approx(middle, abs=0.01)
    at = float(re.search(r"t ([0-9.]+) s", line).group(1))
    assert at == pytest.approx(np.interp(middle, way, table.time), abs=0.05)
    # Each run's speed where it was at that distance; the legend names each trace's run.
    texts = page.locator(".chart .legend > span").all_inner_texts()
    speeds = {
        t.split(" v")[0]: float(t.rsplit(" v", 1)[1].split("±")[0])
        for t in texts
        if " v" in t and "measured" not in t
    }
    assert speeds["estimates"] == pytest.approx(np.interp(middle, way, table["ground_speed"]), rel=0.05)
    assert speeds["slow"] == pytest.approx(np.interp(middle, way / 2, table["ground_speed"] / 2), rel=0.05)


def test_an_overlay_is_in_the_link_and_ends_with_its_run(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served)
    lay(page, "late.parquet", "slow.parquet")
    page.select_option("#over", "distance")
    page.wait_for_function(
        "() => location.hash.includes('over=distance') && location.hash.includes('with=slow')"
    )
    link = page.url
    leave(page)
    page.goto(link)
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 3")
    assert page.input_value("#over") == "distance"
    (three / "slow.parquet").unlink()
    page.wait_for_selector(".note:has-text('slow.parquet was removed')")
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 2")


def test_the_stretch_stays_when_the_axis_changes(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served)
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 20])")
    page.select_option("#over", "distance")
    page.wait_for_function(f"() => ({RANGE})()[0] !== 10")
    page.select_option("#over", "time")
    page.wait_for_function(
        f"() => Math.abs(({RANGE})()[0] - 10) < 0.1 && Math.abs(({RANGE})()[1] - 20) < 0.1"
    )


def formula(page: Any, name: str, text: str, unit: str = "") -> None:
    page.fill("#formula-name", name)
    page.fill("#formula-text", text)
    page.fill("#formula-unit", unit)
    page.press("#formula-text", "Enter")


def test_a_formula_is_drawn_and_kept_in_link_and_layout(page: Any, served: Served, folder: Path) -> None:
    open_drive(page, served, "path=estimates.parquet&from=10&to=12&panels=slip")
    page.click("#formulas summary")
    formula(page, "Slip difference", "100 * (slip_rl - slip_rr)", "%")
    page.wait_for_selector(".chart h2:text-is('Slip difference [%]')")
    formula(page, "Ratio", "slip_rl / slip_rr")
    page.wait_for_selector(".chart h2:text-is('Ratio [unit not known]')")
    page.click("#formulas summary")
    page.wait_for_function("() => Number(document.querySelector('.charts').dataset.rows) < 1000")
    box = page.locator(".u-over >> nth=1").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40)
    page.wait_for_function("() => [...document.querySelectorAll('.value')].every((o) => o.textContent)")
    table = Estimates.read(folder / "estimates.parquet")
    row = int(np.argmin(np.abs(table.time - 11)))
    near = 100 * (table["slip_rl"] - table["slip_rr"])[row - 1 : row + 2]
    value = float(page.locator(".chart >> nth=1").locator(".value").inner_text())
    assert near.min() - 0.01 * abs(near.min()) <= value <= near.max() + 0.01 * abs(near.max())
    page.wait_for_function("() => location.hash.includes('f.Slip')")
    link = page.url
    page.click("summary:text-is('Layouts')")
    page.fill("#layout-name", "slips")
    page.keyboard.press("Enter")
    page.evaluate("() => localStorage.removeItem('terragrip-formulas')")
    leave(page)
    page.goto(link)
    page.wait_for_selector(".chart h2:text-is('Slip difference [%]')")
    leave(page)
    open_drive(page, served, "path=estimates.parquet&panels=slip")
    assert page.locator(".chart").count() == 1
    page.click("summary:text-is('Layouts')")
    page.click("#layouts button:text-is('slips')")
    page.wait_for_selector(".chart h2:text-is('Slip difference [%]')")


def test_a_fault_in_a_formula_stands_at_its_field(page: Any, served: Served) -> None:
    open_drive(page, served)
    before = page.locator(".chart").count()
    page.click("#formulas summary")
    for text, fault in (
        ("slip_rl -", "cannot be read"),
        ("slip_xx + 1", "slip_xx is not a column of this run"),
        ("slip_rl.real", "a dot"),
    ):
        formula(page, "Wrong", text)
        page.wait_for_selector(f"#formula-fault:has-text('{fault}')")
        assert page.get_attribute("#formula-text", "aria-invalid") == "true"
        assert page.evaluate("() => document.activeElement.id") == "formula-text"
    assert page.locator(".chart").count() == before
    assert page.locator(".note.error").count() == 0
    formula(page, "Right", "slip_rl")
    page.wait_for_selector(".chart h2:has-text('Right')")
    assert page.inner_text("#formula-fault") == ""


def test_a_formula_that_a_run_cannot_be_given_leaves_the_charts_alone(
    page: Any, served: Served, folder: Path
) -> None:
    open_drive(page, served, "path=estimates.parquet&panels=slip,f.Sum&f.Sum=slip_rl%2Bno_such_column")
    assert page.locator(".chart").count() == 1
    assert page.locator(".note.error").count() == 0
    page.click("#formulas summary")
    assert "no_such_column is not a column of this run" in page.inner_text("#formulas .list .bad")


def test_any_quantity_over_any_other_of_what_the_charts_show(page: Any, served: Served, folder: Path) -> None:
    open_drive(page, served)
    table = Estimates.read(folder / "estimates.parquet")
    page.wait_for_selector("#across-caption:has-text('thinned evenly')")
    both = np.isfinite(table["slip_rr"]) & np.isfinite(table["adhesion_rr"])
    count = f"{both.sum():,}".replace(",", " ")
    assert f"of the {count} samples" in page.inner_text("#across-caption")
    page.select_option("select[aria-label='Wheel of the plane']", label="any two quantities")
    assert page.input_value("#across-y") == "adhesion_rr"  # what was shown
    page.select_option("#across-y", "measured:drawbar_force")
    page.select_option("#across-x", "ground_speed")
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 12])")
    pull = pl.read_parquet(folder / "recording.parquet")["drawbar_force"].fill_null(np.nan).to_numpy()
    rows = (table.time >= 10) & (table.time <= 12) & np.isfinite(pull)
    page.wait_for_selector(f"#across-caption:has-text('The {rows.sum()} samples that the charts show')")
    assert "Drawbar force" in page.get_attribute(".plane", "aria-label")
    # A point of the plot is an instant of the charts.
    place = page.evaluate(
        """() => { const { plane } = window.terragripDrive.across, one = plane.all[0];
          const b = plane.element.getBoundingClientRect();
          return [b.x + plane.view.px(one.x[50]), b.y + plane.view.py(one.y[50]), one.time[50]]; }"""
    )
    page.mouse.move(place[0], place[1])
    page.wait_for_selector(".line:has-text('t ')")
    assert 10 <= float(re.search(r"t ([0-9.]+) s", page.inner_text(".line")).group(1)) <= 12
    page.wait_for_function("() => location.hash.includes('y=measured')")
    link = page.url
    leave(page)
    page.goto(link)
    page.wait_for_function("() => document.querySelector('#across-y')?.value.startsWith('measured')")
    assert (page.input_value("#across-x"), page.input_value("#across-y")) == (
        "ground_speed",
        "measured:drawbar_force",
    )


def test_the_plot_shows_each_run_in_its_colour(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served)
    lay(page, "late.parquet")
    page.wait_for_function("() => window.terragripDrive.across.plane.all.length === 2")
    assert page.evaluate("() => window.terragripDrive.across.plane.all.map((one) => one.color)") == [
        "blue",
        "vermillion",
    ]


def test_overlay_formulas_and_plot_have_no_faults_and_fit(page: Any, served: Served, three: Path) -> None:
    (three / f"{'Feldversuch_' * 6}3.parquet").write_bytes((three / "slow.parquet").read_bytes())
    open_drive(
        page,
        served,
        "path=estimates.parquet&panels=slip,speed,f.Sum&f.Sum=slip_rl%2Bslip_rr"
        "&with=late.parquet&with=slow.parquet&x=ground_speed&y=slip_rr",
    )
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 3")
    for theme, width in (("light", 1280), ("dark", 390)):
        page.set_viewport_size({"width": width, "height": 800})
        for menu in ("#formulas", "#overlay"):
            page.click(f"{menu} summary")
            assert axe_violations(page, theme) == []
            cut = page.locator(f"{menu} .menu").evaluate("e => e.scrollWidth - e.clientWidth")
            assert cut <= 0  # long names ran out of the menu
            box = page.locator(f"{menu} .menu").bounding_box()
            assert 0 <= box["x"] <= box["x"] + box["width"] <= width
            page.click(f"{menu} summary")
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_the_keyboard_lays_a_run_over_and_makes_a_formula(page: Any, served: Served, three: Path) -> None:
    open_drive(page, served)
    page.focus("#overlay summary")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Space")
    page.wait_for_function("() => document.querySelectorAll('.legend-row .run').length === 2")
    assert (
        page.evaluate("() => document.activeElement.labels[0].textContent") == "late.parquet"
    )  # not the body
    page.focus("#formulas summary")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.type("Sum")
    page.keyboard.press("Tab")
    page.keyboard.type("slip_rl + slip_rr")
    page.keyboard.press("Enter")
    page.wait_for_selector(".chart h2:has-text('Sum')")
