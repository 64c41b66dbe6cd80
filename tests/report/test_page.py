"""The page: self-contained, well formed, honest about being simulated, whole or absent."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.figures import soil_color
from terragrip.report import sections, wheels
from terragrip.report.intervals import pooled, run_coverage
from terragrip.report.page import Headline, Page, Picture, Section, Table, number, percent, render, write_page
from terragrip.report.runs import Run
from terragrip.report.scores import compare, truth_score
from terragrip.report.style import CSS_VARIABLES, in_page, on_paper
from terragrip.report.timeline import Lane, slots, timeline

Drive = Callable[..., Run]


@pytest.fixture(scope="module", name="page")
def page_fixture(drive: Drive) -> Page:
    """A page with every section."""
    first, second = drive("multi1", seed=1), drive("multi2", seed=2)
    comparisons = [c for run in (first, second) for c in compare(run)]
    scores = [score for run in (first, second) if (score := truth_score(run))]
    return Page(
        "Campaign <68 runs>",
        "Everything here is made up.",
        (
            sections.tracking(second),
            sections.slip_and_resistance(second),
            sections.methods(comparisons, scores, "bank"),
            sections.soils(second, [first, second]),
            sections.honesty(second, [*run_coverage(first), *run_coverage(second)]),
        ),
        (Headline("0.9", "R²", "paper 0.8"),),
        simulated=True,
        facts=(("seed", "1"),),
    )


def test_the_page_loads_nothing_and_says_simulated(page: Page, tmp_path: Path) -> None:
    target = write_page(page, tmp_path / "demo")
    html = target.read_text(encoding="utf-8")
    loads = re.findall(r"""(?:src|href|xlink:href|action|data)\s*=\s*["']([^"'#][^"']*)""", html)
    assert loads == []
    assert not re.search(r"@import|url\((?!#)|<script|<link|<iframe", html)
    assert "simulated data" in html
    assert "Campaign &lt;68 runs&gt;" in html
    ids = re.findall(r'\bid="([^"]+)"', html)
    assert len(ids) == len(set(ids))
    targets = set(re.findall(r'href="#([^"]+)"', html)) | set(re.findall(r"url\(#([^)]+)\)", html))
    assert targets <= set(ids)


def test_every_figure_is_an_svg_with_a_caption_that_says_what_it_is(page: Page, tmp_path: Path) -> None:
    write_page(page, tmp_path)
    pictures = [item for section in page.sections for item in section.content if isinstance(item, Picture)]
    assert len(pictures) == 7
    for picture in pictures:
        path = tmp_path / "figures" / f"{picture.name}.svg"
        root = ET.parse(path).getroot()
        assert root.tag.endswith("svg")
        assert path.stat().st_size < 300_000
        assert len(picture.caption) > 40
        assert picture.alt
    captions = " ".join(picture.caption for picture in pictures).lower()
    assert captions.count("simulated") >= 5


def test_a_page_is_the_same_bytes_again(page: Page) -> None:
    assert render(page) == render(page)


def test_colours_of_a_figure_follow_the_page_and_its_text_stays_text(drive: Drive) -> None:
    run = drive()
    svg = timeline(run, [Lane("adhesion [–]", run.estimated("adhesion_rr"))])
    inline = in_page(svg, 'a "label"', "p")
    assert not any(color in inline.lower() for color in CSS_VARIABLES)
    assert "var(--blue)" in inline
    assert 'aria-label="a &quot;label&quot;"' in inline
    assert "time [s]</text>" in inline
    assert "fine" in inline
    assert "stuck" in inline
    ET.fromstring(on_paper(svg).encode())
    ET.fromstring(inline.replace("xlink:", "").encode())


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("missing", ["truth", "recording", "labels", "nis"])
def test_an_absent_input_leaves_a_sentence_not_an_error(drive: Drive, missing: str) -> None:
    run = drive()
    estimates, truth, recording = run.estimates.copy(), run.truth, run.recording
    assert recording is not None
    if missing == "truth":
        truth = None
    if missing == "recording":
        recording = None
    if missing == "labels":
        recording = recording.drop(columns="soil")
        truth = truth.drop(columns="soil") if truth is not None else None
    if missing == "nis":
        estimates["nis"] = np.nan
    run = Run(run.name, estimates, run.method, truth, recording)
    scores = [score] if (score := truth_score(run)) else []
    made = (
        sections.tracking(run),
        sections.slip_and_resistance(run),
        sections.methods(compare(run), scores, "bank"),
        sections.soils(run, [run]),
        sections.honesty(run, run_coverage(run)),
    )
    html = render(Page("t", "l", made))
    assert "simulated data" not in html
    assert ("The strip on top" in html) == (missing != "labels")
    if missing == "labels":
        assert "no section of these runs carries a soil label" in html
    if missing == "truth":
        assert "simulated" not in html
        assert "cover the truth" not in html  # what is shown is the noise alone


def test_a_quantity_that_is_never_known_is_an_empty_lane(drive: Drive) -> None:
    """As soil resistance while a PTO takes an unknown part all along; a warning of NumPy's would fail this test."""
    run = drive()
    unknown = dict.fromkeys(("soil_resistance", "soil_resistance_std"), np.nan)
    bare = Run(run.name, run.estimates.assign(**unknown), run.method)
    assert not sections.slip_and_resistance(bare).omitted


