"""``terragrip inspect``: what is in a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import DbcFiles, ProfileFile
from terragrip.cli.output import check_file
from terragrip.errors import InputError


def command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log of any known format (docs/formats.md).")],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", metavar="FILE", help="Hold the log against this vehicle.")
    ] = None,
    write_profile: Annotated[
        Path | None, typer.Option("--write-profile", metavar="FILE", help="Write the proposed profile here.")
    ] = None,
) -> None:
    """Tell what is in a log.

    Columns, rates, gaps, ranges and doubts, and a profile to begin with.
    """
    from terragrip.files import replacing
    from terragrip.formats import inspect

    if write_profile is not None:
        if write_profile.is_file():
            # It may be one that the user has worked on.
            raise InputError(
                "exists already", file=write_profile, place="--write-profile", mend="name a new file"
            )
        check_file(write_profile, option="--write-profile")
    found = inspect(log, profile, vehicle, dbc=dbc or ())
    print(found.to_text())
    if write_profile is not None:
        with replacing(write_profile) as temporary:
            temporary.write_text(found.profile, encoding="utf-8")
        print(f"Proposed profile written to {write_profile}")
