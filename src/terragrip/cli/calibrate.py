"""``terragrip calibrate``: what logs tell of a vehicle's sensors and wheels."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import DbcFiles, Logs, ProfileFile, Quiet, VehicleFile
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.errors import InputError
from terragrip.note_pages import with_page


def command(
    logs: Logs,
    vehicle: VehicleFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The calibrated vehicle file (YAML).")
    ],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    light: Annotated[
        list[str] | None,
        typer.Option(
            "--light",
            metavar="FROM:TO",
            help="Seconds of a log without torque that were driven without load, or 'all'; once per log, in their order.",
        ),
    ] = None,
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
    check_file(output, [*logs, vehicle, profile, *(dbc or [])], suffixes=(".yaml", ".yml"))
    spans = _spans(light or [], len(logs))
    recordings = []
    with progress("reading", quiet) as step:
        for number, log in enumerate(logs, 1):
            recordings.append(read(log, profile, dbc=tuple(dbc or ())))
            step(number, len(logs), log.name)
    calibration = calibrate(recordings, machine, light=spans)
    if not any(quantity.applies for quantity in calibration.quantities):
        for note in calibration.notes:
            print(f"Note: {with_page(note)}")
        reasons = "; ".join(f"{unknown.name}: {unknown.why}" for unknown in calibration.unknown)
        raise InputError(
            f"nothing can be calibrated ({reasons})",
            file=logs[0],
            hint="record a standstill, a straight pass without load and some minutes of work",
        )
    calibration.apply(machine).save(output)
    if not quiet:
        print(calibration.table())
        print(f"\nWritten to {output}")


def _spans(light: list[str], logs: int) -> list[tuple[float, float] | None] | None:
    """Spans [s] of the logs that were driven without load, from the options."""
    if not light:
        return None
    if len(light) > logs:
        raise InputError(
            f"{len(light)} spans for {logs} logs", place="--light", hint="give at most one per log"
        )
    spans: list[tuple[float, float] | None] = []
    for text in light:
        first, _, last = text.partition(":")
        try:
            span = (-math.inf, math.inf) if text == "all" else (float(first), float(last))
        except ValueError:
            span = (math.nan, math.nan)
        if not span[0] < span[1]:
            raise InputError(
                f"{text!r} is not a span", place="--light", hint="write e.g. '120:300' [s], or 'all'"
            )
        spans.append(span)
    return spans + [None] * (logs - len(light))
