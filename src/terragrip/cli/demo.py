"""``terragrip demo``: the whole way on a simulated campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import Quiet
from terragrip.cli.output import check_folder
from terragrip.cli.progress import progress


def command(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the page, figures and tables."),
    ] = Path("terragrip-demo"),
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Another campaign.")] = None,
    quiet: Quiet = False,
) -> None:
    """Simulate, estimate and score a campaign.

    The paper's field campaign on five soils with every method, beside the paper's scores, as figures and a page.
    """
    from terragrip.report.demo import SEED, run_demo

    check_folder(output)
    with progress("demo", quiet) as step:
        result = run_demo(output, seed=SEED if seed is None else seed, progress=step)
    if not quiet:
        print(f"{len(result.estimates)} runs simulated, estimated and scored in {result.seconds:.0f} s")
        print(f"The page: {result.page}")
        if result.pdf is None:
            from terragrip.report.pdf import EXTRA

            print(f"No PDF: typst is not installed; {EXTRA}")
        else:
            print(f"The PDF: {result.pdf}")
