"""Records of a binary log, whose bytes must all be there."""

from __future__ import annotations

from typing import BinaryIO

LARGEST = 1 << 30
"""Bytes of a record, or of what it unpacks to: a damaged length must not fill the memory."""


def exactly(stream: BinaryIO, size: int) -> bytes:
    """The next ``size`` bytes; raises ValueError where there are fewer."""
    found = stream.read(size)
    if len(found) < size:
        raise ValueError("it ends within a record")
    return found
