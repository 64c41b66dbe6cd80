"""``terragrip estimate``: from a log to estimates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import DbcFiles, Logs, OtherSources, ProfileFile, Quiet, VehicleFile
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.cli.progress import Step, progress
from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT, METHODS

if TYPE_CHECKING:
    from terragrip.recording import Recording
    from terragrip.vehicle import Vehicle

_MANY = 1_000_000  # rows whose estimates do not fit memory at ease


def command(
    logs: Logs,
    vehicle: VehicleFile,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="PATH", help="Parquet file; with several logs, a folder."),
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
    from terragrip.vehicle import Vehicle

    if not method_named(method).can_smooth and smooth:
        raise InputError(f"the method {method} cannot smooth", place="--smooth", mend="choose another method")
    if others and len(logs) > 1:
        raise InputError(
            "there are several logs", place="--with", mend="join the sources of one log at a time"
        )
    machine = Vehicle.load(vehicle)
    targets = _targets(
        logs, output, [vehicle, *([profile] if profile else []), *(dbc or []), *(others or [])]
    )
    sources = Sources(profile, tuple(dbc or ()), tuple(others or ()))
    for number, (log, target) in enumerate(zip(logs, targets, strict=True), 1):
        title = log.name if len(logs) == 1 else f"{log.name} ({number} of {len(logs)})"
        with progress(title, quiet) as step:
            text = _estimate(log, machine, target, sources, method, smooth, step)
        if not quiet:
            print(text if len(logs) == 1 else f"{log.name}: {text.splitlines()[0]}")
    if not quiet:
        print(f"Written to {output}")


@dataclass(frozen=True)
class Sources:
    """What a log is read with: profile, DBC files, other logs of the same drive."""

    profile: Path | None
    dbc: tuple[Path, ...]
    others: tuple[Path, ...]


def _targets(logs: list[Path], output: Path, beside: list[Path]) -> list[Path]:
    """The file of each log's estimates, tried before the long work; ``beside`` are the other inputs."""
    inputs = [*logs, *beside]
    if len(logs) == 1:
        return [check_file(output, inputs, suffixes=(".parquet",))]
    for log in logs:
        if not log.exists():
            raise InputError("no such file", file=log, mend="check the path")
    targets = files_in(output, logs, ".parquet")
    check_folder(output)
    return [check_file(target, inputs) for target in targets]


def _estimate(
    log: Path, vehicle: Vehicle, target: Path, sources: Sources, method: str, smooth: bool, step: Step
) -> str:
    """Estimate one log into a file and return the summary; a long Parquet file goes through in blocks."""
    from terragrip.formats import read

    found = None if sources.dbc or sources.others or smooth else _blocks_of_a_long_log(log, sources.profile)
    if found is not None:
        from terragrip.estimation import estimate_blocks

        blocks, rows = found
        return estimate_blocks(
            blocks, vehicle, target, method, progress=lambda done: step(min(done, rows), rows)
        )
    path = [log, *sources.others] if sources.others else log
    recording = read(path, sources.profile, dbc=sources.dbc)
    if len(recording) > _MANY and not smooth:
        from terragrip.estimation import estimate_in_parts

        return estimate_in_parts(
            recording, vehicle, target, method, progress=lambda done: step(done, len(recording))
        )
    from terragrip.estimation import estimate

    estimates = estimate(recording, vehicle, method, smooth=smooth, progress=step)
    estimates.write(target)
    return estimates.summary()


def _blocks_of_a_long_log(log: Path, profile: Path | None) -> tuple[Iterator[Recording], int] | None:
    """A table too large to be held in memory at ease, in blocks, and about how many rows it has; None of another log."""
    from terragrip.formats.long_logs import long_log, recordings_of
    from terragrip.formats.profile import Profile

    found = long_log(log)
    if found is None:
        return None
    chosen = None if profile is None else Profile.load(profile)
    blocks = recordings_of(found, chosen, with_torque=True)
    return None if blocks is None else (blocks, found.rows)
