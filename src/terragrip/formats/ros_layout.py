"""Where the fields of a ROS message stand in its bytes, so that many messages of one layout are read at once.

A message's layout follows from its type and the lengths of its texts and sequences: messages that agree in these have every
number in the same place. Serialised by ROS 1 nothing is aligned; by ROS 2 (CDR, version 1) numbers are, from byte 4 on.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.messages import LONGEST_ARRAY, LONGEST_LIST, Path, is_left_out

Bytes = npt.NDArray[np.uint8]

_BASE, _NAME, _ARRAY = 1, 2, 3  # kinds of a field's description in rosbags; 4 is a sequence
_NUMBERS = {"bool": "?", "byte": "i1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4",
            "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"}  # fmt: skip
_HEAD = 4  # bytes that say how a CDR message is serialised
_ENCAPSULATED = (b"\0\0", b"\0\1")  # how they begin: big and little endian
_PADDING = 3  # bytes at most behind a CDR message
_INSTANT = ({"sec", "nanosec"}, {"sec", "nsec"})  # fields of a time or a duration
_STAMP = (("header", "stamp", "sec"), ("header", "stamp", "nanosec"))


@dataclass(frozen=True)
class Serialised:
    """How messages of a type are serialised: ``fields`` gives rosbags' descriptions of types; ``one``: by ROS 1."""

    kind: str
    one: bool
    fields: Callable[[], Mapping[str, Any]]


@dataclass(eq=False)
class Layout:
    """``numbers``: place and type of each number by its path; ``texts``: place and length of each text.

    ``stamp``: of the sender's seconds and nanoseconds. ``marks`` and ``marked``: places and values of the bytes that tell the layout
    from others of the same length.
    """

    numbers: dict[Path, tuple[int, np.dtype[Any]]] = field(default_factory=dict)
    texts: dict[Path, tuple[int, int]] = field(default_factory=dict)
    stamp: dict[Path, tuple[int, np.dtype[Any]]] = field(default_factory=dict)
    marks: npt.NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    marked: Bytes = field(default_factory=lambda: np.empty(0, np.uint8))

    def fits(self, data: Bytes) -> npt.NDArray[np.bool_]:
        """Which messages (n, bytes) have this layout."""
        return np.asarray((data[:, self.marks] == self.marked).all(axis=1))

    def values(self, path: Path, data: Bytes, *, is_text: bool) -> npt.NDArray[Any] | None:
        """A field (n,) of messages (n, bytes); None where it is not there, or of the other kind."""
        if not is_text:
            return _numbers(self.numbers[path], data) if path in self.numbers else None
        if path not in self.texts:
            return None
        place, length = self.texts[path]
        rows = data[:, place : place + length]
        return np.array([row.tobytes().decode("utf-8", errors="replace") for row in rows], dtype=object)

    def stamps(self, data: Bytes) -> npt.NDArray[np.float64]:
        """The senders' stamps (n,) [s] of messages (n, bytes), NaN where there are none."""
        if not self.stamp:
            return np.full(len(data), np.nan)
        seconds, rest = (_numbers(self.stamp[path], data) for path in _STAMP)
        result = seconds + 1e-9 * rest
        return np.where(result == 0, np.nan, result)


def _numbers(where: tuple[int, np.dtype[Any]], data: Bytes) -> npt.NDArray[np.float64]:
    place, kind = where
    raw = np.ascontiguousarray(data[:, place : place + kind.itemsize])
    if kind.kind == "b":
        return (raw[:, 0] != 0).astype(np.float64)
    return raw.view(kind)[:, 0].astype(np.float64)


def layout_of(form: Serialised, raw: bytes) -> Layout:
    """The layout of a message: its signals as `terragrip.formats.messages` names those of any message.

    Raises ValueError, LookupError or struct.error where the bytes do not hold such a message, or it has fields of a type that is not
    known.
    """
    walk = _Walk(form, raw)
    walk.message(form.kind, (), is_signal=True)
    left = len(raw) - walk.place
    if left > (0 if form.one else _PADDING):
        raise ValueError("a message is longer than its type")
    layout = walk.layout
    if walk.labels:
        layout.numbers = {walk.labelled(path): where for path, where in layout.numbers.items()}
        layout.texts = {walk.labelled(path): where for path, where in layout.texts.items()}
    layout.marks = np.concatenate([np.arange(first, last) for first, last in walk.marks] or [layout.marks])
    layout.marked = np.frombuffer(raw, np.uint8)[layout.marks]
    return layout


