"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Logs = Annotated[list[Path], typer.Argument(metavar="LOG", help="Logs: CSV (plain or gzipped) or Parquet.")]
VehicleFile = Annotated[Path, typer.Option("--vehicle", metavar="FILE", help="The vehicle file (YAML).")]
ProfileFile = Annotated[
    Path | None,
    typer.Option("--profile", metavar="FILE", help="How the log's columns become Terragrip's (YAML)."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]
