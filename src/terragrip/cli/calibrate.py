"""``terragrip calibrate``: what logs tell of a vehicle's sensors and wheels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import DbcFiles, Logs, ProfileFile, Quiet, VehicleFile
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.errors import InputError


def command(
    logs: Logs,
    vehicle: VehicleFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The calibrated vehicle file (YAML).")
    ],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    quiet: Quiet = False,
) -> None:
    """Calibrate a vehicle from its logs.

    Sensor zeros from standstill, rolling radii from straight passes without load, relative torque gains from
    the adhesion that wheels share. Writes a new vehicle file.
    """
    from terragrip.estimation import calibrate
    from terragrip.formats import read
    from terragrip.vehicle import Vehicle

    machine = Vehicle.load(vehicle)
    check_file(
        output, [*logs, vehicle, *([profile] if profile else []), *(dbc or [])], suffixes=(".yaml", ".yml")
    )
    recordings = []
    with progress("reading", quiet) as step:
        for number, log in enumerate(logs, 1):
            recordings.append(read(log, profile, dbc=tuple(dbc or ())))
            step(number, len(logs), log.name)
    found = calibrate(recordings, machine)
    if not any(quantity.applies for quantity in found.quantities):
        reasons = "; ".join(f"{unknown.name}: {unknown.why}" for unknown in found.unknown)
        raise InputError(
            f"nothing can be calibrated ({reasons})",
            file=logs[0],
            mend="record a standstill, a straight pass without load and some minutes of work",
        )
    found.apply(machine).save(output)
    if not quiet:
        print(found.table())
        print(f"\nWritten to {output}")
