"""What a failure becomes: an exit code and exactly one line on standard error."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
import traceback
from collections.abc import Sequence

import typer

from terragrip.errors import InputError, system_error

UNUSABLE = 2
DEFECT = 1
INTERRUPTED = 130
ISSUES = "the project's issue tracker"

# What the machine, not Terragrip, refuses; and what its user can do.
_REFUSALS = {
    errno.ENOSPC: "the disk is full; free some space or write elsewhere",
    errno.EDQUOT: "the disk quota is used up; free some space or write elsewhere",
    errno.EFBIG: "the file would be larger than the system allows; write elsewhere or raise the limit (ulimit -f)",
    errno.EACCES: "permission denied; change its permissions or choose another place",
    errno.EPERM: "operation not permitted; choose another place",
    errno.EROFS: "the file system is read-only; choose another place",
    errno.EISDIR: "is a folder; name a file",
    errno.ENOTDIR: "a part of the path is not a folder; correct the path",
    errno.ENOENT: "no such file or folder; correct the path",
    errno.ENAMETOOLONG: "the name is too long; shorten it",
    errno.ELOOP: "symbolic links run in a circle; correct the path",
    errno.EMFILE: "too many open files; raise the limit (ulimit -n)",
    errno.EIO: "the device failed to read or write; check the disk",
    errno.ENOMEM: "not enough memory; use a shorter log or a larger machine",
    errno.EEXIST: "exists already and is not a folder; choose another place",
}
_USAGE_ERROR = typer.BadParameter.__mro__[2]  # ClickException, whether typer brings its own click or not


def report(failure: BaseException, words: Sequence[str], debug: bool) -> int:
    """Print the one line for a failure and return the exit code.

    Parameters
    ----------
    failure: what was raised.
    words: the command line without the program's name, for the hint to its help and the defect's report.
    debug: also print the traceback, before the line.
    """
    if debug:
        traceback.print_exception(failure, file=sys.stderr)
    code, line = describe(failure, words)
    if code == DEFECT and not debug:
        line = f"{line}; the traceback is in {_keep_traceback(failure, words)}"
    print(" ".join(f"terragrip: {line}".split()), file=sys.stderr)
    return code


def describe(failure: BaseException, words: Sequence[str] = ()) -> tuple[int, str]:
    """Exit code and line of a failure, without the program's name."""
    if isinstance(failure, KeyboardInterrupt):
        return INTERRUPTED, "interrupted; files already written are whole"
    if isinstance(failure, InputError):
        return UNUSABLE, str(failure)
    if isinstance(failure, _USAGE_ERROR):
        return UNUSABLE, _usage(failure, words)
    if isinstance(failure, MemoryError):
        return UNUSABLE, "not enough memory; use a shorter log or a larger machine"
    if isinstance(failure, ModuleNotFoundError) and (failure.name or "").split(".")[0] != "terragrip":
        return UNUSABLE, f"this needs the Python package {failure.name!r}; pip install 'terragrip[all]'"
    refusal = _refusal(failure)
    if refusal:
        return UNUSABLE, refusal
    kind = type(failure).__name__
    return DEFECT, f"a defect of Terragrip ({kind}: {failure}); please report it to {ISSUES}"


def _usage(failure: BaseException, words: Sequence[str]) -> str:
    message = str(failure.format_message()).rstrip(".")  # type: ignore[attr-defined]
    command = next((word for word in words if not word.startswith("-")), "")
    context = getattr(failure, "ctx", None)
    path = getattr(context, "command_path", None) or " ".join(("terragrip", command)).strip()
    return f"{message}; see {path} --help"


def _refusal(failure: BaseException) -> str | None:
    """The operating system said no."""
    number = system_error(failure)
    if number not in _REFUSALS:
        return None
    place = getattr(failure, "filename2", None) or getattr(failure, "filename", None)
    return f"{place}: {_REFUSALS[number]}" if place else _REFUSALS[number]


def _keep_traceback(failure: BaseException, words: Sequence[str]) -> str:
    from terragrip import __version__

    text = "".join(traceback.format_exception(failure))
    header = f"terragrip {__version__}, Python {sys.version.split()[0]}: terragrip {' '.join(words)}\n\n"
    try:
        handle, path = tempfile.mkstemp(prefix="terragrip-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(header + text)
    except OSError:
        return "nothing (no temporary folder to write to): run again with terragrip --debug"
    return path
