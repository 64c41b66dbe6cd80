"""The bytes of a text file, packed by gzip or not."""

from __future__ import annotations

import gzip
import os
import zlib
from typing import BinaryIO

from terragrip.errors import InputError
from terragrip.files import unreadable

_GZIP = b"\x1f\x8b"


def is_packed(source: str) -> bool:
    """Whether a file is packed by gzip; raises InputError where it cannot be opened."""
    try:
        with open(source, "rb") as stream:
            return stream.read(2) == _GZIP
    except OSError as error:
        raise unreadable(source, error) from error


def opened(source: str) -> BinaryIO:
    """The file, unpacked as it is read; raises InputError where it cannot be opened."""
    try:
        return gzip.open(source, "rb") if is_packed(source) else open(source, "rb")  # type: ignore[return-value]
    except OSError as error:
        raise unreadable(source, error) from error


def read(stream: BinaryIO, size: int, source: str) -> bytes:
    """Up to ``size`` bytes of what `opened` gave; raises InputError where the file is damaged or cannot be read."""
    try:
        return stream.read(size)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        problem = f"is a damaged gzip file ({error})"
        raise InputError(problem, file=source, hint="copy or pack it again") from error
    except OSError as error:
        raise unreadable(source, error) from error


def length_of(source: str) -> int:
    """About how many bytes the text has: a packed file unpacks to some ten times its size."""
    return os.path.getsize(source) * (10 if is_packed(source) else 1)
