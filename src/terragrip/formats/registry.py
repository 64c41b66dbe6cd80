"""Which format a log has, by its content, and by its name only where the content is silent; formats are registered by name.

A format is one module with a `Format` in its ``FORMATS``: ours stand in `_OWN`, those of other packages are entry points of the
group ``terragrip.formats`` (docs/formats.md has an example).
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.files import refuse_missing, unreadable
from terragrip.formats.table import LogTable, Wanted

if TYPE_CHECKING:
    from terragrip.formats.signals import SignalLog
    from terragrip.formats.table_on_disk import TableOnDisk

GROUP = "terragrip.formats"
_OWN = (
    "csv",
    "parquet",
    "can.log",
    "mdf",
    "ros",
    "mcap",
    "matlab",
    "nmea",
    "vbo",
)  # modules, in the order in which they are asked
_HEAD = 8192  # bytes that tell
_BAG, _NOTES = (".db3", ".mcap"), (".txt", ".log", ".dat")  # of a bag, and what may lie beside it

Databases = Sequence[str | os.PathLike[str]]
Reader = Callable[[str, Wanted, Databases], "LogTable | SignalLog"]


@dataclass(frozen=True)
class Format:
    """A format of logs.

    ``name`` registers it, ``title`` is for messages. ``read`` gives of a path the ``wanted`` signals as a `SignalLog`, or the columns of a
    table as a `LogTable`; it raises InputError where the file is damaged, and may raise OSError where it cannot be read. The path and the
    file's SHA-256 are added to what it gives. A file is of this format where it begins with one of ``magic``, or ``recognises`` says so of
    its first 8 KiB; of a file that no format knows, one of ``suffixes`` tells. ``takes_databases``: it holds CAN frames, which DBC files
    decode. ``in_blocks`` gives a file that is one table as a `TableOnDisk`; without ``read`` it always does, with it None may come back.
    """

    name: str
    title: str
    read: Reader | None = None
    suffixes: tuple[str, ...] = ()
    magic: tuple[bytes, ...] = ()
    recognises: Callable[[bytes], bool] | None = None
    takes_databases: bool = False
    in_blocks: Callable[[str], TableOnDisk | None] | None = None


@cache
def _own() -> dict[str, Format]:
    return {one.name: one for module in _OWN for one in import_module(f"terragrip.formats.{module}").FORMATS}


@cache
def formats() -> dict[str, Format]:
    """The registered formats by name, ours first; raises InputError where one of another package cannot be loaded, or takes a name."""
    result = dict(_own())
    for entry in entry_points(group=GROUP):
        place, hint = f"format {entry.name}", f"update or remove the package that provides {entry.value}"
        try:
            one = entry.load()
        except (ImportError, AttributeError) as error:
            raise InputError(f"cannot be loaded ({error})", place=place, hint=hint) from error
        if not isinstance(one, Format) or one.name in result:
            problem = f"{entry.value} is not a Format" if not isinstance(one, Format) else "is there already"
            raise InputError(problem, place=place, hint=hint)
        result[one.name] = one
    return result


def suffixes() -> tuple[str, ...]:
    """The suffixes of all registered formats."""
    return tuple(dict.fromkeys(suffix for one in formats().values() for suffix in one.suffixes))


def format_of(path: str | os.PathLike[str]) -> Format:
    """The format of a log; raises InputError if there is no such file, or it cannot be read."""
    known = formats()
    if (folder := Path(path)).is_dir() and is_bag(folder):
        return known["ros2"]
    refuse_missing(path, suffixes=suffixes())
    try:
        with Path(path).open("rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise unreadable(path, error) from error
    by_magic = (one for one in known.values() if head.startswith(one.magic))
    by_look = (one for one in known.values() if one.recognises is not None and one.recognises(head))
    result = next(itertools.chain(by_magic, by_look), None)
    if result is not None:
        return result
    # Nothing tells. Of a file that is no text, the name says which reader shall say what is wrong; a text is a table, unless another
    # package knows its name.
    binary = b"\0" in head and not head.startswith((b"\xff\xfe", b"\xfe\xff"))
    named = (one for one in known.values() if str(path).lower().endswith(one.suffixes))
    return next((one for one in named if binary or one.name not in _own()), known["csv"])


def is_bag(folder: Path) -> bool:
    """Whether a folder is a ROS 2 bag: by its metadata, or its files, where no log of another format is beside them."""
    try:
        inside = [entry.name.lower() for entry in folder.iterdir() if entry.is_file()]
    except OSError as error:
        raise unreadable(folder, error) from error
    if "metadata.yaml" in inside:
        return True
    parts = [name for name in inside if name.endswith(_BAG)]
    others = tuple(suffix for suffix in suffixes() if suffix not in (*_BAG, *_NOTES))
    return bool(parts) and not any(name.endswith(others) for name in inside)
