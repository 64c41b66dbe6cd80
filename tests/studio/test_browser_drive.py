"""The drive page in a real browser: every sample, every panel, the right ground, files that change under it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import terragrip as tg
from served import DETAILS, Served
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")
pytestmark = DETAILS

COUNT = """([shade, number]) => {
  const canvas = [...document.querySelectorAll(".chart")].at(number).querySelector("canvas");
  const ink = getComputedStyle(document.documentElement).getPropertyValue(`--${shade}`).trim();
  const rgb = [1, 3, 5].map((k) => parseInt(ink.slice(k, k + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && rgb.every((c, k) => Math.abs(data[i + k] - c) < 40)) count++;
  return count;
}"""
"""Pixels of a colour in a chart; not those of a tint, which have that colour at a low alpha."""


def open_drive(page: Any, served: Served, path: str, panels: str = "") -> None:
    page.goto(served.url)
    if panels:
        page.evaluate("p => localStorage.setItem('terragrip-drive-panels', p)", panels)
    page.goto(f"{served.url}/#/drive?path={path}")
    page.wait_for_selector(".charts[data-rows]")


def test_ground_is_that_of_the_run(page: Any, served: Served, folder: Path) -> None:
    def section(run: str, soil: str) -> dict[str, Any]:
        return {"run": run, "start": 0.0, "end": 60.0, "soil": soil, "probabilities": {soil: 0.58}}

    sections = [section("another", "coarse"), section("estimates", "hard")]
    (folder / "ground.json").write_text(json.dumps({"changes": [], "sections": sections}))
    open_drive(page, served, "estimates.parquet")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 40)
    page.wait_for_selector(".line:has-text('recognised: hard (58 %)')")


def test_samples_between_gaps_are_drawn_as_points(page: Any, served: Served, folder: Path) -> None:
    """A drawbar force at 2 Hz among rows at 100 Hz: no two samples are neighbours, so no line joins any."""
    log = pl.read_parquet(folder / "recording.parquet")
    sparse = np.arange(len(log)) % 50 == 0
    log.with_columns(
        pl.when(pl.Series(sparse)).then(pl.col("drawbar_force")).otherwise(None).alias("drawbar_force")
    ).write_parquet(folder / "sparse.parquet")
    recording, vehicle = tg.read(folder / "sparse.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    tg.estimate(recording, vehicle).write(folder / "sparse-estimates.parquet")
    open_drive(page, served, "sparse-estimates.parquet", '["drawbar"]')
    page.evaluate("() => window.terragripDrive.charts.zoom([10, 14])")
    page.wait_for_function("() => Number(document.querySelector('.charts').dataset.rows) < 1000")
    page.wait_for_function(f"() => ({COUNT})(['green', 0]) > 40")  # eight points of 4 px


def test_all_panels_of_four_wheels_are_drawn_at_once(page: Any, served: Served, folder: Path) -> None:
    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    tg.estimate(recording, vehicle, "aukf-fs").write(folder / "adaptive.parquet")
    every = (
        '["adhesion","slip","resistance","efficiency","traction","speed","torque","drawbar","curve","nis",'
        '"supervisor","adaptation","load"]'
    )
    open_drive(page, served, "adaptive.parquet", every)
    for wheel in ("fl", "fr"):
        page.click(f".chip:text-is('{wheel}')")
    asked = "() => performance.getEntriesByType('resource').map((r) => r.name.split('column=').length - 1)"
    page.wait_for_function(f"() => Math.max(...({asked})()) >= 73")
    page.wait_for_function("() => document.querySelectorAll('.chart').length === 13")
    page.wait_for_function(f"() => ({COUNT})(['purple', 0]) > 200")  # the last wheel, drawn over the others
    assert page.locator(".note.error").count() == 0


def test_slip_beyond_the_usual_is_drawn_or_told(page: Any, served: Served, folder: Path) -> None:
    """A stretch at -120 % (a locked wheel rolling back) is drawn; a spike of 900 % is listed in the corner."""
    table = pl.read_parquet(folder / "estimates.parquet")
    time = table["time"].to_numpy()
    slip = table["slip_rr"].to_numpy().copy()
    slip[(time > 20) & (time < 25)] = -1.2
    slip[np.searchsorted(time, 30.0)] = 9.0
    whole = Estimates.read(folder / "estimates.parquet")
    whole.columns["slip_rr"] = slip
    whole.write(folder / "beyond.parquet")
    open_drive(page, served, "beyond.parquet", '["slip"]')
    low = "() => window.terragripDrive.charts.scale(0)"
    page.wait_for_function(f"() => ({low})()[0] < -120")
    assert page.evaluate(low)[1] < 250
    page.wait_for_function(f"() => ({COUNT})(['bad', 0]) > 40")  # up to 900 %


def test_notes_of_the_estimates_are_shown(page: Any, served: Served, folder: Path) -> None:
    whole = Estimates.read(folder / "estimates.parquet")
    replace(whole, notes=("no drawbar_force: nothing is towed",)).write(folder / "noted.parquet")
    open_drive(page, served, "noted.parquet")
    page.click(".run-notes summary")
    assert "nothing is towed" in page.inner_text(".run-notes ul")
    for width in (1280, 390):  # it hung out of the window on the left
        page.set_viewport_size({"width": width, "height": 800})
        box = page.locator(".run-notes ul").bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width


def test_a_log_with_a_date_is_read_by_the_clock(page: Any, served: Served, folder: Path) -> None:
    whole = Estimates.read(folder / "estimates.parquet")
    began = {"recording": {**whole.about["recording"], "time_zero": "2026-10-14T07:59:50+00:00"}}
    replace(whole, about={**whole.about, **began}).write(folder / "dated.parquet")
    open_drive(page, served, "dated.parquet")
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 40)  # 17 s on
    page.wait_for_selector(".line:has-text('t 2026-10-14 08:00:0')")
    page.wait_for_selector(".events .name:has-text('07:59:50.0')")


def test_a_run_whose_wheels_have_other_names_is_seen_over_another(
    page: Any, served: Served, folder: Path
) -> None:
    """It was in the legend, and nothing of it in the charts: its wheels could not be chosen."""
    whole = Estimates.read(folder / "estimates.parquet")
    names = {"rl": "hl", "rr": "hr", "fl": "vl", "fr": "vr"}

    def german(column: str) -> str:
        parts = column.split("_")
        return "_".join(names.get(part, part) for part in parts)

    replace(whole, columns={german(k): v for k, v in whole.columns.items()}).write(folder / "german.parquet")
    page.goto(f"{served.url}/#/drive?path=estimates.parquet&with=german.parquet&over=elapsed&panels=slip")
    page.wait_for_selector(".chart:has-text('german hr')")
    for wheel in ("hl", "hr"):
        page.click(f".chip:text-is('{wheel}')")
    page.wait_for_selector("#no-wheels:has-text('No wheel of german is chosen')")
    page.click(".chip:text-is('vl')")
    page.wait_for_selector(".chart:has-text('german vl')")


def test_a_replaced_run_is_shown_anew_and_a_removed_one_is_said(
    page: Any, served: Served, folder: Path
) -> None:
    open_drive(page, served, "estimates.parquet")
    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    tg.estimate(recording.select(slice(0, 1500)), vehicle).write(folder / "estimates.parquet")
    page.wait_for_selector(".note:has-text('was replaced: reloaded')")
    page.wait_for_function("() => window.terragripDrive.charts.whole[1] < 16")
    (folder / "estimates.parquet").unlink()
    page.wait_for_selector(".charts:has-text('was removed from the folder')")
    assert page.locator(".chart").count() == 0


@pytest.mark.parametrize(("where", "path"), [("drive", "gone.parquet"), ("map", "broken.parquet")])
def test_a_link_to_what_is_not_there_opens_no_other_run(
    page: Any, served: Served, folder: Path, where: str, path: str
) -> None:
    (folder / "broken.parquet").write_bytes(b"PAR1 broken")
    page.goto(f"{served.url}/#/{where}?path={path}")
    said = f".charts:has-text('{path} contains no estimates')"
    page.wait_for_selector(said)
    page.emulate_media(color_scheme="dark")
    page.wait_for_function("() => document.documentElement.dataset.theme === 'dark'")
    assert page.locator(said).count() == 1  # what is drawn anew leaves it
    assert page.locator(".chart").count() == 0
    assert path in page.evaluate("() => document.querySelector('main select').selectedOptions[0].textContent")
    assert (
        page.locator(".tools > :visible").count() == 1
    )  # the choice: there is nothing to colour, save or zoom
    page.select_option("main select", "estimates.parquet")
    page.wait_for_selector(".chart")
    if where == "map":  # it was hidden, and shows the whole track
        page.wait_for_function("() => window.terragripMap.map.getZoom() > 14")