def test_with_nothing_to_compare_the_sections_say_so(drive: Drive) -> None:
    run = drive()
    estimates = run.estimates.assign(nis=np.nan)
    bare = Run(run.name, estimates, "algebraic")
    assert sections.methods([], [], "bank").omitted
    assert sections.honesty(bare, run_coverage(bare)).omitted


def test_coverage_pools_rows_not_runs(drive: Drive) -> None:
    result = [*run_coverage(drive("a", seconds=30.0)), *run_coverage(drive("b", seconds=300.0, seed=3))]
    together = {item.quantity: item for item in pooled(result)}
    mu = together["adhesion µ"]
    assert mu.rows == 4 * (600 + 5900)  # the 5 s stuck are left out
    assert mu.share() == pytest.approx(0.95, abs=0.006)
    assert mu.share(0.5) == pytest.approx(0.5, abs=0.013)
    assert together["soil resistance ρs"].rows == 6500


def test_an_operators_push_is_not_held_against_the_estimate(drive: Drive) -> None:
    run = drive()
    assert run.truth is not None
    rows = int(run.judged.sum())
    push = np.where(run.time < 30, 100.0, 0.0)
    pushed = Run(run.name, run.estimates, run.method, run.truth.assign(true_assist_force=push), run.recording)
    assert int(pushed.judged.sum()) == rows - 600
    assert run_coverage(pushed)[-1].rows == rows - 600


def test_slots_keep_spikes_and_gaps_in_few_points() -> None:
    time = np.arange(0.0, 1000.0, 0.01)
    values = np.zeros(len(time))
    values[54_321] = 7.0
    values[20_000:30_000] = np.nan
    at, drawn = slots(time, values, columns=300)
    assert len(at) <= 2 * 300 + 2
    assert np.nanmax(drawn) == 7.0
    assert at[np.nanargmax(drawn)] == time[54_321]
    assert np.isnan(drawn).any()
    assert np.all(np.diff(at) > 0)
    # a slow channel among fast rows is a line, not dots
    slow = np.where(np.arange(1000) % 7 == 0, 1.0, np.nan)
    assert np.isfinite(slots(np.arange(1000) * 0.01, slow)[1]).all()


def test_a_page_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("x", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be made"):
        write_page(Page("t", "l", (Section("a", "A", content=(Table("c", ("h",), ()),)),)), blocked / "in")


def test_a_failed_rendering_leaves_the_old_page(
    page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "index.html").write_text("old", encoding="utf-8")

    def broken(self: Path, *_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", broken)
    with pytest.raises(InputError, match="No space left"):
        write_page(page, tmp_path)
    assert (tmp_path / "index.html").read_text(encoding="utf-8") == "old"
    assert not list(tmp_path.rglob(".*"))


def test_numbers_are_printed_for_readers() -> None:
    assert number(-0.1234) == "−0.123"
    assert number(float("nan")) == "–"
    assert number(None) == "–"
    assert percent(0.951) == "95.1 %"
    assert soil_color("hard") != soil_color("fine")
    assert (
        soil_color("clay", ("clay", "loam"))
        == soil_color("clay", ("loam", "clay"))
        != soil_color("loam", ("clay", "loam"))
    )


def test_a_sentence_in_a_tables_first_column_is_wrapped() -> None:
    """On one line it pushed the other columns, and its own end, off the page."""
    row = (
        "slip is known to 3 points only, too little to advise by: drive 40 s without load on a road",
        "all",
    )
    page = Page("x", "y", (Section("a", "A", (), (Table("t", ("missing", "for"), (row,)),)),))
    assert '<th scope="row" class="prose">slip is known' in render(page)
    assert re.search(r"th\.prose[^}]*white-space: normal", render(page))


def test_what_has_nothing_to_show_stands_together_at_the_end_with_its_reason() -> None:
    """Eleven empty sections stood between the figures of a log without labels, sensor and positions."""
    sections_ = (
        Section("path", "Where", omitted="Left out: no position."),
        Section("summary", "Summary", ("Driven.",)),
    )
    html = render(Page("Report", "", sections_))
    assert html.index("Driven.") < html.index("What is left out</h2>") < html.index("Left out: no position.")
    nav = html[html.index("<nav") : html.index("</nav>")]
    assert "#summary" in nav
    assert "#left-out" in nav
    assert "#path" not in nav
    assert 'id="path"' in html
    assert "What is left out" not in render(Page("Report", "", sections_[1:]))


def test_the_wheels_of_a_machine_on_six_axles_can_be_told_apart() -> None:
    """The seventh wheel had the first one's colour and dash."""
    assert len({wheels.look(k) for k in range(12)}) == 12


def test_the_zoom_looks_at_driving(drive: Drive) -> None:
    """A log that mostly stands in its middle showed 40 s of a held value."""
    run = drive(seconds=400.0)
    estimates = run.estimates.copy()
    estimates.loc[(run.time > 30) & (run.time < 330), [f"slip_{wheel}" for wheel in run.wheels]] = np.nan
    quiet = Run(run.name, estimates, run.method)
    whole, near, *_ = sections.tracking(quiet).content
    assert "At standstill it is held." in whole.caption
    start, end = map(int, re.findall(r"from (\d+) to (\d+) s", near.caption)[0])
    assert quiet.moving[(quiet.time > start) & (quiet.time < end)].mean() > 0.4
