"""Where other people's readers are called: what they need, and what they raise on a damaged file."""

from __future__ import annotations

import logging
import os
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from terragrip.errors import InputError, missing_package

LARGEST = 1 << 30
"""Bytes of a record, or of what it unpacks to: a damaged length must not fill the memory."""
DAMAGE: tuple[type[Exception], ...] = (
    # What byte-wise parsers run into when bytes are not what they should be.
    ValueError,  # with UnicodeDecodeError
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    AssertionError,
    EOFError,
    OSError,
    MemoryError,
    RecursionError,
    NotImplementedError,
    struct.error,
    zlib.error,
)


def needed(module: str, what: str) -> Any:
    """Import a package of the extra ``formats``; raises InputError that names the extra if it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other people's modules, at import
            result = import_module(module)
    except ModuleNotFoundError as error:
        missing = (error.name or module).partition(".")[0]
        raise missing_package(missing, "formats", f"read {what}") from error
    # What its logger has to say of a damaged file, the InputError or a note says.
    logging.getLogger(module.partition(".")[0]).setLevel(logging.CRITICAL + 1)
    return result


@contextmanager
def reading(
    source: str | os.PathLike[str], kind: str, *errors: type[Exception], hint: str = "copy or record it again"
) -> Iterator[None]:
    """Turn what a library raises on a damaged file into an InputError that says so.

    ``errors`` are the library's own exceptions, beside those of broken bytes. Its warnings are silenced: they
    would be lines that nobody can act on.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except (*DAMAGE, *errors) as error:
        sentence = " ".join(str(error).split())[:100] or type(error).__name__
        raise InputError(f"is a damaged {kind}, or none ({sentence})", file=source, hint=hint) from error


@dataclass
class Seen:
    """How many messages of a file were met so far."""

    messages: int = 0


@contextmanager
def as_far_as_it_goes(
    source: str | os.PathLike[str], kind: str, notes: list[str], *errors: type[Exception]
) -> Iterator[Seen]:
    """As `reading`, for a file of messages: one that is damaged behind some is taken as far as it goes, which a note says."""
    seen = Seen()
    try:
        with reading(source, kind, *errors):
            yield seen
    except InputError as error:
        if not seen.messages:
            raise
        notes.append(
            f"{os.path.basename(source)} ends early, or is damaged ({error.problem}); "
            f"{seen.messages} messages before were read."
        )
