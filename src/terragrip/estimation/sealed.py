"""Snapshots as bytes: a mark of their kind and version, a checksum, what they hold."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

from terragrip.estimation.engine import refusal


def seal(mark: bytes, body: bytes) -> bytes:
    """The body behind its mark and checksum."""
    return mark + struct.pack("<I", zlib.crc32(body)) + body


def unseal(mark: bytes, data: bytes) -> bytes:
    """The body; raises InputError if the bytes are damaged or of another kind or version."""
    start = len(mark) + 4
    body = data[start:]
    if (
        data[: len(mark)] != mark
        or not body
        or struct.unpack("<I", data[start - 4 : start])[0] != zlib.crc32(body)
    ):
        raise refusal(6, None)
    return body


@contextmanager
def understood() -> Iterator[None]:
    """Raise InputError where a sound body does not hold what a snapshot of ours does."""
    try:
        yield
    except (ValueError, LookupError, TypeError, AttributeError, struct.error):
        raise refusal(6, None) from None
