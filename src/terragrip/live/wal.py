"""The write-ahead file of a segment: every input of the core, a line each, with a checksum so that a torn end shows.

Behind `MAGIC` a line is the CRC-32 of its text in eight hexadecimal digits, a blank, and the text: a JSON list of kind and content,
``["S", [arrival, source, stamp, {column: value}]]``, and other inputs of `terragrip.live.core.Core.handle` likewise. The first
line, ``B``, says which segment this is.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MAGIC = b"TGWAL3\n"


class WriteAhead:
    """Appends lines; what was flushed survives a kill of the process, what was synced also one of the machine."""

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
        """An input, as `Reading` gives it back."""
        text = json.dumps([kind, content]).encode()
        self._buffer.append(b"%08x %b\n" % (zlib.crc32(text), text))

    def write(self) -> None:
        """Hand the lines to the system; raises OSError."""
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
    """Inputs of a write-ahead file up to its first torn or damaged line; ``good`` is where that begins, ``size`` the file's."""

    def __init__(self, path: Path) -> None:
        self._data = path.read_bytes()
        self.size = len(self._data)
        self.good = len(MAGIC) if self._data.startswith(MAGIC) else 0

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        while self.good and (end := self._data.find(b"\n", self.good) + 1):
            check, _, text = self._data[self.good : end - 1].partition(b" ")
            if check != b"%08x" % zlib.crc32(text):
                return
            self.good = end
            yield tuple(json.loads(text))
