"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.estimation.methods import METHODS

Logs = Annotated[
    list[Path], typer.Argument(metavar="LOG", help="Logs of any known format (docs/formats.md).")
]
EstimatesFile = Annotated[
    Path, typer.Argument(metavar="ESTIMATES", help="A Parquet file written by 'terragrip estimate'.")
]
EstimatesFiles = Annotated[
    list[Path], typer.Argument(metavar="ESTIMATES", help="Files written by 'terragrip estimate'.")
]
Method = Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(METHODS)}.")]
VehicleFile = Annotated[Path, typer.Option("--vehicle", metavar="FILE", help="The vehicle file (YAML).")]
ProfileFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--profile",
        metavar="FILE",
        help="Profile that maps the log's columns: a YAML file, or tractor-isobus, ros2-4wd or simulink; may be repeated: "
        "one for each LOG, or for it and each --with.",
    ),
]
ProfileFile = Annotated[
    Path | None,
    typer.Option(
        "--profile",
        metavar="FILE",
        help="Profile that maps the log's columns: a YAML file, or tractor-isobus, ros2-4wd or simulink.",
    ),
]
DbcFiles = Annotated[
    list[Path] | None, typer.Option("--dbc", metavar="FILE", help="A DBC of a CAN log; may be repeated.")
]
OtherSources = Annotated[
    list[Path] | None,
    typer.Option(
        "--with", metavar="LOG", help="Another log of the same drive, to be joined; may be repeated."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary.")]
