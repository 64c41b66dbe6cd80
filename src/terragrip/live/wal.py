"""The write-ahead file of a segment: every input of the core, framed so that a torn end shows.

A frame is its length and the CRC-32 of its content (little-endian uint32 each), then the content: kind and content of an input as
`Core.handle` takes them, as JSON; the first frame is a ``B`` that tells which segment this is.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from terragrip.errors import InputError

MAGIC = b"TGWAL4\r\n"
_ANY = b"TGWAL"  # of any version
_HEAD = struct.Struct("<II")

Entry = tuple[str, Any]


class WriteAhead:
    """Appends frames; what was flushed survives a kill of the process, what was synced also one of the machine."""

    def __init__(self, path: Path, *, append_at: int | None = None) -> None:
        flags = os.O_WRONLY | os.O_CREAT | (0 if append_at is not None else os.O_TRUNC)
        self.path = path
        self._file = os.open(path, flags, 0o666)
        self._buffer: list[bytes] = []
        if append_at is None:
            self._buffer.append(MAGIC)
        else:
            os.ftruncate(self._file, append_at)
            os.lseek(self._file, append_at, os.SEEK_SET)

    def add(self, kind: str, content: Any = None) -> None:
        """A frame of a kind, as `Reading` gives it back."""
        data = json.dumps((kind, content), default=float).encode()  # a decoder may give numbers of NumPy
        self._buffer += (_HEAD.pack(len(data), zlib.crc32(data)), data)

    def write(self) -> None:
        """Hand the frames to the system; raises OSError."""
        if self._buffer:
            data = memoryview(b"".join(self._buffer))
            self._buffer.clear()
            while len(data):
                data = data[os.write(self._file, data) :]

    def sync(self) -> None:
        """Have the system put them on the disk; raises OSError."""
        os.fdatasync(self._file)

    def close(self) -> None:
        """Write, sync and close."""
        try:
            self.write()
            self.sync()
        finally:
            os.close(self._file)


class Reading:
    """Entries of a write-ahead file up to its first torn or damaged frame; ``good`` is where that begins, ``size`` the file's.

    Raises InputError on a file of another version, whose rows would be lost.
    """

    def __init__(self, path: Path) -> None:
        self._data = path.read_bytes()
        self.size = len(self._data)
        self.good = len(MAGIC) if self._data.startswith(MAGIC) else 0
        if len(self._data) >= len(MAGIC) and not self.good and self._data.startswith(_ANY):
            hint = "go on with the version that wrote it until the next segment, or remove it: its rows are then lost"
            raise InputError("is of another version of Terragrip", file=path, hint=hint)

    def __iter__(self) -> Iterator[Entry]:
        data, place = self._data, self.good
        while place and place + _HEAD.size <= len(data):
            length, check = _HEAD.unpack_from(data, place)
            content = data[place + _HEAD.size : place + _HEAD.size + length]
            if len(content) < length or zlib.crc32(content) != check or not content:
                return
            try:
                kind, value = json.loads(content)
            except (ValueError, TypeError):
                return
            self.good = place = place + _HEAD.size + length
            yield kind, value
