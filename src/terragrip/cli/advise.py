"""``terragrip advise``: which slip, load, speed and ballast are best, from estimates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import EstimatesFiles, Quiet, VehicleFile
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.note_pages import doubts_of, with_page


def command(
    estimates: EstimatesFiles,
    vehicle: VehicleFile,
    soils: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Known soils, soils.json; without it curves are learned from the estimates."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The advice, advice.json.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Advise on the best slip, load, speed and ballast.

    For each soil: the slip of best efficiency and of most pull power with intervals, the trade-off between them, grip in reserve, what to
    do about load, speed, ballast and tyre pressure, and which data are missing. Without torques: slip compared with the usual band of 8
    to 15 %.
    """
    from terragrip.advice.analysis import advise
    from terragrip.advice.result import words, write
    from terragrip.estimation import Estimates
    from terragrip.soil.estimates import distinct, repeated
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

    target = check_file(output, [*estimates, vehicle, soils], suffixes=(".json",)) if output else None
    machine = Vehicle.load(vehicle)
    library = SoilLibrary.load(soils) if soils else None
    tables = []
    with progress("advise", quiet) as step:
        for number, path in enumerate(distinct(estimates), 1):
            tables.append(Estimates.read(path))
            step(number, len(estimates) + 1)
        advice, way = advise(tables, machine, library)
        step(len(estimates) + 1, len(estimates) + 1)
    if target:
        write(advice, way, target)
    if not quiet:
        for doubt in doubts_of(
            (path.stem, table.notes) for path, table in zip(estimates, tables, strict=True)
        ):
            print(with_page(doubt))
        print(*repeated(estimates), words(advice), sep="\n")
        if target:
            print(f"Written to {output}")
