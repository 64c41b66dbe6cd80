"""``terragrip simulate``: a drive of a simulated robot, with the truth beside the log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.options import Quiet
from terragrip.cli.output import check_folder
from terragrip.cli.progress import progress


def _print_names(wanted: bool) -> None:
    if wanted:
        from terragrip.simulation import scenario_names, set_names

        print("sets:      " + ", ".join(set_names()))
        print("scenarios: " + ", ".join(scenario_names()))
        raise typer.Exit


def command(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A scenario file, or the name of a scenario or set.")
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FOLDER", help="Folder for recording, truth and vehicle."),
    ],
    seed: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Random seed of ground, noise and sensor errors.")
    ] = None,
    names: Annotated[
        bool,
        typer.Option("--list", callback=_print_names, is_eager=True, help="List the scenarios and sets."),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a drive, or a set of drives.

    Writes recording, truth and vehicle file; for a set, one folder per run.
    """
    from terragrip.simulation import Scenario, set_names, set_runs, simulate, simulate_campaign

    if scenario in set_names():
        check_folder(output)
        runs = set_runs(scenario)
        with progress(scenario, quiet) as step:
            for name, result in simulate_campaign(runs, seed or 0, step):
                result.save(output / name)
        count = len(runs)
    else:
        loaded = Scenario.load(scenario)
        check_folder(output)
        simulate(loaded, seed).save(output)
        count = 1
    if not quiet:
        print(f"{count} run{'s' * (count > 1)} written to {output}")
