"""The write-ahead file of a segment: every input of the core, framed so that a torn end shows.

A frame is its length and the CRC-32 of its content (little-endian uint32 each), then the content: a kind byte and
    C  the name of the next channel number, UTF-8
    S  arrival (f64), source (u16), stamp (f64), n (u16), n channel numbers (u16), n values (f64)
    T  a tick at an instant (f64)
    N  a note, JSON
    F  a flush
    B  bytes of the segment's beginning: which segment this is, JSON (always the first frame)
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MAGIC = b"TGWAL2\r\n"
_HEAD = struct.Struct("<II")
_TICK = struct.Struct("<cd")

Entry = tuple[str, Any]


class WriteAhead:
    """Appends frames; what was flushed survives a kill of the process, what was synced also one of the machine."""

    def __init__(self, path: Path, *, append_at: int | None = None, names: list[str] | None = None) -> None:
        flags = os.O_WRONLY | os.O_CREAT | (0 if append_at is not None else os.O_TRUNC)
        self.path = path
        self._file = os.open(path, flags, 0o666)
        self._numbers = {name: k for k, name in enumerate(names or [])}
        self._packers: dict[tuple[str, ...], tuple[struct.Struct, tuple[int, ...]]] = {}
        self._buffer: list[bytes] = []
        if append_at is None:
            self._buffer.append(MAGIC)
        else:
            os.ftruncate(self._file, append_at)
            os.lseek(self._file, append_at, os.SEEK_SET)

    def _frame(self, content: bytes) -> None:
        self._buffer.append(_HEAD.pack(len(content), zlib.crc32(content)))
        self._buffer.append(content)

    def add(self, kind: str, content: Any = None) -> None:
        """A frame of a kind, as `Reading` gives it back; ``C`` is added where a sample needs it."""
        if kind == "S":
            self._sample(*content)
        elif kind == "T":
            self._frame(_TICK.pack(b"T", content))
        else:
            self._frame(kind.encode() + (b"" if content is None else json.dumps(content).encode()))

    def _sample(self, arrival: float, source: int, stamp: float, values: dict[str, float]) -> None:
        names = tuple(values)
        packer, numbers = self._packers.get(names) or self._packer(names)
        self._frame(packer.pack(b"S", arrival, source, stamp, len(numbers), *numbers, *values.values()))

    def _packer(self, names: tuple[str, ...]) -> tuple[struct.Struct, tuple[int, ...]]:
        for name in names:
            if name not in self._numbers:
                self._numbers[name] = len(self._numbers)
                self._frame(b"C" + name.encode())
        result = (
            struct.Struct(f"<cdHdH{len(names)}H{len(names)}d"),
            tuple(self._numbers[name] for name in names),
        )
        self._packers[names] = result
        return result

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
    """Entries of a write-ahead file up to its first torn or damaged frame; ``good`` is where that begins, ``size`` the file's."""

    def __init__(self, path: Path) -> None:
        self._data = path.read_bytes()
        self.size = len(self._data)
        self.good = len(MAGIC) if self._data.startswith(MAGIC) else 0
        self.names: list[str] = []

    def __iter__(self) -> Iterator[Entry]:
        data, place = self._data, self.good
        while place and place + _HEAD.size <= len(data):
            length, check = _HEAD.unpack_from(data, place)
            content = data[place + _HEAD.size : place + _HEAD.size + length]
            if len(content) < length or zlib.crc32(content) != check or not content:
                return
            place += _HEAD.size + length
            self.good = place
            yield from self._decoded(content)

    def _decoded(self, content: bytes) -> Iterator[Entry]:
        kind = content[:1]
        if kind == b"C":
            self.names.append(content[1:].decode())
        else:
            yield self._entry(kind, content)

    def _entry(self, kind: bytes, content: bytes) -> Entry:
        if kind == b"S":
            arrival, source, stamp, count = struct.unpack_from("<dHdH", content, 1)
            numbers = struct.unpack_from(f"<{count}H", content, 21)
            values = struct.unpack_from(f"<{count}d", content, 21 + 2 * count)
            named = {self.names[k]: value for k, value in zip(numbers, values, strict=True)}
            return "S", (arrival, source, stamp, named)
        if kind == b"T":
            return "T", _TICK.unpack(content)[1]
        if kind in (b"N", b"B"):
            return kind.decode(), json.loads(content[1:])
        return kind.decode(), None
