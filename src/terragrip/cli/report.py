"""``terragrip report``: figures and tables from estimates, as a page and a PDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import EstimatesFiles, Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress


def command(
    estimates: EstimatesFiles,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The page, one HTML file; the PDF is written beside it."
        ),
    ],
    library: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The soils.json whose curves are shown; without it they are learned here."
        ),
    ] = None,
    ground: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A ground.json of these drives: soils over time, sections, events."
        ),
    ] = None,
    pdf: Annotated[
        Path | None, typer.Option("--pdf", metavar="FILE", help="Another place for the PDF.")
    ] = None,
    no_pdf: Annotated[bool, typer.Option("--no-pdf", help="The page only.")] = False,
    title: Annotated[str, typer.Option(metavar="TEXT", help="The report's title.")] = "Traction report",
    quiet: Quiet = False,
) -> None:
    """Make a report of estimates.

    Traction over time, adhesion curves of soils with fits and what to trust, operating points, residuals and intervals. Sections without
    data are left out, and a sentence says what they need. One HTML file that loads nothing, and one PDF.
    """
    from terragrip.ground.result import read as read_ground
    from terragrip.report.from_estimates import report_of
    from terragrip.report.page import render, require_drawing, write_whole
    from terragrip.report.pdf import EXTRA, pdf_possible, write_pdf
    from terragrip.soil.library import SoilLibrary

    inputs = [*estimates, library, ground]
    target = check_file(output, inputs, suffixes=(".html", ".htm"))
    printed = None
    if not no_pdf:
        printed = check_file(pdf or target.with_suffix(".pdf"), inputs, suffixes=(".pdf",), option="--pdf")
    require_drawing()
    beside = SoilLibrary.load(library) if library else None
    grounds = read_ground(ground) if ground else ()
    with progress("report", quiet) as step:
        page = report_of(estimates, beside, grounds, title, step)
    write_whole(target, render(page))
    if not quiet:
        print(f"The page: {target}")
    if printed is None:
        return
    if not pdf_possible():
        print(f"No PDF: typst is not installed; {EXTRA}")
        return
    write_pdf(page, printed)
    if not quiet:
        print(f"The PDF: {printed}")
