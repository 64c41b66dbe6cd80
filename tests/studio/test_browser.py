"""The pages in a real browser (Debian's chromium): each page's main path, its speed, its faults, the keyboard alone, axe-core."""

from __future__ import annotations

import json
import re
import shutil
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from served import NEEDS, Served, axe_violations, until
from terragrip.physics.adhesion import CURVES

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")

pytestmark = NEEDS


def open_fit(page: Any, served: Served, path: str = "") -> None:
    page.goto(f"{served.url}/#/fit{f'?path={path}' if path else ''}")
    page.wait_for_selector("#slider-a")


def test_a_moved_slider_redraws_once_a_frame(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    redraws = page.evaluate(
        """async () => {
          const { plot } = window.terragripFit;
          const slider = document.getElementById("slider-a");
          const before = plot.redraws;
          for (let i = 0; i < 40; i++) {
            slider.value = String(0.3 + 0.7 * (i / 40));
            slider.dispatchEvent(new Event("input"));
            slider.dispatchEvent(new Event("input"));
            await new Promise(requestAnimationFrame);
          }
          return plot.redraws - before;
        }"""
    )
    # How many a second (50) is benchmarks/bench_studio.py's to say; here that each frame draws, and each once.
    assert (
        40 <= redraws <= 42
    )  # what else changes meanwhile, such as the samples of the new curve, may draw too


def test_the_browsers_curves_are_the_servers(page: Any, served: Served) -> None:
    open_fit(page, served)
    slips = np.linspace(-0.9, 0.9, 37)
    for name, model in CURVES.items():
        page.select_option("#curve-model", name)
        drawn = page.evaluate(
            """async slips => {
              const { at, state } = window.terragripFit, { samples } = state;
              const drawn = () => samples.of(state.active.id, state.active);
              while (!drawn() || !samples.isCurrent(state.active.id, state.active)) await new Promise(requestAnimationFrame);
              return slips.map((s) => at(drawn(), s));
            }""",
            slips.tolist(),
        )
        np.testing.assert_allclose(drawn, model.value(slips, {}), rtol=1e-12, atol=1e-14)


def test_fit_shows_the_servers_numbers_and_undo_takes_them_back(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.click("#fit-button")
    page.wait_for_selector(".badge")
    fitted = float(page.input_value("#field-a"))
    assert fitted != pytest.approx(1.0)
    page.keyboard.press("Control+z")
    assert float(page.input_value("#field-a")) == pytest.approx(1.0)
    page.keyboard.press("Control+Shift+z")
    assert float(page.input_value("#field-a")) == pytest.approx(fitted)


def test_a_curve_set_by_hand_says_how_far_it_is_from_the_fit(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.click("#fit-button")
    page.wait_for_selector(".badge")
    assert page.inner_text(".apart") == ""
    fitted = float(page.input_value("#field-a"))
    page.fill("#field-a", str(fitted + 0.1))
    page.keyboard.press("Enter")
    page.wait_for_selector(".apart:has-text('off this fit')")
    off = 0.1 * float(CURVES["exponential"].value(0.6, {"a": 1.0}))
    assert f"+{off:.2g} off this fit at 60 % slip" in page.inner_text(".apart")


def test_a_fit_leaves_a_held_parameter_and_leaving_the_page_loses_nothing(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    assert page.is_checked("#hold-p")  # as the paper holds it
    page.fill("#field-p", "0.6")
    page.press("#field-p", "Tab")
    page.click("#fit-button")
    page.wait_for_selector(".badge")
    assert float(page.input_value("#field-p")) == pytest.approx(0.6)
    fitted = page.input_value("#field-a")
    page.click("nav >> text=Folder")
    page.wait_for_selector("text=recording.parquet")
    page.click("nav >> text=Fit")
    page.wait_for_selector(".badge")
    assert page.input_value("#field-a") == fitted
    assert page.input_value("#field-p") == "0.6"
    assert page.locator("#soil-list li").count() > 0


def test_undo_is_kept_while_another_page_is_open(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.fill("#field-a", "0.7")
    page.press("#field-a", "Tab")
    page.fill("#field-a", "0.4")
    page.press("#field-a", "Tab")
    page.keyboard.press("Control+z")
    page.click("nav >> text=Folder")
    page.wait_for_selector("text=recording.parquet")
    page.click("nav >> text=Fit")
    page.wait_for_selector("#slider-a")
    assert page.input_value("#field-a") == "0.7"
    page.keyboard.press("Control+Shift+z")
    assert page.input_value("#field-a") == "0.4"
    page.click("text=Undo")
    page.click("text=Undo")
    assert page.input_value("#field-a") == "1"


def test_a_fit_keeps_to_the_bounds_of_a_slider_and_says_where_it_stopped(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.click("#fit-button")
    page.wait_for_selector(".badge.good")
    free = float(page.input_value("#field-a"))
    page.fill("#lower-a", f"{1.02 * free:.4f}")
    page.press("#lower-a", "Tab")
    assert float(page.input_value("#field-a")) == pytest.approx(1.02 * free, abs=1e-3)
    assert float(page.get_attribute("#slider-a", "min")) == pytest.approx(1.02 * free, abs=1e-3)
    page.click("#fit-button")
    page.wait_for_selector(".badge.poor")
    assert float(page.input_value("#field-a")) == pytest.approx(1.02 * free, abs=1e-3)
    assert "stopped at an end" in page.text_content(".result")
    page.fill("#upper-a", "0.01")  # under the lower end: nothing is taken over
    page.press("#upper-a", "Tab")
    assert page.locator(".bounds input:invalid").count() == 1
    page.fill("#upper-a", "")
    page.press("#upper-a", "Tab")
    page.fill("#lower-a", "")
    page.press("#lower-a", "Tab")
    page.click("#fit-button")
    page.wait_for_selector(".badge.good")
    assert float(page.input_value("#field-a")) == pytest.approx(free)


def test_the_fit_page_by_keyboard_alone(page: Any, served: Served) -> None:
    open_fit(page, served, "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    seen: set[str] = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        now = page.evaluate(
            "() => document.activeElement.id || document.activeElement.textContent.slice(0, 30)"
        )
        seen.add(now)
        if now == "fit-button":
            break
    assert {"slider-a", "field-a", "curve-model"} <= seen
    page.keyboard.press("Enter")
    page.wait_for_selector(".badge")
    page.focus("#slider-a")
    before = page.input_value("#field-a")
    page.keyboard.press("ArrowRight")
    assert page.input_value("#field-a") != before


def diagram(folder: Path) -> None:
    """A picture of a printed diagram, turned by 10 degrees, whose pixels are known: see `pixel`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, 800)
    axes.set_ylim(600, 0)
    axes.axis("off")
    for value in np.linspace(0, 1, 11):
        axes.plot(*zip(pixel(value, 0), pixel(value, 1), strict=True), color="0.7")
        axes.plot(*zip(pixel(0, value), pixel(1, value), strict=True), color="0.7")
    figure.savefig(folder / "scan.png")


def pixel(slip: float, adhesion: float) -> tuple[float, float]:
    """Where a point lies in the picture of `diagram`."""
    c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
    x, y = 560 * slip, -400 * adhesion
    return float(80 + c * x - s * y), float(440 + s * x + c * y)


def mark_axes(page: Any, points: tuple[tuple[float, float], ...], values: tuple[float, ...]) -> None:
    """Click two points of each axis in the picture, give their values, and use them."""
    box = page.wait_for_selector("dialog .sheet").bounding_box()
    scale = box["width"] / 800
    for point in points:
        x, y = pixel(*point)
        page.mouse.click(box["x"] + x * scale, box["y"] + y * scale)
    for place, value in zip(product(("Slip", "Adhesion"), (1, 2)), values, strict=True):
        field = page.locator("input[aria-label='{} axis, point {}, value']".format(*place))
        field.fill(str(value))
        field.press("Tab")
    page.click("text=Use these axes")


def test_a_turned_picture_is_calibrated_to_half_a_per_cent_of_the_axis(
    page: Any, served: Served, folder: Path
) -> None:
    diagram(folder)
    open_fit(page, served)
    page.select_option("select[aria-label='Open a picture from the folder']", "scan.png")
    mark_axes(page, ((0.1, 0.0), (0.9, 0.0), (0.0, 0.1), (0.0, 0.9)), (10, 90, 0.1, 0.9))
    page.wait_for_function("() => window.terragripFit.plot.view.y.high > 0.9")  # the marks are in view
    page.click("text=Digitise a line")
    page.wait_for_selector(".pictures li.chosen")
    wanted = [(0.15, 0.2), (0.35, 0.5), (0.55, 0.6)]
    places = page.evaluate(
        """points => {
          const { plot, state, mapOf } = window.terragripFit;
          const box = plot.element.getBoundingClientRect();
          const map = mapOf(state.kept.pictures["scan.png"]);
          return points.map((p) => { const v = map.toValue(p); return [box.x + plot.view.px(v[0]), box.y + plot.view.py(v[1])]; });
        }""",
        [list(pixel(*point)) for point in wanted],
    )
    for x, y in places:
        page.mouse.click(x, y)
    page.wait_for_function(
        "() => window.terragripFit.state.kept.pictures['scan.png'].lines[0].points.length === 3"
    )

    def kept() -> Any:
        return json.loads((folder / "scan.png.picture.json").read_text())

    until(lambda: [len(line["points"]) for line in kept()["lines"]] == [3])
    np.testing.assert_allclose(kept()["lines"][0]["points"], wanted, atol=0.005)


def test_one_origin_is_clicked_for_both_axes(page: Any, served: Served, folder: Path) -> None:
    diagram(folder)
    open_fit(page, served)
    page.select_option("select[aria-label='Open a picture from the folder']", "scan.png")
    mark_axes(page, ((0.0, 0.0), (0.9, 0.0), (0.0, 0.0), (0.0, 0.9)), (0, 90, 0, 0.9))
    at = "p => window.terragripFit.mapOf(window.terragripFit.state.kept.pictures['scan.png']).toValue(p)"
    np.testing.assert_allclose(page.evaluate(at, list(pixel(0.5, 0.5))), (0.5, 0.5), atol=0.005)


def test_a_broken_file_is_refused_with_one_line_and_a_good_one_estimated(
    page: Any, served: Served, folder: Path
) -> None:
    page.goto(served.url)
    page.wait_for_selector("text=recording.parquet")
    page.set_input_files(
        "#new-file", files=[{"name": "broken.parquet", "mimeType": "", "buffer": b"PAR1 broken"}]
    )
    page.wait_for_selector(".note.error")
    assert "broken.parquet" in page.inner_text(".note.error")
    assert not (folder / "broken.parquet").exists()
    page.click("a:text-is('recording.parquet')")
    page.wait_for_selector("text=ready to estimate")
    page.click("text=Method and file")
    page.fill("#wizard-output", "by-hand.parquet")
    page.click("button:text-is('Estimate')")
    page.wait_for_selector(".state.done")
    assert (folder / "by-hand.parquet").exists()


def test_an_upload_that_ends_or_is_cut_on_another_page_says_so_there(page: Any, served: Served) -> None:
    """Whoever went on to the fit page was thrown from it to the log; a cut one said only that the studio did not respond."""
    page.goto(served.url)
    page.wait_for_selector("text=recording.parquet")
    held: list[Any] = []
    uploads = re.compile(r"/api/file\?path=day")
    page.route(uploads, lambda route: held.append(route))
    for name in ("day1.csv", "day2.csv"):
        page.set_input_files(
            "#new-file", files=[{"name": name, "mimeType": "", "buffer": b"time,v\n0,1\n1,1\n"}]
        )
        page.wait_for_selector(f"#uploads:has-text('{name}')")
    while len(held) < 2:
        page.wait_for_timeout(20)
    page.click("nav >> text=Fit")
    page.wait_for_selector("#slider-a")
    held[0].continue_()
    page.wait_for_selector(".note:has-text('day1.csv is in the folder')")
    served.stop()
    held[1].continue_()
    page.wait_for_selector(".note.error:has-text('day2.csv: was not uploaded')")
    assert "#/fit" in page.url
    page.unroute(uploads)


def test_a_dropped_connection_is_said_and_recovers(page: Any, served: Served, folder: Path) -> None:
    page.goto(served.url)
    page.wait_for_selector("text=recording.parquet")
    wanted = {"recording": "recording.parquet", "vehicle": "vehicle.yaml"}
    for output in ("one.parquet", "two.parquet"):
        page.request.post(f"{served.url}/api/jobs/estimate", data={**wanted, "output": output})
    page.wait_for_selector(".state:has-text('waits for the one before')")
    served.stop()
    page.wait_for_selector("text=does not respond; trying again")
    page.route(
        "**/assets/page-*.js", lambda route: route.abort("connectionrefused")
    )  # also from the browser's cache
    page.click("nav >> text=Fit")  # the bar said "Fit", and the folder stayed below it
    page.wait_for_selector("text=This page could not be loaded")
    page.unroute("**/assets/page-*.js")
    served.start()
    page.wait_for_selector("#curve-list")
    page.click("nav >> text=Folder")
    page.wait_for_function("() => document.querySelectorAll('.state.interrupted').length === 2")
    served.stop()
    page.wait_for_selector("text=does not respond; trying again")
    page.click("a:text-is('recording.parquet')")  # 'the log has changed', for ever
    page.wait_for_selector(".bad:has-text('The studio does not respond')")
    served.start()
    page.wait_for_selector("text=ready to estimate")
    assert page.locator(".note:has-text('does not respond')").count() == 0  # it stayed for six seconds
    page.click("nav >> text=Folder")
    page.wait_for_function("() => document.getElementById('connection').textContent === ''")
    (folder / "late.csv").write_text("time,ground_speed\n0,1\n1,1\n2,1\n")
    page.wait_for_selector("text=late.csv")


def test_two_tabs_see_each_others_changes(page: Any, served: Served) -> None:
    other = page.context.new_page()
    for tab in (page, other):
        tab.goto(served.url)
        tab.wait_for_selector("text=recording.parquet")
        tab.wait_for_load_state("networkidle")  # its own first looks at the folder are over
    page.set_input_files(
        "#new-file",
        files=[{"name": "mine.csv", "mimeType": "", "buffer": b"time,ground_speed\n0,1\n1,1\n2,1\n"}],
    )
    other.wait_for_selector("text=mine.csv")
    other.close()


def test_drive_zooms_brushes_and_explains_a_sample(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    chart = page.locator(".u-over").first
    box = chart.bounding_box()
    before = page.evaluate("() => window.terragripDrive.charts.range")
    page.mouse.move(box["x"] + 200, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 40, steps=4)
    page.mouse.up()
    after = page.evaluate("() => window.terragripDrive.charts.range")
    assert after[1] - after[0] < 0.5 * (before[1] - before[0])
    chart.click(position={"x": 100, "y": 30})
    page.wait_for_selector(".why")
    assert "adhesion" in page.inner_text(".why >> nth=0")
    time_of = page.inner_text(".sample strong")
    page.click("button[aria-label='Next sample']")
    page.wait_for_function("t => document.querySelector('.sample strong').textContent !== t", arg=time_of)
    page.click("text=Panels")
    page.check("text=Consistency of the filter: NIS")
    page.wait_for_selector('[aria-label="Consistency of the filter: NIS over time"]')
    page.focus(".charts")
    shown = "() => window.terragripDrive.charts.range"
    before = page.evaluate(shown)
    page.keyboard.press("ArrowRight")
    after = page.evaluate(shown)
    assert after[0] - before[0] == pytest.approx(0.1 * (before[1] - before[0]))
    assert after[1] - after[0] == pytest.approx(before[1] - before[0])
    page.keyboard.press("Home")
    assert page.evaluate(shown) == page.evaluate("() => window.terragripDrive.charts.whole")


def test_drive_draws_what_the_filter_adapts(page: Any, served: Served, folder: Path) -> None:
    import terragrip as tg

    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    tg.estimate(recording, vehicle, "aukf-fs").write(folder / "adaptive.parquet")
    page.goto(f"{served.url}/#/drive?path=adaptive.parquet")
    page.wait_for_selector(".charts[data-rows]")
    page.click("text=Panels")
    page.check("text=Adaptation A")
    panel = page.wait_for_selector('[aria-label="Adaptation A over time"]')
    assert [text.strip() for text in panel.query_selector(".legend").inner_text().split("\n")] == [
        "µ rl", "µ rr", "ρs", "ω rl", "ω rr", "v",
    ]  # fmt: skip
    drawn = """() => {
      const canvas = [...document.querySelectorAll(".chart")].at(-1).querySelector("canvas");
      const ink = getComputedStyle(document.documentElement).getPropertyValue("--purple").trim();
      const rgb = [1, 3, 5].map((k) => parseInt(ink.slice(k, k + 2), 16));
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) if (rgb.every((c, k) => Math.abs(data[i + k] - c) < 40)) count++;
      return count;
    }"""
    page.wait_for_function(f"() => ({drawn})() > 200")  # the right rear wheel's trace


def test_a_live_replay_follows_pauses_and_recovers(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/live?replay=estimates.parquet")
    page.wait_for_selector("#live-state:text-is('connected')")
    page.wait_for_function("() => window.terragripLive.feed.ring.taken > 150")
    page.wait_for_function("() => window.terragripLive.traces.redraws > 20")
    page.click("#pause")
    held = page.evaluate("() => window.terragripLive.traces.held")
    page.wait_for_function("held => window.terragripLive.feed.ring.now > held", arg=held)
    assert page.evaluate("() => window.terragripLive.traces.held") == held
    page.click("#pause")
    served.stop()
    page.wait_for_selector("#live-state:has-text('connection lost')")
    served.start()
    page.wait_for_selector("#live-state:text-is('connected')")


def test_the_map_draws_the_track_and_changes_its_colours(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/map?path=estimates.parquet")
    page.wait_for_function("() => window.terragripMap?.map.getSource('track')")
    shades = "() => new Set(window.terragripMap.map.getSource('track').serialize().data.features.map((f) => f.properties.shade)).size"
    assert page.evaluate(shades) > 5
    page.select_option("#map-quantity", "soil")
    page.wait_for_function(f"() => ({shades})() === 1")
    assert "grass" in page.inner_text(".legend-row")
    drawn = "() => getComputedStyle(document.querySelector('.legend-row .strip')).backgroundColor"
    assert page.evaluate(drawn) not in ("rgba(0, 0, 0, 0)", "transparent")


def test_a_map_is_made_from_the_page_and_opened(
    page: Any, served: Served, folder: Path, field_maps: Path
) -> None:
    geopandas = pytest.importorskip("geopandas", reason="maps need terragrip[geo]")
    for file in field_maps.iterdir():
        shutil.copy(file, folder)
    page.goto(f"{served.url}/#/map?path=monday.parquet")
    page.wait_for_selector("#map-make:enabled")
    page.click("#map-make")
    page.fill("#job-cell", "2")
    page.fill("#job-slip", "15")
    page.click("#job-go")
    page.wait_for_selector("#map[data-cells]", timeout=240_000)
    assert "monday-map.gpkg" in page.evaluate("() => decodeURIComponent(location.hash)")
    assert "Adhesion µ at 15 % slip" in page.inner_text("#field-panel")
    page.click(".about-map summary")
    command = page.inner_text(".about-map code")
    assert command == "terragrip map monday.parquet --cell=2 --slip=0.15 --output monday-map.gpkg"
    cells = geopandas.read_file(folder / "monday-map.gpkg", layer="cells")
    page.wait_for_selector(f"#map[data-cells='{int(cells.adhesion.notna().sum())}']")
    page.click("nav >> text=Folder")
    page.click("section[aria-label='Maps'] >> text=once.gpkg")
    page.wait_for_selector("#map[data-cells]")
    assert page.input_value("#map-run") == "once.gpkg"


def test_a_brush_is_the_same_on_drive_and_map_and_in_another_tab(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/drive?path=estimates.parquet")
    page.wait_for_selector(".charts[data-rows]")
    other = page.context.new_page()
    other.goto(f"{served.url}/#/map?path=estimates.parquet")
    other.wait_for_function("() => window.terragripMap?.map.getSource('track')")
    assert other.input_value("#map-run") == "estimates.parquet"
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 20])")
    other.wait_for_function("() => window.terragripMap.charts.range.join() === '10,20'")
    other.evaluate("() => window.terragripMap.charts.zoom([12, 18])")
    page.wait_for_function("() => window.terragripDrive.charts.range.join() === '12,18'")
    other.close()
    page.click("nav >> text=Map")
    page.wait_for_function("() => window.terragripMap?.charts.range.join() === '12,18'")
    assert page.input_value("#map-run") == "estimates.parquet"


EVERYWHERE = {
    "#/start": ".files",
    "#/fit?path=estimates.parquet": "#soil-list li",
    "#/start?log=recording.parquet": "text=ready to estimate",
    "#/drive?path=estimates.parquet&at=20": ".why",
    "#/start?machine": "#machine-name",
    "#/live?replay=estimates.parquet": "#live-state:text-is('connected')",
    "#/cab?replay=estimates.parquet": "#cab-age:not(:has-text('connecting'))",
    "#/map?path=estimates.parquet": ".charts[data-rows]",
    "#/drive?path=none.parquet": ".empty",
}
"""Places, each on another page than the one before, and what is there once they are whole."""


def test_axe_finds_nothing(page: Any, served: Served) -> None:
    """No violation of any weight, and nothing wider than the screen: gone to on a narrow one, then on one made wide."""
    faults = []
    for where, ready in EVERYWHERE.items():
        for width, themes in ((390, ("light",)), (1280, ("light", "dark"))):
            page.set_viewport_size({"width": width, "height": 720})
            if width == 390:
                page.goto(f"{served.url}/{where}")
            page.wait_for_selector(f"main.page-{where[2:].partition('?')[0]} >> {ready}", state="attached")
            faults += [
                (where, width, theme, fault) for theme in themes for fault in axe_violations(page, theme)
            ]
            wide = page.evaluate("() => document.documentElement.scrollWidth")
            faults += [(where, width, "wide", wide)] if wide > width else []
    assert faults == []


@pytest.mark.parametrize(("where", "old"), [("live", "main.stale"), ("cab", ".page-cab.dead")])
def test_axe_finds_nothing_where_the_numbers_are_old(page: Any, served: Served, where: str, old: str) -> None:
    page.goto(f"{served.url}/#/{where}?replay=estimates.parquet")
    page.wait_for_function(r"() => /\d/.test(document.querySelector('.big, .cab-number')?.textContent ?? '')")
    served.stop()
    page.wait_for_selector(old, state="attached")
    assert [(theme, fault) for theme in ("light", "dark") for fault in axe_violations(page, theme)] == []
