"""Where the command line starts and ends: parse, run, and turn every failure into an exit code and one line."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer

from terragrip.cli.failure import INTERRUPTED, report

COMPLETION = "_TERRAGRIP_COMPLETE"
"""The environment variable by which a shell's completion calls the program."""

_MODULES = {
    "demo": "demo",
    "new": "new",
    "inspect": "inspect",
    "estimate": "estimate",
    "convert": "convert",
    "export": "convert",  # the contract's other name of it
    "calibrate": "calibrate",
    "soils": "soils",
    "ground": "ground",
    "ground-classifier": "ground_classifier",
    "map": "map",
    "advise": "advise",
    "report": "report",
    "simulate": "simulate",
    "live": "live",
    "studio": "studio",
    "fleet": "fleet",
    "doctor": "doctor",
}
"""Each command's module, with its ``command``, or its ``app`` of several."""


def _print_version(wanted: bool) -> None:
    if wanted:
        from terragrip import __version__

        print(f"terragrip {__version__}")
        raise typer.Exit


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
        if os.name == "posix":
            sys.unraisablehook = _interrupt_again
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


def _interrupt_again(ignored: sys.UnraisableHookArgs) -> None:
    """Python ignores what is raised in a destructor or a weak reference's callback, a Ctrl-C too: one of some 300, measured
    while runs were saved. It is sent again, by a timer: here it would be ignored once more."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        again = threading.Timer(0.05, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
        again.daemon = True
        again.start()
    else:
        sys.__unraisablehook__(ignored)


@cache
def program(only: str | None = None) -> Any:
    """The commands, or ``only`` one, as a group of click, made once: all are a tenth of a short command's time."""
    app = typer.Typer(
        name="terragrip",
        help="Traction under the wheels, estimated from signals that a machine already has.",
        # Plain help: rich's boxes triple the time of `--help` and break the one-line rule for errors.
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    app.callback(invoke_without_command=True)(_terragrip)
    for name in _MODULES if only is None else (only,):
        module = import_module(f"terragrip.cli.{_MODULES[name]}")
        if hasattr(module, "app"):
            app.add_typer(module.app, name=name)
        else:
            app.command(name, hidden=name == "export")(module.command)
    return typer.main.get_command(app)


def _run(words: Sequence[str]) -> int:
    named = next((word for word in words if not word.startswith("-")), None)
    command = program(named if named in _MODULES and COMPLETION not in os.environ else None)
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
