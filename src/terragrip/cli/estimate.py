"""``terragrip estimate``: from a log to estimates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import DbcFiles, Logs, OtherSources, ProfileFile, Quiet, VehicleFile
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.cli.progress import progress
from terragrip.errors import InputError
from terragrip.estimation.export import KINDS, require_suffix
from terragrip.estimation.methods import DEFAULT, METHODS


def command(
    logs: Logs,
    vehicle: VehicleFile,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="Parquet file, or another by its suffix (docs/export.md); with several logs, a folder.",
        ),
    ],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    others: OtherSources = None,
    method: Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(METHODS)}.")] = DEFAULT,
    smooth: Annotated[bool, typer.Option("--smooth", help="Run the whole log backwards too.")] = False,
    quiet: Quiet = False,
) -> None:
    """Estimate traction from logs.

    Adhesion, slip, soil resistance, net traction and efficiency of every wheel at every row, each with its
    standard deviation, as Parquet. Where no torque was logged: slip, from speeds alone.
    """
    from terragrip.estimation.methods import method_named
    from terragrip.from_log import estimate_file
    from terragrip.vehicle import Vehicle

    if not method_named(method).can_smooth and smooth:
        raise InputError(f"the method {method} cannot smooth", place="--smooth", hint="choose another method")
    if others and len(logs) > 1:
        raise InputError(
            "there are several logs", place="--with", hint="join the sources of one log at a time"
        )
    machine = Vehicle.load(vehicle)
    targets = _targets(
        logs, output, [vehicle, *([profile] if profile else []), *(dbc or []), *(others or [])]
    )
    for number, (log, target) in enumerate(zip(logs, targets, strict=True), 1):
        title = log.name if len(logs) == 1 else f"{log.name} ({number} of {len(logs)})"
        with progress(title, quiet) as step:
            text = estimate_file(
                [log, *others] if others else log,
                machine,
                target,
                method,
                profile=profile,
                dbc=dbc or (),
                smooth=smooth,
                progress=step,
            )
        if not quiet:
            print(text if len(logs) == 1 else f"{log.name}: {text.splitlines()[0]}")
    if not quiet:
        print(f"Written to {output}")


def _targets(logs: list[Path], output: Path, beside: list[Path]) -> list[Path]:
    """The file of each log's estimates, tried before the long work; ``beside`` are the other inputs."""
    inputs = [*logs, *beside]
    if len(logs) == 1:
        target = check_file(output, inputs, suffixes=tuple(KINDS))
        require_suffix(target)
        return [target]
    for log in logs:
        if not log.exists():
            raise InputError("no such file", file=log, hint="check the path")
    targets = files_in(output, logs, ".parquet")
    check_folder(output)
    return [check_file(target, inputs) for target in targets]
