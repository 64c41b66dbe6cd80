"""``terragrip soils``: adhesion-slip curves of soils from estimates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress

if TYPE_CHECKING:
    from terragrip.soil.library import Soil


def command(
    estimates: Annotated[
        list[Path], typer.Argument(metavar="ESTIMATES", help="Files written by 'terragrip estimate'.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The soil library, soils.json.")
    ],
    model: Annotated[
        str, typer.Option(metavar="NAME", help="Curve model; the paper's is 'exponential'.")
    ] = "exponential",
    free: Annotated[bool, typer.Option("--free", help="Fit all parameters, not the paper's one.")] = False,
    weights: Annotated[bool, typer.Option("--weights", help="Weight bins by their samples.")] = False,
    lower: Annotated[float, typer.Option(help="Lowest slip of the bins.")] = 0.05,
    upper: Annotated[
        float, typer.Option(help="Highest slip of the bins; on grass 0.40 as the paper.")
    ] = 0.60,
    width: Annotated[float, typer.Option(help="Width of a bin.")] = 0.01,
    minimum: Annotated[int, typer.Option(help="Fewest samples of a bin.")] = 10,
    soil: Annotated[
        str | None, typer.Option(metavar="NAME", help="The soil of all rows, for logs without labels.")
    ] = None,
    merge: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Add to this library; its twins are replaced.")
    ] = None,
    literature: Annotated[
        bool, typer.Option("--literature", help="Add the soils of the literature.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Learn adhesion-slip curves of soils.

    Pairs of slip and adhesion where vehicle and tool stand on one soil and nothing is flagged, in slip bins; a curve for each soil with
    intervals, R2, NRMSE, what the data cannot tell, and what to drive next.
    """
    from terragrip.errors import InputError
    from terragrip.soil.bins import PAPER_BINS, BinSettings
    from terragrip.soil.estimates import soils_of
    from terragrip.soil.fit import FREE, AdhesionCurve
    from terragrip.soil.library import SoilLibrary
    from terragrip.soil.literature import literature_soils

    inputs = [*estimates, *([merge] if merge else [])]
    target = check_file(output, inputs, suffixes=(".json",))
    base = SoilLibrary.load(merge) if merge else None
    try:
        bins = BinSettings(width, lower, upper, minimum)
    except ValueError as error:
        raise InputError(str(error), place="--width, --lower, --upper", mend="choose other bins") from None
    curve = AdhesionCurve(model, FREE if free else None, weights="count" if weights else None, bins=bins)
    special = PAPER_BINS if bins == BinSettings() else {}
    with progress("soils", quiet) as step:
        campaign = soils_of(estimates, curve, special, soil, step)
    library = campaign.library({"files": [str(path) for path in estimates]})
    if base is not None:
        library = base.merge(library, "replace")
    if literature:
        library = library.merge(literature_soils(), "keep")
    library.write(target)
    if not quiet:
        print(table(library))
        for sentence in campaign.words:
            print(sentence)
        print(f"Written to {output}")


def table(library: Mapping[str, Soil]) -> str:
    """The library as lines of text: soil, model, first free parameter with its interval, R2, NRMSE, bins."""
    rows: list[tuple[str, ...]] = [("soil", "model", "parameters (95 % interval)", "R2", "NRMSE", "bins")]
    for name, one in library.items():
        free = one.fit.get("free", list(one.parameters))
        words = []
        for key in free:
            interval = one.interval.get(key)
            words.append(
                f"{key} {one.parameters[key]:.3g}"
                + (f" ({interval[0]:.3g} to {interval[1]:.3g})" if interval else "")
            )
        score = ["" if value is None else f"{value:.3f}" for value in (one.r2, one.nrmse)]
        rows.append((name, one.model, ", ".join(words), *score, str(len(one.bins) or "")))
    widths = [max(len(row[i]) for row in rows) for i in range(6)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
