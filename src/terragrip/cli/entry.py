"""Where the command line starts and ends: parse, run, and turn every failure into an exit code and one line."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import sys
import warnings
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any

import typer

from terragrip.cli.advise import command as advise
from terragrip.cli.calibrate import command as calibrate
from terragrip.cli.convert import command as convert
from terragrip.cli.demo import command as demo
from terragrip.cli.doctor import command as doctor
from terragrip.cli.estimate import command as estimate
from terragrip.cli.failure import INTERRUPTED, report
from terragrip.cli.fleet import command as fleet
from terragrip.cli.ground import command as ground
from terragrip.cli.ground_classifier import app as ground_classifier
from terragrip.cli.inspect import command as inspect
from terragrip.cli.live import command as live
from terragrip.cli.map import command as map_command
from terragrip.cli.new import app as new
from terragrip.cli.report import command as report_command
from terragrip.cli.simulate import command as simulate
from terragrip.cli.soils import command as soils
from terragrip.cli.studio import command as studio

COMPLETION = "_TERRAGRIP_COMPLETE"
"""The environment variable by which a shell's completion calls the program."""

app = typer.Typer(
    name="terragrip",
    help="Traction under the wheels, estimated from signals that a machine already has.",
    # Plain help: rich's boxes triple the time of `--help` and break the one-line rule for errors.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("demo")(demo)
app.add_typer(new, name="new")
app.command("inspect")(inspect)
app.command("estimate")(estimate)
app.command("convert")(convert)
app.command("export", hidden=True)(convert)  # the contract's other name of it
app.command("calibrate")(calibrate)
app.command("soils")(soils)
app.command("ground")(ground)
app.add_typer(ground_classifier, name="ground-classifier")
app.command("map")(map_command)
app.command("advise")(advise)
app.command("report")(report_command)
app.command("simulate")(simulate)
app.command("live")(live)
app.command("studio")(studio)
app.command("fleet")(fleet)
app.command("doctor")(doctor)


def _print_version(wanted: bool) -> None:
    if wanted:
        from terragrip import __version__

        print(f"terragrip {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _terragrip(
    context: typer.Context,
    verbose: Annotated[bool, typer.Option("--verbose", help="Log each step to standard error.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of a failure.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    if verbose:
        from terragrip.cli.log import log_to_stderr

        log_to_stderr()
    if context.invoked_subcommand is None:
        print(context.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments: what follows the program's name; ``sys.argv[1:]`` by default.

    Returns
    -------
    0 done; 2 the input or the call is unusable (one line on standard error); 1 a defect of Terragrip (one
    line that says where the traceback is); 130 interrupted; 141 the reader of standard output went away.
    """
    if arguments is None:
        _search_little_garbage()
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    if not (debug or "--verbose" in words):
        # A failure is one line on standard error; a library's warning would be a second one.
        warnings.simplefilter("ignore")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal without µ or ± gets a question mark, not a traceback
            stream.reconfigure(errors="replace")
    try:
        code = _run(words)
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes standard output once more at exit: give it somewhere to go.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except KeyboardInterrupt as interruption:
        return report(interruption, words, debug)
    return code


def _search_little_garbage() -> None:
    """The collector looks less often, and not at all at the end, when it would look through all that was imported: both are a fifth
    of a short command's time."""
    gc.set_threshold(20_000)
    atexit.register(gc.freeze)


@cache
def program() -> Any:
    """All commands as one group of click, made once: that takes 40 ms of the processor, and a process may call `main` many times."""
    return typer.main.get_command(app)


def _run(words: Sequence[str]) -> int:
    command = program()
    # Parsing eats the list it is given, and the report needs the words.
    if COMPLETION in os.environ:  # the shell asks what may follow; the answer goes to standard output
        return int(command.main(list(words), prog_name="terragrip", standalone_mode=False) or 0)
    try:
        with command.make_context("terragrip", list(words)) as context:
            command.invoke(context)
    except typer.Exit as done:
        return done.exit_code
    except typer.Abort:
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except Exception as failure:  # noqa: BLE001 - the last stop: whatever it is becomes a line and a code
        return report(failure, words, "--debug" in words)
    return 0
