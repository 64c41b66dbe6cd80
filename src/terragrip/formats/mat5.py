"""MATLAB's MAT-file version 5, after "MAT-File Format" (MathWorks): tagged elements, some of them compressed.

SciPy reads the same files, but a damaged one can end the whole process (a segmentation fault in 1.17), so the bytes are read
here. Numbers stay in the file until they are asked for.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_NUMBERS = range(6, 16)  # classes of double to uint64
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_DEEPEST = 16
_PEEK = 4096  # bytes of a compressed variable that tell its name and size
_LARGEST = 1 << 32  # bytes that one variable may unpack to


@dataclass(frozen=True)
class Opaque:
    """An object of a MATLAB class, which cannot be read; ``kind`` names the class where it is known."""

    kind: str = ""


@dataclass(frozen=True, eq=False)
class Array:
    """A numeric array, read when it is asked for; ``shape`` as in MATLAB.

    ``part`` reads some rows of one column of a vector or matrix; without it the whole array is read for that.
    """

    shape: tuple[int, ...]
    read: Callable[[], npt.NDArray[Any]]
    part: Callable[[slice, int], npt.NDArray[Any]] | None = None

    def column(self, number: int, length: int, rows: slice = slice(None)) -> npt.NDArray[Any]:
        """Some rows of a column, where the array has ``length`` rows (or is a vector of as many numbers)."""
        if self.part is not None:
            return self.part(rows, number)
        return self.read().reshape(length, -1)[rows, number]


def read_mat5(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The variables of a file by name: `Array`, mapping (struct), list (cell, struct array), text or `Opaque`.

    Raises ValueError, struct.error or zlib.error where the bytes are not what they should be.
    """
    with open(path, "rb") as stream:
        data = memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
    order = {b"IM": "<", b"MI": ">"}.get(bytes(data[126:128]))
    if order is None:
        raise ValueError("its header lacks the mark of the byte order")
    found: dict[str, Any] = {}
    place = _HEADER
    while place + 8 <= len(data):
        kind, start, end, after = _tag(data, place, order)
        if kind == _COMPRESSED:
            name, value = _unpacked(data[start:end], order)
        elif kind == _MATRIX:
            name, value = _matrix(data[start:end], order, 0)
        else:
            raise ValueError(f"element {kind} stands where a variable should")
        if value is not None and name:
            found[name] = value
        place = end if kind == _COMPRESSED else after
    return found


def _tag(data: memoryview, place: int, order: str) -> tuple[int, int, int, int]:
    """Type of the element at ``place``, start and end of its data, and where the next one begins."""
    first, size = struct.unpack_from(f"{order}II", data, place)
    if first >> 16:  # up to four bytes in the tag itself
        kind, size, start, after = first & 0xFFFF, first >> 16, place + 4, place + 8
        if size > 4:
            raise ValueError("an element is longer than its tag says it can be")
    else:
        kind, start = first, place + 8
        after = start + size + (-size % 8)
    if start + size > len(data):
        raise ValueError("an element reaches beyond the end")
    return kind, start, start + size, min(after, len(data))


def _unpacked(packed: memoryview, order: str) -> tuple[str, Any]:
    """A compressed variable; a plain array is unpacked when it is read."""
    head = memoryview(zlib.decompressobj().decompress(packed, _PEEK))
    kind, size = struct.unpack_from(f"{order}II", head)
    if kind != _MATRIX:
        raise ValueError("a compressed element is no variable")
    if size > _LARGEST:
        raise ValueError("a compressed variable unpacks to over 4 GiB")
    parts = _Parts(head[8:], order)
    code, _, dimensions, name = parts.head()
    if code in _NUMBERS:
        shape = tuple(dimensions)
        if 0 in shape:
            return name, None
        return name, Array(shape, lambda: _array_of(_whole(packed, size), order))
    return _matrix(_whole(packed, size), order, 0)


def _whole(packed: memoryview, size: int) -> memoryview:
    unpacked = zlib.decompressobj().decompress(packed, size + 8)
    return memoryview(unpacked)[8:]


def _array_of(data: memoryview, order: str) -> npt.NDArray[Any]:
    value = _matrix(data, order, 0)[1]
    if not isinstance(value, Array):
        raise ValueError("a variable is not what its head says")
    return value.read()