class _Walk:
    """Goes through the bytes of a message.

    ``labels``: the texts of its list ``name``, which name the entries of other lists of that length; ``lists``: how long its own lists are.
    """

    def __init__(self, form: Serialised, raw: bytes) -> None:
        if not form.one and raw[:2] not in _ENCAPSULATED:
            raise ValueError("not a message in CDR")
        self._types, self._raw, self._one = form.fields(), raw, form.one
        self._order = "<" if form.one or raw[1] else ">"
        self.place = 0 if form.one else _HEAD
        self.layout = Layout()
        self.labels: list[str] = []
        self.lists: dict[str | int, int] = {}
        self.marks: list[tuple[int, int]] = [] if form.one else [(0, _HEAD)]

    def labelled(self, path: Path) -> Path:
        """A path whose place in one of the message's own lists is a label, where there is one for each."""
        if len(path) > 1 and isinstance(path[1], int) and self.lists[path[0]] == len(self.labels):
            return (path[0], self.labels[path[1]], *path[2:])
        return path

    def message(self, kind: str, path: Path, *, is_signal: bool) -> None:
        """Take a message's fields; ``is_signal``: not left out by what it is in."""
        fields = self._types[kind][1]
        is_instant = {name for name, _ in fields} in _INSTANT
        for name, (node, content) in fields:
            own = (*path, name)
            counts = is_signal and not is_instant and not is_left_out(path, name)
            if int(node) == _BASE:
                self._base(content[0], own, is_signal=counts)
                if own in _STAMP and is_instant:
                    self.layout.stamp[own] = self.place - 4, np.dtype(f"{self._order}{_NUMBERS[content[0]]}")
            elif int(node) == _NAME:
                self.message(content, own, is_signal=counts)
            else:
                entry, count = content
                self._entries(entry, count if int(node) == _ARRAY else self._length(), own, is_signal=counts)

    def _entries(self, entry: Any, count: int, path: Path, *, is_signal: bool) -> None:
        node, content = entry
        is_base = int(node) == _BASE
        if len(path) == 1:
            self.lists[path[0]] = count
        if is_base and content[0] in _NUMBERS:
            kind = np.dtype(self._order + _NUMBERS[content[0]])
            if count:
                self._align(kind.itemsize)
            for k in range(count if is_signal and count <= LONGEST_ARRAY else 0):
                self.layout.numbers[*path, k] = self.place + k * kind.itemsize, kind
            self._skip(count * kind.itemsize)
            return
        if count > len(self._raw):  # of entries without content there could be any number
            raise ValueError("a list is longer than its message")
        for k in range(count):
            if not is_base:
                self.message(content, (*path, k), is_signal=is_signal and count <= LONGEST_LIST)
                continue
            place, length = self._text()
            if path == ("name",):
                self.marks.append((place, self.place))
                self.labels.append(self._raw[place : place + length].decode("utf-8", errors="replace"))

    def _base(self, kind: str, path: Path, *, is_signal: bool) -> None:
        if kind == "string":
            where = self._text()
            if is_signal:
                self.layout.texts[path] = where
            return
        number = np.dtype(self._order + _NUMBERS[kind])
        self._align(number.itemsize)
        if is_signal:
            self.layout.numbers[path] = self.place, number
        self._skip(number.itemsize)

    def _text(self) -> tuple[int, int]:
        """Place and length of a text, which CDR ends with a zero."""
        length, place = self._length(), self.place
        self._skip(length)
        if not self._one and not (length and self._raw[self.place - 1] == 0):
            raise ValueError("a text without its end")
        return place, length if self._one else length - 1

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
