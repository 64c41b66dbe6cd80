"""The records of a ROS 1 bag (format 2.0) in the order of the file, with or without an index, as far as it goes.

rosbags' own reader holds the whole index in memory, some 100 bytes a message, and reads no bag without one.
"""

from __future__ import annotations

import bz2
import io
import itertools
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

from terragrip.formats.boundary import DAMAGE, LARGEST, needed

_MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG, _CHUNK, _CONNECTION = 2, 3, 5, 7
_LONGEST_HEADER = 1 << 16
_LENGTH = struct.Struct("<I")
_TIME, _PLACE = struct.Struct("<II"), struct.Struct("<Q")

Message = tuple[int, float, bytes]
"""A message: its connection, when it was received [s], its content."""
Record = tuple[int, dict[bytes, bytes], bytes, bool]
"""Kind, fields and content of a record, and whether that is whole."""


@dataclass(frozen=True)
class Connection:
    """Who publishes: ``number``, topic, type and the definition of that."""

    number: int
    topic: str
    kind: str
    definition: str


def records(stream: BinaryIO, notes: list[str]) -> Iterator[Connection | Message]:
    """The connections and messages of a bag; what is damaged within a chunk is left out, which ``notes`` tell.

    Raises ValueError, struct.error, LookupError or OSError where the bag is damaged or ends early.
    """
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise ValueError("it does not begin as ROS 1 bags do")
    damaged = 0
    for kind, fields, content, whole in _records(stream):
        if kind == _BAG and whole:
            yield from _indexed(stream, fields)
        elif kind == _CHUNK and (whole or fields[b"compression"] == b"none"):
            try:
                yield from _contents(_records(io.BytesIO(_unpacked(fields, content))))
            except DAMAGE:
                damaged += whole
        elif whole:
            yield from _contents([(kind, fields, content, whole)])
    if damaged:
        notes.append(f"{damaged} chunks are damaged; their unreadable parts were left out.")


def _records(stream: BinaryIO) -> Iterator[Record]:
    """The records up to the end, the last of which may not be whole; raises ValueError behind such a one."""
    while head := stream.read(_LENGTH.size):
        (length,) = _LENGTH.unpack(head)
        if length > _LONGEST_HEADER:
            raise ValueError("a record's header has over 64 KiB")
        fields = _fields(_exactly(stream, length))
        (size,) = _LENGTH.unpack(_exactly(stream, _LENGTH.size))
        if size > LARGEST:
            raise ValueError("a record of over 1 GiB")
        content = stream.read(size)
        yield fields[b"op"][0], fields, content, len(content) == size
        if len(content) < size:
            raise ValueError("it ends within a record")


def _indexed(stream: BinaryIO, fields: dict[bytes, bytes]) -> Iterator[Connection | Message]:
    """The connections that the index at the end repeats, if there is one: the chunk that named them first may be damaged."""
    here = stream.tell()
    try:
        (place,) = _PLACE.unpack(fields.get(b"index_pos", bytes(8)))
        if here < place < stream.seek(0, 2):
            stream.seek(place)
            yield from _contents(
                itertools.takewhile(lambda record: record[0] == _CONNECTION, _records(stream))
            )
    except DAMAGE:
        pass  # the records before it tell, too
    finally:
        stream.seek(here)


def _fields(header: bytes) -> dict[bytes, bytes]:
    """The fields of a header by name."""
    result, place = {}, 0
    while place < len(header):
        (length,) = _LENGTH.unpack_from(header, place)
        place += _LENGTH.size
        if place + length > len(header):
            raise ValueError("a field reaches beyond its header")
        name, _, value = header[place : place + length].partition(b"=")
        result[name] = value
        place += length
    return result


def _unpacked(fields: dict[bytes, bytes], content: bytes) -> bytes:
    """The records of a chunk."""
    (size,) = _LENGTH.unpack(fields[b"size"])
    if size > LARGEST:
        raise ValueError("a chunk of over 1 GiB")
    packing = fields[b"compression"]
    if packing == b"bz2":
        return bz2.BZ2Decompressor().decompress(content, size)
    if packing == b"lz4":
        try:
            unpacked: bytes = (
                needed("lz4.frame", "a ROS 1 bag").LZ4FrameDecompressor().decompress(content, size)
            )
        except RuntimeError as error:
            raise ValueError(str(error)) from error
        return unpacked
    if packing != b"none":
        raise ValueError(f"its chunks are packed by {packing[:20]!r}")
    return content


def _contents(records: Iterable[Record]) -> Iterator[Connection | Message]:
    """The connections and messages among records that are whole."""
    for kind, fields, content, whole in records:
        if whole and kind == _CONNECTION:
            yield _connection(fields, content)
        elif whole and kind == _MESSAGE:
            (number,) = _LENGTH.unpack(fields[b"conn"])
            seconds, rest = _TIME.unpack(fields[b"time"])
            yield number, seconds + 1e-9 * rest, content


def _connection(fields: dict[bytes, bytes], content: bytes) -> Connection:
    (number,) = _LENGTH.unpack(fields[b"conn"])
    about = _fields(content)
    texts = (fields[b"topic"], about[b"type"], about[b"message_definition"])
    return Connection(number, *(text.decode("utf-8", "replace") for text in texts))


def _exactly(stream: BinaryIO, size: int) -> bytes:
    """The next ``size`` bytes; raises ValueError where there are fewer."""
    result = stream.read(size)
    if len(result) < size:
        raise ValueError("it ends within a record")
    return result
