"""``terragrip convert``: estimates as the file of another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import EstimatesFile, Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.estimation.export import KINDS, require_suffix


def command(
    estimates: EstimatesFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help=f"The file: {', '.join(KINDS)}.")
    ],
    quiet: Quiet = False,
) -> None:
    """Write estimates as a file of another program.

    For Excel, MATLAB, QGIS or Foxglove, by the suffix. The file has all columns with their units, and the origin of the estimates.
    Estimates that the format cannot represent are refused before any work.
    """
    from terragrip.estimation.converting import convert

    target = check_file(output, [estimates], suffixes=tuple(KINDS))
    require_suffix(target)
    with progress(output.name, quiet) as step:
        convert(estimates, target, step)
    if not quiet:
        print(f"Written to {output}")
