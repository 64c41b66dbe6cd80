"""``terragrip map``: georeferenced maps from estimates with positions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.note_pages import doubts_of, with_page

if TYPE_CHECKING:
    from terragrip.maps import FieldMap


def command(
    inputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="ESTIMATES", help="Files written by 'terragrip estimate', in the order of their days."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The map: .gpkg, .parquet, .geojson, .tif, .png, .svg or .pdf.",
        ),
    ],
    cell: Annotated[
        float | None,
        typer.Option(
            metavar="METRES",
            help="Size of a cell; default the working width, or from lane to lane.",
        ),
    ] = None,
    slip: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Slip at which adhesion is mapped; default near the drive's own."),
    ] = None,
    soils: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="soils.json: the curves that convert adhesion to that slip."),
    ] = None,
    ground: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="ground.json of these runs: their recognised soils."),
    ] = None,
    fill: Annotated[
        float, typer.Option(metavar="CELLS", help="Fill this many cells around the driven ones by kriging.")
    ] = 0.0,
    layer: Annotated[
        str,
        typer.Option(metavar="NAME", help="For .parquet and .geojson: cells, points, anomalies or changes."),
    ] = "cells",
    datum: Annotated[str, typer.Option(metavar="CRS", help="Datum of latitude and longitude.")] = "EPSG:4326",
    quiet: Quiet = False,
) -> None:
    """Map the ground: adhesion at one slip, soil resistance, slip, efficiency.

    Each cell has value, standard deviation, count and passes; patches unlike their surroundings and changes between passes are listed. A
    log without torques gives slip alone.
    """
    from terragrip.errors import InputError
    from terragrip.estimation import Estimates
    from terragrip.maps import MapSettings, map_of, write_map
    from terragrip.maps.layers import LAYERS
    from terragrip.maps.soils import sections_by_run
    from terragrip.maps.writing import require_suffix
    from terragrip.soil.estimates import distinct, repeated
    from terragrip.soil.library import SoilLibrary

    target = check_file(output, [*inputs, soils, ground])
    require_suffix(target)
    for value, name, least, most in (
        (cell, "--cell", 0.05, 1000.0),
        (slip, "--slip", 0.02, 0.9),
        (fill or None, "--fill", 1.0, 100.0),
    ):
        if value is not None and not least <= value <= most:
            raise InputError(f"{value:g} is out of range", place=name, hint=f"take {least:g} to {most:g}")
    if layer not in LAYERS:
        raise InputError(f"there is no layer {layer!r}", place="--layer", hint=f"take {', '.join(LAYERS)}")
    library = SoilLibrary.load(soils) if soils else None
    files = distinct(inputs)
    names = run_names(files)
    sections = sections_by_run(ground, names) if ground else {}
    noted: list[tuple[str, tuple[str, ...]]] = []

    def runs() -> Iterator[tuple[str, Estimates, str]]:
        for name, path in zip(names, files, strict=True):
            table = Estimates.read(path)
            noted.append((name, table.notes))
            yield name, table, str(path)

    steps = len(files) + 2
    with progress("map", quiet) as step:
        made = map_of(
            runs(), MapSettings(cell, slip, datum, fill), library, lambda done: step(done, steps), sections
        )
        step(steps - 1, steps)
        write_map(made, target, layer)
    if not quiet:
        print(*repeated(files), *map(with_page, doubts_of(noted)), summary(made), sep="\n")
        print(f"Written to {output}")


def run_names(files: list[Path]) -> list[str]:
    """The files' names without suffix; with their folder where two are alike: monday/field, friday/field."""
    stems = [path.stem for path in files]
    return [
        f"{path.resolve().parent.name}/{path.stem}" if stems.count(path.stem) > 1 else path.stem
        for path in files
    ]


def summary(made: FieldMap) -> str:
    """Lines of text: the grid, each quantity over field and headland, anomalies, changes, notes."""
    import numpy as np

    from terragrip.maps.anomalies import PATCH, least_difference

    runs = f"{len(made.runs)} run{'s' * (len(made.runs) != 1)}"
    around = " ".join(
        f"{abs(degrees):.3f}° {'NE'[k] if degrees >= 0 else 'SW'[k]}" for k, degrees in enumerate(made.middle)
    )
    lines = [
        f"{runs}, cells of {made.cell:g} m, EPSG:{made.epsg}; positions around {around} in {made.datum}"
        " (--datum names another)"
    ]
    lines.append("Median of the cells, with the 10 % and 90 % quantiles:")
    for name, cells in made.cells.items():
        at = f" at {100 * made.reference_slip:g} % slip" if name == "adhesion" else ""
        driven = cells.count > 0
        line = f"{name}{at}: {int(driven.sum())} cells"
        for area, inside in (("field", cells.headland <= 0.5), ("headland", cells.headland > 0.5)):
            if (driven & inside).any():
                low, middle, high = np.quantile(cells.value[driven & inside], [0.1, 0.5, 0.9])
                line += f"; {area} {middle:.3f} ({low:.3f} to {high:.3f})"
        found = made.anomalies.get(name, [])
        line += f"; {len(found)} anomal{'y' if len(found) == 1 else 'ies'}"
        least = least_difference(cells.where(driven), found) if name in made.anomalies else np.nan
        if np.isfinite(least):
            line += f" (hardly one of {PATCH} cells that differs by less than {least:.2g} can be found)"
        changes = made.changes.get(name)
        if changes is not None:
            line += f"; {int(changes.significant.sum())} of {len(changes)} cells driven again changed"
        lines.append(line)
    return "\n".join([*lines, *map(with_page, made.notes)])