class _Parts:
    """Goes through the elements of a matrix."""

    def __init__(self, data: memoryview, order: str) -> None:
        self.data, self.order, self.place = data, order, 0

    @property
    def rest(self) -> int:
        """Bytes that are left."""
        return len(self.data) - self.place

    def next(self) -> tuple[int, memoryview]:
        """Type and data of the next element."""
        kind, start, end, self.place = _tag(self.data, self.place, self.order)
        return kind, self.data[start:end]

    def integers(self) -> list[int]:
        """The next element, of integers of 32 bits."""
        _, part = self.next()
        return list(struct.unpack_from(f"{self.order}{len(part) // 4}i", part))

    def text(self) -> str:
        """The next element, of characters of 8 bits."""
        return bytes(self.next()[1]).decode("latin-1")

    def head(self) -> tuple[int, int, list[int], str]:
        """Class, flags, dimensions and name; an object of a MATLAB class has no dimensions."""
        _, part = self.next()
        flags = struct.unpack_from(f"{self.order}I", part)[0]
        code = flags & 0xFF
        dimensions = [] if code == _OPAQUE else self.integers()
        if any(size < 0 for size in dimensions):
            raise ValueError("an array has a negative size")
        return code, flags, dimensions, self.text()


def _matrix(data: memoryview, order: str, depth: int) -> tuple[str, Any]:
    """Name and value of a variable or of a part of one."""
    if depth > _DEEPEST:
        raise ValueError("its structs are nested too deep")
    if not len(data):
        return "", None
    parts = _Parts(data, order)
    code, _, dimensions, name = parts.head()
    count = int(np.prod(dimensions, dtype=object)) if dimensions else 0
    if code in _NUMBERS:
        return name, _numbers(parts, tuple(dimensions), count)
    if code == _CHAR:
        kind, text = parts.next()
        return name, _decoded(kind, bytes(text), order)
    if code in (_STRUCT, _OBJECT):
        if code == _OBJECT:
            parts.text()
        return name, _structs(parts, count, depth)
    if code == _CELL:
        _refuse_more(parts, count)
        return name, [_matrix(parts.next()[1], order, depth + 1)[1] for _ in range(count)]
    if code == _OPAQUE:
        parts.text()  # the system of classes, MCOS
        return name, Opaque(parts.text())
    return name, Opaque("function" if code == _FUNCTION else "sparse" if code == _SPARSE else "")


def _numbers(parts: _Parts, shape: tuple[int, ...], count: int) -> Array | None:
    if not count:
        return None
    kind, raw = parts.next()
    if kind not in _TYPES:
        raise ValueError(f"an array holds elements of type {kind}")
    dtype = np.dtype(parts.order + _TYPES[kind])
    if len(raw) != count * dtype.itemsize:
        raise ValueError("an array is not as long as its sizes say")

    def read() -> npt.NDArray[Any]:
        return np.frombuffer(raw, dtype).reshape(shape, order="F")

    return Array(shape, read)


def _structs(parts: _Parts, count: int, depth: int) -> Any:
    """A struct as a mapping, an array of structs as a list of them."""
    width = parts.integers()[0]
    names = bytes(parts.next()[1])
    if width <= 0 or width > 256:
        raise ValueError("the names of a struct's fields have no length")
    fields = [names[k : k + width].partition(b"\0")[0].decode("latin-1") for k in range(0, len(names), width)]
    _refuse_more(parts, count * len(fields))
    found = [
        {field: _matrix(parts.next()[1], parts.order, depth + 1)[1] for field in fields} for _ in range(count)
    ]
    return found[0] if count == 1 else found


def _refuse_more(parts: _Parts, count: int) -> None:
    """Raise ValueError where fewer bytes are left than ``count`` elements have at least."""
    if count * 8 > parts.rest:
        raise ValueError("an array has more elements than bytes")


def _decoded(kind: int, text: bytes, order: str) -> str:
    encoding = _TEXTS.get(kind, "latin-1")
    if encoding.startswith("utf-") and encoding != "utf-8":
        encoding += "-le" if order == "<" else "-be"
    return text.decode(encoding, "replace")
