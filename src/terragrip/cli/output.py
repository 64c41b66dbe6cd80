"""Where results go: tried before the long work, so that nobody waits for an estimate that cannot be kept."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from terragrip.errors import InputError


def check_file(
    path: Path,
    inputs: Iterable[Path | None] = (),
    *,
    suffixes: tuple[str, ...] = (),
    option: str = "--output",
) -> Path:
    """A file that can be written, not one of the inputs (as far as given), in a folder that exists.

    Raises
    ------
    InputError: it is a folder, a device, an input, has none of the suffixes (if any are given), or its folder is
        missing or cannot be written.
    """
    if path.is_dir():
        raise InputError("is a folder", file=path, place=option, hint="name a file in it")
    if path.exists() and not path.is_file():
        raise InputError("is a device, not a file", file=path, place=option, hint="name a file")
    if suffixes and path.suffix.lower() not in suffixes:
        named = " or ".join(suffixes)
        raise InputError(
            f"is not named {named}", file=path, place=option, hint=f"write e.g. {path.stem}{suffixes[0]}"
        )
    _refuse_inputs(path, inputs)
    if not path.parent.exists():
        raise InputError(
            f"the folder {path.parent} does not exist", file=path, place=option, hint="make it first"
        )
    _try_writing(path.parent, option)
    if path.exists() and not os.access(path, os.W_OK):
        raise InputError("is write-protected", file=path, place=option, hint="choose another name")
    return path


def check_folder(path: Path) -> Path:
    """A folder that can be written; made if it does not exist (its parent must).

    Raises
    ------
    InputError: it is a file, its parent is missing, or it cannot be made or written.
    """
    if path.exists() and not path.is_dir():
        raise InputError(
            "is a file, and a folder is needed", file=path, place="--output", hint="name a folder"
        )
    if not path.exists():
        if not path.parent.exists():
            raise InputError(
                f"the folder {path.parent} does not exist", file=path, place="--output", hint="make it first"
            )
        _try_writing(path.parent)
        path.mkdir()
    _try_writing(path)
    return path


def files_in(folder: Path, logs: Iterable[Path], suffix: str) -> list[Path]:
    """A file in the folder for each log, by the log's name.

    Raises
    ------
    InputError: two logs would write to one file, or one is an input itself.
    """
    logs = list(logs)
    seen: dict[Path, Path] = {}
    for log in logs:
        target = folder / f"{log.name.split('.')[0] or log.stem}{suffix}"
        if target in seen:
            raise InputError(
                f"has the same name as {seen[target]}: both would be written to {target}",
                file=log,
                hint="rename one, or estimate them one at a time",
            )
        _refuse_inputs(target, logs)
        seen[target] = log
    return list(seen)


def _refuse_inputs(path: Path, inputs: Iterable[Path | None]) -> None:
    for source in inputs:
        if source is not None and path.exists() and source.exists() and path.samefile(source):
            raise InputError("is an input too", file=path, place="--output", hint="choose another name")


def _try_writing(folder: Path, option: str = "--output") -> None:
    """Permission bits do not tell (root, read-only mounts, quotas): try it."""
    try:
        with tempfile.TemporaryFile(dir=folder) as trial:
            trial.write(b"\0")
    except OSError as error:
        raise InputError(
            f"cannot be written ({error.strerror})",
            file=folder,
            place=option,
            hint="free space or choose another folder"
            if error.errno == errno.ENOSPC
            else "choose another folder",
        ) from error
