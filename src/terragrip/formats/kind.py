"""What kind of log a file is: told by its content, by its name only where the content is silent."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from terragrip.files import refuse_missing, unreadable
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import LogTable, Wanted

SUFFIXES = (
    *(
        ".csv",
        ".txt",
        ".tsv",
        ".dat",
        ".csv.gz",
        ".txt.gz",
        ".tsv.gz",
        ".parquet",
        ".mat",
        ".bag",
        ".db3",
        ".mcap",
    ),
    *(".mf4", ".blf", ".asc", ".trc", ".log", ".nmea"),
)
_HEAD = 8192  # bytes that tell

Databases = Sequence[str | os.PathLike[str]]
Reader = Callable[[str, Wanted | None, Databases], LogTable | SignalLog]

_NMEA = re.compile(
    rb"^[^$!\r\n]{0,60}[$!](?:[A-Z]{2}[A-Z]{3}|P[A-Z]{3,}),[\x20-\x7e]*\*?[0-9A-Fa-f]{0,2}\r?$", re.MULTILINE
)
_CANDUMP = re.compile(
    rb"^\s*(?:\((?:\d{4}-\d\d-\d\d )?[\d:]+\.\d+\)\s+)?\S+\s+(?:[RT]X\s+\S+\s+\S+\s+)?[0-9A-Fa-f]{3,8}(?:#[0-9A-Fa-fR#]|\s+\[\s*\d+\])",
    re.MULTILINE,
)
_TRC = re.compile(rb"^\s*\d+\)\s+\d+(?:\.\d+)?\s+(?:\d+\s+)?(?:[RT]x\s+)?[0-9A-Fa-f]{4,8}\s", re.IGNORECASE)
_ASC = re.compile(rb"\A(?:\s*//[^\n]*\n)*\s*(?:date\s|base\s+(?:hex|dec))", re.IGNORECASE)


@dataclass(frozen=True)
class Kind:
    """A kind of log: its ``title`` for messages, the module and function that read it, whether a DBC serves it."""

    title: str
    module: str
    function: str
    takes_databases: bool = False

    def reader(self) -> Reader:
        """The function that reads it; its module is imported now."""
        found: Reader = getattr(import_module(f"terragrip.formats.{self.module}"), self.function)
        return found


CSV = Kind("text table", "csv", "read_csv_log")
PARQUET = Kind("Parquet file", "parquet", "read_parquet_log")
BLF = Kind("BLF log", "can.log", "read_blf", True)
ASC = Kind("ASC log", "can.log", "read_asc", True)
TRC = Kind("TRC log", "can.log", "read_trc", True)
CANDUMP = Kind("candump log", "can.log", "read_candump", True)
FRAME_TABLE = Kind("table of CAN frames", "can.log", "read_frame_table", True)
MDF = Kind("MDF file", "mdf", "read_mdf", True)
ROS1 = Kind("ROS 1 bag", "ros", "read_ros1")
ROS2 = Kind("ROS 2 bag", "ros", "read_ros2")
MCAP = Kind("MCAP file", "mcap", "read_mcap")
MATLAB = Kind("MATLAB file", "matlab", "read_matlab")
NMEA = Kind("NMEA 0183 log", "nmea", "read_nmea")

_MAGIC: tuple[tuple[bytes, Kind], ...] = (
    (b"PAR1", PARQUET),
    (b"LOGG", BLF),
    (b"MDF     ", MDF),
    (b"UnFinMF ", MDF),
    (b"#ROSBAG V", ROS1),
    (b"SQLite format 3\0", ROS2),
    (b"\x89MCAP0\r\n", MCAP),
    (b"MATLAB 5.0 MAT-file", MATLAB),
    (b"MATLAB 7.3 MAT-file", MATLAB),
    (b"\x89HDF\r\n\x1a\n", MATLAB),
    (b";$FILEVERSION=", TRC),
)
_BY_NAME = {".mat": MATLAB, ".parquet": PARQUET, ".pq": PARQUET, ".blf": BLF, ".mf4": MDF, ".mdf": MDF, ".dat": CSV,
            ".bag": ROS1, ".db3": ROS2, ".mcap": MCAP, ".trc": TRC, ".asc": ASC, ".nmea": NMEA}  # fmt: skip


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """The kind of a log; raises InputError if there is no such file, or it cannot be read."""
    if (folder := Path(path)).is_dir() and _is_bag(folder):
        return ROS2
    refuse_missing(path, suffixes=SUFFIXES)
    try:
        with Path(path).open("rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise unreadable(path, error) from error
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    text = _text_kind(head)
    if text is not None:
        return text
    # Nothing tells: of a file that is no text, the name says which reader shall say what is wrong.
    binary = b"\0" in head and not head.startswith((b"\xff\xfe", b"\xfe\xff"))
    return _BY_NAME.get(Path(path).suffix.lower(), CSV) if binary else CSV


def _is_bag(folder: Path) -> bool:
    try:
        return any(
            entry.suffix in (".db3", ".mcap") or entry.name == "metadata.yaml" for entry in folder.iterdir()
        )
    except OSError as error:
        raise unreadable(folder, error) from error


def _text_kind(head: bytes) -> Kind | None:
    """The kind of a text that is no plain table."""
    if _ASC.match(head):
        return ASC
    if b";$FILEVERSION=" in head:
        return TRC
    lines = [line for line in head.splitlines()[:40] if line.strip()]
    if not lines:
        return None
    if sum(bool(_CANDUMP.match(line)) for line in lines) > len(lines) / 3:
        return CANDUMP
    if sum(bool(_TRC.match(line)) for line in lines) > len(lines) / 3:
        return TRC  # version 1.0 has no head
    if sum(bool(_NMEA.match(line)) for line in lines[:-1] or lines) > len(lines) / 3:
        return NMEA
    header = lines[0].lower()
    if b"data" in header and (b"id" in header or b"pgn" in header):
        from terragrip.formats.can.text_logs import layout_of

        if layout_of(header.decode("utf-8", "replace")) is not None:
            return FRAME_TABLE
    return None
