"""``terragrip estimate``: from a log to estimates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import Logs, ProfileFile, Quiet, VehicleFile
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.cli.progress import progress
from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT, METHODS

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.vehicle import Vehicle


def command(
    logs: Logs,
    vehicle: VehicleFile,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="PATH", help="Parquet file; with several logs, a folder."),
    ],
    profile: ProfileFile = None,
    method: Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(METHODS)}.")] = DEFAULT,
    smooth: Annotated[bool, typer.Option("--smooth", help="Run the whole log backwards too.")] = False,
    quiet: Quiet = False,
) -> None:
    """Estimate traction from logs.

    Adhesion, slip, soil resistance, net traction and efficiency of every wheel at every row, each with its
    standard deviation, as Parquet.
    """
    from terragrip.estimation.methods import method_named
    from terragrip.vehicle import Vehicle

    if smooth and not method_named(method).can_smooth:
        raise InputError(f"the method {method} cannot smooth", place="--smooth", mend="choose another method")
    machine = Vehicle.load(vehicle)
    targets = _targets(logs, output, vehicle, profile)
    for number, (log, target) in enumerate(zip(logs, targets, strict=True), 1):
        title = log.name if len(logs) == 1 else f"{log.name} ({number} of {len(logs)})"
        estimates = _estimate(log, machine, profile, method, smooth, title, quiet)
        estimates.write(target)
        if not quiet:
            text = estimates.summary()
            print(text if len(logs) == 1 else f"{log.name}: {text.splitlines()[0]}")
    if not quiet:
        print(f"Written to {output}")


def _targets(logs: list[Path], output: Path, vehicle: Path, profile: Path | None) -> list[Path]:
    """The file of each log's estimates, tried before the long work."""
    inputs = [*logs, vehicle, *([profile] if profile else [])]
    if len(logs) == 1:
        return [check_file(output, inputs, suffixes=(".parquet",))]
    for log in logs:
        if not log.exists():
            raise InputError("no such file", file=log, mend="check the path")
    targets = files_in(output, logs, ".parquet")
    check_folder(output)
    return [check_file(target, inputs) for target in targets]


def _estimate(
    log: Path, vehicle: Vehicle, profile: Path | None, method: str, smooth: bool, title: str, quiet: bool
) -> Estimates:
    from terragrip.estimation import estimate
    from terragrip.formats import read

    recording = read(log, profile)
    with progress(title, quiet) as step:
        return estimate(recording, vehicle, method, smooth=smooth, progress=step)
