"""Files on disk: a helpful refusal, a fingerprint, and writing that never leaves half a file."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from terragrip.errors import InputError, nearest


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside ``path``, renamed to it at the end, so that no file is ever half-written.

    Raises InputError if the folder cannot be written or the disk is full.
    """
    target = Path(path)
    try:
        temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except (OSError, ValueError) as error:
        raise unwritable(path, error, "choose another folder, or make it writable") from error
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise unwritable(path, error, "free space or choose another folder") from error
    finally:
        temporary.unlink(missing_ok=True)


def unwritable(path: str | os.PathLike[str], error: Exception, hint: str) -> InputError:
    """The InputError for a file that cannot be written."""
    return InputError(
        f"cannot be written ({getattr(error, 'strerror', None) or error})", file=path, hint=hint
    )


def refuse_missing(path: str | os.PathLike[str], *, suffixes: tuple[str, ...] = ()) -> None:
    """Raise InputError if ``path`` is no file; names the nearest one, or one of ``suffixes`` in a folder."""
    target = Path(path)
    try:
        if target.is_file():
            return
        if target.is_dir():
            inside = sorted(p.name for p in target.iterdir() if p.name.lower().endswith(suffixes or ""))
            hint = f"name a file in it, such as {inside[0]}" if inside else "name a file"
            raise InputError("is a folder", file=path, hint=hint)
        if target.exists():
            raise InputError("is not a regular file", file=path, hint="name a file on disk")
        if not target.parent.is_dir():
            raise InputError("no such file", file=path, hint=f"there is no folder {target.parent}")
        close = nearest(target.name, (p.name for p in target.parent.iterdir() if p.is_file()))
    except InputError:
        raise
    except (OSError, ValueError) as error:  # no permission; a name too long or with a NUL
        raise InputError(
            f"cannot be opened ({error})", file=path, hint="check the path and its permissions"
        ) from error
    raise InputError("no such file", file=path, hint=f"did you mean {close}?" if close else "check the path")


def sha256(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's content in hexadecimal, read in pieces; raises InputError if it cannot be read."""
    import hashlib

    refuse_missing(path)
    try:
        with Path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def unreadable(path: str | os.PathLike[str], error: OSError) -> InputError:
    """The InputError for a file that exists but cannot be read."""
    return InputError(
        f"cannot be read ({error.strerror or error})", file=path, hint="check its permissions and the disk"
    )
