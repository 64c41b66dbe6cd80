"""``terragrip inspect``: what is in logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.drives import logs_in
from terragrip.cli.options import DbcFiles, ProfileFile
from terragrip.cli.output import check_file
from terragrip.errors import InputError

if TYPE_CHECKING:
    from terragrip.formats.inspection import Inspection


def command(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG", help="Logs of any known format (docs/formats.md), or folders or patterns of them."
        ),
    ],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    vehicle: Annotated[
        Path | None,
        typer.Option("--vehicle", metavar="FILE", help="Check the log against this vehicle file."),
    ] = None,
    write_profile: Annotated[
        Path | None, typer.Option("--write-profile", metavar="FILE", help="Write the proposed profile here.")
    ] = None,
) -> None:
    """Report what logs contain.

    Columns, rates, gaps, ranges and doubts, the proposed source of each channel, and a profile to start from. For several logs: a line
    each, and the proposals for each layout of columns. Exit code 2 if a log cannot be read or has no wheels.
    """
    from terragrip.files import replacing
    from terragrip.formats import inspect
    from terragrip.formats.inspection_text import summary_of
    from terragrip.recording.checks import how_to_pivot

    if write_profile is not None:
        if write_profile.is_file():
            # It may be one that the user has worked on.
            raise InputError(
                "exists already", file=write_profile, place="--write-profile", hint="name a new file"
            )
        check_file(write_profile, option="--write-profile")
    paths = logs_in(logs)
    if len(paths) == 1:
        result = [inspect(paths[0], profile, vehicle, dbc=dbc or ())]
        print(result[0].to_text())
    else:
        result, faults = [], []
        for path in paths:
            try:
                result.append(inspect(path, profile, vehicle, dbc=dbc or ()))
            except InputError as error:
                faults.append(str(error))
        if result:
            print(summary_of(result))
        for fault in faults[:-1]:
            typer.echo(fault, err=True)
        if faults:
            raise InputError(f"{faults[-1]} ({len(faults)} of {len(paths)} logs could not be read)")
    if write_profile is not None:
        _refuse_several(result, write_profile)
        with replacing(write_profile) as temporary:
            temporary.write_text(result[0].profile, encoding="utf-8")
        print(f"Proposed profile written to {write_profile}")
    elif result and all(one.refused for one in result):
        raise InputError(
            result[0].refused,
            file=result[0].file,
            hint=how_to_pivot([column.name for column in result[0].columns])
            or (
                "log the wheels too, or join it to a log that has them"
                if result[0].rows
                else "check the logger"
            ),
        )


def _refuse_several(result: list[Inspection], target: Path) -> None:
    """Raise InputError unless the logs have the same columns, so that one profile is theirs."""
    layouts = {tuple(column.name for column in one.columns) for one in result}
    if len(layouts) != 1:
        problem = (
            f"would be one profile for {len(layouts)} layouts of columns"
            if result
            else "there is no log to propose it for"
        )
        raise InputError(problem, file=target, place="--write-profile", hint="inspect logs of one kind")
