"""Where the fields of a ROS message stand in its bytes, so that many messages of one layout are read at once.

A message's layout follows from its type and the lengths of its texts and sequences: messages that agree in these have every
number in the same place. Serialised by ROS 1 nothing is aligned; by ROS 2 (CDR, version 1) numbers are, from byte 4 on.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.messages import LONGEST_ARRAY

Path = tuple[str | int, ...]
Bytes = npt.NDArray[np.uint8]

_BASE, _NAME, _ARRAY = 1, 2, 3  # kinds of a field's description in rosbags; 4 is a sequence
_NUMBERS = {"bool": "?", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
            "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"}  # fmt: skip
_HEAD = 4  # bytes that say how a CDR message is serialised
_LITTLE = 1


@dataclass(frozen=True, eq=False)
class Layout:
    """``numbers``: place and type of each number by its path; ``texts``: place and length of each text.

    ``marks`` and ``marked``: the places and values of the bytes that tell the layout from others of the same length.
    """

    numbers: dict[Path, tuple[int, np.dtype[Any]]]
    texts: dict[Path, tuple[int, int]]
    marks: npt.NDArray[np.intp]
    marked: Bytes

    def fits(self, data: Bytes) -> npt.NDArray[np.bool_]:
        """Which messages (n, bytes) have this layout."""
        return np.asarray((data[:, self.marks] == self.marked).all(axis=1))

    def number(self, path: Path, data: Bytes) -> npt.NDArray[np.float64]:
        """A number (n,) of messages (n, bytes)."""
        place, kind = self.numbers[path]
        raw = np.ascontiguousarray(data[:, place : place + kind.itemsize])
        if kind.kind == "b":
            return (raw[:, 0] != 0).astype(np.float64)
        return raw.view(kind)[:, 0].astype(np.float64)

    def text(self, path: Path, data: Bytes) -> list[str]:
        """A text of each message (n, bytes)."""
        place, length = self.texts[path]
        return [row.tobytes().decode("utf-8", errors="replace") for row in data[:, place : place + length]]


def layout_of(
    types: Mapping[str, Any], kind: str, raw: bytes, labels: Sequence[str] | None, *, one: bool
) -> Layout:
    """The layout of a message; ``types``: rosbags' descriptions of fields, ``one``: it is serialised by ROS 1.

    ``labels``: the texts of its list ``name``, which name the entries of lists of that length. Raises ValueError, LookupError
    or struct.error where the bytes do not hold such a message, or it has fields of a type that is not known.
    """
    walk = _Walk(types, raw, labels, one=one)
    walk.message(kind, ())
    places = np.concatenate([np.arange(first, last) for first, last in walk.marks] or [np.empty(0, np.intp)])
    return Layout(
        walk.numbers, walk.texts, places.astype(np.intp), np.frombuffer(raw, np.uint8)[places.astype(np.intp)]
    )


class _Walk:
    """Goes through the bytes of a message."""

    def __init__(
        self, types: Mapping[str, Any], raw: bytes, labels: Sequence[str] | None, *, one: bool
    ) -> None:
        self._types, self._raw, self._labels, self._one = types, raw, labels, one
        self.place = 0 if one else _HEAD
        self._order = "<" if one or raw[1] & _LITTLE else ">"
        self.numbers: dict[Path, tuple[int, np.dtype[Any]]] = {}
        self.texts: dict[Path, tuple[int, int]] = {}
        self.marks: list[tuple[int, int]] = [] if one else [(0, _HEAD)]

    def message(self, kind: str, path: Path) -> None:
        """Take a message's fields."""
        for name, (node, content) in self._types[kind][1]:
            own = (*path, name)
            if int(node) == _BASE:
                self._base(content[0], own)
            elif int(node) == _NAME:
                self.message(content, own)
            else:
                entry, count = content
                count = count if int(node) == _ARRAY else self._length()
                self._entries(entry, count, own)

    def _entries(self, entry: Any, count: int, path: Path) -> None:
        node, content = entry
        if int(node) == _BASE and content[0] in _NUMBERS:
            kind = np.dtype(self._order + _NUMBERS[content[0]])
            if count:
                self._align(kind.itemsize)
            for k, step in enumerate(self._steps(path, count) if count <= LONGEST_ARRAY else ()):
                self.numbers[*path, step] = self.place + k * kind.itemsize, kind
            self._skip(count * kind.itemsize)
            return
        if count > len(self._raw):  # of entries without content there could be any number
            raise ValueError("a list is longer than its message")
        for step in self._steps(path, count):
            if int(node) == _BASE:
                self._base(content[0], (*path, step), content_counts=path == ("name",))
            else:
                self.message(content, (*path, step))

    def _steps(self, path: Path, count: int) -> Sequence[str | int]:
        """What the entries of a list go by."""
        named = self._labels is not None and len(self._labels) == count and len(path) == 1
        return self._labels if named else range(count)  # type: ignore[return-value]

    def _base(self, kind: str, path: Path, *, content_counts: bool = False) -> None:
        if kind != "string":
            number = np.dtype(self._order + _NUMBERS[kind])
            self._align(number.itemsize)
            self.numbers[path] = self.place, number
            self._skip(number.itemsize)
            return
        length = self._length()
        self.texts[path] = self.place, length if self._one else max(length - 1, 0)  # CDR ends it with a zero
        self._skip(length)
        if content_counts:
            self.marks.append((self.place - length, self.place))

    def _length(self) -> int:
        self._align(4)
        result = struct.unpack_from(f"{self._order}I", self._raw, self.place)[0]
        self.marks.append((self.place, self.place + 4))
        self.place += 4
        return int(result)

    def _align(self, size: int) -> None:
        if not self._one:
            self.place += -(self.place - _HEAD) % size

    def _skip(self, size: int) -> None:
        self.place += size
        if self.place > len(self._raw):
            raise ValueError("a message ends early")
