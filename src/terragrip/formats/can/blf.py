"""Vector BLF: the frames of many objects at once, where python-can makes a Python object of each.

The layout is python-can's, after Lorenz' "Vector BLF": a header, then containers (packed by zlib or not) whose content is one
stream of objects, each with a header of its own. Frames are CAN (types 1 and 86), CAN FD (100) and CAN FD 64 (101).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from terragrip.formats.can.catalog import EXTENDED

Bytes = npt.NDArray[np.uint8]
Places = npt.NDArray[np.intp]
Block = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.int64], Bytes]
"""Frames as `terragrip.formats.can.frames.Frames.take_many` takes them."""

_FILE = struct.Struct("<4sL")  # mark, length of the header
_START = struct.Struct("<8H")  # year, month, weekday, day, hour, minute, second, ms
_START_AT = 40
_OBJECT = struct.Struct("<4sHHLL")  # mark, length of the header, its version, length and type of the object
_PACKING = struct.Struct("<H6xL4x")
_MARK, _CONTAINER = b"LOBJ", 10
_CLASSIC, _FD, _FD_64 = (1, 86), 100, 101
_BODY = {1: 32, 2: 40}  # where an object begins behind its header, by that one's version
_FLAGS_AT, _STAMP_AT = 16, 24
_TEN_MICROSECONDS = 1  # flag of a stamp; else it counts nanoseconds
_IDENTIFIER, _WIDE, _REMOTE, _REMOTE_64 = 0x1FFFFFFF, 0x80000000, 0x80, 0x10
_FD_64_HEAD = 40
_TOGETHER = 1 << 20  # bytes of objects that are read at once
_LARGEST = 1 << 28  # bytes of a container
_PADDING = 8


def frames_of(stream: BinaryIO) -> Iterator[Block]:
    """The data frames of a log in blocks, in its order.

    Raises ValueError, struct.error or zlib.error where the log is damaged or ends early; the frames before it come first.
    """
    head = stream.read(_START_AT + _START.size)
    mark, length = _FILE.unpack_from(head)
    if mark != b"LOGG":
        raise ValueError("it does not begin as BLF logs do")
    start = _start(_START.unpack_from(head, _START_AT))
    stream.read(max(length - len(head), 0))
    waiting = bytearray()
    problem: Exception | None = None
    containers = _containers(stream)
    while problem is None:
        try:
            waiting += next(containers)
            if len(waiting) < _TOGETHER:
                continue
        except StopIteration:
            break
        except (ValueError, zlib.error, struct.error) as error:
            problem = error
        whole = bytes(waiting)
        places, end, wrong = _objects(whole)
        yield from _blocks(whole, places, start)
        problem = problem or wrong
        waiting = bytearray(whole[end:])
    if problem is not None:
        raise problem
    whole = bytes(waiting)
    places, _, wrong = _objects(whole)
    yield from _blocks(whole, places, start)
    if wrong is not None:
        raise wrong


def _start(told: tuple[int, ...]) -> float:
    """When the measurement began [s since 1970]; 0 where the log does not say."""
    year, month, _, day, hour, minute, second, milliseconds = told
    try:
        return datetime(year, month, day, hour, minute, second, milliseconds * 1000, UTC).timestamp()
    except ValueError:
        return 0.0


def _containers(stream: BinaryIO) -> Iterator[bytes]:
    """What the containers hold, unpacked; of one that is cut off, as much as there is."""
    while head := stream.read(_OBJECT.size):
        mark, _, _, size, kind = _OBJECT.unpack(head)
        if mark != _MARK:
            raise ValueError("an object does not begin as objects do")
        if not _OBJECT.size <= size <= _LARGEST:
            raise ValueError("an object has an odd length")
        content = stream.read(size - _OBJECT.size)
        stream.read(size % 4)
        if kind == _CONTAINER:
            packing, _ = _PACKING.unpack_from(content)
            inner = content[_PACKING.size :]
            if packing == 2:
                yield zlib.decompressobj().decompress(inner, _LARGEST)
            elif packing == 0:
                yield inner
        if len(content) < size - _OBJECT.size:
            raise ValueError("it ends within an object")


def _objects(data: bytes) -> tuple[dict[tuple[int, int], list[int]], int, Exception | None]:
    """Where objects begin, by type and version of their header; where the next one would, and what is wrong with it."""
    found: dict[tuple[int, int], list[int]] = {}
    place, end, unpack = 0, len(data), _OBJECT.unpack_from
    while place + _OBJECT.size <= end:
        mark, _, version, size, kind = unpack(data, place)
        if mark != _MARK:  # padding stands between
            place = data.find(_MARK, place, place + _PADDING)
            if place < 0:
                return found, end, ValueError("an object does not begin as objects do")
            if place + _OBJECT.size > end:
                break
            mark, _, version, size, kind = unpack(data, place)
        if not _OBJECT.size <= size <= _LARGEST:
            return found, end, ValueError("an object has an odd length")
        if place + size > end:
            break
        try:
            found[kind, version].append(place)
        except KeyError:
            found[kind, version] = [place]
        place += size
    return found, place, None


def _blocks(data: bytes, objects: dict[tuple[int, int], list[int]], start: float) -> Iterator[Block]:
    """The data frames among some objects."""
    raw = np.frombuffer(data, np.uint8)
    parts: list[tuple[Places, Block]] = []
    for (kind, version), listed in objects.items():
        body = _BODY.get(version)
        if body is None or kind not in (*_CLASSIC, _FD, _FD_64):
            continue
        places = np.array(listed, dtype=np.intp)
        sizes = _numbers(raw, places + 8, "<u4")
        places = places[sizes >= body + (16 if kind in _CLASSIC else 84 if kind == _FD else _FD_64_HEAD)]
        parts.append(_frames(raw, places, body, kind, start))
    if not parts:
        return
    width = max(block[3].shape[1] for _, block in parts)
    order = np.argsort(np.concatenate([places for places, _ in parts]), kind="stable")
    columns = zip(*(block[:3] for _, block in parts), strict=True)
    time, identifiers, lengths = (np.concatenate(column)[order] for column in columns)
    wide = [np.pad(block[3], ((0, 0), (0, width - block[3].shape[1]))) for _, block in parts]
    if len(order):
        yield time, identifiers, lengths, np.concatenate(wide)[order]


def _frames(raw: Bytes, places: Places, body: int, kind: int, start: float) -> tuple[Places, Block]:
    """The data frames of one type at some places, and those of their places."""
    remote = (
        _numbers(raw, places + body + 12, "<u4") & _REMOTE_64
        if kind == _FD_64
        else raw[places + body + 2] & _REMOTE
    )
    places = places[remote == 0]
    ticks = np.where(_numbers(raw, places + _FLAGS_AT, "<u4") == _TEN_MICROSECONDS, 1e5, 1e9)
    time = _numbers(raw, places + _STAMP_AT, "<u8") / ticks + start
    told = _numbers(raw, places + body + 4, "<u4").astype(np.int64)
    identifiers = (told & _IDENTIFIER) | np.where(told & _WIDE, EXTENDED, 0)
    if kind == _FD_64:
        lengths, data = _payloads_64(raw, places, body)
    elif kind == _FD:
        lengths, data = np.minimum(raw[places + body + 14], 64), _rows(raw, places + body + 20, 64)
    else:
        lengths, data = np.minimum(raw[places + body + 3], 8), _rows(raw, places + body + 8, 8)
    return places, (time, identifiers, lengths.astype(np.int64), data)


def _payloads_64(raw: Bytes, places: Places, body: int) -> tuple[npt.NDArray[np.int64], Bytes]:
    """Lengths (n,) and payloads (n, 64) of CAN FD 64: what the object does not hold of one is 0."""
    lengths = np.minimum(raw[places + body + 2], 64).astype(np.int64)
    behind = raw[places + body + 35].astype(np.int64)  # where data of another kind begin, if there are any
    room = (
        np.where(behind > 0, behind, _numbers(raw, places + 8, "<u4")).astype(np.int64) - body - _FD_64_HEAD
    )
    reach = np.minimum(np.arange(64), np.maximum(room, 1)[:, None] - 1)
    held = raw[np.minimum(places[:, None] + body + _FD_64_HEAD + reach, len(raw) - 1)]
    return lengths, np.where(np.arange(64) < room[:, None], held, 0).astype(np.uint8)


def _numbers(raw: Bytes, places: Places, kind: str) -> npt.NDArray[np.uint64 | np.uint32]:
    dtype = np.dtype(kind)
    return _rows(raw, places, dtype.itemsize).view(dtype)[:, 0]


def _rows(raw: Bytes, places: Places, width: int) -> Bytes:
    return raw[places[:, None] + np.arange(width)]
