"""The bytes of a text file, packed by gzip or not."""

from __future__ import annotations

import gzip
import os
from typing import BinaryIO

from terragrip.errors import InputError
from terragrip.files import unreadable
from terragrip.formats.boundary import reading

_GZIP = b"\x1f\x8b"
_RATIO = 200
"""Bytes of text that a packed byte may become: logs reach 3 to 30, the most that gzip can do is 1032."""
_HARMLESS = 32 << 20
"""Bytes of text that any packed file may become."""
_MOST = 16 << 30
"""Bytes of text that no packed file may become; an unpacked one may be longer."""


def is_packed(source: str) -> bool:
    """Whether a file is packed by gzip; raises InputError where it cannot be opened."""
    try:
        with open(source, "rb") as stream:
            return stream.read(2) == _GZIP
    except OSError as error:
        raise unreadable(source, error) from error


def opened(source: str) -> BinaryIO:
    """The file, unpacked as it is read; raises InputError where it cannot be opened."""
    return gzip.open(source, "rb") if is_packed(source) else open(source, "rb")  # type: ignore[return-value]


def read(stream: BinaryIO, size: int, source: str) -> bytes:
    """Up to ``size`` bytes of what `opened` gave, all of them where it is negative.

    Raises InputError where the file is damaged, cannot be read, or unpacks to so much that it is no log: never more than that is held.
    """
    packed = isinstance(stream, gzip.GzipFile)
    with reading(source, "gzip file" if packed else "text table", hint="copy or pack it again"):
        if not packed:
            return stream.read(size)
        most = _most(source)
        left = most - stream.tell() + 1
        data = stream.read(left if size < 0 else min(size, left))
    if stream.tell() > most:
        held = os.path.getsize(source)
        problem = f"unpacks to more than {most / 1e6:.0f} MB from {held / 1e6:.3g} MB, unlike any log"
        raise InputError(
            problem, file=source, hint="if it is a log, unpack it with 'gunzip' and give the text"
        )
    return data


def _most(source: str) -> int:
    """How many bytes a packed file may unpack to."""
    return min(_MOST, max(_HARMLESS, _RATIO * os.path.getsize(source)))


def length_of(source: str) -> int:
    """About how many bytes the text has: a packed file unpacks to some ten times its size."""
    return os.path.getsize(source) * (10 if is_packed(source) else 1)
