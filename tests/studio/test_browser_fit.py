"""The fit page in a real browser: bins by slip or pull, residuals, several soils at once, points as CSV, the loupe."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from served import DETAILS, Served
from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BY_SLIP, BinSettings
from terragrip.soil.estimates import soils_of
from terragrip.soil.fit import AdhesionCurve

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

BINS = "() => window.terragripFit.state.soils[0].bins"
RIGHT = "() => { const r = window.terragripFit.residuals.summary; return r.count ? r : null; }"


def open_fit(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/fit?path=estimates.parquet")
    page.wait_for_selector("#soil-list li")


def test_bins_by_slip_are_those_of_terragrip_soils_by_slip(page: Any, served: Served, folder: Path) -> None:
    open_fit(page, served)
    by_pull = page.evaluate(BINS)
    page.select_option("#bins-by", "slip")
    page.wait_for_function(f"n => ({BINS})().length !== n", arg=len(by_pull))
    name = page.evaluate("() => window.terragripFit.state.soils[0].name")
    curve = AdhesionCurve(bins=BinSettings(0.01, 0.05, 0.60, 10, BY_SLIP))
    soils = soils_of([folder / "estimates.parquet"], curve, bins={}).soils
    wanted = [one["mean"] for one in soils[name].curve.bins_.to_list()]
    np.testing.assert_allclose([one["mean"] for one in page.evaluate(BINS)], wanted, rtol=1e-9)
    page.click("#fit-button")
    page.wait_for_selector(".badge")
    fitted = page.evaluate("() => window.terragripFit.state.active.fit.bins.map((b) => b.mean)")
    np.testing.assert_allclose(fitted, wanted, rtol=1e-9)  # the fit takes what is shown
    page.select_option("#bins-by", "pull")
    page.wait_for_function(f"n => ({BINS})().length === n", arg=len(by_pull))


def test_estimates_without_adhesion_say_so(page: Any, served: Served, folder: Path) -> None:
    """They showed the prototype, without a word, and an undo of what nobody had done."""
    table = Estimates.read(folder / "estimates.parquet")
    kept = {
        k: v for k, v in table.columns.items() if not k.startswith(("adhesion", "net_traction", "efficiency"))
    }
    dataclasses.replace(table, columns=kept).write(folder / "slip.parquet")
    page.goto(f"{served.url}/#/fit?path=slip.parquet")
    page.wait_for_selector(".note.error:has-text('slip.parquet: has slip but no adhesion')")
    assert page.locator("button", has_text="Undo").is_disabled()


def test_residuals_are_bins_less_the_curve(page: Any, served: Served) -> None:
    open_fit(page, served)
    page.fill("#field-a", "0.7")
    page.press("#field-a", "Tab")
    page.click("#residuals")
    page.wait_for_function(
        "() => { const s = window.terragripFit.state; return s.samples.isCurrent(s.active.id, s.active); }"
    )
    bins = page.evaluate(BINS)
    left = [b["mean"] - CURVES["exponential"].value(b["slip"], {"a": 0.7}) for b in bins]
    page.wait_for_function(
        f"w => {{ const r = ({RIGHT})(); return r && Math.abs(r.rms - w) < 0.01 * w; }}",
        arg=float(np.sqrt(np.mean(np.square(left)))),
    )
    found = page.evaluate(RIGHT)
    assert found["count"] == len(bins)
    assert found["rms"] == pytest.approx(float(np.sqrt(np.mean(np.square(left)))), rel=0.01)
    assert found["largest"] == pytest.approx(float(np.max(np.abs(left))), rel=0.01)


def test_each_shown_soil_gets_its_curve(page: Any, served: Served, folder: Path) -> None:
    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    half = len(recording) // 2
    tg.estimate(recording.select(slice(half)), vehicle).write(folder / "half.parquet")
    open_fit(page, served)
    page.wait_for_selector("#soil-file option[value='half.parquet']", state="attached")
    page.select_option("#soil-file", "half.parquet")
    page.wait_for_function("() => window.terragripFit.state.soils.length === 2")
    page.click("#fit-each")
    page.wait_for_selector("#fits tbody tr >> nth=1")
    scales = page.evaluate(
        "() => window.terragripFit.state.kept.curves.filter((c) => c.fit).map((c) => c.parameters.a)"
    )
    wanted = [
        soils_of([folder / name]).soils["grass"].curve.parameters_["a"]
        for name in ("estimates.parquet", "half.parquet")
    ]
    np.testing.assert_allclose(scales, wanted, rtol=1e-6)
    page.keyboard.press("Control+z")  # one step
    assert page.evaluate("() => window.terragripFit.state.kept.curves.length") == 1


def test_points_are_exported_as_they_are_shown(page: Any, served: Served, tmp_path: Path) -> None:
    open_fit(page, served)
    with page.expect_download() as waiting:
        page.click("#points-csv")
    waiting.value.save_as(tmp_path / "points.csv")
    rows = list(csv.DictReader((tmp_path / "points.csv").open()))
    bins = [row for row in rows if row["kind"] == "bin"]
    shown = page.evaluate(BINS)
    np.testing.assert_allclose([float(r["adhesion [-]"]) for r in bins], [b["mean"] for b in shown])
    points = page.evaluate("() => window.terragripFit.state.soils[0].points.slip.length")
    assert sum(row["kind"] == "point" for row in rows) == points


def test_a_fit_that_takes_long_says_so(page: Any, served: Served) -> None:
    page.goto(f"{served.url}/#/fit?path=estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.evaluate(
        """() => {
          window.said = [];
          new MutationObserver(() => window.said.push(document.getElementById("fit-progress")?.textContent ?? ""))
            .observe(document.querySelector("[aria-label='Curve']"), { subtree: true, childList: true, characterData: true });
        }"""
    )
    page.click("#fit-each")
    page.wait_for_function("() => window.said.includes('Fitting grass, 1 of 1 …')")
    page.wait_for_function("() => window.terragripFit.state.kept.curves.some((curve) => curve.fit)")
    page.wait_for_function("() => document.getElementById('fit-progress').textContent === ''")


def test_the_loupe_shows_the_picture_while_a_line_is_digitised(
    page: Any, served: Served, folder: Path
) -> None:
    from PIL import Image

    picture = np.full((400, 600, 3), 255, np.uint8)
    picture[:, 300:] = (200, 30, 30)  # red from the middle on
    Image.fromarray(picture).save(folder / "scan.png")
    (folder / "scan.png.picture.json").write_text(
        '{"slip": {"marks": [{"pixel": [0, 400], "value": 0}, {"pixel": [600, 400], "value": 0.6}], "log": false},'
        '"adhesion": {"marks": [{"pixel": [0, 400], "value": 0}, {"pixel": [0, 0], "value": 0.8}], "log": false},'
        '"opacity": 0.5, "shown": true, "lines": []}'
    )
    open_fit(page, served)
    page.wait_for_selector("option[value='scan.png']", state="attached")
    page.select_option("select[aria-label='Open a picture from the folder']", "scan.png")
    page.wait_for_selector("text=Digitise a line")
    at = page.evaluate(
        "() => { const { plot } = window.terragripFit; const b = plot.element.getBoundingClientRect();"
        "return [b.x + plot.view.px(0.31), b.y + plot.view.py((plot.view.y.low + plot.view.y.high) / 2)]; }"
    )
    page.mouse.move(*at)
    assert page.is_hidden(".loupe")
    page.click("text=Digitise a line")
    page.mouse.move(at[0] + 1, at[1])
    page.wait_for_selector(".loupe", state="visible")
    sides = page.evaluate(
        """() => { const c = document.querySelector('.loupe'), pen = c.getContext('2d');
        return [0.02, 0.9].map((x) => [...pen.getImageData(x * c.width, 0.4 * c.height, 1, 1).data]); }"""
    )
    assert sides[0][1] > 200  # white on the left
    assert sides[1][0] > 150 > sides[1][1]  # red on the right


def test_a_curve_set_by_hand_outlasts_a_reload_and_who_comes_back_finds_it_once(
    page: Any, served: Served, folder: Path
) -> None:
    """A reload lost it, and each way back to the page's address added the library's curves once more."""
    bins = "() => window.terragripFit.state.soils.map((soil) => soil.bins.length)"
    page.goto(f"{served.url}/#/fit?path=soils.json")
    page.wait_for_selector("#soil-list li")
    before = page.evaluate(bins)
    page.fill("#field-a", "0,7")
    page.press("#field-a", "Tab")
    page.reload()
    page.wait_for_function(
        "n => (window.terragripFit?.state.soils[0]?.bins.length ?? 0) === n", arg=before[0]
    )
    assert page.input_value("#field-a") == "0.7"
    page.goto(f"{served.url}/#/live")
    page.wait_for_selector("#alarms")
    page.go_back()
    page.wait_for_selector("#soil-list li")
    assert page.evaluate(bins) == before
    assert page.locator("#curve-list li").count() == 2  # the prototype and the library's
    page.wait_for_load_state("networkidle")  # else the page, still opening, shows the new file
    library = json.loads((folder / "soils.json").read_text())
    name = next(iter(library["soils"]))
    library["soils"][name]["bins"] = library["soils"][name]["bins"][1:]
    (folder / "soils.json").write_text(json.dumps(library))
    page.wait_for_selector(".note:has-text('soils.json was replaced: reloaded')")
    page.wait_for_function(f"n => ({bins})()[0] === n", arg=before[0] - 1)
    assert page.input_value("#field-a") == "0.7"


def test_a_librarys_curve_comes_with_what_its_fit_left_open_and_keeps_it_when_saved(
    page: Any, served: Served, folder: Path
) -> None:
    """A curve of which soils.json said 'a .001 to 1.7, not fixed' was drawn as sure, and lost its interval in the next library."""
    library = json.loads((folder / "soils.json").read_text())
    ((name, soil),) = library["soils"].items()
    soil["interval"] = {"a": [0.001, 1.7]}
    soil["identifiability"] |= {"identifiable": False, "sentence": "The data leave a open."}
    soil["notes"] = ["The data leave a open."]
    (folder / "soils.json").write_text(json.dumps(library))
    page.goto(f"{served.url}/#/fit?path=soils.json")
    page.wait_for_selector(".result .badge:has-text('not identifiable')")
    assert "0.001 … 1.7" in page.inner_text(".result")
    assert "The data leave a open." in page.inner_text(".result")
    page.wait_for_function("() => document.querySelector('main').textContent.includes('beyond the points')")
    page.once("dialog", lambda dialog: dialog.accept("other.json"))
    page.click("text=Save to library")
    page.wait_for_selector(".note:has-text('saved to other.json')")
    saved = json.loads((folder / "other.json").read_text())["soils"][name]
    for key in ("parameters", "interval", "identifiability", "notes"):
        assert saved[key] == soil[key]


def test_all_shows_the_whole_of_a_curve_above_the_points(page: Any, served: Served) -> None:
    """The paper's curve over the points of a soft soil left the plot at the top."""
    page.goto(f"{served.url}/#/fit?path=soils.json")
    page.wait_for_selector("#soil-list li")
    page.get_by_label("Add a curve from the literature").select_option(index=1)
    page.wait_for_function("""() => {
        const { state, plot } = window.terragripFit;
        const { x, y } = plot.view;
        const tops = state.kept.curves.map((curve) => {
            const { slip, value } = state.samples.of(curve.id, curve) ?? { slip: [], value: [] };
            return Math.max(...value.filter((v, i) => slip[i] >= 0 && slip[i] <= x.high));
        });
        return tops.length > 2 && tops.every((top) => top > 0 && top < y.high);
    }""")


def test_a_fit_without_points_is_asked_for_them_until_there_are_some(page: Any, served: Served) -> None:
    """'Choose a soil ... first' stayed over the points and their fit until it was dismissed."""
    page.goto(f"{served.url}/#/fit")
    page.click("text=Add a curve")
    page.click("#fit-button")
    page.wait_for_selector(".note.error:has-text('Choose a soil, or digitise a line')")
    page.select_option("#soil-file", "estimates.parquet")
    page.wait_for_selector("#soil-list li")
    page.wait_for_selector(".note.error:has-text('Choose a soil')", state="detached")
