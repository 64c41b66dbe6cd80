"""``terragrip report``: one page that loads nothing, one PDF with its own fonts, and a sentence for what is absent."""

from __future__ import annotations

import contextlib
import re
import zlib
from pathlib import Path

import pytest

import made_up
from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.report import soil_sections
from terragrip.report.from_estimates import report_of
from terragrip.report.page import Page, Section, Table, number
from terragrip.soil.library import Soil, SoilLibrary


@pytest.fixture(scope="module", name="files")
def files_fixture(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Six runs on single soils and one across three, with a force sensor."""
    folder = tmp_path_factory.mktemp("estimates")
    for i in range(3):
        made_up.estimates(1000 + i, ("hard",)).write(folder / f"hard-{i}.parquet")
        made_up.estimates(1010 + i, ("fine",)).write(folder / f"fine-{i}.parquet")
    made_up.estimates(1020, ("hard", "fine", "grass", "hard"), sensor=True, rows=2400).write(
        folder / "multi.parquet"
    )
    return [str(path) for path in sorted(folder.glob("*.parquet"))]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page is there at once, for what is about the files alone."""
    page = Page("Traction report", "of nothing", (Section("a", "A", prose=("A word.",)),))
    monkeypatch.setattr("terragrip.report.from_estimates.report_of", lambda *_: page)


@pytest.fixture(scope="module", name="report")
def report_fixture(files: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of all, beside the ground of the last."""
    folder = tmp_path_factory.mktemp("report")
    ground = str(folder / "ground.json")
    assert main(["ground", files[-1], "-o", ground, "--quiet"]) == 0
    words = ["report", *files, "--ground", ground, "-o", str(folder / "report.html")]
    assert main([*words, "--title", "Field <3>", "--quiet"]) == 0
    return folder


def test_the_page_holds_every_section_and_loads_nothing(report: Path) -> None:
    html = (report / "report.html").read_text(encoding="utf-8")
    assert "Field &lt;3&gt;" in html
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#)|@import|url\((?!#)|<script|<link""", html)
    assert "simulated data" not in html
    assert 'class="omitted"' not in html
    for anchor in (
        "tracking-multi",
        "wheels-multi",
        "maxima",
        "curves",
        "trust",
        "missing",
        "soils",
        "advice",
        "ground",
        "sections",
        "events",
        "residuals",
        "methods",
        "honesty",
        "runs",
    ):
        assert f'id="{anchor}"' in html, anchor
    assert "0.046" in html  # the paper's NRMSE on hard
    assert "6 runs" not in html
    assert "7 runs" in html


@pytest.mark.usefixtures("undrawn")
def test_a_library_given_is_what_is_shown(
    files: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is learned beside it; a soil that it does not hold is said."""
    SoilLibrary({"fine": Soil("fine", "exponential", {"a": 0.777})}).write(tmp_path / "soils.json")
    monkeypatch.setattr("terragrip.soil.estimates.learn_soils", None)
    runs = [file for file in files if file.endswith("-0.parquet")]
    words = ["report", *runs, "--library", str(tmp_path / "soils.json"), "-o", str(tmp_path / "report.html")]
    assert main([*words, "--no-pdf", "--quiet"]) == 0
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "0.777" in html
    assert "hard: not fitted, the library does not contain it" in html


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("soil", "is_drawn"), [("grass", True), ("fine", False)])
def test_a_run_on_a_soil_that_the_other_lacks_is_drawn_beside_it(
    tmp_path: Path, soil: str, is_drawn: bool
) -> None:
    """The second run, of one soil, had no place over time nor among the operating points, whatever its soil."""
    made_up.estimates(1, ("hard", "fine"), rows=400).write(tmp_path / "a.parquet")
    made_up.estimates(2, (soil,), rows=400).write(tmp_path / "b.parquet")
    page = report_of([tmp_path / "a.parquet", tmp_path / "b.parquet"])
    anchors = {section.anchor for section in page.sections if section is not None}
    assert ("tracking-b" in anchors, "wheels-b" in anchors) == (is_drawn, is_drawn)
    (points,) = (section for section in page.sections if section is not None and section.anchor == "soils")
    rows = {row[0] for table in points.content if isinstance(table, Table) for row in table.rows}
    assert rows == {"hard", "fine", *([soil] if is_drawn else [])}


@pytest.mark.usefixtures("undrawn")
def test_runs_without_labels_show_the_library_that_is_given(tmp_path: Path) -> None:
    """The studio learns the curve of an unlabelled log under a name and writes the report: it had no curve, for want of a label."""
    made_up.estimates(1000, ("",), rows=300).write(tmp_path / "run.parquet")
    SoilLibrary({"field": Soil("field", "exponential", {"a": 0.777})}).write(tmp_path / "soils.json")
    for words, has_curve in ((["--library", str(tmp_path / "soils.json")], True), ([], False)):
        words = ["report", str(tmp_path / "run.parquet"), *words, "-o", str(tmp_path / "report.html")]
        assert main([*words, "--no-pdf", "--quiet"]) == 0
        html = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert ("0.777" in html, "no soil label, so no curve" in html) == (has_curve, not has_curve)
        assert "The same from" not in html  # a short run has no part to look at closely


def test_the_pdf_is_drawn_with_text_and_brings_its_fonts(report: Path) -> None:
    pdf = (report / "report.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-")
    assert pdf.rstrip().endswith(b"%%EOF")
    assert b"DejaVuSans" in pdf
    assert b"/Subtype/Image" not in pdf.replace(
        b"/Subtype /Image", b"/Subtype/Image"
    )  # figures are drawn, not painted
    assert 20_000 < len(pdf) < 1_000_000


def test_the_pdf_has_an_outline_of_the_sections_and_tags_for_who_cannot_see_it(report: Path) -> None:
    pdf = (report / "report.pdf").read_bytes()
    parts = [pdf]
    for found in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL):
        with contextlib.suppress(zlib.error):
            parts.append(zlib.decompress(found[1]))
    whole = b"\n".join(parts)
    page = (report / "report.html").read_text(encoding="utf-8")
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    titles = whole.count(b"/Parent") and re.findall(rb"/Title ?\(([^)]*)\)", whole)
    assert len(headings) > 10
    for heading in headings:
        if heading.isascii() and "&" not in heading:
            assert heading.encode() in titles, heading
    assert b"/Outlines" in whole
    assert b"/StructTreeRoot" in whole
    assert b"pdfuaid" in whole  # PDF/UA, which Typst refuses to write where tags lack
    assert whole.count(b"/Alt") >= page.count("<figure")
    assert b"/Lang" in whole


def test_no_pdf_and_another_place_for_it(
    drawn: None, files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", files[0], "-o", str(tmp_path / "a.html"), "--no-pdf"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.html"}
    assert main(["report", files[0], "-o", str(tmp_path / "b.html"), "--pdf", str(tmp_path / "c.pdf")]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.html", "b.html", "c.pdf"}
    assert str(tmp_path / "c.pdf") in capsys.readouterr().out


def test_without_typst_the_page_is_written_and_one_line_says_what_to_install(
    drawn: None,
    files: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("terragrip.report.pdf.pdf_possible", lambda: False)
    assert main(["report", files[0], "-o", str(tmp_path / "a.html"), "--quiet"]) == 0
    output = capsys.readouterr()
    assert "pip install 'terragrip[report]'" in output.out
    assert len(output.out.splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"a.html"}


@pytest.mark.usefixtures("undrawn")
def test_one_run_without_labels_or_sensor_leaves_sections_out_with_a_sentence(tmp_path: Path) -> None:
    made_up.estimates(1, ("",)).write(tmp_path / "bare.parquet")
    assert (
        main(["report", str(tmp_path / "bare.parquet"), "-o", str(tmp_path / "a.html"), "--no-pdf", "-q"])
        == 0
    )
    html = (tmp_path / "a.html").read_text(encoding="utf-8")
    omitted = re.findall(r'<p class="omitted">(.*?)</p>', html)
    assert len(omitted) >= 6
    assert all(text.startswith("Left out: ") for text in omitted)
    assert 'id="fig-traction-bare"' in html


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["{0}", "{0}", "-o", "a.html"], "is given twice"),
        (["{0}", "-o", "a.txt"], "is not named .html"),
        (["nowhere.parquet", "-o", "a.html"], "nowhere.parquet"),
        (["{0}", "-o", "a.html", "--library", "nowhere.json"], "nowhere.json"),
        (["{0}", "-o", "a.html", "--pdf", "a.html"], "is not named .pdf"),
        (["{0}", "-o", "nofolder/a.html"], "does not exist"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_leaves_nothing(
    files: list[str],
    words: list[str],
    expected: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", *(word.format(files[0]) for word in words)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert expected in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_the_efficiency_is_that_of_the_vehicles_own_tyres(report: Path) -> None:
    html = (report / "report.html").read_text(encoding="utf-8")
    assert f"ρt = {number(made_up.VEHICLE['tire_rolling_resistance'])} the tyre" in html


@pytest.mark.usefixtures("undrawn")
def test_events_of_the_estimates_are_listed_without_a_ground(tmp_path: Path) -> None:
    from terragrip.estimation.engine import EVENTS

    table = made_up.estimates(5, ("hard",))
    table.event_codes[300:320] = EVENTS.index("gap")
    table.write(tmp_path / "run.parquet")
    words = [
        "report",
        str(tmp_path / "run.parquet"),
        "-o",
        str(tmp_path / "report.html"),
        "--no-pdf",
        "--quiet",
    ]
    assert main(words) == 0
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "1 gap; listed are warnings" in html
    assert "run, 30.0 s" in html
    assert "tool slides up" not in html


@pytest.mark.usefixtures("undrawn")
def test_the_best_slip_counts_the_vehicles_own_rolling_resistance(
    files: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    handed, made = [], soil_sections.both_maxima
    monkeypatch.setattr(
        soil_sections,
        "both_maxima",
        lambda curves, tire, *rest: handed.append(tire) or made(curves, tire, *rest),
    )
    report_of([Path(files[0])])
    vehicle = Estimates.read(files[0]).vehicle
    assert vehicle.tire_rolling_resistance > 0
    assert handed == [vehicle.tire_rolling_resistance]


def test_the_cover_names_three_files_and_counts_the_rest(report: Path) -> None:
    html = (report / "report.html").read_text(encoding="utf-8")
    assert "fine-0.parquet, fine-1.parquet and fine-2.parquet and 4 more" in html
