"""``terragrip estimate``: from logs to estimates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.drives import Drive, drives_in, drives_of
from terragrip.cli.options import DbcFiles, Method, OtherSources, ProfileFiles, Quiet, VehicleFile
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.cli.progress import progress
from terragrip.errors import InputError
from terragrip.estimation.export import KINDS, require_suffix
from terragrip.estimation.methods import DEFAULT


def command(
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
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="LOG", help="Logs of any known format (docs/formats.md), or folders or patterns of them."
        ),
    ] = None,
    profile: ProfileFiles = None,
    dbc: DbcFiles = None,
    others: OtherSources = None,
    table: Annotated[
        Path | None,
        typer.Option(
            "--drives",
            metavar="TABLE",
            help="In place of LOG: a CSV with the columns log, profile, drive; logs of one drive are joined.",
        ),
    ] = None,
    method: Method = DEFAULT,
    smooth: Annotated[bool, typer.Option("--smooth", help="Also smooth the whole log backwards.")] = False,
    quiet: Quiet = False,
) -> None:
    """Estimate traction from logs.

    Adhesion, slip, soil resistance, net traction and efficiency of every wheel in every row, each with its standard deviation, as Parquet.
    Without a logged torque: slip, from speeds alone. Of several logs, one that cannot be read does not stop the others; the exit code
    is then 2.
    """
    from terragrip.estimation.methods import method_named
    from terragrip.formats.registry import is_bag
    from terragrip.from_log import estimate_file
    from terragrip.vehicle import Vehicle

    method_named(method, smooth=smooth)
    machine = Vehicle.load(vehicle)
    drives = _drives(logs or [], profile or [], others or [], table)
    used = [p for drive in drives for p in drive.profiles if p is not None]
    # A folder that happens to hold one log goes into a folder all the same, as a script expects.
    listed = table is not None or any(
        not (log.is_file() or (log.is_dir() and is_bag(log))) for log in logs or []
    )
    into_folder = len(drives) > 1 or (listed and output.suffix.lower() not in KINDS)
    targets = _targets(drives, output, into_folder, [vehicle, *used, *(dbc or []), table])

    def estimated(drive: Drive, target: Path, title: str) -> str:
        with progress(title, quiet) as step:
            return estimate_file(
                drive.source,
                machine,
                target,
                method,
                profile=drive.profile,
                dbc=dbc or (),
                smooth=smooth,
                progress=step,
            )

    if not into_folder:
        text = estimated(drives[0], targets[0], drives[0].name)
        if not quiet:
            print(text)
            print(f"Written to {output}")
        return
    _one_by_one(drives, targets, output, estimated, quiet)


def _drives(logs: list[Path], profiles: list[Path], others: list[Path], table: Path | None) -> list[Drive]:
    """What to estimate; raises InputError where the call says it twice or not at all, or a profile cannot be used."""
    from terragrip.formats import Profile

    if table is not None:
        if logs or profiles or others:
            raise InputError(
                "names the logs and profiles itself",
                file=table,
                place="--drives",
                hint="leave out the others",
            )
        drives = drives_in(table)
    elif logs:
        drives = drives_of(logs, profiles, others)
    else:
        raise InputError("no log is named", place="LOG", hint="name logs or a folder, or a table by --drives")
    for profile in {profile for drive in drives for profile in drive.profiles if profile is not None}:
        Profile.load(profile)
    return drives


def _one_by_one(
    drives: list[Drive],
    targets: list[Path],
    output: Path,
    estimated: Callable[[Drive, Path, str], str],
    quiet: bool,
) -> None:
    """Estimate all drives; those that cannot be are named on standard error, and raise InputError at the end."""
    from terragrip.from_log import follows

    faults, before = [], None
    for number, (drive, target) in enumerate(zip(drives, targets, strict=True), 1):
        try:
            text = estimated(drive, target, f"{drive.name} ({number} of {len(drives)})")
        except InputError as error:
            fault = str(error) if drive.logs[0].name in str(error) else f"{drive.name}: {error}"
            faults.append(fault)
            continue
        if not quiet:
            first, *rest = text.splitlines()
            print(
                "\n  ".join([f"{drive.name}: {first}", *(line for line in rest if line.startswith("Note: "))])
            )
            if before is not None and follows(target, before[1]):
                print(
                    f"  Note: {drive.name} begins where {before[0].name} ends. If a logger cut one drive into these files, make one file "
                    "of them (docs: formats#many-logs-at-once): each was estimated as a drive of its own."
                )
        before = drive, target
    if not quiet and len(faults) < len(drives):
        print(f"Written to {output}: {len(drives) - len(faults)} of {len(drives)}")
    for fault in faults[:-1]:
        typer.echo(f"terragrip: {fault}", err=True)
    if faults:
        raise InputError(
            f"{faults[-1]} ({len(faults)} of {len(drives)} logs could not be estimated; the others are)"
        )


def _targets(drives: list[Drive], output: Path, into_folder: bool, beside: list[Path | None]) -> list[Path]:
    """The file of each drive's estimates, tried before the long work; ``beside`` are the other inputs."""
    logs = [log for drive in drives for log in drive.logs]
    inputs = [*logs, *beside]
    if not into_folder:
        target = check_file(output, inputs, suffixes=tuple(KINDS))
        require_suffix(target)
        return [target]
    if output.suffix.lower() in KINDS and not output.is_dir():
        raise InputError(
            f"is one file for {len(drives)} logs", file=output, place="--output", hint="name a folder"
        )
    for log in logs:
        if not log.exists():
            raise InputError("no such file", file=log, hint="check the path")
    targets = files_in(
        output, [drive.logs[0].with_name(Path(drive.name).name) for drive in drives], ".parquet"
    )
    check_folder(output)
    return [check_file(target, inputs) for target in targets]
